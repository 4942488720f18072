"""How hard a fit searches, and the free run of what it found: the same for every fit."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, cast

from mgdd.errors import ParameterError
from mgdd.results import Fit
from mgdd.results.fit import FitQuality, n_best_of
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.signals.metrics import nrmse_fit_percent, rmse

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr
    from numpy.typing import ArrayLike

    from mgdd.results.fit_report import FitReport


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """How hard a fit searches; what is None keeps the default of the fit.

    Parameters
    ----------
    n_starts : int, optional
        Searches from different start values, >= 1; the best is kept.
    seed : int, optional
        Seed of the further start values, >= 0.
    max_iterations : int, optional
        Trial steps of a search, >= 1.
    tolerance : float, optional
        Relative decrease of the cost that ends a search, > 0 [-].

    Raises
    ------
    ParameterError
        A value outside its domain.

    Examples
    --------
    >>> from mgdd.optimize import FitOptions
    >>> FitOptions(n_starts=1).n_starts
    1
    """

    n_starts: int | None = None
    seed: int | None = None
    max_iterations: int | None = None
    tolerance: float | None = None

    def __post_init__(self) -> None:
        for name, least in (("n_starts", 1), ("seed", 0), ("max_iterations", 1)):
            value = getattr(self, name)
            if value is not None and not value >= least:
                raise ParameterError.of(name, value, f">= {least}")
        if self.tolerance is not None and not self.tolerance > 0.0:
            raise ParameterError.of("tolerance", self.tolerance, "> 0")


@dataclass(frozen=True, kw_only=True)
class Resolved:
    """Options in which nothing is left open; a fit reads those that it has."""

    n_starts: int = 1
    seed: int = 0
    max_iterations: int = 1
    tolerance: float = 1.0


def fit_options(options: FitOptions | None, **defaults: float | None) -> Resolved:
    """Fill in the defaults of a fit; an option that the fit does not have is refused."""
    given = {} if options is None else {f.name: getattr(options, f.name) for f in fields(options)}
    given = {name: value for name, value in given.items() if value is not None}
    for name in given:
        if name not in defaults:
            raise ParameterError(f"options: {name} has no effect on this fit, which has {', '.join(defaults)}")
    return replace(Resolved(), **{**defaults, **given})


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
