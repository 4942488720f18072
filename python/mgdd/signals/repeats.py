"""What bits alone show of a measured channel: cycles that are copies, stretches that recur, samples that stand still.

Noise makes every sample its own: values that recur over a stretch, where the rounding does not explain it, were
written twice. No model of what was measured is needed, and a copy with new noise is not seen.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Two windows are alike at random once in a thousand records; a window has this many samples at least, and changes.
_FALSE_ALARM, _WINDOW, _CHANGES = 1e-3, 64, 8
# Equal values of two cycles at one place, as rounding makes them: less is not trusted, more is not noise.
_EQUAL, _ALL_EQUAL = (0.05, 0.95), 0.98
# A run of equal samples is looked at from four on, and is stuck where noise gives it once in a million records.
_RUN, _RUN_PROBABILITY, _LEAST_SHARE = 3, 1e-6, 1e-3
_MIX = np.uint64(0x9E3779B97F4A7C15)  # odd: a product with it loses no bit


class Copies(NamedTuple):
    """Cycles (from 0) that are those of another, the share of samples copied, and one pair of places (row, sample)."""

    cycles: tuple[int, ...]
    samples: int
    first: tuple[int, int]
    again: tuple[int, int]


class Still(NamedTuple):
    """The longest run of equal samples that nothing explains: cycle, first and last sample, cycles that have one."""

    cycle: int
    first: int
    last: int
    cycles: tuple[int, ...]


def noise_of(rows: NDArray[np.float64]) -> float:
    """Give the standard deviation of the noise of a smooth part (cycle, sample), by third differences."""
    n = len(rows)
    off = np.diff(rows - rows.mean(axis=0) if n > 1 else rows, 3, axis=1)
    return float(1.4826 * np.median(np.abs(off)) / np.sqrt(20.0 * (1.0 - 1.0 / n if n > 1 else 1.0)))


def resolution_of(values: NDArray[np.float64]) -> float:
    """Give the least distance of two values, 0 where all are one."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-9 * max(float(np.abs(values).max()), 1e-300)]
    return float(steps.min()) if steps.size else 0.0


