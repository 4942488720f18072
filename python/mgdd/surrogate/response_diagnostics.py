"""Diagnostics and findings of a fitted response."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError
from mgdd.results.finding import Finding
from mgdd.results.labels import labelled_dataset
from mgdd.surrogate.points import hull_of
from mgdd.surrogate.polynomial import PolynomialSurface
from mgdd.surrogate.response_model import ResponseModel

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

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
