"""Crank angle from the signal of an encoder or a toothed wheel: of arrays, and of a table of a test cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd._core import engine as _core
from mgdd.errors import DataError, argument
from mgdd.io.column_names import TIME_UNITS, Heading
from mgdd.io.cycle_period import CYCLE_DEG
from mgdd.io.table import Table
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import even_step

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

# Steps of the even grid that divide a turn [deg]; the widest one that is not above that of the samples is taken.
_STEPS_DEG = (0.01, 0.02, 0.025, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
# Mean pressure around the two places of TDC: the firing one has more, by at least this share of the whole range.
_AROUND_DEG, _CLEARLY = 15.0, 0.15
# Pressure peaks about TDC where an engine is motored or burns late, some 45 degrees behind at most.
_PEAK_DEG = (-15.0, 50.0)
# An edge is displaced by at least so many degrees, and by so many times what is usual; looked for at parts of a pitch.
_DISPLACED_DEG, _ODD, _PER_PITCH = 0.3, 8.0, 4


@dataclass(frozen=True, kw_only=True)
class Encoder:
    """A sensor of the crank angle: pulses of a turn, and what marks the turn.

    The mark is the gap of the missing teeth, or a pulse on a channel of its own. Without either the angle counts from
    the first edge of the record, and nothing tells whether edges are missing.

    Parameters
    ----------
    column : int or str, optional
        Of a file: the column of the signal, by position from 0 or by name.
    teeth : int
        Pulses of a turn, missing ones counted: 60 of a 60-2 wheel.
    missing_teeth : int
        Teeth that are missing side by side: 2 of a 60-2 wheel.
    index_column : int or str, optional
        Of a file: the column with one pulse a turn.
    falling : bool
        The falling edges of the signal count, not the rising ones.
    level : float, optional
        Where an edge is, in units of the signal; None is midway between its low and high level. 0 for a coil.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.io import Encoder
    >>> time = np.arange(0.0, 0.2, 1e-5)
    >>> place = (9000.0 * time % 360.0) / 6.0  # 1500 rpm, 60 teeth, two of them missing
    >>> found = Encoder(teeth=60, missing_teeth=2).angle(time, 5.0 * ((place < 58) & (place % 1.0 < 0.5)))
    >>> found["speed_rpm"].values.round(1).tolist(), int(found["lost"])
    ([1500.0, 1500.0, 1500.0], 0)
    """

    column: int | str | None = None
    teeth: int = 360
    missing_teeth: int = 0
    index_column: int | str | None = None
    falling: bool = False
    level: float | None = None

    def angle(self, time_s: ArrayLike, signal: ArrayLike, index: ArrayLike | None = None) -> xr.Dataset:
        """Find the crank angle of every sample.

        Edges stand where the signal crosses its level; a lost edge is counted by the time that passes, one too many is
        left out, and a turn with a wrong count is stretched between its marks. Between edges runs a monotone cubic
        (Fritsch and Butland 1984).

        Parameters
        ----------
        time_s : array_like, shape (n,)
            Time [s], rising.
        signal : array_like, shape (n,)
            The signal, in any unit.
        index : array_like, shape (n,), optional
            The channel with one pulse a turn.

        Returns
        -------
        xarray.Dataset
            ``crank_angle_deg(time_s)``, running on, 0 at a mark: the first edge behind the gap, the edge of the index,
            or the first edge; NaN before the first and behind the last countable turn. ``speed_rpm(turn)`` from
            mark to mark, ``mark_s(turn)``; ``lost``, ``extra`` (edges) and ``lost_marks`` are counts, ``slipped_deg``
            (stretch, end) are turns whose count is wrong, and the neighbourhoods of edges that come early or late: the
            angle is right at their ends only.

        Raises
        ------
        ParameterError
            A wheel that cannot be, a level outside the signal.
        DataError, ShapeError
            Unlike lengths, a sample that is not finite, a signal that stands, or one of another wheel, which is named.
        """
        result = _encoder_angle(self, time_s, signal, index)
        marks = result["mark_s"]
        speed = 60.0 / np.diff(marks)
        slipped = np.array(result["slipped_deg"], dtype=np.float64).reshape(-1, 2)
        return labelled_dataset(
            {
                "time_s": ("time_s", np.asarray(time_s, dtype=np.float64)),
                "turn": ("turn", np.arange(1, speed.size + 1), "-", "turn"),
                "slip": ("slip", np.arange(1, len(slipped) + 1), "-", "stretch of miscounted or displaced edges"),
                "end": ("end", np.array(["from", "to"]), "-", "end of a stretch"),
                "crank_angle_deg": ("time_s", result["angle_deg"], "deg", "crank angle from a mark on"),
                "mark_s": ("turn", marks[:-1], "s", "time of the mark that begins a turn"),
                "speed_rpm": ("turn", speed, "rpm", "engine speed"),
                "slipped_deg": (("slip", "end"), slipped, "deg", "miscounted or displaced edges"),
                **{name: ((), result[name], "-", name.replace("_", " ")) for name in ("lost", "extra", "lost_marks")},
            }
        )


def _encoder_angle(encoder: Encoder, time_s: ArrayLike, signal: ArrayLike, index: ArrayLike | None) -> dict[str, Any]:
    e = encoder
    result: dict[str, Any] = _core.encoder_angle(
        time_s, signal, index, teeth=e.teeth, missing_teeth=e.missing_teeth, falling=e.falling, level=e.level
    )
    displaced = _displaced(np.asarray(result["angle_deg"]), np.asarray(time_s, np.float64), e.teeth)
    return {**result, "slipped_deg": sorted([*result["slipped_deg"], *displaced])}


def _displaced(degrees: NDArray[np.float64], time_s: NDArray[np.float64], teeth: int) -> list[tuple[float, float]]:
    """Give the stretches of a pitch before and behind an edge that comes early or late, as where a dropout cuts it.

    What a place of the wheel has in every turn, as a bent tooth, is left to it.
    """
    valid, pitch = np.isfinite(degrees), 360.0 / teeth
    angle, time = degrees[valid], time_s[valid]
    at = np.arange(angle[0] + pitch, angle[-1] - pitch, pitch / _PER_PITCH)
    if not at.size:
        return []
    before, here, behind = (np.interp(at + side, angle, time) for side in (-pitch, 0.0, pitch))
    late = pitch * (2.0 * here - before - behind) / (behind - before)
    turn = teeth * _PER_PITCH
    if late.size >= 3 * turn:
        late -= np.resize(np.median(late[: late.size // turn * turn].reshape(-1, turn), axis=0), late.size)
    usual = float(np.median(np.abs(late)))
    sample = float(np.median(np.diff(angle)))  # within it a pulse may begin anywhere
    bad = np.flatnonzero(np.abs(late) > max(_DISPLACED_DEG, _ODD * usual, 2.0 * sample))
    parts = np.split(bad, np.flatnonzero(np.diff(bad) > 2 * _PER_PITCH) + 1) if bad.size else []
    return [(float(at[part[0]]) - pitch, float(at[part[-1]]) + pitch) for part in parts]


class Turning(NamedTuple):
    """The angle of every sample of a table by its encoder, its columns, and the remarks on it."""

    degrees: NDArray[np.float64]
    columns: tuple[int, ...]
    speed_rpm: float | None
    slipped_deg: list[tuple[float, float]]
    notes: list[str]
    has_mark: bool


def turning_of(table: Table, heads: Sequence[Heading], encoder: Encoder, time: int | str | None) -> Turning:
    """Read the encoder of a table over its time, or over its samples where it has none."""
    if encoder.column is None:
        raise DataError(f"{table.source}: {argument('encoder')} names no column: give the one of its signal")
    column = table.index(encoder.column)
    size = table.lengths[column]
    index = None if encoder.index_column is None else table.index(encoder.index_column)
    clock = table.index(time) if time is not None else _time(table, heads, size, column)
    seconds = np.arange(size, dtype=np.float64)
    if clock is not None:
        unit = heads[clock].unit
        seconds = table.numbers(clock) / TIME_UNITS[unit if unit in TIME_UNITS else "s"]
        even_step(seconds, where=f"{table.source}, {table.called(clock)}, row {{}}".format)
    pulse = None if index is None else table.numbers(index)
    try:
        result = _encoder_angle(encoder, seconds, table.numbers(column), pulse)
    except DataError as error:
        raise error.reworded(f"{table.source}, {table.called(column)}: {error}") from error
    marks, notes = result["mark_s"], []
    for count, what in (
        (result["lost"], "edge{} missing, the angle runs through"),
        (result["extra"], "edge{} too many, left out"),
        (result["lost_marks"], "mark{} of the turn missing or false"),
    ):
        if count:
            notes.append(f"{table.called(column)}: {count} {what.format('s' if count > 1 else '')}")
    has_mark = encoder.missing_teeth > 0 or index is not None
    if not has_mark:
        notes.append(f"{table.called(column)} has no mark of the turn: that no edge is missing is taken for granted")
    speed = 60.0 * (len(marks) - 1) / float(marks[-1] - marks[0]) if clock is not None and len(marks) > 1 else None
    used = tuple(i for i in (column, index, clock) if i is not None)
    return Turning(result["angle_deg"], used, speed, result["slipped_deg"], notes, has_mark)


def _time(table: Table, heads: Sequence[Heading], size: int, column: int) -> int | None:
    return next(
        (i for i, head in enumerate(heads) if head.quantity == "time" and table.lengths[i] == size and i != column),
        None,
    )


def on_even_angles(
    turning: Turning, channels: NDArray[np.float64], *, step_deg: float | None, tdc_deg: float, source: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Give even angles, channels (channel, sample) and a last one, 1 in slipped turns, there, and firing TDC.

    The first channel is a cylinder pressure; `tdc_deg` is the angle of TDC behind a mark of the turn. Firing TDC is the
    one of the two turns with the higher pressure.
    """
    valid = np.flatnonzero(np.isfinite(turning.degrees))
    part = slice(int(valid[0]), int(valid[-1]) + 1)
    degrees = turning.degrees[part]
    usual = float(np.median(np.diff(degrees)))
    step: float = step_deg or max((each for each in _STEPS_DEG if each <= usual * 1.001), default=_STEPS_DEG[0])
    first = int(np.ceil(degrees[0] / step))
    count = int(np.floor(degrees[-1] / step)) - first + 1
    if count * step < CYCLE_DEG:
        raise DataError(f"{source}: the encoder covers {max(count * step, 0.0):.4g} degrees: a cycle of 720 is needed")
    bad = np.flatnonzero(~np.isfinite(channels[0]))
    if bad.size:
        raise DataError(
            f"{source}: pressure, sample {bad[0]}: {channels[0, bad[0]]}: must be finite; remove or repair it"
        )
    even = np.linspace(first * step, (first + count - 1) * step, count)
    out = np.empty((len(channels) + 1, count))
    for row, values in zip(out, channels, strict=False):
        row[:] = _core.at_even_angles(degrees, values[part], first * step, step, count)
    out[-1] = 0.0
    for low, high in turning.slipped_deg:
        out[-1, (even > low) & (even < high)] = 1.0
    return even, out, _firing(even, out[0], tdc_deg, source)


def _firing(even: NDArray[np.float64], pressure: NDArray[np.float64], tdc_deg: float, source: str) -> float:
    """Return which of two places of TDC, a turn apart, is the firing one."""
    past = (even - tdc_deg + 180.0) % 720.0 - 180.0
    levels = [float(np.mean(pressure[np.abs(past - turn) <= _AROUND_DEG])) for turn in (0.0, 360.0)]
    wide = float(np.ptp(pressure))
    firing = (tdc_deg + (0.0 if levels[0] > levels[1] else 360.0)) % CYCLE_DEG
    peak = (float(even[pressure.argmax()]) - firing + 180.0) % 360.0 - 180.0
    if not (abs(levels[0] - levels[1]) > _CLEARLY * wide and _PEAK_DEG[0] <= peak <= _PEAK_DEG[1]):
        behind = float(even[pressure.argmax()] % 360.0)
        raise DataError(
            f"{source}: {argument('firing_tdc_deg', format(tdc_deg, 'g'))} behind the mark is not TDC: the pressure "
            f"peaks {behind:.1f} degrees behind a mark, and TDC is near that"
        )
    return firing
