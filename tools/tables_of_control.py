"""Tables of the controllers: PID and sliding mode on the virtual throttle, with the tuned sets of the design study."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from mgdd import presets
from mgdd.control import Pid, SlidingMode
from mgdd.loop import VirtualThrottle
from mgdd.throttle import SensorPair, Throttle

__all__ = ["Baseline", "baselines", "plant_of", "settings_of", "sine_mse_deg2", "stepped", "throttle_baselines"]

Rows = dict[str, list[float]]
Controller = Pid | SlidingMode

SEEDS = 5
SENSORS = SensorPair(noise_v=0.03 * 4.0 / 90.0, lag_s=0.0)  # 0.03 deg of noise, 12 bits


@dataclass(frozen=True)
class Baseline:
    """A tuned set of the study and the medians that it found there."""

    preset: str
    kind: type[Controller]
    tuned: tuple[float, ...]
    large_ms: float
    small_ms: float
    small_mse_deg2: float
    sine_mse_deg2: float


# PID: Kp, Ki, Kd in duty % per travel %, kick per Coulomb friction, its width, integral window, dead band, feed-forward
# of rate and friction per their values in the model. Sliding mode: switching duty, layer in rad, integral, bandwidth,
# pole of the reference, friction feed-forward, integral layers.
BASELINES = (
    Baseline("P1", Pid, (11.5, 117.0, 0.132, 1.3, 0.019, 2.0, 0.1, 0.57, 0.65), 74.0, 24.0, 0.064, 0.028),
    Baseline("P2", Pid, (11.0, 49.4, 0.117, 1.3, 0.216, 2.0, 0.0, 0.55, 0.99), 69.0, 23.0, 0.065, 0.052),
    Baseline("P3", Pid, (15.8, 15.0, 0.147, 1.3, 0.097, 1.0, 0.0, 1.3, 1.3), 75.0, 25.0, 0.068, 0.006),
    Baseline("P1", SlidingMode, (0.793, 0.0604, 3.03, 136.0, 170.0, 0.82, 3.0), 100.0, 25.0, 0.055, 0.253),
    Baseline("P2", SlidingMode, (0.238, 0.0248, 4.46, 85.0, 147.0, 1.2, 1.0), 193.0, 18.0, 0.048, 0.25),
    Baseline("P3", SlidingMode, (0.855, 0.0564, 21.2, 119.0, 185.0, 1.2, 0.5), 135.0, 18.0, 0.044, 0.155),
)


def baselines() -> dict[str, Baseline]:
    return {f"{b.preset}, {'PID' if b.kind is Pid else 'sliding mode'}": b for b in BASELINES}


def plant_of(preset: str) -> Throttle:
    throttle = presets.load(preset, kind="throttle").throttle
    return throttle.replace(friction="stribeck", stiction_nm=0.3) if preset == "P1" else throttle


def settings_of(baseline: Baseline) -> dict[str, float]:
    """Return the keywords of the controller: the tuned set in the units of `mgdd.control`, for its plant as it is."""
    throttle, row = plant_of(baseline.preset), baseline.tuned
    stall_nm = throttle.stall_torque_nm
    tau_s = throttle.inertia_kgm2 / throttle.damping_nms_per_rad
    gain = math.degrees(stall_nm / throttle.inertia_kgm2)
    coulomb = throttle.coulomb_nm / stall_nm
    known = {"limp_home_deg": throttle.limp_home_deg}
    for side in ("above", "below"):
        known[f"preload_{side}"] = getattr(throttle, f"preload_{side}_nm") / stall_nm
        known[f"spring_{side}_per_deg"] = math.radians(getattr(throttle, f"spring_{side}_nm_per_rad")) / stall_nm
        if baseline.kind is Pid:
            known[f"proportional_{side}_per_deg"] = row[0] / 90.0
            known[f"integral_{side}_per_deg_s"] = row[1] / 90.0
            known[f"derivative_{side}_s_per_deg"] = row[2] / 90.0
    if baseline.kind is Pid:
        return known | {
            "kick": row[3] * coulomb,
            "kick_width_deg": row[4],
            "integral_window_deg": row[5],
            "dead_band_deg": row[6],
            "rate_s_per_deg": row[7] / (tau_s * gain),
            "friction": row[8] * coulomb,
        }
    return known | {
        "gain_deg_per_s2": gain,
        "time_constant_s": tau_s,
        "switching": row[0],
        "layer_deg": math.degrees(row[1]),
        "integral_per_s": row[2],
        "bandwidth_per_s": row[3],
        "reference_pole_per_s": row[4],
        "friction": row[5] * coulomb,
        "integral_layers": row[6],
    }


def controller_of(baseline: Baseline, reaching: str = "boundary_layer") -> Controller:
    if baseline.kind is Pid:
        return Pid(**settings_of(baseline))
    return SlidingMode(reaching=reaching, **settings_of(baseline))


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
        controller, throttle = controller_of(baseline, reaching), plant_of(baseline.preset)
        errors = tracked(controller, throttle, seed, 1100, lambda k: from_deg if k < 500 else to_deg)[500:]
        outside = np.flatnonzero(np.abs(errors) > band_deg)
        found.append((outside[-1] + 1.0 if outside.size else 0.0, np.mean(errors**2)))
    settling_ms, mse_deg2 = np.median(found, axis=0)
    return float(settling_ms), float(mse_deg2)


def sine_mse_deg2(baseline: Baseline) -> float:
    """MSE of 40 ± 10 deg at 1 Hz over 5 s, after one second [deg²]."""
    controller, throttle = controller_of(baseline), plant_of(baseline.preset)
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
