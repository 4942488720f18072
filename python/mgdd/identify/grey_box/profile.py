"""The profile likelihood of a parameter: how the best fit worsens as it is held elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError
from mgdd.identify.grey_box.fit import GreyBoxFit
from mgdd.results import Fit
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import Result
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.grey_box.search import Search, Vector

_STEPS = 40  # refits on one side, at most
_SHARE = 0.5  # of the quantile, by which a refit goes further where the profile is a parabola
_NEAR = 0.01  # of the root of the quantile, at which a crossing counts as met
_CLOSER = 6  # refits between a value inside and one outside


@dataclass(frozen=True, kw_only=True, repr=False)
class LikelihoodProfile(Result):
    """What the records tell of one parameter once all others are fitted again.

    Parameters
    ----------
    name : str
        The parameter.
    value : float
        Its estimate.
    low, high : float
        Ends of the interval; a bound, or infinite, where the fit does not worsen enough before.
    level : float
        Probability that the interval holds the true value [-].
    dataset : xarray.Dataset
        ``deviance`` [-] over the values at which the others were fitted; the interval is where it is below `quantile`.
    quantile : float
        Square of Student's t at the level [-].
    """

    name: str
    value: float
    low: float
    high: float
    level: float
    quantile: float
    dataset: xr.Dataset


def profile_likelihood(fit: Fit, name: str, *, level: float = 0.95) -> LikelihoodProfile:
    """Hold one parameter at values beside its estimate, fit all others again, and see how far the fit lets it go.

    The interval of `FitReport.interval` takes the model as linear; this one does not, and is one-sided where the
    records bound a parameter on one side only. Of a model that is linear both are the same. A residual that is
    correlated in time widens it as it widens the standard error.

    Parameters
    ----------
    fit : mgdd.results.Fit
        A fit of `fit_model`.
    name : str
        One of the estimated parameters.
    level : float
        Probability that the interval holds the true value, between 0 and 1 [-].

    Returns
    -------
    LikelihoodProfile
        Interval, and the deviance at every value tried.

    Raises
    ------
    ParameterError
        A fit of another kind, a parameter that was not estimated, a level outside 0 to 1.

    References
    ----------
    Bates and Watts (1988), Nonlinear Regression Analysis and Its Applications, section 6.1.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import DiscreteModel, fit_model, profile_likelihood
    >>> decay = DiscreteModel(step=lambda x, u, p: p[0] * x, parameters={"pole": 0.8}, initial_state=(1.0,))
    >>> record = decay.simulate({"time_s": np.arange(40.0), "u": np.zeros(40)})
    >>> record["y"] = record["y"] + 0.05 * np.random.default_rng(1).standard_normal(40)
    >>> profile = profile_likelihood(fit_model(decay, record), "pole")
    >>> profile.low < 0.8 < profile.high
    True
    """
    if not isinstance(fit, GreyBoxFit):
        raise ParameterError("fit: must be one of fit_model, whose search a profile repeats")
    ParameterError.unless(0.0 < level < 1.0, "level", level, "between 0 and 1")
    names = fit.report.names
    ParameterError.unless(name in names, "name", name, f"one of the estimated {', '.join(names)}")
    best = float(fit.report.values[names.index(name)])
    unit, quantile = _unit(fit, name), _quantile(fit, level)
    tried, ends = {best: 0.0}, []
    for side in (-1, 1):
        end, own = _end(fit, name, side, unit, quantile)
        tried |= own
        ends.append(end)
    at = sorted(tried)
    dataset = labelled_dataset(
        {
            name: (name, at, unit_of(name), name),
            "deviance": (name, [tried[value] for value in at], "-", f"deviance, {name} held"),
        }
    )
    return LikelihoodProfile(
        name=name, value=best, low=ends[0], high=ends[1], level=level, quantile=quantile, dataset=dataset
    )


def _quantile(fit: GreyBoxFit, level: float) -> float:
    """Return the square of Student's t that `FitReport.interval` takes."""
    report = fit.report
    finite = np.flatnonzero(np.isfinite(report.stderr) & (report.stderr > 0.0))
    if finite.size == 0:
        from scipy.stats import t

        return float(t.ppf(0.5 + 0.5 * level, max(report.residual.size - len(report.names), 1)) ** 2)
    one = report.names[finite[0]]
    low, high = report.interval(level)[one]
    return float(((high - low) / (2.0 * report.stderr[finite[0]])) ** 2)


