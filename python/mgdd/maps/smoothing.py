"""A smooth map near the cell-wise optimum: a convex quadratic program under ranges and slope limits."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mgdd.errors import ConvergenceError, DataError, ParameterError, argument, did_you_mean, printable
from mgdd.io.extras import import_extra
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.maps.cells import cell_at
from mgdd.maps.smoothness import smoothness_of
from mgdd.surrogate.points import EDGE, hull_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_KEPT = 1e-7  # of the median range: how far a value that is kept may move in the search, before it is set back
_NARROWEST = 0.05  # of the median range: an optimum is not held more tightly than this
_INSIDE = 1e-7  # of a slope limit or range: kept free for the tolerance of the solver
_TOLERANCE = 1e-9
_HEAVIEST = 1e6
_SHOWN = 3  # cells that a note names
_AT_END = 1e-4  # of the median range: a value this near to the end of its range is held there


def smooth_map(
    optimum: CalibrationMap | xr.Dataset,
    *,
    weight: float = 1.0,
    slope_limits: Mapping[str, float] | None = None,
    fill: bool = False,
    tolerance: float | None = None,
) -> CalibrationMap:
    """Smooth a map inside of the ranges of its cells or a tolerance, under limits on its slope along each axis.

    The distance from the cell-wise values, each measured by the half width of its range, plus `weight` times the second
    differences along the axes becomes least.

    Parameters
    ----------
    optimum : CalibrationMap, or the Dataset of one
        With ``low`` and ``high`` in every cell that has a value, as `optimize_map` gives it with a `max_loss`, or any
        with a `tolerance`. With `fill` alone a cell that has no range keeps its value and its source.
    weight : float
        Of the smoothness against the distance, 0 to 1e6. The second differences count in half widths of the median
        range per squared mean step of the axis.
    slope_limits : mapping of str to float, optional
        Largest change per unit of an axis [unit of the value / unit of the axis], > 0.
    fill : bool
        Give cells without a value what smoothness and slope limits make of their neighbours, with the source
        ``interpolated``, or ``extrapolated`` outside of the convex hull of the cells that have one; they stay empty
        without it.
    tolerance : float, optional
        How far a value may move at most, in the unit of the map, >= 0; inside of its range too where it has one; as
        far as the range if left out.

    Returns
    -------
    CalibrationMap
        Values with the source ``smoothed``, none outside of its range; ``active_limit`` names what holds a value:
        ``range_low`` or ``range_high``, an end of its range, or ``slope_`` and the axis. ``provenance`` gives the
        largest move, and which cells were filled.

    Warns
    -----
    UserWarning
        Cells that were filled are extrapolated.

    Raises
    ------
    mgdd.errors.ParameterError
        A weight, slope limit or tolerance out of its domain, an unknown axis.
    mgdd.errors.DataError
        A cell with a value and without a range or tolerance.
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
    >>> torque = CalibrationMap({"speed_rpm": [1000, 2000, 3000]}, [80, float("nan"), 120], name="torque_nm",
    ...                         cells={"source": ["given", "unattainable", "given"]})
    >>> filled = smooth_map(torque, fill=True, tolerance=0)
    >>> filled.values.round(3).tolist(), filled.provenance["filled"]
    ([80.0, 100.0, 120.0], '1 cell: speed_rpm = 2000')
    """
    optimum = map_of(optimum, "optimum")
    slopes = _checked(optimum, weight, slope_limits or {})
    values, low, high = (_flat(optimum, name) for name in ("", "low", "high"))
    finite = np.isfinite(values)
    if tolerance is not None:
        if isinstance(tolerance, bool) or not (np.isfinite(tolerance) and tolerance >= 0.0):
            raise ParameterError.of("tolerance", tolerance, f">= 0, {optimum.unit}")
        low, high = np.fmax(low, values - tolerance), np.fmin(high, values + tolerance)  # of no range: the tolerance
    # What fills the gaps need not touch the rest.
    fixed = finite & ((np.isnan(low) & np.isnan(high) & fill) | (tolerance == 0.0))
    _check_ranges(optimum, values, low, high, finite, fixed)
    ranged = finite & ~fixed
    scale, width = _half_widths(values, low, high, ranged, finite)
    free_low, free_high = np.where(ranged, low, -np.inf), np.where(ranged, high, np.inf)
    # Not of no width: a method of interior points needs an interior.
    free_low[fixed], free_high[fixed] = values[fixed] - _KEPT * scale, values[fixed] + _KEPT * scale
    _check_reach(optimum, slopes, free_low, free_high)
    pairs = _neighbours(optimum, slopes)
    solved = _solve(optimum, values, width, scale, finite, free_low, free_high, pairs, weight)
    held = _holds(solved, free_low, free_high, pairs, _AT_END * scale)
    solved[fixed], held[fixed] = values[fixed], ""
    if tolerance is not None:
        solved[finite] = _within(solved[finite], values[finite], tolerance)
    missing = ~finite & (not fill)
    outside = _outside(optimum, finite) if fill else np.zeros(finite.size, np.bool_)
    gained = np.where(outside, "extrapolated", "interpolated")
    cells = {
        "source": np.where(missing | fixed, optimum.cells["source"].ravel(), np.where(finite, "smoothed", gained)),
        "active_limit": np.where(missing, "", held),
        "support": np.where(finite | missing, optimum.cells["support"].ravel(), 0.0),
        "objective": np.where(fixed, optimum.cells["objective"].ravel(), np.nan),
    }
    how = ", ".join(f"{name} at most {limit:g} per unit" for name, limit in slopes.items() if np.isfinite(limit))
    notes = {"smoothed": f"weight {weight:g}, slope over {how or 'every axis free'}"}
    if tolerance is not None:
        move = np.where(finite, np.abs(solved - values), 0.0)
        notes["smoothed"] += (
            f"; tolerance {tolerance:g} {optimum.unit}, largest move {move.max():.4g} {optimum.unit} at "
            f"{cell_at(optimum.axes, int(np.argmax(move)))}"
        )
    if fill and not finite.all():
        notes["filled"] = _named(optimum, ~finite)
        if outside.any():
            notes["extrapolated"] = f"{_named(optimum, outside)}: outside of the hull of the cells with a value"
            warnings.warn(
                f"{printable(str(optimum.name))}: extrapolated {notes['extrapolated']}: check them",
                UserWarning,
                stacklevel=3,
            )
    return optimum.replaced(
        np.where(missing, np.nan, solved).reshape(optimum.values.shape),
        cells={name: column.reshape(optimum.values.shape) for name, column in cells.items()},
        provenance=notes,
    )


def _within(smoothed: Array, values: Array, tolerance: float) -> Array:
    """Keep the tolerance to the last bit: the end of a range is rounded."""
    while (beyond := np.abs(smoothed - values) > tolerance).any():
        smoothed = np.where(beyond, np.nextafter(smoothed, values), smoothed)
    return smoothed


def _outside(optimum: CalibrationMap, finite: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which cells lie outside of the convex hull of those with a value."""
    points = np.stack([entries.ravel() for entries in np.meshgrid(*optimum.axes.values(), indexing="ij")], axis=1)
    base = points[finite]
    varies = np.ptp(base, axis=0) > 0.0
    inside = (points[:, ~varies] == base[0, ~varies]).all(axis=1)
    if varies.any():
        try:
            hull = hull_of(base[:, varies], [name for name, free in zip(optimum.axes, varies, strict=True) if free])
        except DataError:  # a few cells on a slanted line: nothing lies between them
            return ~finite
        inside &= hull.depth(points[:, varies])[0] >= -EDGE
    return np.asarray(~inside & ~finite)


