"""From a sweep to the best value of its input at every operating point, under limits."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from mgdd import _core
from mgdd._core.optimize import Limit
from mgdd.errors import ConvergenceError, DataError, ParameterError, argument
from mgdd.maps.calibration_map import CalibrationMap
from mgdd.maps.cells import MapTask, cell_at
from mgdd.maps.sweep_columns import Parts, SweepColumns, between, feasible_parts, range_around, sweep_columns
from mgdd.optimize.optimum import idle_limits, limits_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)

EDGE = "end_of_sweep"
_SHOWN = 6


def optimize_map(
    sweep: xr.Dataset,
    objective: str,
    *,
    over: str = "soc_cad",
    limits: Mapping[str, float] | Sequence[Limit] | None = None,
    maximize: bool = True,
    max_loss: float | None = None,
    sd: Mapping[str, float | str] | None = None,
    infeasible: Literal["raise", "keep"] = "raise",
    provenance: Mapping[str, str] | None = None,
) -> CalibrationMap:
    """Find the best value of an input at every operating point of a sweep, under limits.

    The best point of the sweep is refined by the parabola through it and its neighbours. Where a limit is crossed
    between two points it counts as linear there, and the optimum ends at the crossing.

    Parameters
    ----------
    sweep : xarray.Dataset
        Variables over one or two operating axes and `over`, from a model, a response model or a bench. Points that are
        NaN, misfires for example, are left out.
    objective : str
        Variable to optimise.
    over : str
        The swept input, three points at least.
    limits : mapping of str to float, or sequence of Limit, optional
        Upper limits on other variables, for example ``{"p_max_bar": 95.0}``; the margin of a `Limit` is kept.
    maximize : bool
        Whether the best objective is the highest; False for consumption.
    max_loss : float, optional
        What a value may lose against the optimum, in the unit of the objective: with it ``low`` and ``high`` of a cell
        hold the values that keep the limits and lose no more, without it those that keep the limits. `smooth_map`
        stays between them.
    sd : mapping of str to float or str, optional
        Standard deviation of the objective and of limited variables at one point, a number or a variable of the
        sweep; it makes that of the optimum.
    infeasible : {"raise", "keep"}
        Cells in which no value keeps the limits are an error that names them, or stay without a value.
    provenance : mapping of str to str, optional
        Kept in the map, beside what was optimised.

    Returns
    -------
    CalibrationMap
        Over the operating axes, named `over`. Its cells have the ``objective`` at the optimum, the connected range
        ``low`` to ``high`` around it, as ``support`` the number of known points, and as ``active_limit`` the variable
        that holds the optimum or ``end_of_sweep``.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown variable, a limit or loss that is not a number.
    mgdd.errors.DataError
        A sweep with other axes, repeated breakpoints or too few points.
    mgdd.errors.ConvergenceError
        Cells in which nothing keeps the limits; the message states how near the nearest comes.

    Notes
    -----
    A range is connected: a value beyond a stretch that breaks a limit does not belong to it. Between the points of the
    sweep objective and limits count as linear for it, which underrates a concave objective; a step of the sweep of
    0.5 °CA keeps the difference below 0.01 points of the efficiency.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> from mgdd.engine import Cylinder, OperatingPoint, timing_sweep
    >>> from mgdd.maps import optimize_map
    >>> fuels = xr.DataArray([12.0, 26.0], dims="fuel_mg", attrs={"units": "mg", "long_name": "fuel"})
    >>> runs = [timing_sweep(Cylinder(), OperatingPoint(fuel_mg=fuel), soc_cad=np.arange(-20, 11)) for fuel in (12, 26)]
    >>> sweep = xr.concat(runs, "fuel_mg").assign_coords(fuel_mg=fuels)
    >>> best = optimize_map(sweep, "efficiency_gross", limits={"p_max_bar": 95.0}, max_loss=0.002)
    >>> best.values.round(1).tolist(), best.cells["active_limit"].tolist()
    ([-3.3, -2.9], ['', 'p_max_bar'])
    """
    checked = limits_of(limits)
    caps = {limit.name: limit.upper - limit.margin for limit in checked}
    if objective in caps:
        raise ParameterError(f"limits: {objective} is the objective: limit other variables")
    ParameterError.unless(infeasible in ("raise", "keep"), "infeasible", infeasible, "'raise' or 'keep'")
    if max_loss is not None and not (max_loss > 0.0 and np.isfinite(max_loss)):
        raise ParameterError.of("max_loss", max_loss, f"> 0, in the unit of {objective}")
    scatter = dict(sd or {})
    extra = tuple(name for name in scatter.values() if isinstance(name, str))
    for name in scatter:
        if name != objective and name not in caps:
            raise ParameterError(f"sd: {name!r} is neither the objective nor limited: leave it out")
    data = sweep_columns(sweep, over, tuple(dict.fromkeys((objective, *caps, *extra))), objective)
    sign = 1.0 if maximize else -1.0
    gain = sign * data.columns[objective]
    finite = np.isfinite(gain)
    for name in caps:
        finite &= np.isfinite(data.columns[name])
    if finite.any():
        for finding in idle_limits(
            caps, {name: float(data.columns[name][finite].max()) for name in caps}, "in the sweep"
        ):
            _LOG.warning("%s", finding)
    excess = np.stack([np.where(finite, -1.0, np.inf), *(data.columns[name] - cap for name, cap in caps.items())])
    excess = np.where(finite, excess, np.inf)
    parts = feasible_parts(excess)
    empty = np.asarray(~(parts.low <= parts.high).any(axis=1))
    if empty.any() and (infeasible == "raise" or empty.all()):
        raise ConvergenceError(_nothing_feasible(data, excess, empty, caps, over))
    best = _best(data.over, np.where(finite, gain, np.nan), parts, empty)
    noise = {name: _column(data, value) for name, value in scatter.items()}
    names = ("", *caps)
    active, spread = _held(data, best, parts, names, noise, objective)
    around = parts
    if max_loss is not None:
        loss = np.where(finite, (best.gain[:, None] - gain) - max_loss, np.inf)
        around = feasible_parts(np.concatenate([excess, loss[None]]))
    low, high, _, _ = range_around(data.over, around, np.where(empty, data.over[0], best.at))
    cells = {
        "source": np.where(empty, "infeasible", "optimised"),
        "support": finite.sum(axis=1),
        "sd": np.where(empty, np.nan, spread),
        "low": np.where(empty, np.nan, low),
        "high": np.where(empty, np.nan, high),
        "objective": np.where(empty, np.nan, sign * best.gain),
        "active_limit": np.where(empty, "", active),
    }
    noted = {"optimised": f"{objective} {'highest' if maximize else 'lowest'}", "mgdd_version": _core.__version__}
    return CalibrationMap(
        data.axes,
        np.where(empty, np.nan, best.at).reshape(data.shape),
        name=over,
        labels={name: data.labels[name] for name in (*data.axes, over)},
        cells={name: column.reshape(data.shape) for name, column in cells.items()},
        task=MapTask(objective=objective, limits=caps, maximize=maximize),
        provenance={**noted, **(provenance or {})},
    )


class _Best(NamedTuple):
    """The optimum of every cell: where, how good, the parabola, and the ends of the part that it lies in."""

    at: Array
    gain: Array
    centre: NDArray[np.intp]  # middle point of the parabola
    slope: Array
    bend: Array
    low: Array
    high: Array
    below: NDArray[np.intp]  # interval whose part begins at low
    above: NDArray[np.intp]


def _best(over: Array, gain: Array, parts: Parts, empty: NDArray[np.bool_]) -> _Best:
    step, cells = np.diff(over), np.arange(gain.shape[0])
    n = step.size
    is_open = parts.low <= parts.high
    ends = np.concatenate([between(gain, parts.low), between(gain, parts.high)], axis=1)
    ends = np.where(np.concatenate([is_open, is_open], axis=1) & np.isfinite(ends), ends, -np.inf)
    place = np.argmax(ends, axis=1)
    interval = np.where(empty, 0, place % n)
    share = np.where(place < n, parts.low[cells, interval], parts.high[cells, interval])
    share = np.where(empty, 0.0, share)
    at_point = (share <= 0.0) | (share >= 1.0)
    point = interval + (share >= 0.5)
    # At a point of the sweep the parts on both sides belong to it, at a crossing the part of its own interval does.
    below, above = np.where(at_point, np.maximum(point - 1, 0), interval), np.where(at_point, point, interval)
    above = np.minimum(above, n - 1)
    timing = over[interval] + share * step[interval]
    low = np.where(at_point & (point == 0), over[0], over[below] + parts.low[cells, below] * step[below])
    high = np.where(at_point & (point == n), over[-1], over[above] + parts.high[cells, above] * step[above])
    centre = np.clip(point, 1, n - 1)
    before, after = step[centre - 1], step[centre]
    left, middle, right = gain[cells, centre - 1], gain[cells, centre], gain[cells, centre + 1]
    rise, fall = (middle - left) / before, (right - middle) / after
    bend = 2.0 * (fall - rise) / (before + after)
    slope = (rise * after + fall * before) / (before + after)
    concave = bend < 0.0  # not where a neighbour is NaN
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = over[centre] - slope / bend
    at = np.where(concave, np.clip(vertex, low, high), timing)
    gone = at - over[centre]
    here = np.where(concave, middle + slope * gone + 0.5 * bend * gone**2, ends[cells, place])
    return _Best(at, here, centre, slope, np.where(concave, bend, np.nan), low, high, below, above)


def _held(
    data: SweepColumns, best: _Best, parts: Parts, names: Sequence[str], noise: Mapping[str, Array], objective: str
) -> tuple[NDArray[np.str_], Array]:
    """Name what holds each optimum, and give its standard deviation."""
    cells, over = np.arange(best.at.size), data.over
    early, late = best.at <= best.low, best.at >= best.high
    share_low, share_high = parts.low[cells, best.below], parts.high[cells, best.above]
    by_low = early & (share_low > 0.0) & (share_low <= 1.0)
    by_high = late & (share_high < 1.0) & (share_high >= 0.0)
    edge = (early & (best.at <= over[0])) | (late & (best.at >= over[-1]))
    which = np.where(by_low, parts.first[cells, best.below], np.where(by_high, parts.last[cells, best.above], 0))
    active = np.array(names)[which]
    active = np.where(edge & (active == ""), EDGE, active)
    spread = np.full(best.at.size, np.nan)
    if objective in noise:
        free = (active == "") & np.isfinite(best.bend)
        spread = np.where(free, _vertex_sd(over, best, noise[objective]), spread)
    for number, name in enumerate(names):
        mine = which == number
        if number == 0 or name not in noise or not mine.any():
            continue
        interval = np.where(by_low, best.below, best.above)
        share = np.where(by_low, share_low, share_high)
        limited, step = data.columns[name], np.diff(over)[interval]
        climb = np.abs(limited[cells, interval + 1] - limited[cells, interval]) / step
        scatter = np.hypot(
            (1.0 - share) * noise[name][cells, interval], share * noise[name][cells, interval + 1]
        )  # of the straight line between two points
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.where(mine, scatter / climb, spread)
    return active, np.where(np.isfinite(spread), spread, np.nan)


def _vertex_sd(over: Array, best: _Best, noise: Array) -> Array:
    """Propagate independent errors of the three points to the vertex of their parabola."""
    cells, centre = np.arange(best.at.size), best.centre
    before, after = over[centre] - over[centre - 1], over[centre + 1] - over[centre]
    both = before + after
    slope = np.stack([-after / (before * both), (after - before) / (before * after), before / (after * both)])
    bend = np.stack([2.0 / (before * both), -2.0 / (before * after), 2.0 / (after * both)])
    errors = np.stack([noise[cells, centre + k] for k in (-1, 0, 1)])
    lever = (slope * best.bend - bend * best.slope) / best.bend**2
    return np.asarray(np.sqrt(np.sum((lever * errors) ** 2, axis=0)))


def _column(data: SweepColumns, value: float | str) -> Array:
    if isinstance(value, str):
        return data.columns[value]
    if isinstance(value, bool) or not (np.isfinite(value) and value >= 0.0):
        raise ParameterError.of("sd", value, "a number >= 0 or a variable of the sweep")
    first = next(iter(data.columns.values()))
    return np.full(first.shape, float(value))


def _nothing_feasible(
    data: SweepColumns, excess: Array, empty: NDArray[np.bool_], caps: Mapping[str, float], over: str
) -> str:
    """Name the cells, and where the limits come nearest."""
    blind = empty & ~np.isfinite(excess[0]).any(axis=1)
    if blind.all() or (blind.any() and (blind == empty).all()):
        names = [cell_at(data.axes, int(place)) for place in np.flatnonzero(blind)]
        raise DataError(f"{_several(names)}: no point of the sweep is known: measure there or drop the rows")
    size = np.array([max(abs(cap), 1e-300) for cap in caps.values()])
    worst = np.max(excess[1:] / size[:, None, None], axis=0)
    worst = np.where(empty[:, None] & np.isfinite(worst), worst, np.inf)
    cell, point = np.unravel_index(int(np.argmin(worst)), worst.shape)
    near = ", ".join(f"{name} = {data.columns[name][cell, point]:.4g} (limit {cap:g})" for name, cap in caps.items())
    names = [cell_at(data.axes, int(place)) for place in np.flatnonzero(empty)]
    which = "any cell" if empty.all() else f"{empty.sum()} of {empty.size} cells: {_several(names)}"
    remedy = "raise a limit, widen the sweep" + (
        "" if empty.all() else f", or pass {argument('infeasible', repr('keep'))}"
    )
    return (
        f"no {over} keeps the limits in {which}; nearest at {cell_at(data.axes, int(cell))}, {over} = "
        f"{data.over[point]:g}: {near}; {remedy}"
    )


def _several(cells: Sequence[str]) -> str:
    more = f"; and {len(cells) - _SHOWN} more" if len(cells) > _SHOWN else ""
    return "; ".join(cells[:_SHOWN]) + more
