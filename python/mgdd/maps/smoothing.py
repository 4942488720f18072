"""A smooth map near the cell-wise optimum: a convex quadratic program under ranges and slope limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import ConvergenceError, DataError, ParameterError, argument, did_you_mean
from mgdd.io.extras import import_extra
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.maps.cells import cell_at

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["smooth_map"]

_KEPT = 1e-7  # of the median range: how far a value that is kept may move in the search, before it is set back
_NARROWEST = 0.05  # of the median range: an optimum is not held more tightly than this
_INSIDE = 1e-7  # of a slope limit or range: kept free for the tolerance of the solver
_TOLERANCE = 1e-9
_HEAVIEST = 1e6
_AT_END = 1e-4  # of the median range: a value this near to the end of its range is held there


def smooth_map(
    optimum: CalibrationMap | xr.Dataset,
    *,
    weight: float = 1.0,
    slope_limits: Mapping[str, float] | None = None,
    fill: bool = False,
) -> CalibrationMap:
    """Smooth a map inside of the ranges of its cells, under limits on its slope along each axis.

    The distance from the cell-wise values, each measured by the half width of its range, plus `weight` times the second
    differences along the axes becomes least.

    Parameters
    ----------
    optimum : CalibrationMap, or the Dataset of one
        With ``low`` and ``high`` in every cell that has a value, as `optimize_map` gives it with a `max_loss`. With
        `fill` a cell that has neither keeps its value and its source.
    weight : float
        Of the smoothness against the distance, 0 to 1e6. The second differences count in half widths of the median
        range per squared mean step of the axis.
    slope_limits : mapping of str to float, optional
        Largest change per unit of an axis [unit of the value / unit of the axis], > 0.
    fill : bool
        Give cells without a value what smoothness and slope limits make of their neighbours, with the source
        ``interpolated``; they stay empty without it.

    Returns
    -------
    CalibrationMap
        Values with the source ``smoothed``, none outside of its range; ``active_limit`` says what holds a value:
        ``range_low`` or ``range_high``, an end of its range, or ``slope_`` and the axis.

    Raises
    ------
    mgdd.errors.ParameterError
        A weight or slope limit out of its domain, an unknown axis.
    mgdd.errors.DataError
        A cell with a value and without a range.
    mgdd.errors.ConvergenceError
        Ranges and slope limits contradict each other; the message names the two cells that lie furthest apart.
    ImportError
        The package clarabel is missing.

    References
    ----------
    Goulart and Chen (2024), Clarabel: An interior-point solver for conic programs with quadratic objectives.

    Examples
    --------
    >>> from mgdd.maps import CalibrationMap, smooth_map
    >>> best = CalibrationMap({"fuel_mg": [10, 20, 30]}, [-4, -9, -5], name="soc_cad",
    ...                       cells={"low": [-6, -11, -7], "high": [-2, -7, -3]})
    >>> smooth_map(best, slope_limits={"fuel_mg": 0.3}).values.round(2).tolist()
    [-5.67, -7.0, -6.67]
    """
    optimum = map_of(optimum, "optimum")
    slopes = _checked(optimum, weight, slope_limits or {})
    values, low, high = (_flat(optimum, name) for name in ("", "low", "high"))
    known = np.isfinite(values)
    kept = known & np.isnan(low) & np.isnan(high) & fill  # what fills the gaps need not touch the rest
    _check_ranges(optimum, values, low, high, known, kept)
    ranged = known & ~kept
    scale, width = _half_widths(values, low, high, ranged, known)
    free_low, free_high = np.where(ranged, low, -np.inf), np.where(ranged, high, np.inf)
    # Not of no width: a method of interior points needs an interior.
    free_low[kept], free_high[kept] = values[kept] - _KEPT * scale, values[kept] + _KEPT * scale
    _check_reach(optimum, slopes, free_low, free_high)
    pairs = _neighbours(optimum, slopes)
    solved = _solve(optimum, values, width, scale, known, free_low, free_high, pairs, weight)
    held = _holds(solved, free_low, free_high, pairs, _AT_END * scale)
    solved[kept], held[kept] = values[kept], ""
    missing = ~known & (not fill)
    cells = {
        "source": np.where(
            missing | kept, optimum.cells["source"].ravel(), np.where(known, "smoothed", "interpolated")
        ),
        "active_limit": np.where(missing, "", held),
        "support": np.where(known | missing, optimum.cells["support"].ravel(), 0.0),
        "objective": np.where(kept, optimum.cells["objective"].ravel(), np.nan),
    }
    how = ", ".join(f"{name} at most {limit:g} per unit" for name, limit in slopes.items() if np.isfinite(limit))
    return optimum.replaced(
        np.where(missing, np.nan, solved).reshape(optimum.values.shape),
        cells={name: column.reshape(optimum.values.shape) for name, column in cells.items()},
        provenance={"smoothed": f"weight {weight:g}, slope over {how or 'every axis free'}"},
    )


class _Pairs(NamedTuple):
    """Neighbouring cells along an axis that has a slope limit, and how far their values may differ."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    most: Array
    axis: NDArray[np.str_]


