"""Whether the values of a column can be an angle or a pressure, and what they look like where they cannot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mgdd.io.pressure_checks import MIN_SAMPLES, RADIAN_SPAN

# Two levels hold at least this share of the samples each, so near to an end of the range, and next to none is between.
_HELD, _NEAR, _BETWEEN = 0.05, 0.08, 0.01
_STANDS, _EVEN, _SOME = 0.2, 0.9, 101
# A turn and a cycle in radians, and how far a coarse step may miss them.
_RADIANS, _MISSED = (2.0 * np.pi, 4.0 * np.pi), 0.05
# A pressure rises once in a cycle from the lower to the upper level; a wave does so smoothly, at even distances, and is
# as long above its middle as below, where a whole cycle of a pressure is above for less than a fifth, at any speed.
_RISES, _LEVELS, _SMOOTH, _REGULAR, _ABOVE = 1.5, (0.25, 0.75), 0.45, 0.2, (0.3, 0.7)


def no_angle(values: NDArray[np.float64], unit: str) -> str | None:
    """Say what a column looks like that cannot be an angle; None where it may be one."""
    if values.size < MIN_SAMPLES or not np.isfinite(values).all():
        return None
    low, high = float(values.min()), float(values.max())
    step, span = np.diff(values), high - low
    if (held := _held(values, low, high)) is not None:
        return held
    inner = step[np.abs(step) <= 0.5 * span]
    if not inner.size or np.all(inner > 0.0) or np.all(inner < 0.0):
        if inner.size == step.size or not inner.size:
            return None
        period = span + float(np.median(np.abs(inner)))
        if unit == "deg" and span < RADIAN_SPAN and min(abs(period / turn - 1.0) for turn in _RADIANS) > _MISSED:
            return f"a sawtooth from {low:g} to {high:g}, as a voltage of an encoder"
        if unit == "deg" and period > 720.0 * (1.0 + _MISSED):
            return f"a count from {low:g} to {high:g} that starts again, as the pulses of an encoder"
        return None
    if np.mean(inner == 0.0) > _STANDS and (np.all(inner >= 0.0) or np.all(inner <= 0.0)):
        whole = "a count of pulses" if np.all(values == np.round(values)) else "a staircase"
        return f"{whole} from {low:g} to {high:g}, which stands still in {np.mean(inner == 0.0):.0%} of the samples"
    moving = inner[inner != 0.0]
    if moving.size and min(np.mean(moving > 0.0), np.mean(moving < 0.0)) > _STANDS:
        return f"a wave that rises and falls between {low:g} and {high:g}, as a voltage of an encoder"
    return None


def no_pressure(values: NDArray[np.float64], cycles: float) -> str | None:
    """Say what a column looks like that cannot be the pressure of so many cycles; None where it may be one."""
    if values.size < MIN_SAMPLES:
        return None
    low, high = float(values.min()), float(values.max())
    if not np.isfinite(low + high):  # a NaN is both
        return None
    if (held := _held(values, low, high)) is not None:
        return held
    at = np.arange(0, values.size - 1, -(-values.size // _SOME))
    some = values[at + 1] - values[at]  # where nearly all steps are even, so are most of some
    usual = float(np.sort(some)[at.size // 2])
    if usual and 2 * np.count_nonzero(np.abs(some - usual) <= 1e-3 * abs(usual)) > at.size:
        step = np.diff(values)
        if np.count_nonzero(np.abs(step - usual) <= 1e-3 * abs(usual)) >= _EVEN * step.size:
            return f"even steps from {low:g} to {high:g}, as an angle, a time or a count"
    above = np.count_nonzero(values > 0.5 * (low + high)) / values.size
    if not _ABOVE[0] < above < _ABOVE[1] or np.abs(np.diff(values)).max() >= _SMOOTH * (high - low):
        return None
    first, last = low + _LEVELS[0] * (high - low), low + _LEVELS[1] * (high - low)
    marks = np.where(values >= last, 1, np.where(values <= first, -1, 0))
    at = np.flatnonzero(marks)
    rises = at[1:][(marks[at[1:]] > 0) & (marks[at[:-1]] < 0)]
    if rises.size >= max(3.0, _RISES * cycles):
        apart = np.diff(rises)
        if apart.std() <= _REGULAR * apart.mean():
            return f"a wave that rises {rises.size} times in {cycles:.3g} cycle(s) between {low:g} and {high:g}"
    return None


def _held(values: NDArray[np.float64], low: float, high: float) -> str | None:
    if low == high:
        return f"the constant {low:g}"
    near = _NEAR * (high - low)
    lower, upper = (np.count_nonzero(end) / values.size for end in (values <= low + near, values >= high - near))
    if 1.0 - lower - upper < _BETWEEN and min(lower, upper) >= _HELD:
        return f"a square wave between {low:g} and {high:g}, as the marks or pulses of an encoder"
    return None
