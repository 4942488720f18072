"""Where limits are kept along the timings of many cells at once: parts of intervals, and connected ranges of them.

Between two points of a sweep every quantity counts as linear. Arrays have one row per cell and one column per point of
the sweep, or per interval between two of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_NOWHERE = 2.0  # beyond any share of an interval


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
    known = parts.low[rows, home] <= parts.high[rows, home]
    low, high = np.where(known, low, at), np.where(known, high, at)
    first = np.where(known & (low > timings[0]), parts.first[rows, left], -1)
    last = np.where(known & (high < timings[-1]), parts.last[rows, right], -1)
    return np.minimum(low, at), np.maximum(high, at), first, last
