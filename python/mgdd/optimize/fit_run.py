"""The free run of a fitted model beside the measurement: its Dataset, its quality and its figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from mgdd.results import Fit
from mgdd.results.fit import FitQuality, n_best_of
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.signals.metrics import nrmse_fit_percent, rmse

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr
    from numpy.typing import ArrayLike

    from mgdd.results.fit_report import FitReport


def fit_run(time_s: ArrayLike, measured: ArrayLike, model: ArrayLike, label: Label) -> xr.Dataset:
    """Put measurement and free run into one Dataset."""
    return labelled_dataset(
        {
            "time_s": ("time_s", time_s),
            "measured": ("time_s", measured, label.units, f"{label.long_name}, measured"),
            "model": ("time_s", model, label.units, f"{label.long_name}, free run"),
        }
    )


def quality_of(run: xr.Dataset) -> FitQuality:
    """Compare a free run with its measurement, on all samples."""
    measured, model = run["measured"].to_numpy(), run["model"].to_numpy()
    percent = nrmse_fit_percent(measured, model) if measured.min() < measured.max() else None
    error = rmse(measured, model)
    return FitQuality(nrmse_fit_percent=percent, rmse=error, unit=label_of(run["measured"]).units, n=measured.size)


def fit_of(report: FitReport, model: Any, run: xr.Dataset | None, errors: Iterable[float], **more: Any) -> Fit:
    """Make a fit of the best report, its model and free run, the errors of all searches, and what else is known."""
    ranked = tuple(sorted(errors))
    known = {
        "kind": model.kind,
        "train": None if run is None else quality_of(run),
        "findings": report.findings,
        "unidentifiable": report.unidentifiable,
        "n_best": n_best_of(ranked),
    }
    return Fit(report=report, model=model, run=run, draw=draw_run, start_rmse=ranked, **{**known, **more})


def draw_run(fit: Fit, ax: Any) -> Any:
    """Draw a fit that keeps such a run."""
    from mgdd.plot.measured import measured_and_model

    return measured_and_model(cast("xr.Dataset", fit.run), ax=ax)
