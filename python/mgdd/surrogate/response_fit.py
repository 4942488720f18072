"""Fit a model of one response over the factors of a design, with confidence intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, ShapeError, argument
from mgdd.io.point_table import flat_points, input_names
from mgdd.optimize import least_squares
from mgdd.results import Fit
from mgdd.results.finding import Finding
from mgdd.results.fit import FitQuality
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.signals import nrmse_fit_percent
from mgdd.signals.metrics import rmse
from mgdd.surrogate.points import column_label, column_names, hull_of, points_of
from mgdd.surrogate.polynomial import PolynomialBasis, PolynomialSurface, choose_terms, support_of
from mgdd.surrogate.process import ProcessSurface, fit_process
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
    _check(kind, degree, select, n_starts, seed)
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
    from mgdd.plot.response import response_diagnostics

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


def _check(kind: str, degree: int, select: str, n_starts: int, seed: int) -> None:
    for what, value, choices in (("kind", kind, KINDS), ("select", select, SELECTIONS)):
        if value not in choices:
            raise ParameterError.of(what, value, f"one of {', '.join(choices)}")
    counts = (("degree", degree, 1, _MOST_DEGREE), ("n_starts", n_starts, 1, 1000), ("seed", seed, 0, 2**32 - 1))
    for what, count, least, most in counts:
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or not least <= count <= most:
            raise ParameterError.of(what, count, f"a whole number in [{least}, {most}]")


_OUTLIER = 0.05  # probability that clean data have any outlier
_RARE = 0.01  # probability at which clean data show each of the other patterns
_FEW_ORDERED = 10
_PER_FACTOR = 10
_TAKES_ALL = 0.99


def outlier_bound(n: int, freedom: float) -> float:
    """Return the size that the largest of n studentised residuals exceeds in one of twenty clean sets (Bonferroni)."""
    from scipy.stats import t

    return float(t.ppf(1.0 - 0.5 * _OUTLIER / n, freedom - 1.0)) if freedom > 1.0 else float("nan")


def response_findings(
    model: ResponseModel, studentised: NDArray[np.float64], left_out: NDArray[np.float64]
) -> tuple[Finding, ...]:
    """Return every limitation of the fit."""
    fitted, weight = model.surface.fitted()
    residual = model.values - fitted
    freedom = model.values.size - float(weight.sum())
    standardised = residual / np.sqrt(np.maximum(1.0 - weight, 1e-12))
    return (
        *_few(model, weight),
        *_outliers(model, studentised),
        *_prediction(model, left_out, residual),
        *_spread(standardised, fitted),
        *_order(standardised),
        *_curved(model, residual, fitted),
        *_lack_of_fit(model, residual, freedom),
        *_hull(model),
    )


def _few(model: ResponseModel, weight: NDArray[np.float64]) -> Iterator[Finding]:
    n, m = model.points.shape
    if isinstance(model.surface, PolynomialSurface):
        terms = model.surface.coefficients.size
        if n - terms < max(3, terms // 2):
            text = f"{n} points for {terms} terms leave {n - terms} degrees of freedom for the noise"
            yield Finding("few_points", (model.name,), text, "add points or lower the degree")
        alone = np.flatnonzero(weight > _TAKES_ALL)
        if alone.size:
            text = f"the model passes through point {', '.join(map(str, alone[:5]))} whatever was measured there"
            yield Finding(
                "high_leverage", tuple(f"point {k}" for k in alone), text, "repeat it, or add points beside it"
            )
    elif n < _PER_FACTOR * m:
        text = f"{n} points of {m} factors: a Gaussian process wants about {_PER_FACTOR * m}"
        yield Finding("few_points", (model.name,), text, "add points: its intervals are too narrow with few")


def _outliers(model: ResponseModel, studentised: NDArray[np.float64]) -> Iterator[Finding]:
    bound = outlier_bound(model.values.size, model.surface.freedom)
    outliers = np.flatnonzero(np.abs(studentised) > bound)
    if outliers.size:
        worst = ", ".join(f"{k} ({studentised[k]:+.1f})" for k in outliers[:5])
        text = f"point {worst} beyond ±{bound:.1f} standard deviations of what the other points predict"
        yield Finding(
            "outlier", tuple(f"point {k}" for k in outliers), text, "look at the record; repeat it before it is dropped"
        )


def _prediction(
    model: ResponseModel, left_out: NDArray[np.float64], residual: NDArray[np.float64]
) -> Iterator[Finding]:
    error = model.values - left_out
    finite = np.isfinite(error)
    spread = model.values[finite] - model.values[finite].mean()
    if finite.sum() < 2:
        return
    share = 1.0 - float(np.sum(error[finite] ** 2) / np.sum(spread**2))
    if share < 0.5:
        text = f"the others predict {100.0 * max(share, 0.0):.0f} % of the variance of left-out points"
        yield Finding(
            "poor_prediction", (model.name,), text, "add points, factors or terms, or measure with less noise"
        )
    ratio = float(np.sqrt(np.mean(error[finite] ** 2) / max(float(np.mean(residual[finite] ** 2)), 1e-300)))
    if ratio > 2.0 and isinstance(model.surface, PolynomialSurface):
        text = f"left-out points are missed by {ratio:.1f} times the residual: there are too many terms for the points"
        yield Finding("overfitted", (model.name,), text, "add points or lower the degree")


def _spread(residual: NDArray[np.float64], fitted: NDArray[np.float64]) -> Iterator[Finding]:
    """Test with Koenker whether squared residuals grow with the fitted value."""
    from scipy.stats import chi2

    share = _correlation(residual**2, fitted) ** 2
    if residual.size >= _FEW_ORDERED and chi2.sf(residual.size * share, 1) < _RARE:
        grows = "grow" if _correlation(residual**2, fitted) > 0.0 else "shrink"
        text = (
            f"the residuals {grows} with the fitted value: the interval is too narrow at one end, too wide at the other"
        )
        yield Finding("heteroscedastic", (), text, "fit the logarithm of the response, or two regions apart")


def _order(residual: NDArray[np.float64]) -> Iterator[Finding]:
    from scipy.stats import norm

    n = residual.size
    if n < _FEW_ORDERED:
        return
    limit = float(norm.ppf(1.0 - 0.5 * _RARE)) / np.sqrt(n)
    remedy = "run the points in random order, and repeat one from time to time"
    if abs(_correlation(residual, np.arange(n, dtype=np.float64))) > limit:
        yield Finding("structured", ("run order",), "the residuals drift with the order of the points", remedy)
    elif abs(_correlation(residual[1:], residual[:-1])) > limit:
        yield Finding(
            "structured", ("run order",), "neighbours in the order of the points have related residuals", remedy
        )


def _curved(model: ResponseModel, residual: NDArray[np.float64], fitted: NDArray[np.float64]) -> Iterator[Finding]:
    """Test with Tukey whether the square of the fitted value explains what is left."""
    from scipy.stats import t

    if not isinstance(model.surface, PolynomialSurface) or model.surface.freedom < 4.0:
        return
    orthogonal, _ = np.linalg.qr(model.surface.support.basis(model.points))
    square = (fitted - fitted.mean()) ** 2
    square = square - orthogonal @ (orthogonal.T @ square)
    size = float(np.linalg.norm(square))
    if size <= 1e-9 * float(np.sum((fitted - fitted.mean()) ** 2)):
        return
    explained = float(square @ residual) / size
    left = max(float(residual @ residual) - explained**2, 1e-300)
    freedom = model.surface.freedom - 1.0
    if 2.0 * t.sf(abs(explained) / np.sqrt(left / freedom), freedom) < _RARE:
        text = "the residuals curve with the fitted value: the polynomial misses a curvature"
        yield Finding(
            "structured", ("fitted",), text, "raise the degree, transform the response, or take a Gaussian process"
        )


def _lack_of_fit(model: ResponseModel, residual: NDArray[np.float64], freedom: float) -> Iterator[Finding]:
    from scipy.stats import f

    _, group = np.unique(model.points, axis=0, return_inverse=True)
    group = group.reshape(-1)
    counts = np.bincount(group)
    pure_freedom = float(model.values.size - counts.size)
    if pure_freedom < 1.0 or freedom - pure_freedom < 1.0:
        return
    means = np.bincount(group, model.values) / counts
    pure = float(np.sum((model.values - means[group]) ** 2)) / pure_freedom
    missed = (float(residual @ residual) - pure * pure_freedom) / (freedom - pure_freedom)
    if pure > 0.0 and f.sf(missed / pure, freedom - pure_freedom, pure_freedom) < _RARE:
        text = f"the model misses repeated points by {np.sqrt(missed / pure):.1f} times what they scatter"
        yield Finding("lack_of_fit", (model.name,), text, "raise the degree, or take a Gaussian process")


def _hull(model: ResponseModel) -> Iterator[Finding]:
    try:
        hull_of(model.points, tuple(model.factors))
    except DataError as reason:
        text = f"{reason}; `extrapolated` goes by the range of each factor alone"
        yield Finding("no_hull", tuple(model.factors), text)


def _correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    a, b = one - one.mean(), other - other.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else 0.0


_STEPS = 41


def diagnostics_of(model: ResponseModel, left_out: NDArray[np.float64], studentised: NDArray[np.float64]) -> xr.Dataset:
    """Tabulate points and cuts of a model."""
    from scipy.stats import norm, rankdata

    fitted, weight = model.surface.fitted()
    n, names, (unit, long_name) = model.values.size, tuple(model.factors), model.label
    bound = outlier_bound(n, model.surface.freedom)
    scores = norm.ppf((rankdata(studentised, method="ordinal") - 0.375) / (n + 0.25))
    columns = {
        name: ("point", column, *label)
        for (name, label), column in zip(model.factors.items(), model.points.T, strict=True)
    }
    low, high, middle = model.points.min(axis=0), model.points.max(axis=0), np.median(model.points, axis=0)
    steps = np.linspace(low, high, _STEPS, axis=1)
    at = np.tile(middle, (len(names), _STEPS, 1))
    for place in range(len(names)):
        at[place, :, place] = steps[place]
    cuts = model.predict(dict(zip(names, at.reshape(-1, len(names)).T, strict=True)))
    cut = {name: cuts[name].to_numpy().reshape(len(names), _STEPS) for name in ("mean", "lower", "upper")}
    along, unit_text = ("factor", "step"), "unit of the factor"
    return labelled_dataset(
        {
            "point": ("point", np.arange(n), "-", "point in run order"),
            **columns,
            "measured": ("point", model.values, unit, f"{long_name}, measured"),
            "fitted": ("point", fitted, unit, f"{long_name}, fitted"),
            "left_out": ("point", left_out, unit, f"{long_name}, predicted from the other points"),
            "residual": ("point", model.values - fitted, unit, f"{long_name}, measured minus fitted"),
            "studentised": ("point", studentised, "-", "studentised residual"),
            "leverage": ("point", weight, "-", "leverage"),
            "normal_score": ("point", scores, "-", "normal score"),
            "outlier": ("point", np.abs(studentised) > bound, "-", "beyond the bound for outliers"),
            "outlier_bound": ((), bound, "-", "bound for outliers"),
            "factor": ("factor", list(names), "-", "factor"),
            "step": ("step", np.arange(_STEPS), "-", "step of a cut"),
            "cut": (along, steps, unit_text, "factor, the others at their medians"),
            "cut_mean": (along, cut["mean"], unit, f"{long_name}, prediction"),
            "cut_lower": (along, cut["lower"], unit, f"{long_name}, lower end of the interval"),
            "cut_upper": (along, cut["upper"], unit, f"{long_name}, upper end of the interval"),
        },
        attrs={"response": model.name, "kind": model.kind, "level": 0.95},
    )