def _named(optimum: CalibrationMap, where: NDArray[np.bool_]) -> str:
    places = np.flatnonzero(where)
    shown = "; ".join(cell_at(optimum.axes, int(k)) for k in places[:_SHOWN])
    more = f" and {places.size - _SHOWN} more" if places.size > _SHOWN else ""
    return f"{places.size} cell{'s' if places.size > 1 else ''}: {shown}{more}"


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
    finite: NDArray[np.bool_],
    fixed: NDArray[np.bool_],
) -> None:
    if not finite.any():
        raise DataError(f"{optimum.name}: no cell has a value: there is nothing to smooth")
    bad = finite & ~fixed & ~((low <= values) & (values <= high))  # a range that is NaN too
    if bad.any():
        at = int(np.argmax(bad))
        raise DataError(
            f"{optimum.name} at {cell_at(optimum.axes, at)}: {values[at]:g} has the range {low[at]:g} to {high[at]:g}: "
            f"a value needs a range around it; an optimum with {argument('max_loss')} has one, or set the cells low "
            f"and high, or give a {argument('tolerance')}; with {argument('fill', 'True')} cells that have no range "
            "keep their values"
        )


def _half_widths(
    values: Array, low: Array, high: Array, ranged: NDArray[np.bool_], finite: NDArray[np.bool_]
) -> tuple[float, Array]:
    """Return the median half width and that of each cell; without ranges the values themselves set the scale."""
    if not ranged.any():
        return (scale := float(np.ptp(values[finite])) or 1.0), np.where(finite, scale, np.inf)
    width = np.where(ranged, np.maximum(high - values, values - low), np.nan)
    middle = float(np.median(width[ranged]))
    width = np.where(ranged, np.maximum(width, _NARROWEST * middle if middle > 0.0 else 1.0), np.inf)
    scale = float(np.median(width[ranged]))
    return scale, np.where(finite & ~ranged, scale, width)


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


