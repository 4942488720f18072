"""What both studies of throttle models are fitted to and judged on: three noisy records and the fit of a free run."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from mgdd.identify.throttle.free_run import free_run, quality_of
from mgdd.results.labels import labelled_dataset
from mgdd.results.model import Model
from mgdd.signals import amplitude_random_steps, chirp
from mgdd.throttle import Throttle, simulate

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["DURATION_S", "LSB_DEG", "NOISE_DEG", "RECORDS", "SAMPLE_S", "judged_run", "noisy_records"]

DURATION_S, SAMPLE_S = 12.0, 1e-3
NOISE_DEG, LSB_DEG = 0.03, 90.0 / 4096.0
RECORDS = ("train", "chirp", "steps")


def noisy_records(throttle: Throttle, noise: list[np.random.Generator]) -> dict[str, xr.Dataset]:
    """Simulate training chirp, test chirp and steps of 150 ms from rest at limp-home, through a noisy 12-bit sensor."""
    duties = (
        chirp(DURATION_S, offset=0.15, amplitude=0.20, low_hz=0.2, high_hz=6.0, step_s=SAMPLE_S),
        chirp(DURATION_S, offset=0.15, amplitude=0.18, low_hz=0.3, high_hz=5.0, step_s=SAMPLE_S),
        amplitude_random_steps(DURATION_S, offset=0.15, amplitude=0.20, hold_s=0.15, step_s=SAMPLE_S),
    )
    out = {}
    for name, signal, rng in zip(RECORDS, duties, noise, strict=True):
        time, duty = signal["time_s"].to_numpy(), signal["duty"].to_numpy()
        true = simulate(throttle, duty, time_s=time)["angle_deg"].to_numpy()
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
