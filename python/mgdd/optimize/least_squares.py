"""Levenberg-Marquardt for a Python function, how hard a fit searches, and the free run of what it found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError
from mgdd.optimize.inputs import bounds_pair
from mgdd.results import Fit
from mgdd.results.fit import FitQuality, n_best_of
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.signals.metrics import nrmse_fit_percent, rmse

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

CoreReport = _core.optimize.FitReport
LeastSquaresOptions = _core.optimize.LeastSquaresOptions


def least_squares(
    fun: Callable[[NDArray[np.float64]], tuple[ArrayLike, ArrayLike] | None],
    x0: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    bounds: tuple[ArrayLike | None, ArrayLike | None] | None = None,
    log_scaled: ArrayLike | None = None,
    data: ArrayLike | None = None,
    records: Sequence[int] | None = None,
    max_iterations: int = 200,
    cost_tolerance: float = 1e-12,
    correlation_limit: float = 0.98,
) -> FitReport:
    """Minimise half the sum of squares of a residual with an exact Jacobian.

    Levenberg-Marquardt with column scaling after Moré and damping after Nielsen. A step that leaves the
    bounds is clipped, not rejected.

    Parameters
    ----------
    fun : callable
        ``fun(x) -> (residual, jacobian)`` with shapes (m,) and (m, n), m >= n, both in natural units. None,
        or a value that is not finite, says that this point cannot be evaluated: the step is shortened.
        Exceptions of `fun` pass through.
    x0 : array_like, shape (n,)
        Start, within the bounds.
    names : sequence of str, optional
        Parameter names; x0, x1, ... without.
    bounds : pair of array_like, each of shape (n,) or scalar, optional
        Least and largest values, as `scipy.optimize.least_squares` takes them.
    log_scaled : array_like of bool, shape (n,) or scalar, optional
        Parameters searched as log(p); they need lower bounds > 0. Everything reported stays in natural units.
    data : array_like, shape (m,), optional
        What the residual compares with, in its unit; gives `FitReport.nrmse_fit_percent`.
    records : sequence of int, optional
        Residuals of each record, in the order of time: residuals that are correlated in time then widen the standard
        errors, which are those of a jackknife over blocks (Kuensch 1989). All count as independent if left out.
    max_iterations : int
        Trial steps.
    cost_tolerance : float
        Relative change of the cost that counts as none [-].
    correlation_limit : float
        Absolute correlation beyond which two parameters are reported as unidentifiable [-].

    Returns
    -------
    FitReport
        Also when the fit failed: look at `success`, `status` and `message`.

    Raises
    ------
    ParameterError
        Names, bounds, start or a tolerance outside its domain. Nothing has been evaluated then.
    ShapeError
        Arrays that do not belong together, or fewer residuals than parameters.

    References
    ----------
    Kuensch (1989), The jackknife and the bootstrap for general stationary observations.
    Moré (1978), The Levenberg-Marquardt algorithm: implementation and theory.
    Nielsen (1999), Damping parameter in Marquardt's method.

    Examples
    --------
    >>> import numpy as np
    >>> def rosenbrock(x):
    ...     residual = [10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]
    ...     return residual, [[-20.0 * x[0], 10.0], [-1.0, 0.0]]
    >>> fit = least_squares(rosenbrock, [-1.2, 1.0], names=["a", "b"], bounds=(None, [0.5, np.inf]))
    >>> fit.values.round(6).tolist(), fit.bounds_active.tolist(), str(fit.findings[0])
    ([0.5, 0.25], [1, 0], 'a stands at its upper bound 0.5')
    """
    start = _vector(x0, "x0")
    n = start.size
    if names is None:
        names = [f"x{i}" for i in range(n)]
    elif isinstance(names, str) or len(names) != n:
        raise ShapeError.of("names", names, f"{n} names, one per value of x0")
    lowers, uppers = (_per_parameter(side, f"bounds[{k}]", n) for k, side in enumerate(bounds_pair(bounds)))
    logs = _per_parameter(False if log_scaled is None else log_scaled, "log_scaled", n)
    parameters = [
        _core.optimize.Parameter(name=name, lower=low, upper=high, log_scaled=bool(log))
        for name, low, high, log in zip(names, lowers.tolist(), uppers.tolist(), logs.tolist(), strict=True)
    ]
    options = LeastSquaresOptions(
        max_iterations=max_iterations, cost_tolerance=cost_tolerance, correlation_limit=correlation_limit
    )
    measured = None if data is None else _vector(data, "data")
    return FitReport.from_core(
        _core.optimize.least_squares(fun, start, parameters=parameters, options=options, records=records or []),
        measured,
    )


def _vector(value: ArrayLike, name: str) -> NDArray[np.float64]:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterError.of(name, value, "numbers") from error
    if vector.ndim != 1:
        raise ShapeError(f"{name} has {vector.ndim} dimensions: must have 1")
    return vector


def _per_parameter(value: ArrayLike, name: str, n: int) -> NDArray[np.float64]:
    vector = _vector(np.repeat(np.asarray(value), n) if np.ndim(value) == 0 else value, name)
    if vector.size != n:
        raise ShapeError(f"{name} has {vector.size} values for the {n} of x0")
    return vector


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
            ParameterError.unless(value is None or value >= least, name, value, f">= {least}")
        ParameterError.unless(self.tolerance is None or self.tolerance > 0.0, "tolerance", self.tolerance, "> 0")


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
    fields = {
        "kind": model.kind,
        "train": None if run is None or "train" in more else quality_of(run),
        "findings": report.findings,
        "unidentifiable": report.unidentifiable,
        "n_best": n_best_of(ranked),
    }
    return Fit(report=report, model=model, run=run, draw=draw_run, start_rmse=ranked, **{**fields, **more})


def draw_run(fit: Fit, ax: Any) -> Any:
    """Draw a fit that keeps such a run."""
    from mgdd.plot.throttle import measured_and_model

    return measured_and_model(cast("xr.Dataset", fit.run), ax=ax)


def spread_starts(
    first: Mapping[str, float], box: Sequence[_core.optimize.Parameter], n_starts: int, seed: int
) -> list[dict[str, float]]:
    """Give the first start as it is, and further ones from a Latin hypercube between the bounds of the box."""
    further = _core.optimize.latin_hypercube(box, n_starts - 1, seed) if n_starts > 1 else []
    names = [parameter.name for parameter in box]
    return [dict(first), *({**first, **dict(zip(names, point.tolist(), strict=True))} for point in further)]
