"""Tables of the controllers: PID and sliding mode on the virtual throttle, with the tuned sets of the design study."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from mgdd.loop import VirtualThrottle
from mgdd.throttle import SensorPair, Throttle
from mgdd_studies import run_study
from mgdd_studies.throttle_cases import Baseline, Controller, baselines, controller_of, settings_of, throttle_of

__all__ = ["Baseline", "baselines", "settings_of", "sine_mse_deg2", "stepped", "throttle_baselines", "throttle_faults"]

Rows = dict[str, list[float]]

SEEDS = 5
SENSORS = SensorPair(noise_v=0.03 * 4.0 / 90.0, lag_s=0.0)  # 0.03 deg of noise, 12 bits


def tracked(
    controller: Controller, throttle: Throttle, seed: int, samples: int, reference_deg: Callable[[int], float]
) -> np.ndarray:
    """Errors of the true angle [deg]; the duty computed from a sample acts one sample later."""
    start_deg = reference_deg(0)
    plant = VirtualThrottle(throttle, sensors=SENSORS, start_deg=start_deg, seed=seed)
    measured_deg, acting, errors = start_deg, 0.0, []
    for k in range(samples):
        computed = controller.step(reference_deg(k), measured_deg)
        plant.apply({"duty": acting})
        values = plant.measure().values
        acting, measured_deg = computed, values["sensed_angle_deg"]
        errors.append(reference_deg(k) - values["angle_deg"])
    return np.array(errors)


def stepped(
    baseline: Baseline, from_deg: float, to_deg: float, reaching: str = "boundary_layer"
) -> tuple[float, float]:
    """Return medians over the seeds: settling [ms] into 2 % of the step or 0.2 deg, and MSE over 0.6 s [deg²]."""
    band_deg = max(0.02 * abs(to_deg - from_deg), 0.2)
    found = []
    for seed in range(SEEDS):
        controller, throttle = controller_of(baseline, reaching), throttle_of(baseline.preset)
        errors = tracked(controller, throttle, seed, 1100, lambda k: from_deg if k < 500 else to_deg)[500:]
        outside = np.flatnonzero(np.abs(errors) > band_deg)
        found.append((outside[-1] + 1.0 if outside.size else 0.0, np.mean(errors**2)))
    settling_ms, mse_deg2 = np.median(found, axis=0)
    return float(settling_ms), float(mse_deg2)


def sine_mse_deg2(baseline: Baseline) -> float:
    """MSE of 40 ± 10 deg at 1 Hz over 5 s, after one second [deg²]."""
    controller, throttle = controller_of(baseline), throttle_of(baseline.preset)
    errors = tracked(controller, throttle, 0, 6000, lambda k: 40.0 + 10.0 * math.sin(2e-3 * math.pi * k))
    return float(np.mean(errors[1000:] ** 2))


@cache
def throttle_baselines() -> Rows:
    rows = {}
    for label, b in baselines().items():
        (large_ms, _), (small_ms, small_mse) = stepped(b, 20.0, 60.0), stepped(b, 40.0, 42.0)
        sine = sine_mse_deg2(b)
        rows[label] = [large_ms, b.large_ms, small_ms, b.small_ms, small_mse, b.small_mse_deg2, sine, b.sine_mse_deg2]
    return rows


@cache
def throttle_faults() -> Rows:
    """Time to the safe state per controller and preset [ms], excursion [deg], return per preset [ms] where it comes."""
    found: dict[str, list[dict[str, float | None]]] = {}
    for row in run_study("throttle-faults", figures=False).summary["rows"]:
        found.setdefault(row["fault"], []).append(row)
    rows = {}
    for fault, each in found.items():
        safe = [row["safe_ms"] for row in each]
        returns = [max(row["return_ms"] or 0.0 for row in each if row["preset"] == name) for name in ("P1", "P2", "P3")]
        rows[fault] = [*safe, max(row["beyond_deg"] for row in each), *(value for value in returns if value > 0.0)]
    return rows