def _flat(optimum: CalibrationMap, column: str) -> Array:
    return np.asarray(optimum.cells[column] if column else optimum.values, np.float64).ravel()


def _checked(optimum: CalibrationMap, weight: float, limits: Mapping[str, float]) -> dict[str, float]:
    if isinstance(weight, bool) or not 0.0 <= weight <= _HEAVIEST:
        raise ParameterError.of("weight", weight, f">= 0 and <= {_HEAVIEST:g}, which makes a plane")
    for name, limit in limits.items():
        if name not in optimum.axes:
            near = did_you_mean(name, optimum.axes) or f"the map has {', '.join(optimum.axes)}"
            raise ParameterError(f"slope_limits: no axis {name!r}: {near}")
        if isinstance(limit, bool) or not (np.isfinite(limit) and limit > 0.0):
            raise ParameterError.of(f"slope_limits: {name}", limit, f"> 0, {optimum.unit} per unit of the axis")
    return {name: float(limits.get(name, np.inf)) for name in optimum.axes}


def _check_ranges(
    optimum: CalibrationMap,
    values: Array,
    low: Array,
    high: Array,
    known: NDArray[np.bool_],
    kept: NDArray[np.bool_],
) -> None:
    if not known.any():
        raise DataError(f"{optimum.name}: no cell has a value: there is nothing to smooth")
    bad = known & ~kept & ~((low <= values) & (values <= high))  # a range that is NaN too
    if bad.any():
        at = int(np.argmax(bad))
        raise DataError(
            f"{optimum.name} at {cell_at(optimum.axes, at)}: {values[at]:g} has the range {low[at]:g} to {high[at]:g}: "
            f"a value needs a range around it; an optimum with {argument('max_loss')} has one, or set the cells low "
            f"and high; with {argument('fill', 'True')} cells that have no range keep their values"
        )


def _half_widths(
    values: Array, low: Array, high: Array, ranged: NDArray[np.bool_], known: NDArray[np.bool_]
) -> tuple[float, Array]:
    """Return the median half width and that of each cell; without ranges the values themselves say what is much."""
    if not ranged.any():
        return (scale := float(np.ptp(values[known])) or 1.0), np.where(known, scale, np.inf)
    width = np.where(ranged, np.maximum(high - values, values - low), np.nan)
    middle = float(np.median(width[ranged]))
    width = np.where(ranged, np.maximum(width, _NARROWEST * middle if middle > 0.0 else 1.0), np.inf)
    scale = float(np.median(width[ranged]))
    return scale, np.where(known & ~ranged, scale, width)


def _check_reach(optimum: CalibrationMap, slopes: Mapping[str, float], low: Array, high: Array) -> None:
    """Refuse ranges that no map of these slopes can pass: two cells that lie further apart than the way allows.

    On a full grid this is necessary and sufficient: the way between two cells is the sum of its parts along the axes.
    """
    grid = np.meshgrid(*optimum.axes.values(), indexing="ij")
    way = np.zeros((low.size, low.size))
    for entries, slope in zip(grid, slopes.values(), strict=True):
        distance = np.abs(entries.ravel()[:, None] - entries.ravel())
        way += np.where(distance > 0.0, distance * slope if np.isfinite(slope) else np.inf, 0.0)
    apart = low[:, None] - high
    if not (apart - way > _TOLERANCE * np.maximum(1.0, np.abs(low[:, None]))).any():
        return
    factor = np.divide(apart, way, out=np.zeros_like(way), where=apart > way)  # that the slopes lack
    up, down = (int(k) for k in np.unravel_index(int(np.argmax(factor)), factor.shape))
    needed = low[up] - high[down]
    named = ", ".join(f"{name} {slope:g}" for name, slope in slopes.items() if np.isfinite(slope))
    raise ConvergenceError(
        f"slope limits ({named} per unit) allow {way[up, down]:.4g} between {cell_at(optimum.axes, down)}, at most "
        f"{high[down]:.4g}, and {cell_at(optimum.axes, up)}, at least {low[up]:.4g}: {needed:.4g} is needed; "
        f"raise the slope limits by a factor of {factor[up, down]:.3g}, or widen the ranges: a larger "
        f"{argument('max_loss')}, other limits"
    )


def _neighbours(optimum: CalibrationMap, slopes: Mapping[str, float]) -> _Pairs:
    index = np.arange(optimum.values.size).reshape(optimum.values.shape)
    first, second, most, axis = [], [], [], []
    for number, (name, entries) in enumerate(optimum.axes.items()):
        if not np.isfinite(slopes[name]):
            continue
        rows = np.moveaxis(index, number, 0)
        first.append(rows[:-1].ravel())
        second.append(rows[1:].ravel())
        most.append(np.repeat(np.diff(entries) * slopes[name], rows[0].size))
        axis.append(np.full(first[-1].size, f"slope_{name}"))
    if not first:
        return _Pairs(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0), np.zeros(0, "U1"))
    return _Pairs(np.concatenate(first), np.concatenate(second), np.concatenate(most), np.concatenate(axis))