def copies(rows: NDArray[np.float64]) -> Copies | None:
    """Find a stretch of a record (cycle, sample) that stands in it twice, anywhere."""
    n, m = rows.shape
    stream = np.ascontiguousarray(rows).ravel()
    if n < 2:
        return None
    equal = float(np.median((rows[1:] == rows[:-1]).mean(axis=1)))
    window = int(max(_WINDOW, np.log(stream.size**2 / _FALSE_ALARM) / -np.log(np.clip(equal, *_EQUAL))))
    if equal > _ALL_EQUAL:
        window = m
    if window > stream.size // 2:
        return None
    hashes = _hashes(stream, window)
    changes = np.concatenate([[0], np.cumsum(stream[1:] != stream[:-1])])
    alive = changes[window - 1 :] - changes[: stream.size - window + 1] >= max(16, window // _CHANGES)
    places = np.flatnonzero(alive)
    alive_hashes = hashes[places]
    ordered = np.sort(alive_hashes)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if not twice.size:
        return None
    hit = places[np.isin(alive_hashes, twice)]
    order = hit[np.argsort(hashes[hit], kind="stable")]
    same = hashes[order[1:]] == hashes[order[:-1]]
    again, first = order[1:][same], order[:-1][same]
    true = stream[again] == stream[first]
    again, first = again[true], first[true]
    if not again.size:
        return None
    covered = np.zeros(stream.size + 1, np.int64)
    np.add.at(covered, again, 1)
    np.add.at(covered, again + window, -1)
    share = (np.cumsum(covered)[:-1] > 0).reshape(n, m).mean(axis=1)
    k = int(np.argmin(again))
    cycles = tuple(np.flatnonzero(share > 0.0).tolist())
    return Copies(cycles, round(float(share.sum()) * m), divmod(int(first[k]), m), divmod(int(again[k]), m))


def _hashes(stream: NDArray[np.float64], window: int) -> NDArray[np.uint64]:
    """Hash every window of so many samples: by doubling, and two halves that overlap."""
    hashed = stream.view(np.uint64) * _MIX
    hashed ^= hashed >> np.uint64(29)
    size = 1
    while 2 * size <= window:
        hashed = _joined(hashed[:-size], hashed[size:])
        size *= 2
    rest = window - size
    return _joined(hashed[:-rest], hashed[rest:]) if rest else hashed


def _joined(left: NDArray[np.uint64], right: NDArray[np.uint64]) -> NDArray[np.uint64]:
    out = left * _MIX
    out ^= out >> np.uint64(31)
    out += right
    return out


def still(rows: NDArray[np.float64], noise: float, near: int) -> Still | None:
    """Find samples of a record (cycle, sample) that stand still longer than rounding makes them.

    How often two neighbours are equal the other cycles show, within `near` samples of the place; of a single cycle its
    resolution and its noise do.
    """
    n, m = rows.shape
    equal = rows[:, 1:] == rows[:, :-1]
    starts, ends = _runs(equal)
    if not starts.size:
        return None
    row, at = np.divmod(starts, m)
    length = ends - starts
    if n > 1:
        log_probability = _log_probability(equal, row, at, length, near)
    else:
        usual = np.array([resolution_of(_alike(rows, rows[0, a])) for a in at]) / (
            2.0 * np.sqrt(np.pi) * max(noise, 1e-12)
        )
        log_probability = length * np.log(np.clip(usual, _LEAST_SHARE, 0.9))
    rare = np.flatnonzero(np.log(rows.size) + log_probability < np.log(_RUN_PROBABILITY))
    odd = []
    usual_cycle = np.median(rows, axis=0) if n > 2 else None
    for k in rare[np.argsort(log_probability[rare])][:4096].tolist():
        first, last = int(at[k]), int(at[k] + length[k])
        level = float(rows[row[k], first])
        step = resolution_of(_alike(rows[: min(n, 8)], level))
        if usual_cycle is not None:
            moved = float(np.ptp(usual_cycle[first : last + 1]))
        else:  # between the samples a run away on each side
            out = (rows[row[k], max(first - int(length[k]), 0)], rows[row[k], min(last + int(length[k]), m - 1)])
            moved = abs(float(out[1] - out[0])) / 3.0
        if moved > 2.0 * step + 4.0 * noise or noise > 0.5 * step:
            odd.append(k)
    if not odd:
        return None
    longest = max(odd, key=lambda k: int(length[k]))
    cycles = tuple(sorted({int(row[k]) for k in odd}))
    return Still(int(row[longest]), int(at[longest]), int(at[longest] + length[longest]), cycles)


def _alike(rows: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Give the values of the same order as `level`, which a text rounds alike."""
    low, high = sorted((0.5 * level, 2.0 * level))
    return rows[(rows >= low) & (rows <= high)]


def _runs(equal: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Give the first and last sample of every run in the stream; no run goes from one row to the next."""
    n = len(equal)
    edges = np.diff(np.concatenate([equal, np.zeros((n, 1), bool)], axis=1).ravel().astype(np.int8), prepend=0)
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = ends - starts >= _RUN
    return starts[long], ends[long]


def _log_probability(
    equal: NDArray[np.bool_], row: NDArray[np.intp], at: NDArray[np.intp], length: NDArray[np.intp], near: int
) -> NDArray[np.float64]:
    """Give the logarithm of the probability of each run, by the equal neighbours of the other cycles around there."""
    n, m = equal.shape
    index = np.arange(m)
    low, high = np.maximum(index - near, 0), np.minimum(index + near + 1, m)
    width = high - low
    hits = _around(equal.sum(axis=0, dtype=np.int64)[None], low, high)[0]
    out = np.empty(len(row))
    for r in np.unique(row):
        row_hits = _around(equal[r : r + 1].astype(np.int64), low, high)[0]
        share = np.maximum((hits - row_hits + 1.0) / ((n - 1) * width + 2.0), _LEAST_SHARE)
        total = np.concatenate([[0.0], np.cumsum(np.log(share))])
        mine = row == r
        out[mine] = total[at[mine] + length[mine]] - total[at[mine]]
    return out


def _around(counts: NDArray[np.int64], low: NDArray[np.intp], high: NDArray[np.intp]) -> NDArray[np.int64]:
    total = np.concatenate([np.zeros((len(counts), 1), np.int64), np.cumsum(counts, axis=1)], axis=1)
    around: NDArray[np.int64] = total[:, high] - total[:, low]
    return around