def _unit(fit: GreyBoxFit, name: str) -> float:
    """Return by how much half the sum of squares rises where the deviance is one.

    Half the variance of an independent residual, times the square of what correlation in time adds to the error.
    """
    report, search = fit.report, fit.search
    i, free = report.names.index(name), np.flatnonzero(report.bounds_active == 0)
    freedom = max(report.residual.size - free.size, 1)
    variance, wider = 2.0 * report.cost / freedom, 1.0
    evaluated = search.residual(report.values)
    if evaluated is not None and i in free and math.isfinite(report.stderr[i]):
        norm = np.linalg.norm(evaluated[1][:, free], axis=0)
        slopes, at = evaluated[1][:, free] / np.where(norm > 0.0, norm, 1.0), free.tolist().index(i)
        alone = variance * float(np.linalg.pinv(slopes.T @ slopes)[at, at]) / norm[at] ** 2
        wider = float(report.stderr[i] ** 2 / alone) if alone > 0.0 else 1.0
    return 0.5 * variance * wider


def _end(fit: GreyBoxFit, name: str, side: int, unit: float, quantile: float) -> tuple[float, dict[float, float]]:
    """Go to one side until the deviance passes the quantile; return where, and the deviances on the way."""
    report, search = fit.report, fit.search
    i, target = report.names.index(name), math.sqrt(quantile)
    bound, error = float((report.lower, report.upper)[side > 0][i]), float(report.stderr[i])
    inside, others, tried = (float(report.values[i]), 0.0), report.values, dict[float, float]()
    step = error if math.isfinite(error) and error > 0.0 else 0.05 * max(abs(inside[0]), 1e-3)
    step *= _SHARE * target

    def root(at: float) -> float:
        """Fit the others from the last ones; a value that cannot be run is far outside."""
        nonlocal others
        refit = _held(search, others, i, at)
        if refit is not None:
            others = refit[1]
        tried[at] = math.inf if refit is None else max((refit[0] - report.cost) / unit, 0.0)
        return math.sqrt(tried[at])

    for _ in range(_STEPS):
        at = inside[0] + side * step
        at = bound if (at - bound) * side >= 0.0 else at
        outside = (at, root(at))
        if outside[1] > target:
            return _crossing(root, inside, outside, target), tried
        if at == bound:
            return bound, tried
        if outside[1] - inside[1] < 0.5 * _SHARE * target:
            step *= 1.5
        inside = outside
    return side * math.inf, tried


def _crossing(
    root: Callable[[float], float], inside: tuple[float, float], outside: tuple[float, float], target: float
) -> float:
    """Find where the root of the deviance, which is close to a line, meets the target."""
    for _ in range(_CLOSER):
        share = (target - inside[1]) / (outside[1] - inside[1]) if math.isfinite(outside[1]) else 0.5
        at = inside[0] + share * (outside[0] - inside[0])
        now = (at, root(at))
        if abs(now[1] - target) < _NEAR * target:
            return at
        inside, outside = (now, outside) if now[1] < target else (inside, now)
    return inside[0]


def _held(search: Search, values: Vector, i: int, at: float) -> tuple[float, Vector] | None:
    """Fit all but one parameter; return half the sum of squares, and all values."""
    x = values.copy()
    x[i] = at
    if x.size == 1:
        evaluated = search.residual(x)
        return None if evaluated is None else (0.5 * float(evaluated[0] @ evaluated[0]), x)
    report = search.solve(x, held=i)
    return (float(report.cost), np.insert(report.values, i, at)) if math.isfinite(report.cost) else None
