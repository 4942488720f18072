"""What a fit hands back: estimates, uncertainty, what the data leave open, and how the search went."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError
from mgdd.results.describe import Row
from mgdd.results.finding import Finding, classified, findings_html
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.results.result import Result
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

_COLUMNS = ("parameter", "value", "stderr", "lower", "upper", "remark")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FitReport(Result):
    """Estimates, their uncertainty, what the data leave open, and how the search went.

    Attribute names follow `scipy.optimize.OptimizeResult` where it has one. Arrays are read-only.

    Attributes
    ----------
    names : tuple of str
        Parameter names; every array below that has n entries follows their order.
    values, lower, upper : ndarray, shape (n,)
        Estimates and bounds in the units of the parameters.
    stderr : ndarray, shape (n,)
        Standard errors, same units; `interval` turns them into confidence intervals. Infinite for a parameter in a null
        direction; NaN at a bound (it was held, not estimated) and without degrees of freedom.
    bounds_active : ndarray of int, shape (n,)
        -1 at the lower bound, +1 at the upper, 0 free.
    covariance, correlation : ndarray, shape (n, n)
        Of the free parameters; NaN rows and columns for those at a bound.
    unidentifiable : tuple of str
        Names the data do not determine: at a bound, correlated beyond the limit, or in a null direction.
    findings : tuple of Finding
        One per reason behind `unidentifiable`: ``at_bound``, ``null_direction`` or ``correlated``.
    null_directions : ndarray, shape (n, k)
        Parameter changes, largest entry 1, that leave the residual as it is.
    rmse : float
        Root mean square of the residual, in its unit.
    cost : float
        Half the sum of squares.
    nrmse_fit_percent : float or None
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
    residual_blocks : float or None
        Blocks of the record that `stderr` and `covariance` count as independent; None where they count every residual.

    See Also
    --------
    mgdd.optimize.least_squares : makes one.

    References
    ----------
    Bates and Watts (1988), Nonlinear Regression Analysis and Its Applications, section 2.2.
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
    findings: tuple[Finding, ...]
    null_directions: NDArray[np.float64]
    rmse: float
    cost: float
    nrmse_fit_percent: float | None
    residual: NDArray[np.float64]
    nfev: int
    njev: int
    nit: int
    history: dict[str, NDArray[Any]]
    status: str
    message: str
    success: bool
    residual_blocks: float | None = None

    @classmethod
    def from_core(cls, core_report: _core.optimize.FitReport, data: ArrayLike | None = None) -> FitReport:
        """Wrap a report of the core; of the data that its residual was compared with, `nrmse_fit_percent` is made."""
        residual = _frozen(core_report.residual)
        own: dict[str, Any] = {
            "bounds_active": _frozen(np.asarray(core_report.bounds_active, dtype=np.int_)),
            "findings": classified(core_report),
            "nrmse_fit_percent": None if data is None else _fit_percent(residual, data),
            "nit": core_report.iterations,
            "history": {key: _frozen(column) for key, column in core_report.history.items()},
        }
        for name in cls.__dataclass_fields__.keys() - own.keys():
            value = getattr(core_report, name)
            own[name] = (
                _frozen(value) if isinstance(value, np.ndarray) else tuple(value) if isinstance(value, list) else value
            )
        return cls(**own)

    @property
    def x(self) -> NDArray[np.float64]:
        """Estimates under SciPy's name; the same array as `values`."""
        return self.values

    @property
    def fun(self) -> NDArray[np.float64]:
        """Residual under SciPy's name; the same array as `residual`."""
        return self.residual

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Turn the standard errors into confidence intervals.

        Student's t with the degrees of freedom that the errors have: independent blocks less one where
        `residual_blocks` counts them, otherwise residuals less parameters.

        Parameters
        ----------
        level : float
            Probability that an interval holds the true value, between 0 and 1 [-].

        Returns
        -------
        dict of str to tuple of float
            Lower and upper end by name, in the units of the parameters; NaN for a parameter at a bound.

        Raises
        ------
        ParameterError
            A level outside 0 to 1.

        Examples
        --------
        >>> from mgdd.optimize import least_squares
        >>> report = least_squares(lambda x: ([x[0] - 1.0, x[0] - 3.0, x[0] - 2.0], [[1], [1], [1]]), [0.0])
        >>> low, high = report.interval()["x0"]
        >>> round(low, 3), round(high, 3)
        (-0.484, 4.484)
        """
        from scipy.stats import t

        ParameterError.unless(0.0 < level < 1.0, "level", level, "between 0 and 1")
        if self.residual_blocks is None:
            freedom = float(self.residual.size - np.count_nonzero(self.bounds_active == 0))
        else:
            freedom = self.residual_blocks - 1.0
        wide = float(t.ppf(0.5 + 0.5 * level, max(freedom, 1.0)))
        return {
            name: (float(value - wide * error), float(value + wide * error))
            for name, value, error in zip(self.names, self.values, self.stderr, strict=True)
        }

    def __repr__(self) -> str:
        text = f"<FitReport {self.status}, {len(self.names)} parameters, rmse={self.rmse:.6g}"
        names = f", unidentifiable={list(self.unidentifiable)}" if self.unidentifiable else ""
        fits = len(text) + len(names) < 100
        return f"{text}{names}>" if fits else f"{text}, {len(self.unidentifiable)} unidentifiable>"

    def summary(self) -> str:
        """Table of the fit for a terminal.

        Returns
        -------
        str
            The verdict, one line per parameter (value, stderr, bounds, remark), and the findings.
        """
        rows = [_COLUMNS, *self._lines()]
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
        """
        fields = [field for field in self.__dataclass_fields__ if field not in ("residual", "findings")]
        plain = {field: to_jsonable(getattr(self, field)) for field in fields}
        return plain | {"findings": [finding.to_dict() for finding in self.findings]}

    @property
    def dataset(self) -> xr.Dataset:
        """Estimates over ``parameter``, and their correlation over ``parameter`` and ``other``."""
        names, unit = list(self.names), "unit of the parameter"
        return labelled_dataset(
            {
                "parameter": ("parameter", names, "-", "parameter"),
                "other": ("other", names, "-", "parameter"),
                "value": ("parameter", self.values, unit, "estimate"),
                "stderr": ("parameter", self.stderr, unit, "standard error"),
                "lower": ("parameter", self.lower, unit, "lower bound"),
                "upper": ("parameter", self.upper, unit, "upper bound"),
                "bound_active": ("parameter", self.bounds_active, "-", "bound reached: -1 lower, 1 upper"),
                "correlation": (("parameter", "other"), self.correlation, "-", "correlation"),
            }
        )

    def _repr_html_(self) -> str:
        def line(cells: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        body = "".join(line(row, "td") for row in self._lines())
        notes = findings_html("not identifiable from these data", self.findings)
        return (
            f"<div><p><b>{html.escape(self.status)}</b>: {html.escape(self.message)}<br>"
            f"{html.escape(self._numbers())}</p>"
            f"<table><thead>{line(_COLUMNS, 'th')}</thead><tbody>{body}</tbody></table>{notes}</div>"
        )

    def _numbers(self) -> str:
        fit = "" if self.nrmse_fit_percent is None else f", fit {self.nrmse_fit_percent:.4g} %"
        return (
            f"rmse {self.rmse:.6g}, cost {self.cost:.6g}{fit}; "
            f"{self.nit} iterations, {self.nfev} residual and {self.njev} Jacobian evaluations"
        )

    def _title(self) -> str:
        return f"{self.status}: {self.message}"

    def _rows(self) -> list[Row]:
        estimates = zip(self.names, self.values, self.stderr, strict=True)
        return [Row(name, f"{value:.6g} ± {error:.2g}", unit_of(name)) for name, value, error in estimates]

    def _lines(self) -> list[tuple[str, ...]]:
        remarks = {-1: "at lower bound", 1: "at upper bound"}
        rows = []
        for i, name in enumerate(self.names):
            numbers = (self.values[i], self.stderr[i], self.lower[i], self.upper[i])
            remark = remarks.get(int(self.bounds_active[i]), "")
            if not remark and name in self.unidentifiable:
                remark = "not identifiable"
            rows.append((name, *(f"{number:.6g}" for number in numbers), remark))
        return rows


def _frozen(array: ArrayLike) -> NDArray[Any]:
    copy = np.array(array)
    copy.flags.writeable = False
    return copy


def _fit_percent(residual: NDArray[np.float64], data: ArrayLike) -> float | None:
    measured = np.asarray(data, dtype=np.float64)
    if not np.isfinite(residual).all():
        return None
    if measured.shape != residual.shape:
        raise ShapeError(f"data has shape {measured.shape}: must have one value per residual, {residual.shape}")
    spread = float(np.linalg.norm(measured - measured.mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(residual)) / spread) if spread > 0.0 else None
