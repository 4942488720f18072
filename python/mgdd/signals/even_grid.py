"""The one check of sampling: which times count as even, what step they mean, where a sample is missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd.errors import DataError, ShapeError

# Share of the mean step by which a step may differ from it: what the clock of a test bench jitters.
JITTER = 0.1
# Share of a step by which a sample may be off the even grid of the whole record: beyond it a sample is missing.
DRIFT = 0.5
# A step above this multiple of the usual one lacks a sample.
GAP = 1.5
# Two steps are the same within this share.
_SAME = 1e-3
# Six digits after the point, as many tables have them, leave the last sample open by this [s], and by this share.
_DIGITS_S, _DIGITS = 1e-6, 1e-2


def even_step(
    time_s: ArrayLike,
    *,
    where: Callable[[int], str] = "time_s, sample {}".format,
    remedy: str = "resample the record to an even step first",
) -> float:
    """Return the step [s] of an even time column, and refuse an uneven one.

    Even are times that rise, in steps within 10 % of their mean, each sample within half a step of the even grid
    through the first and the last. The step is rounded to a nanosecond where that moves the last sample by at most 1 µs
    and 1 % of a step, so that a table with six digits means the step that it was written with.
    """
    time = np.asarray(time_s, dtype=np.float64)
    if time.ndim != 1 or time.size < 2:
        raise ShapeError(f"time_s has shape {time.shape}: must be one column of at least two samples")
    finite = np.isfinite(time)
    if not finite.all():
        raise DataError(f"{where(int(np.argmin(finite)))}: time is not finite: repair it or cut the record")
    steps = np.diff(time)
    if not np.all(steps > 0.0):
        at = int(np.argmin(steps > 0.0)) + 1
        raise DataError(
            f"{where(at)}: {time[at]:g} s does not exceed the time before, {time[at - 1]:g} s: sort the rows, drop "
            "repeats"
        )
    mean = float(time[-1] - time[0]) / (time.size - 1)
    off = np.abs(steps - mean)
    drift = np.abs(time - time[0] - mean * np.arange(time.size))
    jitters = off.max() > JITTER * mean
    if jitters or drift.max() > DRIFT * mean:
        at = int(np.argmax(off)) + 1 if jitters else int(np.argmax(drift))
        raise DataError(
            f"{where(at)}: uneven sampling: the step is {time[at] - time[at - 1]:.6g} s and the mean {mean:.6g} s: "
            f"{remedy.format(step=float(f'{mean:.2g}'))}"
        )
    rounded = round(mean, 9)
    moved = abs(rounded - mean) * (time.size - 1)
    return rounded if moved <= _DIGITS_S and moved <= _DIGITS * mean else mean


def is_same_step(first_s: float, second_s: float) -> bool:
    """Return whether two sample times [s] are one, within 0.1 %."""
    return bool(abs(first_s - second_s) <= _SAME * second_s)


def common_step(times_s: Sequence[ArrayLike], names: Sequence[str]) -> float:
    """Return the step that several even time columns share."""
    steps = [even_step(time, where=f"{name}, sample {{}}".format) for name, time in zip(names, times_s, strict=True)]
    for name, step in zip(names, steps, strict=True):
        if not is_same_step(step, steps[0]):
            raise DataError(
                f"{name} is sampled every {step:g} s, {names[0]} every {steps[0]:g} s: resample them to one step"
            )
    return steps[0]


def check_count(values: ArrayLike, name: str = "cycle") -> None:
    """Refuse a count that does not go up by exactly one."""
    count = np.asarray(values, dtype=np.float64)
    wrong = np.diff(count) != 1.0
    if wrong.any():
        at = int(np.argmax(wrong)) + 1
        raise DataError(
            f"{name} {count[at]:g} follows {count[at - 1]:g}: must count up by one, a lag in rows has no meaning "
            "across a gap"
        )


def wide_steps(values: NDArray[np.float64]) -> tuple[list[int], float]:
    """Give the samples after a step of more than 1.5 times the usual one, and that median step."""
    steps = np.diff(values)
    usual = float(np.median(steps))
    return (np.flatnonzero(steps > GAP * usual * (1.0 + 1e-9)) + 1).tolist(), usual
