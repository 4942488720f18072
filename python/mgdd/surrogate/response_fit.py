"""Fit a model of one response over the factors of a design, with confidence intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, ShapeError, argument
from mgdd.io.point_table import flat_points, input_names
from mgdd.optimize import least_squares
from mgdd.results import Fit
from mgdd.results.fit import FitQuality
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import Label, label_of
from mgdd.signals import nrmse_fit_percent
from mgdd.signals.metrics import rmse
from mgdd.surrogate.points import column_label, column_names, points_of
from mgdd.surrogate.polynomial import PolynomialBasis, PolynomialSurface, choose_terms, support_of
from mgdd.surrogate.process import ProcessSurface, fit_process
from mgdd.surrogate.response_diagnostics import diagnostics_of, response_findings
from mgdd.surrogate.response_model import RESERVED, ResponseModel

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

KINDS = ("polynomial", "gaussian_process")
SELECTIONS = ("bic", "press", "all")
_MOST_DEGREE = 4

Surface = PolynomialSurface | ProcessSurface
Fitter = Callable[["NDArray[np.float64]", "NDArray[np.float64]"], tuple[Surface, FitReport]]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ResponseFit(Fit):
    """A fitted response: `model` predicts it, `train` is the fit of the points and `test` that of left-out ones.

    Parameters
    ----------
    diagnostics : xarray.Dataset
        Over ``point``: the factors, ``measured``, ``fitted``, ``left_out`` (predicted from the other points),
        ``residual`` (measured minus fitted), ``studentised``, ``leverage``, ``normal_score`` and ``outlier``; the
        number ``outlier_bound``; cuts through the medians of the points, ``cut``, ``cut_mean``, ``cut_lower`` and
        ``cut_upper`` over ``factor`` and ``step``.
    """

    diagnostics: xr.Dataset


def fit_response(
    points: Any,
    response: str | ArrayLike,
    *,
    kind: str = "polynomial",
    factors: Sequence[str] | None = None,
    degree: int = 2,
    select: str = "bic",
    folds: int | None = None,
    n_starts: int = 5,
    seed: int = 0,
) -> ResponseFit:
    """Fit a model of one response over the factors of a design.

    Parameters
    ----------
    points : xarray.Dataset, DataFrame or mapping of columns
        One column per factor, in the order in which the points were run; or a sweep over a grid.
    response : str or array_like, shape (n,)
        Column of `points`, or the measured values.
    kind : {"polynomial", "gaussian_process"}
        Least squares on products of the factors, or a Gaussian process (Matérn 5/2, a length scale per factor, white
        noise; needs ``pip install "mgdd[gp]"``).
    factors : sequence of str, optional
        Columns to use. If left out: the inputs of a sweep or of read points, which are the axes of its grid or
        coordinates over its points; all but the response where `points` marks none as an input.
    degree : int
        Of the full polynomial, 1 to 4.
    select : {"bic", "press", "all"}
        Keep the terms with the least Schwarz criterion, those that predict left-out points best, or all. A product is
        kept with its factors only.
    folds : int, optional
        Leave out one of so many random parts at a time and repeat the whole fit, choice of terms included. Without it
        each point is left out alone, in closed form, terms or length scales held.
    n_starts : int
        Searches for the length scales of a Gaussian process.
    seed : int
        Of these starts and of the parts.

    Returns
    -------
    ResponseFit
        ``model.predict`` gives mean, interval and what is extrapolated; ``findings`` list the limitations: codes
        ``outlier``, ``few_points``, ``high_leverage``, ``poor_prediction``, ``overfitted``, ``heteroscedastic``,
        ``structured``, ``lack_of_fit`` and ``no_hull``. Clean data show an outlier in one of twenty sets, each other
        pattern in one of a hundred.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown kind, a degree, selection or number of parts outside its domain, a factor twice.
    mgdd.errors.DataError
        A missing column, a number that is not finite, a factor or response that does not vary, too few points.
    ImportError
        The extra ``gp`` is not installed.

    References
    ----------
    Allen (1974), The relationship between variable selection and data augmentation and a method for prediction.
    Cook and Weisberg (1982), Residuals and Influence in Regression.
    Koenker (1981), A note on studentizing a test for heteroscedasticity.
    Tukey (1949), One degree of freedom for non-additivity.
    Loeppky et al. (2009), Choosing the sample size of a computer experiment.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.design import design_points
    >>> from mgdd.surrogate import fit_response
    >>> plan = design_points({"speed_rpm": (1000.0, 3000.0), "fuel_mg": (5.0, 40.0)}, method="factorial", levels=4)
    >>> noise = np.random.default_rng(3).normal(0.0, 0.02, 16)
    >>> fit = fit_response(plan, 0.3 * plan["fuel_mg"] - 1e-7 * (plan["speed_rpm"] - 1800.0) ** 2 + noise)
    >>> fit.model.terms, [finding.code for finding in fit.findings]
    (('1', 'speed_rpm', 'fuel_mg', 'speed_rpm^2'), [])
    """
    for what, value, choices in (("kind", kind, KINDS), ("select", select, SELECTIONS)):
        ParameterError.unless(value in choices, what, value, f"one of {', '.join(choices)}")
    counts = (("degree", degree, 1, _MOST_DEGREE), ("n_starts", n_starts, 1, 1000), ("seed", seed, 0, 2**32 - 1))
    for what, count, least, most in counts:
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or not least <= count <= most:
            raise ParameterError.of(what, count, f"a whole number in [{least}, {most}]")
    if hasattr(points, "data_vars"):
        column = response if isinstance(response, str) and response in points else ""
        factors = factors if factors is not None else input_names(points, column) or None
        if column and points[column].ndim > 1:
            points = flat_points(points, None if factors is None else [*factors, column], "points")
    names = _factor_names(points, response, factors)
    x = points_of(points, names)
    name, label, y = _response(points, response, names, len(x))
    if folds is not None and not (isinstance(folds, int | np.integer) and 2 <= folds <= len(y)):
        raise ParameterError.of("folds", folds, f"a whole number in [2, {len(y)}], the points")
    flat = [factor for factor, span in zip(names, np.ptp(x, axis=0), strict=True) if not span > 0.0]
    if flat:
        raise DataError(f"{flat[0]} does not vary in the points: leave it out of factors")
    if not np.ptp(y) > 0.0:
        raise DataError(f"{name} is {y[0]:g} at every point: nothing to fit; record more digits")

    def fitter(column: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[Surface, FitReport]:
        if kind == "polynomial":
            return _polynomial(column, values, names, degree, select)
        return fit_process(column, values, names, n_starts=n_starts, seed=seed)

    surface, report = fitter(x, y)
    model = ResponseModel(
        name=name, label=label, factors={factor: column_label(points, factor) for factor in names}, surface=surface
    )
    left_out, studentised = surface.left_out()
    parted = left_out if folds is None else _parted(x, y, fitter, int(folds), seed)
    finite = np.isfinite(parted)
    return ResponseFit(
        report=report,
        model=model,
        kind=kind,
        train=_quality(y, surface.fitted()[0], label),
        test=_quality(y[finite], parted[finite], label) if finite.sum() > 1 else None,
        checked_by="leave-one-out" if folds is None else f"{folds}-fold",
        findings=(*report.findings, *response_findings(model, studentised, left_out)),
        unidentifiable=report.unidentifiable,
        source=name,
        draw=_draw,
        diagnostics=diagnostics_of(model, left_out, studentised),
    )


def _draw(fit: ResponseFit, ax: Any) -> Any:
    from mgdd.plot.identification import response_diagnostics

    return response_diagnostics(fit.diagnostics, ax=ax)


def _polynomial(
    points: NDArray[np.float64], values: NDArray[np.float64], names: tuple[str, ...], degree: int, select: str
) -> tuple[PolynomialSurface, FitReport]:
    half = 0.5 * np.ptp(points, axis=0)
    basis = PolynomialBasis.of(degree, centre=points.min(axis=0) + half, scale=half)
    if select != "all":
        basis = basis.only(choose_terms(basis(points), values, basis.monomials, select))
    terms, labels = basis(points), basis.names(names)
    n, p = terms.shape
    if n <= p:
        raise DataError(f"{n} points for {p} terms: at least {p + 1} are needed; add points or lower the degree")
    if np.linalg.matrix_rank(terms) < p:
        raise DataError(
            f"the points do not separate the {p} terms ({', '.join(labels)}): use {argument('select', repr('bic'))}, "
            "fewer factors or a lower degree, or add points with d_optimal"
        )
    coefficients = np.asarray(np.linalg.lstsq(terms, values, rcond=None)[0], dtype=np.float64)
    report = least_squares(lambda c: (terms @ c - values, terms), coefficients, names=labels, data=values)
    surface = PolynomialSurface(
        points=points,
        values=values,
        support=support_of(points, basis, inputs=names, share=1.0),
        coefficients=coefficients,
        noise_sd=float(np.sqrt(np.sum((values - terms @ coefficients) ** 2) / (n - p))),
    )
    return surface, report


def _parted(
    points: NDArray[np.float64], values: NDArray[np.float64], fitter: Fitter, folds: int, seed: int
) -> NDArray[np.float64]:
    """Predict each random part from a fit to the others."""
    predicted = np.empty(values.size)
    order = np.random.default_rng(seed).permutation(values.size)
    for part in np.array_split(order, folds):
        others = np.setdiff1d(order, part)
        if not (np.ptp(points[others], axis=0) > 0.0).all() or not np.ptp(values[others]) > 0.0:
            raise DataError(f"folds = {folds}: without one part a factor or the response does not vary; use more folds")
        predicted[part] = fitter(points[others], values[others])[0].predict(points[part])[0]
    return predicted


def _quality(measured: NDArray[np.float64], model: NDArray[np.float64], label: Label) -> FitQuality:
    varies = bool(np.ptp(measured) > 0.0)
    return FitQuality(
        nrmse_fit_percent=float(nrmse_fit_percent(measured, model)) if varies else None,
        rmse=float(rmse(measured, model)),
        unit=label.units,
        n=measured.size,
    )


def _factor_names(points: Any, response: Any, factors: Sequence[str] | None) -> tuple[str, ...]:
    have = column_names(points, "points")
    if isinstance(response, str) and response not in have:
        raise DataError(f"points have no response {response!r}: they have {', '.join(have)}")
    column = response if isinstance(response, str) else None
    names = tuple(name for name in have if name != column) if factors is None else tuple(factors)
    if isinstance(factors, str) or not names or len(set(names)) < len(names):
        raise ParameterError.of("factors", factors, "names of columns, each once, at least one")
    odd = [name for name in names if name in RESERVED or name == column]
    if odd:
        raise ParameterError.of("factors", odd[0], f"no response and none of {', '.join(RESERVED)}: rename the column")
    return names


def _response(
    points: Any, response: Any, factors: tuple[str, ...], size: int
) -> tuple[str, Label, NDArray[np.float64]]:
    if isinstance(response, str):
        name, label, given = response, column_label(points, response), points[response]
    else:
        given = response
        name = str(getattr(response, "name", None) or "response")
        attributes: Mapping[str, Any] = getattr(response, "attrs", {})
        if name in factors:  # arithmetic on a factor kept its name and unit
            name, attributes = "response", {}
        labelled = {"units", "long_name"} <= set(attributes)
        label = label_of(given) if labelled else Label("unit of the response", name)
    values = np.array(given, dtype=np.float64)
    if values.shape != (size,):
        raise ShapeError(f"{name} has shape {values.shape}: must have one value per point, ({size},)")
    if not np.isfinite(values).all():
        raise DataError(f"{name}: point {int(np.argmin(np.isfinite(values)))} is not finite: drop or repeat it")
    return name, label, values