def _bends(optimum: CalibrationMap, scale: float) -> Any:
    """Give the matrix of second differences along all axes, an axis counted in its mean steps."""
    from scipy import sparse

    index = np.arange(optimum.values.size).reshape(optimum.values.shape)
    parts = []
    for number, entries in enumerate(optimum.axes.values()):
        if entries.size < 3:
            continue
        step = np.diff(entries) / (entries[-1] - entries[0]) * (entries.size - 1)
        both = 0.5 * (step[:-1] + step[1:])
        coefficients = np.stack([1.0 / (step[:-1] * both), -2.0 / (step[:-1] * step[1:]), 1.0 / (step[1:] * both)])
        rows = np.moveaxis(index, number, 0)
        columns = np.stack([rows[:-2], rows[1:-1], rows[2:]]).reshape(3, -1)
        weights = np.repeat(coefficients, rows[0].size, axis=1) / scale
        count = np.broadcast_to(np.arange(columns.shape[1]), columns.shape)
        shape = (columns.shape[1], index.size)
        parts.append(sparse.csc_matrix((weights.ravel(), (count.ravel(), columns.ravel())), shape=shape))
    return sparse.vstack(parts, format="csc") if parts else sparse.csc_matrix((0, index.size))


def _solve(
    optimum: CalibrationMap,
    values: Array,
    width: Array,
    scale: float,
    known: NDArray[np.bool_],
    low: Array,
    high: Array,
    pairs: _Pairs,
    weight: float,
) -> Array:
    """Solve for the map; the unknowns are distances from the median value in half widths of the median range."""
    clarabel = import_extra("clarabel", "maps", "smoothing a map")
    from scipy import sparse

    n, middle = values.size, float(np.median(values[known]))
    pull = np.where(known, (scale / width) ** 2, 1e-9)  # the least, so that a cell without neighbours has one answer
    target = np.where(known, (values - middle) / scale, 0.0)
    bends = _bends(optimum, 1.0)
    unit = 2.0 / (1.0 + weight)  # keeps the numbers near one, whatever the weight
    quadratic = sparse.triu(unit * (sparse.diags(pull) + weight * (bends.T @ bends)), format="csc")
    own = np.flatnonzero(known)
    pick = sparse.csc_matrix((np.ones(own.size), (np.arange(own.size), own)), shape=(own.size, n))
    rows = np.arange(pairs.first.size)
    ones = np.ones(rows.size)
    step = sparse.csc_matrix(
        (np.concatenate([ones, -ones]), (np.tile(rows, 2), np.concatenate([pairs.second, pairs.first]))),
        shape=(rows.size, n),
    )
    spare = _INSIDE * (high[own] - low[own])
    most = pairs.most * (1.0 - _INSIDE) / scale
    bounds = np.concatenate([(high[own] - spare - middle) / scale, (middle - low[own] - spare) / scale, most, most])
    rules = sparse.vstack([pick, -pick, step, -step], format="csc")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = _TOLERANCE
    cones = [clarabel.NonnegativeConeT(bounds.size)]
    answer = clarabel.DefaultSolver(quadratic, -unit * pull * target, rules, bounds, cones, settings).solve()
    if str(answer.status) not in ("Solved", "AlmostSolved"):
        raise ConvergenceError(
            f"smoothing {optimum.name}: the solver ended with {answer.status} after {answer.iterations} iterations; "
            "check the ranges low and high for cells that lie far from the others"
        )
    found = np.clip(middle + scale * np.array(answer.x), low, high)
    excess = np.abs(found[pairs.second] - found[pairs.first]) - pairs.most
    if excess.size and excess.max() > _TOLERANCE * max(scale, float(pairs.most.max())):
        raise ConvergenceError(
            f"smoothing {optimum.name}: a slope limit is exceeded by {excess.max():.3g} {optimum.unit}; widen the "
            "ranges low and high, or raise the slope limits a little"
        )
    return np.asarray(found, np.float64)


def _holds(values: Array, low: Array, high: Array, pairs: _Pairs, near: float) -> NDArray[np.str_]:
    """Say what holds each value: an end of its range first, then a slope."""
    held = np.full(values.size, "", "U64")
    steep = np.abs(values[pairs.second] - values[pairs.first]) >= pairs.most * (1.0 - 1e-4)
    for column in (pairs.first, pairs.second):
        held[column[steep]] = pairs.axis[steep]
    held[values - low <= near] = "range_low"
    held[high - values <= near] = "range_high"
    return held
