"""A sweep as arrays, one row per cell of a map and one column per point of the swept input; where it keeps limits.

Between two points every quantity counts as linear: limits are kept in parts of intervals, and in connected ranges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, argument, did_you_mean
from mgdd.results.labels import Label, check_labels, label_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_FEWEST = 3
_NOWHERE = 2.0  # beyond any share of an interval


@dataclass(frozen=True, kw_only=True)
class SweepColumns:
    """Variables of a sweep by name, each of shape (cells, points); the swept input increases, cells follow the axes."""

    axes: Mapping[str, Array]
    over: Array
    columns: Mapping[str, Array]
    labels: Mapping[str, Label]

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells per axis."""
        return tuple(entries.size for entries in self.axes.values())


def sweep_columns(sweep: xr.Dataset, over: str, names: tuple[str, ...], lead: str) -> SweepColumns:
    """Take variables out of a sweep, or name what is wrong with it; the axes are those of the variable `lead`."""
    for name in names:
        if name not in sweep.data_vars:
            near = did_you_mean(name, map(str, sweep.data_vars)) or f"it has {', '.join(map(str, sweep.data_vars))}"
            raise ParameterError(f"the sweep has no variable {name!r}: {near}")
    dims = [str(dim) for dim in sweep[lead].dims]
    axes = [dim for dim in dims if dim != over]
    if over not in dims or not 1 <= len(axes) <= 2:
        raise DataError(
            f"{lead} stands over {' x '.join(dims) or 'nothing'}: an optimum needs one or two operating axes and "
            f"{over!r}; name the swept input with {argument('over')}"
        )
    check_labels(sweep[list(names)])
    for dim in (*axes, over):
        _check_rising(dim, sweep[dim].to_numpy())
    if sweep.sizes[over] < _FEWEST:
        raise DataError(f"{over} has {sweep.sizes[over]} points: an optimum needs {_FEWEST} at least")
    columns = {}
    for name in names:
        odd = [str(dim) for dim in sweep[name].dims if dim not in dims]
        if odd:
            raise DataError(f"{name} stands over {odd[0]!r} too, {lead} does not: select one of its entries")
        own_variable: Any = sweep.variables[name]
        wide = own_variable.set_dims({dim: sweep.sizes[dim] for dim in (*axes, over)})
        columns[name] = np.ascontiguousarray(wide.to_numpy(), np.float64).reshape(-1, sweep.sizes[over])
    labels = {name: label_of(sweep[name]) for name in (*axes, over, *names)}
    entries = {axis: sweep[axis].to_numpy().astype(np.float64) for axis in axes}
    return SweepColumns(axes=entries, over=sweep[over].to_numpy().astype(np.float64), columns=columns, labels=labels)


def _check_rising(name: str, entries: NDArray[np.float64]) -> None:
    if entries.dtype.kind not in "iuf" or not np.isfinite(entries).all():
        raise DataError(f"{name}: its coordinates must be finite numbers")
    bad = np.flatnonzero(np.diff(entries) <= 0.0)
    if bad.size:
        i = int(bad[0])
        raise DataError(
            f"{name}[{i + 1}] = {entries[i + 1]:g} after {entries[i]:g}: breakpoints must increase and stand once; "
            f"sort them or take the mean of repeated ones, for example sweep.groupby({name!r}).mean()"
        )


@dataclass(frozen=True, kw_only=True)
class Parts:
    """The part of every interval in which all quantities are at most zero, as shares of its length.

    Low is above high where there is none; a point that keeps the limits between two that do not is a part of length
    zero. First and last are the quantities that end it.
    """

    low: Array
    high: Array
    first: NDArray[np.intp]
    last: NDArray[np.intp]


def feasible_parts(excess: Array) -> Parts:
    """Find the part of every interval in which all quantities (quantity, cell, point) are at most zero, as shares."""
    before, after = excess[:, :, :-1], excess[:, :, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = before / (before - after)
    crossing = np.where(np.isnan(crossing), 1.0, np.clip(crossing, 0.0, 1.0))  # infinite / infinite: at the end
    low = np.where(before <= 0.0, 0.0, np.where(after <= 0.0, crossing, _NOWHERE))
    high = np.where(after <= 0.0, 1.0, np.where(before <= 0.0, crossing, -_NOWHERE))
    first, last = np.argmax(low, axis=0), np.argmin(high, axis=0)
    return Parts(low=low.max(axis=0), high=high.min(axis=0), first=first, last=last)


def between(columns: Array, share: Array, interval: NDArray[np.intp] | None = None) -> Array:
    """Interpolate columns (..., cells, points) at shares of intervals, one of each or `interval` of each cell.

    The ends need no other end.
    """
    if interval is None:
        before, after = columns[..., :-1], columns[..., 1:]
    else:
        rows = np.arange(interval.size)
        before, after = columns[..., rows, interval], columns[..., rows, interval + 1]
    with np.errstate(invalid="ignore"):
        inside = before + share * (after - before)
    return np.where(share <= 0.0, before, np.where(share >= 1.0, after, inside))


def range_around(timings: Array, parts: Parts, at: Array) -> tuple[Array, Array, NDArray[np.intp], NDArray[np.intp]]:
    """Find the connected range of kept limits around a timing of every cell, and which quantity ends it at each side.

    That is -1 at the end of the sweep, and where the range is the timing alone.
    """
    step = np.diff(timings)
    rows, n = np.arange(at.size), step.size
    home = np.clip(np.searchsorted(timings, at, side="right") - 1, 0, n - 1)
    # An interval goes on into the next one where the point between them keeps the limits.
    on = (parts.high[:, :-1] >= 1.0) & (parts.low[:, 1:] <= 0.0)
    places = np.arange(n)
    stop_right = np.where(np.pad(on, ((0, 0), (0, 1))), n, places)
    stop_left = np.where(np.pad(on, ((0, 0), (1, 0))), -1, places)
    right = np.minimum.accumulate(stop_right[:, ::-1], axis=1)[:, ::-1][rows, home]
    left = np.maximum.accumulate(stop_left, axis=1)[rows, home]
    low = timings[left] + parts.low[rows, left] * step[left]
    high = timings[right] + parts.high[rows, right] * step[right]
    inside = parts.low[rows, home] <= parts.high[rows, home]
    low, high = np.where(inside, low, at), np.where(inside, high, at)
    first = np.where(inside & (low > timings[0]), parts.first[rows, left], -1)
    last = np.where(inside & (high < timings[-1]), parts.last[rows, right], -1)
    return np.minimum(low, at), np.maximum(high, at), first, last
