"""Records of several engine cycles, one below the other or running on, cut into cycles of one angle grid."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, argument
from mgdd.io.cycle_period import CYCLE_DEG, repetition
from mgdd.io.cycle_phase import phases
from mgdd.io.table import Place
from mgdd.signals.even_grid import wide_steps

# Share of a step by which the angles of two cycles may differ and still be one grid.
SAME_ANGLE = 0.01
# Share of a step by which the end of a cycle may be missed: angles of three digits in radians are rounded by as much.
_ROUNDED = 0.3
# An encoder's step divides the cycle: by so much of a sample a step may miss that, or is meant to.
_WHOLE, _NEARLY_WHOLE = 1e-3, 0.2
# A record may lack this share of its samples, at so many places; more is another step.
_LOSABLE, _PLACES = 0.01, 8
# Sums of steps end this much [deg] beside the angle that was meant.
_ROUNDING = 1e-6


class Cycles(NamedTuple):
    """Angle [deg], channels (channel, cycle, angle), the row of each sample of the first cycle, notes for the user.

    `taken` are the numbers, from 0, of the cycles that are whole among all of the record, where it has `total`.
    """

    degrees: NDArray[np.float64]
    values: NDArray[np.float64]
    rows: NDArray[np.intp]
    notes: tuple[str, ...] = ()
    taken: tuple[int, ...] | None = None
    total: int = 0


def arranged(
    degrees: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    firing_tdc_deg: float | None,
    before_tdc: bool,
    place: Place,
    counts_turns: bool = False,
) -> Cycles:
    """Turn angles as in the file [deg] to °CA aTDC and cut channels (channel, column, sample) into complete cycles.

    The columns of a channel are cycles; the first channel is a cylinder pressure, whose period must be a cycle, unless
    the angle `counts_turns` by a mark of the shaft.
    """
    rows = np.arange(degrees.size)
    if before_tdc and firing_tdc_deg is not None:
        raise DataError("firing_tdc_deg, before_tdc: angles are in one convention: give one of them")
    if before_tdc:
        degrees = 0.0 - degrees
        if np.all(np.diff(degrees) < 0.0):
            degrees, values, rows = degrees[::-1], values[..., ::-1], rows[::-1]
    falls, runs_on = several_cycles(degrees)
    columns = values.shape[1]
    if (falls.size or runs_on) and columns > 1:
        raise DataError(
            f"{place.source}: several pressure columns, and several cycles below each other: name one column, "
            f"{argument('pressure_column', '')}"
        )
    notes: tuple[str, ...] = ()
    if falls.size:
        stack = _stacked(degrees, values[:, 0], rows, falls, place)
        degrees, values, rows, notes, *_ = stack
        columns = values.shape[1]
        if firing_tdc_deg is None or not _splits_a_burn(degrees, firing_tdc_deg) or columns == 1:
            turned = _turned(degrees, values, rows, firing_tdc_deg, place)
            return turned._replace(notes=notes, taken=stack.taken, total=stack.total)
    if firing_tdc_deg is not None and columns > 1 and _splits_a_burn(degrees, firing_tdc_deg):
        # The columns follow each other: end of compression in one, its combustion at the head of the next.
        whole = degrees[-1] - degrees[0] >= 720.0 - 1e-3
        keep = slice(0, degrees.size - 1 if whole else degrees.size)
        degrees = np.concatenate([degrees[keep] + 720.0 * k for k in range(columns)])
        rows = np.tile(rows[keep], columns)
        values, runs_on = values[..., keep].reshape(len(values), 1, -1), True
    if runs_on:
        _check_tdc(degrees, firing_tdc_deg, place)
        cut = _running(degrees, values[:, 0], rows, float(firing_tdc_deg or 0.0), place, counts_turns)
        return cut._replace(notes=notes + cut.notes)
    return _turned(degrees, values, rows, firing_tdc_deg, place)._replace(notes=notes)


def several_cycles(degrees: NDArray[np.float64]) -> tuple[NDArray[np.intp], bool]:
    """Return where an angle falls back to its start, and whether it runs on over more than one cycle."""
    step, span = np.diff(degrees), float(np.ptp(degrees))
    return np.flatnonzero(step < -0.5 * span) + 1, bool(np.all(step > 0.0)) and span > 720.0 + SAME_ANGLE


def _turned(
    degrees: NDArray[np.float64],
    values: NDArray[np.float64],
    rows: NDArray[np.intp],
    firing_tdc_deg: float | None,
    place: Place,
) -> Cycles:
    """Sort one cycle of a 0..720 record by its angles in °CA aTDC."""
    if firing_tdc_deg is None:
        return Cycles(degrees, np.ascontiguousarray(values), rows)
    _check_tdc(degrees, firing_tdc_deg, place)
    step = np.diff(degrees)
    if not np.all(step > 0.0):
        k = int(np.argmin(step > 0.0)) + 1
        raise DataError(f"{place.source}: angle_deg[{k}] = {degrees[k]:g} follows {degrees[k - 1]:g}: angles must rise")
    span = np.ptp(degrees)
    if span > 720.0:
        raise DataError(f"{place.source}: angles span {span:g} degrees: one cycle of at most 720 degrees is needed")
    shifted = degrees - firing_tdc_deg
    cad = np.where(shifted > 360.0, shifted - 720.0, np.where(shifted < -360.0, shifted + 720.0, shifted))
    order = np.argsort(cad, kind="stable")
    return Cycles(cad[order], np.ascontiguousarray(values[..., order]), rows[order])


def _seam(start: float, firing_tdc_deg: float) -> float:
    """Return where a cycle of 720 degrees that starts there is cut, in °CA aTDC within -360 to 360."""
    return (start - firing_tdc_deg + 360.0 + _ROUNDING) % 720.0 - 360.0 - _ROUNDING


def _splits_a_burn(degrees: NDArray[np.float64], firing_tdc_deg: float) -> bool:
    """Return whether cycles of 720 degrees start between compression and expansion, not in the gas exchange."""
    step = float(np.median(np.diff(degrees)))
    return degrees[-1] - degrees[0] + 1.5 * step >= 720.0 and abs(_seam(float(degrees[0]), firing_tdc_deg)) < 180.0


def _check_tdc(degrees: NDArray[np.float64], firing_tdc_deg: float | None, place: Place) -> None:
    if firing_tdc_deg is None:
        span = degrees[-1] - degrees[0]
        raise DataError(
            f"{place.source}: crank angles run on from {degrees[0]:g} to {degrees[-1]:g}, {span / 720.0:.3g} cycles: "
            f"pass {argument('firing_tdc_deg', '')} with the angle of firing TDC in the first of them, 0 to 720"
        )
    if not 0.0 <= firing_tdc_deg <= 720.0:
        error = DataError.of("firing_tdc_deg", firing_tdc_deg, "in [0, 720]")
        raise error.reworded(f"{place.source}: {error}")


def _stacked(
    degrees: NDArray[np.float64],
    values: NDArray[np.float64],
    rows: NDArray[np.intp],
    falls: NDArray[np.intp],
    place: Place,
) -> Cycles:
    """Cut where the angle returns to its start."""
    edges = [0, *falls.tolist(), degrees.size]
    blocks = [slice(a, b) for a, b in itertools.pairwise(edges)]
    step = float(np.median(np.abs(np.diff(degrees))))
    low, high = min(degrees[b.start] for b in blocks), max(degrees[b.stop - 1] for b in blocks)
    whole = [degrees[b.start] < low + 0.5 * step and degrees[b.stop - 1] > high - 0.5 * step for b in blocks]
    if not any(whole):
        raise DataError(
            f"{place.source}: the angle returns at {place.row(int(falls[0]))}, and no cycle from {low:g} to {high:g} "
            "is complete: give at least one"
        )
    dropped = [k + 1 for k, complete in enumerate(whole) if not complete]
    inner = [k for k in dropped if 1 < k < len(blocks)]
    if inner:
        b = blocks[inner[0] - 1]
        raise DataError(
            f"{place.row(b.start)}: cycle {inner[0]} of {len(blocks)} runs from {degrees[b.start]:g} to "
            f"{degrees[b.stop - 1]:g}, the others from {low:g} to {high:g}: repair it or remove its rows"
        )
    whole_blocks = [b for b, complete in zip(blocks, whole, strict=True) if complete]
    grid = degrees[whole_blocks[0]]
    for b in whole_blocks:
        if b.stop - b.start != grid.size or np.abs(degrees[b] - grid).max() > SAME_ANGLE * step:
            raise DataError(
                f"{place.row(b.start)}: the cycle that starts here has other crank angles than the one at "
                f"{place.row(whole_blocks[0].start)}: give all cycles the same angles"
            )
    which = f"cycle{'s' if len(dropped) > 1 else ''} {' and '.join(map(str, dropped))}"
    notes = [f"{which} of {len(blocks)} left out: incomplete"] if dropped else []
    taken = tuple(k for k, complete in enumerate(whole) if complete)
    cut = np.stack([values[:, b] for b in whole_blocks], axis=1)
    return Cycles(grid, cut, rows[whole_blocks[0]], tuple(notes), taken, len(blocks))


def _running(
    degrees: NDArray[np.float64],
    values: NDArray[np.float64],
    rows: NDArray[np.intp],
    firing_tdc_deg: float,
    place: Place,
    counts_turns: bool,
) -> Cycles:
    """Cut angles that run on into cycles of 720 degrees, at the start of the record or at gas-exchange TDC."""
    wide, step = wide_steps(degrees)
    if wide:
        k = wide[0]
        raise DataError(
            f"{place.row(int(rows[k]))}: gap in the crank angle from {degrees[k - 1]:g} to {degrees[k]:g}: the usual "
            f"step is {step:g}; fill it or cut the record there"
        )
    period = None if counts_turns else repetition(degrees, values[0], firing_tdc_deg)
    samples = CYCLE_DEG / step
    encoded = abs(samples - round(samples)) < _WHOLE
    if period is not None and period.differs and not (encoded and abs(period.degrees / CYCLE_DEG - 1.0) < _LOSABLE):
        factor = CYCLE_DEG / period.degrees
        if abs(samples / factor - round(samples / factor)) < _NEARLY_WHOLE:
            factor = samples / round(samples / factor)
        raise DataError(
            f"{place.source}: the angle runs on and the pressure repeats every {period.degrees:.6g} degrees, not every "
            f"720, over {period.cycles} cycles: correct the step of the angle by a factor of {factor:.6g}, "
            f"{argument('angle_step_deg', format(step * factor, '.6g'))} for a file without an angle"
        )
    first = float(degrees[0])
    if _splits_a_burn(degrees, firing_tdc_deg):
        first += (-360.0 - _seam(first, firing_tdc_deg)) % 720.0
    count = int((degrees[-1] + step * (1.0 + _ROUNDED) - first) // 720.0)
    if count < 1:
        raise DataError(
            f"{place.source}: no complete cycle between {degrees[0]:g} and {degrees[-1]:g} with firing TDC at "
            f"{firing_tdc_deg:g}: 720 degrees from gas-exchange TDC on are needed"
        )
    taken: tuple[int, ...] | None = None
    starts = np.searchsorted(degrees, first + 720.0 * np.arange(count + 1) - _ROUNDED * step)
    head, tail = int(starts[0]), degrees.size - int(starts[-1])
    grid = degrees[starts[0] : starts[1]]
    at = grid + 720.0 * np.arange(count)[:, None]
    notes = []
    parts = [f"{n * step:.4g} degrees at the {end}" for n, end in ((head, "start"), (tail, "end")) if n > 1]
    if parts:
        notes.append(f"{' and '.join(parts)} of the record left out: incomplete cycles")
    same = np.all(np.diff(starts) == grid.size)
    cut = degrees[starts[0] : starts[0] + at.size].reshape(at.shape) if same else at
    if same and np.abs(cut - at).max() <= SAME_ANGLE * step:
        stream = values[:, starts[0] :]
        values = stream[:, : at.size].reshape(-1, *at.shape)
        if encoded and not counts_turns:
            past = grid - grid[0] + _seam(float(grid[0]), firing_tdc_deg)
            values, taken, more = _without_losses(past, step, values, stream)
            notes += more
    else:
        at = at[at[:, -1] <= degrees[-1] + _ROUNDED * step]
        values = np.stack([np.interp(at, degrees, row) for row in values])
        notes.append("the step does not divide 720 degrees: cycles interpolated linearly to the angles of the first")
    past = grid - grid[0] + _seam(float(grid[0]), firing_tdc_deg)
    cad = np.where(past > 360.0 - SAME_ANGLE * step, past - 720.0, past)
    order = np.argsort(cad, kind="stable")
    return Cycles(
        cad[order],
        np.ascontiguousarray(values[..., order]),
        rows[starts[0] : starts[1]][order],
        tuple(notes),
        taken,
        count if taken is not None else 0,
    )


def _without_losses(
    past: NDArray[np.float64], step: float, values: NDArray[np.float64], stream: NDArray[np.float64]
) -> tuple[NDArray[np.float64], tuple[int, ...] | None, list[str]]:
    """Cut anew behind places where an encoder's record lacks samples, and leave out the cycles around each.

    `values` are the channels (channel, cycle, angle) as cut from the `stream` (channel, sample) at even steps.
    """
    count, size = values.shape[1:]
    begins = size * np.arange(count)
    out: set[int] = set()
    notes = []
    for _ in range(_PLACES):
        kept_cycles = np.array([k for k in range(count) if k not in out])
        placed = phases(past, values[0, kept_cycles])
        jump = None if placed is None else placed.jump(step)
        lost = 0 if jump is None else -round(jump.cad / step)
        if jump is None or not lost:
            break
        behind = int(kept_cycles[jump.cycle])
        begins[behind:] -= lost
        out |= {behind - 1, behind}
        what = f"{abs(lost)} samples {'are missing' if lost > 0 else 'too many'}"
        notes.append(
            f"{what} between the compressions of cycles {behind} and {behind + 1} of {count}: both are left out, those "
            "behind are cut "
            f"{abs(lost) * step:.3g} degrees {'earlier' if lost > 0 else 'later'}; the step of {step:g} stays"
        )
        out |= {k for k in range(count) if begins[k] + size > stream.shape[1]}
        at = np.clip(begins[:, None] + np.arange(size), 0, stream.shape[1] - 1)
        values = stream[:, at]
    if not out:
        return values, None, []
    taken = tuple(k for k in range(count) if k not in out)
    return np.ascontiguousarray(values[:, list(taken)]), taken, notes
