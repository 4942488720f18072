"""What studies of throttles share: tuned sets of PID and sliding mode, their supervisor, and three noisy records."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd import presets
from mgdd.control import Pid, SlidingMode, ThrottleSupervisor
from mgdd.identify.throttle.free_run import free_run, quality_of
from mgdd.loop.controller_families import FAMILIES, Setup, groups_of
from mgdd.results.fit import Model
from mgdd.results.labels import labelled_dataset
from mgdd.signals import amplitude_random_steps, chirp
from mgdd.throttle import Throttle, simulate_throttle

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "DURATION_S", "LSB_DEG", "NOISE_DEG", "RECORDS", "SAMPLE_S", "Baseline", "Controller", "baselines", "controller_of",
    "judged_run", "noisy_records", "settings_of", "supervisor_of", "throttle_of",
]  # fmt: skip

Controller = Pid | SlidingMode
RETURN_S = {"P1": 0.4, "P2": 0.4, "P3": 0.8}  # from anywhere to limp-home with the bridge open


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
_BASELINES = (
    Baseline("P1", Pid, (11.5, 117.0, 0.132, 1.3, 0.019, 2.0, 0.1, 0.57, 0.65), 74.0, 24.0, 0.064, 0.028),
    Baseline("P2", Pid, (11.0, 49.4, 0.117, 1.3, 0.216, 2.0, 0.0, 0.55, 0.99), 69.0, 23.0, 0.065, 0.052),
    Baseline("P3", Pid, (15.8, 15.0, 0.147, 1.3, 0.097, 1.0, 0.0, 1.3, 1.3), 75.0, 25.0, 0.068, 0.006),
    Baseline("P1", SlidingMode, (0.793, 0.0604, 3.03, 136.0, 170.0, 0.82, 3.0), 100.0, 25.0, 0.055, 0.253),
    Baseline("P2", SlidingMode, (0.238, 0.0248, 4.46, 85.0, 147.0, 1.2, 1.0), 193.0, 18.0, 0.048, 0.25),
    Baseline("P3", SlidingMode, (0.855, 0.0564, 21.2, 119.0, 185.0, 1.2, 0.5), 135.0, 18.0, 0.044, 0.155),
)


def baselines() -> dict[str, Baseline]:
    """Give all tuned sets by preset and kind."""
    return {f"{b.preset}, {'PID' if b.kind is Pid else 'sliding mode'}": b for b in _BASELINES}


def throttle_of(preset: str) -> Throttle:
    """Give the throttle of the study: P1 has more stiction there."""
    throttle: Throttle = presets.load(preset, kind="throttle").throttle
    return throttle.replace(friction="stribeck", stiction_nm=0.3) if preset == "P1" else throttle


def settings_of(baseline: Baseline) -> dict[str, Any]:
    """Give the keywords of the controller: the tuned set in the units of `mgdd.control`, for its plant as it is."""
    family = FAMILIES["pid" if baseline.kind is Pid else "sliding_mode"]
    row = list(baseline.tuned)
    if baseline.kind is SlidingMode:
        row[1] = math.degrees(row[1])  # the layer stands in rad there
    groups = groups_of(throttle_of(baseline.preset))
    return family.build(groups, dict(zip(family.space, row, strict=True)), Setup()).settings


def controller_of(baseline: Baseline, reaching: str = "boundary_layer") -> Controller:
    """Make the controller."""
    settings = settings_of(baseline)
    return Pid(**settings) if baseline.kind is Pid else SlidingMode(**{**settings, "reaching": reaching})


def supervisor_of(preset: str) -> ThrottleSupervisor:
    """Make a supervisor that knows the groups of a preset and the time in which its springs return the plate."""
    throttle = throttle_of(preset)
    groups = groups_of(throttle)
    return ThrottleSupervisor(
        closed_deg=throttle.closed_deg,
        open_deg=throttle.open_deg,
        nominal_supply_v=throttle.supply_v,
        friction=throttle.stiction_nm / throttle.stall_torque_nm,
        return_s=RETURN_S[preset],
        **groups.spring,
        **groups.motion,
    )


DURATION_S, SAMPLE_S = 12.0, 1e-3
NOISE_DEG, LSB_DEG = 0.03, 90.0 / 4096.0
RECORDS = ("train", "chirp", "steps")


def noisy_records(throttle: Throttle, noise: list[np.random.Generator]) -> dict[str, xr.Dataset]:
    """Simulate training chirp, test chirp and steps of 150 ms from rest at limp-home, through a noisy 12-bit sensor."""
    duties = (
        chirp(DURATION_S, offset=0.15, amplitude=0.20, low_hz=0.2, high_hz=6.0, sample_s=SAMPLE_S),
        chirp(DURATION_S, offset=0.15, amplitude=0.18, low_hz=0.3, high_hz=5.0, sample_s=SAMPLE_S),
        amplitude_random_steps(DURATION_S, offset=0.15, amplitude=0.20, hold_s=0.15, sample_s=SAMPLE_S),
    )
    out: dict[str, xr.Dataset] = {}
    for name, signal, rng in zip(RECORDS, duties, noise, strict=True):
        time, duty = signal["time_s"].to_numpy(), signal["duty"].to_numpy()
        true = simulate_throttle(throttle, duty, time_s=time)["angle_deg"].to_numpy()
        noisy = true + NOISE_DEG * rng.standard_normal(true.size)
        out[name] = labelled_dataset(
            {
                "time_s": ("time_s", time, "s", "time"),
                "duty": ("time_s", duty, "-", "duty"),
                "angle_deg": ("time_s", np.round(noisy / LSB_DEG) * LSB_DEG, "deg", "measured angle"),
                "true_deg": ("time_s", true, "deg", "true angle"),
            }
        )
    return out


def judged_run(model: Model, log: xr.Dataset) -> tuple[xr.Dataset, float]:
    """Give the free run of a model over a record and its fit [%], as every throttle fit states it."""
    run = free_run(model, log)
    return run, cast("float", quality_of([run]).nrmse_fit_percent)
