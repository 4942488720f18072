"""The one measure of how well a throttle model meets a log: its free run, without the first 50 ms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError
from mgdd.identify.throttle.fit import ThrottleModel
from mgdd.results import labelled_dataset
from mgdd.signals.even_grid import even_step
from mgdd.signals.metrics import fit_percent, rmse

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["columns_of", "discarded", "free_run", "quality"]

# What the start of a free run still carries of the unknown speed and current.
DISCARD_S = 0.05


def columns_of(log: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return time [s], duty [-] and angle [deg] of a log."""
    time, duty, angle = (np.asarray(log[n].to_numpy(), dtype=np.float64) for n in ("time_s", "duty", "angle_deg"))
    return time, duty, angle


def discarded(step_s: float, size: int) -> int:
    """Return how many samples at the start a figure of merit leaves out: 50 ms, at most half of the record."""
    return min(round(DISCARD_S / step_s), size // 2)


def free_run(model: ThrottleModel, log: xr.Dataset) -> xr.Dataset:
    """Run a model free over a log from its first angle."""
    time, duty, angle = columns_of(log)
    run = np.asarray(model.simulate(time, duty, start_deg=float(angle[0])), dtype=np.float64)
    if run.shape != angle.shape or not np.isfinite(run).all():
        raise DataError(f"the {model.kind} model runs away on {log.attrs.get('file', 'log')}: its fit has failed")
    return labelled_dataset(
        {
            "time_s": ("time_s", time),
            "duty": ("time_s", duty),
            "angle_deg": ("time_s", angle),
            "model_deg": ("time_s", run),
            "residual_deg": ("time_s", run - angle, "deg", "model minus measured angle"),
        },
        attrs={"file": str(log.attrs.get("file", "log")), "kind": model.kind},
    )


def quality(model: ThrottleModel, logs: Sequence[xr.Dataset]) -> tuple[float, float]:
    """Return fit [%] and RMS error [deg] of the free runs over all logs, each without its first 50 ms."""
    measured, modelled = [], []
    for log in logs:
        run = free_run(model, log)
        skip = discarded(even_step(log["time_s"]), run.sizes["time_s"])
        measured.append(run["angle_deg"].to_numpy()[skip:])
        modelled.append(run["model_deg"].to_numpy()[skip:])
    y, yh = np.concatenate(measured), np.concatenate(modelled)
    return fit_percent(y, yh), rmse(y, yh)