def _solve(
    optimum: CalibrationMap,
    values: Array,
    width: Array,
    scale: float,
    finite: NDArray[np.bool_],
    low: Array,
    high: Array,
    pairs: _Pairs,
    weight: float,
) -> Array:
    """Solve for the map; the unknowns are distances from the median value in half widths of the median range."""
    clarabel = import_extra("clarabel", "maps", "smoothing a map")
    from scipy import sparse

    n, middle = values.size, float(np.median(values[finite]))
    pull = np.where(finite, (scale / width) ** 2, 1e-10)  # the least, so that a cell without neighbours has one answer
    target = np.where(finite, (values - middle) / scale, 0.0)
    unit = 2.0 / (1.0 + weight)  # keeps the numbers near one, whatever the weight
    smoothness = smoothness_of(optimum, weight, has_gaps=not finite.all())
    quadratic = sparse.triu(unit * (sparse.diags(pull) + smoothness), format="csc")
    at = np.flatnonzero(finite)
    pick = sparse.csc_matrix((np.ones(at.size), (np.arange(at.size), at)), shape=(at.size, n))
    rows = np.arange(pairs.first.size)
    ones = np.ones(rows.size)
    step = sparse.csc_matrix(
        (np.concatenate([ones, -ones]), (np.tile(rows, 2), np.concatenate([pairs.second, pairs.first]))),
        shape=(rows.size, n),
    )
    spare = _INSIDE * (high[at] - low[at])
    most = pairs.most * (1.0 - _INSIDE) / scale
    bounds = np.concatenate([(high[at] - spare - middle) / scale, (middle - low[at] - spare) / scale, most, most])
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
    solution = np.clip(middle + scale * np.array(answer.x), low, high)
    excess = np.abs(solution[pairs.second] - solution[pairs.first]) - pairs.most
    if excess.size and excess.max() > _TOLERANCE * max(scale, float(pairs.most.max())):
        raise ConvergenceError(
            f"smoothing {optimum.name}: a slope limit is exceeded by {excess.max():.3g} {optimum.unit}; widen the "
            "ranges low and high, or raise the slope limits a little"
        )
    return np.asarray(solution, np.float64)


def _holds(values: Array, low: Array, high: Array, pairs: _Pairs, near: float) -> NDArray[np.str_]:
    """Return what holds each value: an end of its range first, then a slope."""
    held = np.full(values.size, "", "U64")
    steep = np.abs(values[pairs.second] - values[pairs.first]) >= pairs.most * (1.0 - 1e-4)
    for column in (pairs.first, pairs.second):
        held[column[steep]] = pairs.axis[steep]
    held[values - low <= near] = "range_low"
    held[high - values <= near] = "range_high"
    return held
