"""The free run of a throttle model over a log, and how close it comes: the one definition for every throttle fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd.errors import DataError
from mgdd.identify.throttle.n_step import DISCARD_S, columns_of, step_of
from mgdd.results import Fit, FitQuality, Model, labelled_dataset
from mgdd.signals.metrics import nrmse_fit_percent, rmse

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["discarded", "draw_free_run", "free_run", "quality_of", "source_of"]


def free_run(model: Model, log: xr.Dataset) -> xr.Dataset:
    """Run a model free over a log from its first angle."""
    time, duty, angle = columns_of(log)
    run = model.simulate(log, initial_state={"angle_deg": float(angle[0])})["angle_deg"].to_numpy()
    if run.shape != angle.shape or not np.isfinite(run).all():
        raise DataError(f"the {model.kind} model runs away on {source_of(log)}: its fit has failed")
    return labelled_dataset(
        {
            "time_s": ("time_s", time),
            "duty": ("time_s", duty),
            "angle_deg": ("time_s", angle),
            "model_deg": ("time_s", run),
            "residual_deg": ("time_s", run - angle, "deg", "model minus measured angle"),
        },
        attrs={"file": source_of(log), "kind": model.kind},
    )


def quality_of(run: xr.Dataset) -> FitQuality:
    """Compare a free run with its log, without the first 50 ms."""
    skip = discarded(run)
    measured, modelled = run["angle_deg"].to_numpy()[skip:], run["model_deg"].to_numpy()[skip:]
    return FitQuality(
        nrmse_fit_percent=nrmse_fit_percent(measured, modelled),
        rmse=rmse(measured, modelled),
        unit="deg",
        n=measured.size,
    )


def discarded(log: xr.Dataset) -> int:
    """Return how many samples at the start a figure of merit leaves out."""
    return round(DISCARD_S / step_of(log["time_s"].to_numpy()))


def source_of(log: xr.Dataset) -> str:
    """Return the name of a log."""
    return str(log.attrs.get("file", "log"))


def draw_free_run(fit: Fit, ax: Any) -> Any:
    """Draw the free run of a throttle fit over its log."""
    from mgdd import plot

    return plot.free_run(cast("xr.Dataset", fit.run), ax=ax)
