"""Least squares with bounds, log-scaled parameters and an honest report: numbers in, numbers out.

`least_squares` runs the Levenberg-Marquardt search of the C++ core on a Python function. Every fit of this
package, also those that never enter Python while they run, answers with a `FitReport`.

Examples
--------
>>> import numpy as np
>>> from mgdd.optimize import least_squares
>>> t = np.linspace(0.0, 3.0, 40)
>>> y = 2.0 * np.exp(-0.8 * t) + 0.01 * np.cos(40.0 * t)
>>> def decay(p):
...     e = np.exp(-p[1] * t)
...     return p[0] * e - y, np.column_stack([e, -p[0] * t * e])
>>> fit = least_squares(decay, [1.0, 0.1], names=["amplitude", "rate"], data=y)
>>> fit.success, fit.unidentifiable
(True, ())
>>> np.abs(fit.values - [2.0, 0.8]).max() < 3.0 * fit.stderr.max()
np.True_
"""

from __future__ import annotations

import html
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["FitReport", "least_squares"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FitReport:
    """Estimates, their uncertainty, what the data leave open, and how the search went.

    Attribute names follow `scipy.optimize.OptimizeResult` where it has one. Arrays are read-only.

    Attributes
    ----------
    names : tuple of str
        Parameter names; every array below that has n entries follows their order.
    values, lower, upper : ndarray, shape (n,)
        Estimates and bounds in the units of the parameters.
    stderr : ndarray, shape (n,)
        Standard errors, same units. Infinite for a parameter in a null direction; NaN at a bound (it was
        held, not estimated) and without degrees of freedom.
    bounds_active : ndarray of int, shape (n,)
        -1 at the lower bound, +1 at the upper, 0 free.
    covariance, correlation : ndarray, shape (n, n)
        Of the free parameters; NaN rows and columns for those at a bound.
    unidentifiable : tuple of str
        Names the data do not determine: at a bound, correlated beyond the limit, or in a null direction.
    findings : tuple of str
        One sentence per reason behind `unidentifiable`.
    null_directions : ndarray, shape (n, k)
        Parameter changes, largest entry 1, that leave the residual as it is.
    rmse : float
        Root mean square of the residual, in its unit.
    cost : float
        Half the sum of squares.
    fit_percent : float or None
        100 (1 - norm(residual) / norm(data - mean)), None without data [%].
    residual : ndarray, shape (n_residuals,)
        Residual at `values`; also as `fun`.
    nfev, njev, nit : int
        Residual evaluations, Jacobian evaluations, trial steps.
    history : dict of str to ndarray
        `cost`, `damping` [-], `step_norm` and `accepted` per trial step; entry 0 is the start.
    status : str
        ``not_run``, ``cost_converged``, ``step_converged``, ``gradient_converged``, ``iteration_limit``,
        ``evaluation_failed`` or ``stalled``.
    message : str
        The status as a sentence.
    success : bool
        Whether a tolerance was met.

    See Also
    --------
    least_squares : makes one.

    References
    ----------
    Bates and Watts (1988), Nonlinear Regression Analysis and Its Applications, section 2.2.

    Examples
    --------
    >>> from mgdd import _core
    >>> FitReport.from_core(_core.FitReport()).status
    'not_run'
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    stderr: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    bounds_active: NDArray[np.int_]
    covariance: NDArray[np.float64]
    correlation: NDArray[np.float64]
    unidentifiable: tuple[str, ...]
    findings: tuple[str, ...]
    null_directions: NDArray[np.float64]
    rmse: float
    cost: float
    fit_percent: float | None
    residual: NDArray[np.float64]
    nfev: int
    njev: int
    nit: int
    history: dict[str, NDArray[Any]]
    status: str
    message: str
    success: bool

    @classmethod
    def from_core(cls, core_report: _core.FitReport, data: ArrayLike | None = None) -> FitReport:
        """Wrap a report of the core.

        Parameters
        ----------
        core_report : _core.FitReport
            As any fit of the core returns it.
        data : array_like, shape (n_residuals,), optional
            What the residual was compared with, in the unit of the residual; gives `fit_percent`.

        Returns
        -------
        FitReport
            Independent of `core_report`.

        Raises
        ------
        ShapeError
            `data` is not one value per residual.

        Examples
        --------
        >>> from mgdd import _core
        >>> FitReport.from_core(_core.FitReport()).success
        False
        """
        residual = _frozen(core_report.residual)
        return cls(
            names=tuple(core_report.names),
            values=_frozen(core_report.values),
            stderr=_frozen(core_report.stderr),
            lower=_frozen(core_report.lower),
            upper=_frozen(core_report.upper),
            bounds_active=_frozen(np.asarray(core_report.bounds_active, dtype=np.int_)),
            covariance=_frozen(core_report.covariance),
            correlation=_frozen(core_report.correlation),
            unidentifiable=tuple(core_report.unidentifiable),
            findings=tuple(core_report.findings),
            null_directions=_frozen(core_report.null_directions),
            rmse=core_report.rmse,
            cost=core_report.cost,
            fit_percent=None if data is None else _fit_percent(residual, data),
            residual=residual,
            nfev=core_report.nfev,
            njev=core_report.njev,
            nit=core_report.iterations,
            history={key: _frozen(column) for key, column in core_report.history.items()},
            status=core_report.status,
            message=core_report.message,
            success=core_report.success,
        )

    @property
    def x(self) -> NDArray[np.float64]:
        """Estimates under SciPy's name; the same array as `values`."""
        return self.values

    @property
    def fun(self) -> NDArray[np.float64]:
        """Residual under SciPy's name; the same array as `residual`."""
        return self.residual

    def __repr__(self) -> str:
        open_names = f", unidentifiable={list(self.unidentifiable)}" if self.unidentifiable else ""
        return f"<FitReport {self.status}, {len(self.names)} parameters, rmse={self.rmse:.6g}{open_names}>"

    def summary(self) -> str:
        """Table of the fit for a terminal.

        Returns
        -------
        str
            The verdict, one line per parameter (value, stderr, bounds, remark), and the findings.

        Examples
        --------
        >>> from mgdd import _core
        >>> print(FitReport.from_core(_core.FitReport()).summary().splitlines()[0])
        not_run: the fit has not been run
        """
        rows = [_COLUMNS, *self._rows()]
        widths = [max(len(row[k]) for row in rows) for k in range(len(_COLUMNS))]
        lines = [f"{self.status}: {self.message}", self._numbers(), ""]
        for row in rows:
            cells = [row[0].ljust(widths[0]), *(row[k].rjust(widths[k]) for k in range(1, 5)), row[5]]
            lines.append("  ".join(cells).rstrip())
        if self.findings:
            lines += ["", "not identifiable from these data:", *(f"  {finding}" for finding in self.findings)]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Everything but the residual as plain Python values that `json.dumps` takes.

        Returns
        -------
        dict
            Arrays become lists; infinite and NaN numbers become None.

        Examples
        --------
        >>> import json
        >>> from mgdd import _core
        >>> json.loads(json.dumps(FitReport.from_core(_core.FitReport()).to_dict()))["cost"] is None
        True
        """
        return {field: _plain(getattr(self, field)) for field in self.__dataclass_fields__ if field != "residual"}

    def _repr_html_(self) -> str:
        def line(cells: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        body = "".join(line(row, "td") for row in self._rows())
        findings = "".join(f"<li>{html.escape(finding)}</li>" for finding in self.findings)
        notes = f"<p>not identifiable from these data:</p><ul>{findings}</ul>" if findings else ""
        return (
            f"<div><p><b>{html.escape(self.status)}</b>: {html.escape(self.message)}<br>"
            f"{html.escape(self._numbers())}</p>"
            f"<table><thead>{line(_COLUMNS, 'th')}</thead><tbody>{body}</tbody></table>{notes}</div>"
        )

    def _numbers(self) -> str:
        fit = "" if self.fit_percent is None else f", fit {self.fit_percent:.4g} %"
        return (
            f"rmse {self.rmse:.6g}, cost {self.cost:.6g}{fit}; "
            f"{self.nit} iterations, {self.nfev} residual and {self.njev} Jacobian evaluations"
        )

    def _rows(self) -> list[tuple[str, ...]]:
        remarks = {-1: "at lower bound", 1: "at upper bound"}
        rows = []
        for i, name in enumerate(self.names):
            numbers = (self.values[i], self.stderr[i], self.lower[i], self.upper[i])
            remark = remarks.get(int(self.bounds_active[i]), "")
            if not remark and name in self.unidentifiable:
                remark = "not identifiable"
            rows.append((name, *(f"{number:.6g}" for number in numbers), remark))
        return rows


def least_squares(
    fun: Callable[[NDArray[np.float64]], tuple[ArrayLike, ArrayLike] | None],
    x0: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    log_scaled: ArrayLike | None = None,
    data: ArrayLike | None = None,
    max_iterations: int = 200,
    cost_tolerance: float = 1e-12,
    step_tolerance: float = 1e-10,
    gradient_tolerance: float = 1e-12,
    initial_damping: float = 1e-3,
    correlation_limit: float = 0.98,
    rank_tolerance: float = 1e-10,
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
    lower, upper : array_like, shape (n,) or scalar, optional
        Bounds; none without.
    log_scaled : array_like of bool, shape (n,) or scalar, optional
        Parameters searched as log(p); they need lower > 0. Everything reported stays in natural units.
    data : array_like, shape (m,), optional
        What the residual compares with, in its unit; gives `FitReport.fit_percent`.
    max_iterations : int
        Trial steps.
    cost_tolerance, step_tolerance : float
        Relative change of the cost, and scaled step over scaled parameters, that count as none [-].
    gradient_tolerance : float
        Cosine between the residual and a free Jacobian column that counts as zero [-].
    initial_damping : float
        Relative to Jacobian columns of unit length [-].
    correlation_limit : float
        Absolute correlation beyond which two parameters are reported as unidentifiable [-].
    rank_tolerance : float
        Singular value of the column-scaled Jacobian, relative to the largest, that counts as zero [-].

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
    Moré (1978), The Levenberg-Marquardt algorithm: implementation and theory.
    Nielsen (1999), Damping parameter in Marquardt's method.

    Examples
    --------
    >>> import numpy as np
    >>> def rosenbrock(x):
    ...     residual = [10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]
    ...     return residual, [[-20.0 * x[0], 10.0], [-1.0, 0.0]]
    >>> fit = least_squares(rosenbrock, [-1.2, 1.0], names=["a", "b"], upper=[0.5, np.inf])
    >>> fit.values.round(6).tolist(), fit.bounds_active.tolist(), fit.findings
    ([0.5, 0.25], [1, 0], ('a stands at its upper bound 0.5',))
    """
    start = _vector(x0, "x0")
    n = start.size
    if names is None:
        names = [f"x{i}" for i in range(n)]
    elif isinstance(names, str) or len(names) != n:
        raise ShapeError(f"names = {names!r}: must be {n} names, one per value of x0")
    lowers = _per_parameter(-np.inf if lower is None else lower, "lower", n)
    uppers = _per_parameter(np.inf if upper is None else upper, "upper", n)
    logs = _per_parameter(False if log_scaled is None else log_scaled, "log_scaled", n)
    parameters = [
        _core.Parameter(name=name, lower=low, upper=high, log_scaled=bool(log))
        for name, low, high, log in zip(names, lowers.tolist(), uppers.tolist(), logs.tolist(), strict=True)
    ]
    options = _core.LeastSquaresOptions(
        max_iterations=max_iterations,
        cost_tolerance=cost_tolerance,
        step_tolerance=step_tolerance,
        gradient_tolerance=gradient_tolerance,
        initial_damping=initial_damping,
        correlation_limit=correlation_limit,
        rank_tolerance=rank_tolerance,
    )
    measured = None if data is None else _vector(data, "data")
    return FitReport.from_core(_core.least_squares(fun, start, parameters=parameters, options=options), measured)


_COLUMNS = ("parameter", "value", "stderr", "lower", "upper", "remark")


def _frozen(array: ArrayLike) -> NDArray[Any]:
    copy = np.array(array)
    copy.flags.writeable = False
    return copy


def _vector(value: ArrayLike, name: str) -> NDArray[np.float64]:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{name} = {value!r}: must be numbers") from error
    if vector.ndim != 1:
        raise ShapeError(f"{name} has {vector.ndim} dimensions: must have 1")
    return vector


def _per_parameter(value: ArrayLike, name: str, n: int) -> NDArray[np.float64]:
    vector = _vector(np.repeat(np.asarray(value), n) if np.ndim(value) == 0 else value, name)
    if vector.size != n:
        raise ShapeError(f"{name} has {vector.size} values for the {n} of x0")
    return vector


def _fit_percent(residual: NDArray[np.float64], data: ArrayLike) -> float | None:
    measured = np.asarray(data, dtype=np.float64)
    if not np.isfinite(residual).all():
        return None
    if measured.shape != residual.shape:
        raise ShapeError(f"data has shape {measured.shape}: must have one value per residual, {residual.shape}")
    spread = float(np.linalg.norm(measured - measured.mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(residual)) / spread) if spread > 0.0 else None


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
