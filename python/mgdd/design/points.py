"""Designs of experiments: which points to run, inside what may be run, and beside what has been run."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.design.choice import (
    best_of,
    d_efficiency_percent,
    d_optimal,
    draw_inside,
    extend_hypercube,
    far_points,
    least_distance,
    sampler_of,
)
from mgdd.design.factors import Factors, factors_of
from mgdd.design.region import FeasibleRegion, inside_of
from mgdd.errors import DataError, ParameterError, argument
from mgdd.surrogate.polynomial import MODELS, PolynomialBasis

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

METHODS = ("sobol", "halton", "lhs", "maximin", "factorial", "d_optimal")
_POOL = 30  # candidates per point where points are chosen by distance
_MOST_GRID = 8192  # points of a grid of candidates; beyond it they are drawn
_DRAWN_CANDIDATES = 8192


def design_points(
    factors: Mapping[str, tuple[float, float] | Sequence[float] | AbstractSet[float]],
    n: int | None = None,
    *,
    method: str = "sobol",
    feasible: FeasibleRegion | Callable[[dict[str, NDArray[np.float64]]], Any] | None = None,
    existing: Any = None,
    model: str = "quadratic",
    levels: int | Mapping[str, int] | None = None,
    n_starts: int = 10,
    seed: int = 0,
) -> xr.Dataset:
    """Choose the points of an experiment.

    Parameters
    ----------
    factors : mapping of str to tuple, sequence or set of float
        Per factor its range (low, high), three or more levels, or a set of levels where there are two. A name that ends
        in its unit gives it.
    n : int, optional
        Points to add; all methods but ``"factorial"`` need it.
    method : {"sobol", "halton", "lhs", "maximin", "factorial", "d_optimal"}
        Low-discrepancy sequences; Latin hypercube, one point in each of n equal parts of every range; points far from
        each other; every combination of levels; points that determine the terms of `model` best.
    feasible : FeasibleRegion or callable, optional
        Points are drawn until n lie inside; a callable gets the columns by name and returns one bool per point. What
        is rejected spoils the balance of a sequence and the even parts of a Latin hypercube. Candidates of
        ``"d_optimal"`` and combinations of ``"factorial"`` that are not inside are left out.
    existing : xarray.Dataset, DataFrame or mapping of columns, optional
        Points that were run. New ones keep away from them; ``"lhs"`` fills the parts that they leave free,
        ``"d_optimal"`` adds to what they determine.
    model : {"linear", "interactions", "quadratic", "cubic"}
        Polynomial for ``"d_optimal"``.
    levels : int or mapping of str to int, optional
        Levels of each range for ``"factorial"`` (3) and for the candidates of ``"d_optimal"`` (5; fewer where their
        grid would exceed 8192 points); an odd number has the middle.
    n_starts : int
        Searches of ``"d_optimal"`` and tries of ``"lhs"``, of which the best is kept.
    seed : int
        Of everything random: the same seed gives the same points.

    Returns
    -------
    xarray.Dataset
        The factors over ``point``, new points only, numbered after the existing ones. Attributes: ``method``, ``seed``,
        ``feasible_share`` of what was drawn, ``least_distance`` of two points in ranges of the factors (existing ones
        included); of ``"d_optimal"`` also ``model``, ``n_terms``, ``n_candidates``, ``log_det`` of X'X with ranges
        scaled to -1 and 1, ``d_efficiency_percent`` and ``log_det_starts``. Run them in random order.

    Raises
    ------
    mgdd.errors.ParameterError
        A range that is empty or reversed, levels that repeat, an unknown method or model, n missing or not positive,
        fewer points than terms.
    mgdd.errors.DataError
        Existing points outside the factors or not feasible, too few feasible candidates; the message has their share.

    Warns
    -----
    UserWarning
        A Sobol design whose n is not a power of two: its first moments are not balanced.

    References
    ----------
    McKay et al. (1979), A comparison of three methods for selecting values of input variables.
    Sobol (1967), On the distribution of points in a cube.
    Halton (1960), On the efficiency of certain quasi-random sequences of points.
    Fedorov (1972), Theory of Optimal Experiments.

    Examples
    --------
    >>> from mgdd.design import design_points
    >>> plan = design_points({"soi_cad": (-20.0, 5.0), "fuel_mg": (5.0, 40.0)}, 16)
    >>> plan.sizes["point"], plan["fuel_mg"].attrs["units"]
    (16, 'mg')
    >>> three = design_points({"soi_cad": (-20.0, 4.0)}, 6, method="d_optimal")
    >>> sorted(three["soi_cad"].values.tolist())
    [-20.0, -20.0, -8.0, -8.0, 4.0, 4.0]
    """
    checked = factors_of(factors)
    for name, value, choices in (("method", method, METHODS), ("model", model, MODELS)):
        ParameterError.unless(value in choices, name, value, f"one of {', '.join(choices)}")
    if method == "factorial":
        if n is not None:
            raise ParameterError.of(argument("n"), n, "None: the levels of a factorial determine the number of points")
    elif n is None or isinstance(n, bool) or not isinstance(n, int | np.integer) or not 1 <= n <= 1_000_000:
        raise ParameterError.of(argument("n"), n, f"a whole number in [1, 1000000] for method {method!r}")
    for name, count, least in (("n_starts", n_starts, 1), ("seed", seed, 0)):
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < least:
            raise ParameterError.of(name, count, f"a whole number >= {least}")
    counts = _levels(checked, levels, 3 if method == "factorial" else 5)
    before = np.empty((0, len(checked.items))) if existing is None else checked.existing(existing)

    def inside(points: NDArray[np.float64]) -> NDArray[np.bool_]:
        return inside_of(feasible, checked.columns(points))

    if len(before):
        good = inside(before)
        if not good.all():
            few = f"{int(good.sum())} of {good.size} points are feasible ({100.0 * good.mean():.2g} %)"
            raise DataError(
                f"{argument('existing')}: {few}, point {int(np.argmin(good))} is not: drop what is not, or widen the "
                "region"
            )
    generator = np.random.default_rng(seed)
    attrs: dict[str, Any] = {"method": method, "seed": seed}
    if method == "factorial":
        points, share = _factorial(checked, counts, inside)
    elif method == "d_optimal":
        points, share, more = _d_optimal(checked, int(n or 0), before, counts, inside, model, n_starts, generator)
        attrs |= more
    else:
        points, share = _filled(checked, int(n or 0), before, inside, method, n_starts, generator, feasible is None)
    attrs["feasible_share"] = share
    nearest = least_distance(checked.to_unit(np.vstack([before, points])))
    if np.isfinite(nearest):
        attrs["least_distance"] = nearest
    return checked.dataset(points, first=len(before), attrs=attrs)


def _filled(
    factors: Factors,
    n: int,
    before: NDArray[np.float64],
    inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]],
    method: str,
    n_starts: int,
    generator: np.random.Generator,
    free: bool,
) -> tuple[NDArray[np.float64], float]:
    m, shares = len(factors.items), factors.to_unit(before)
    if method == "lhs" and free:
        if len(before):
            return factors.of_unit(extend_hypercube(shares, n, generator, n_starts=n_starts)), 1.0
        sample = sampler_of("lhs", m, generator)
        return factors.of_unit(best_of(lambda: sample(n), shares, n_starts)), 1.0
    by_distance = method == "maximin" or len(before) > 0
    if method == "sobol" and free and not by_distance and n & (n - 1):
        warnings.warn(
            f"n = {n}: the means of a Sobol design are balanced for powers of two only; the nearest are "
            f"{1 << (n.bit_length() - 1)} and {1 << n.bit_length()}",
            UserWarning,
            stacklevel=4,
        )
    sample = sampler_of("sobol" if method == "maximin" else method, m, generator)
    points, feasible_count, drawn = draw_inside(
        lambda count: factors.of_unit(sample(count)), _POOL * n if by_distance else n, inside=inside, what=method
    )
    if by_distance:
        points = points[far_points(factors.to_unit(points), n, existing=shares)]
    return points, feasible_count / drawn


def _factorial(
    factors: Factors, counts: Mapping[str, int], inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]]
) -> tuple[NDArray[np.float64], float]:
    points = factors.grid(counts)
    good = inside(points)
    if not good.any():
        raise DataError(f"feasible: none of the {len(points)} combinations is feasible (0 %): more levels or limits")
    return points[good], float(good.mean())


def _d_optimal(
    factors: Factors,
    n: int,
    before: NDArray[np.float64],
    counts: Mapping[str, int],
    inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]],
    model: str,
    n_starts: int,
    generator: np.random.Generator,
) -> tuple[NDArray[np.float64], float, dict[str, Any]]:
    half = 0.5 * factors.span
    basis = PolynomialBasis.of(model, centre=factors.low + half, scale=half)
    terms = len(basis.monomials)
    if n + len(before) < terms:
        raise ParameterError.of(argument("n"), n, f">= {terms - len(before)}: the {model} model has {terms} terms")
    grid = _candidates(factors, counts, basis.monomials.shape[1], generator)
    good = inside(grid)
    if not good.any():
        raise DataError(f"feasible: none of {len(grid)} candidates is feasible (0 %): more levels or a wider region")
    candidates = grid[good]
    result = d_optimal(basis(candidates), n, fixed=basis(before), n_starts=n_starts, generator=generator)
    points = candidates[result.rows]
    return (
        points[np.lexsort(points.T[::-1])],
        float(good.mean()),
        {
            "model": model,
            "n_terms": terms,
            "n_candidates": len(candidates),
            "log_det": result.log_det,
            "d_efficiency_percent": d_efficiency_percent(result.log_det, n=n + len(before), terms=terms),
            "log_det_starts": [value for value in result.log_det_starts if np.isfinite(value)],
        },
    )


def _candidates(
    factors: Factors, counts: Mapping[str, int], degree: int, generator: np.random.Generator
) -> NDArray[np.float64]:
    """Return the grid; where it is too large one of fewer levels, and Sobol points where that is not enough."""
    # By two at a time: an odd number of levels keeps the middle.
    for most in (*range(max(counts.values()), degree, -2), degree + 1):
        fewer = {f.name: min(counts[f.name], most) if f.levels is None else counts[f.name] for f in factors.items}
        if np.prod(list(map(float, fewer.values()))) <= _MOST_GRID:
            return factors.grid(fewer)
    return factors.of_unit(sampler_of("sobol", len(factors.items), generator)(_DRAWN_CANDIDATES))


def _levels(factors: Factors, levels: int | Mapping[str, int] | None, usual: int) -> dict[str, int]:
    given = levels if isinstance(levels, Mapping) else dict.fromkeys(factors.names, usual if levels is None else levels)
    unknown = [name for name in given if name not in factors.names]
    if unknown:
        raise ParameterError.of("levels", unknown[0], f"names of factors: {', '.join(factors.names)}")
    out = {}
    for factor in factors.items:
        count = given.get(factor.name, usual)
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or not 2 <= count <= 1000:
            raise ParameterError.of(f"levels: {factor.name}", count, "a whole number in [2, 1000]")
        out[factor.name] = int(count) if factor.levels is None else factor.levels.size
    return out
