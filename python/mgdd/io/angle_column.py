"""How a table of pressure is to be read, and its crank angle: of a column, a time with a speed, or a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, argument
from mgdd.io.column_names import TIME_UNITS, Heading, check_choice, heading
from mgdd.io.cycle_period import CYCLE_DEG, repetition
from mgdd.io.encoder import Encoder, Turning, turning_of
from mgdd.io.pressure_checks import MIN_SAMPLES, PRESSURE_UNITS
from mgdd.io.table import Table
from mgdd.io.wrong_channel import no_angle

ANGLE_UNITS = ("deg", "rad", *TIME_UNITS)


@dataclass(frozen=True)
class Reading:
    """How a table is to be read; the fields are the arguments of `mgdd.io.read_pressure`."""

    angle_column: int | str | None
    pressure_column: int | str | Sequence[int | str] | None
    angle_unit: str | None
    pressure_unit: str | None
    firing_tdc_deg: float | None
    before_tdc: bool
    tdc_offset_cad: float
    angle_step_deg: float | None
    angle_start_deg: float | None
    speed_rpm: float | None
    gain_bar_per_v: float | None
    offset_bar: float | None
    encoder: Encoder | None = None

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Self:
        """Take the fields out of the arguments of a reader."""
        return cls(**{each.name: given[each.name] for each in fields(cls)})

    def __post_init__(self) -> None:
        if self.pressure_unit is not None:
            check_choice("pressure_unit", self.pressure_unit, PRESSURE_UNITS)
        if self.angle_unit is not None:
            check_choice("angle_unit", self.angle_unit, ANGLE_UNITS)
        _check_range("angle_step_deg", self.angle_step_deg, 0.0, 10.0)
        _check_range("speed_rpm", self.speed_rpm, 0.0, 30000.0)
        if self.gain_bar_per_v is not None and not (np.isfinite(self.gain_bar_per_v) and self.gain_bar_per_v):
            raise DataError.of("gain_bar_per_v", self.gain_bar_per_v, "a finite number, not 0")
        if self.offset_bar is not None and self.gain_bar_per_v is None:
            raise DataError(
                f"{argument('offset_bar')} acts on volts only: give {argument('gain_bar_per_v', '')} too; an offset in "
                "bar is what the pegging of the analysis finds"
            )
        for other, value in (("angle_column", self.angle_column), ("angle_unit", self.angle_unit)):
            if self.encoder is None and self.angle_step_deg is not None and value is not None:
                raise DataError(
                    f"{argument('angle_step_deg')} is for samples without an angle column, {argument(other)} for a "
                    "column: give one of them"
                )
        if self.encoder is not None:
            self._check_encoder()

    def _check_encoder(self) -> None:
        given = {"angle_unit": self.angle_unit, "angle_start_deg": self.angle_start_deg, "speed_rpm": self.speed_rpm}
        idle = next((name for name, value in given.items() if value is not None), "before_tdc")
        if idle != "before_tdc" or self.before_tdc:
            raise DataError(f"{argument(idle)} and {argument('encoder')} are two ways to an angle: leave one out")
        if self.firing_tdc_deg is None:
            raise DataError(
                f"{argument('encoder')} gives no TDC: pass {argument('firing_tdc_deg', '')} with the angle of "
                "TDC behind the mark of the turn, 0 to 360"
            )
        DataError.unless(0.0 <= self.firing_tdc_deg <= CYCLE_DEG, "firing_tdc_deg", self.firing_tdc_deg, "in [0, 720]")


def _check_range(name: str, value: float | None, low: float, high: float) -> None:
    DataError.unless(value is None or low < value <= high, name, value, f"> {low:g} and <= {high:g}")


# A speed is stated to a digit or read off a display; one that is further off is of another point.
_CORRECTED = 0.01


def headings(table: Table) -> list[Heading]:
    """Read header and units row of a table, column by column."""
    if table.lines is not None and table.height < MIN_SAMPLES <= table.width:
        raise DataError(
            f"{table.source}: {table.height} rows of {table.width} cells: too few samples; if each row is a cycle, "
            f"pass {argument('cycle_per_row', 'True')}"
        )
    names = table.header or ("",) * table.width
    return [
        heading(name, table.unit(index), where=f"{table.source}, {table.called(index)}")
        for index, name in enumerate(names)
    ]


class Angle(NamedTuple):
    """Column, degrees, the unit that they came in, whether they were made from a step or a time, or by an encoder."""

    column: int | None
    degrees: NDArray[np.float64]
    unit: str
    made: bool
    turning: Turning | None = None

    @property
    def columns(self) -> tuple[int, ...]:
        """Return the columns that the angle comes from."""
        if self.turning is not None:
            return self.turning.columns
        return () if self.column is None else (self.column,)

    @property
    def cycles(self) -> float:
        """Return how many cycles there are, a part of one counting as one."""
        if self.turning is not None:
            return float(np.nanmax(self.degrees) - np.nanmin(self.degrees)) / CYCLE_DEG
        step, span = np.diff(self.degrees), float(np.ptp(self.degrees))
        if not step.size or not np.isfinite(span):
            return np.inf  # the check of the trace says what is wrong with it
        back = step * (1.0 if np.mean(step > 0.0) >= 0.5 else -1.0) < -0.5 * span
        return max(1.0 + float(np.sum(back)), span / CYCLE_DEG)


def angle_of(table: Table, heads: Sequence[Heading], how: Reading, *, samples: int | None = None) -> Angle:
    """Read the angle, or make it; `samples` is the length of the raster of a file without one."""
    if how.encoder is not None:
        turning = turning_of(table, heads, how.encoder, how.angle_column)
        return Angle(turning.columns[0], turning.degrees, "deg", False, turning)
    if how.angle_step_deg is not None:
        _check_start(table.source, "a count of samples", how)
        count = np.arange(table.height if samples is None else samples, dtype=np.float64)
        return Angle(None, (how.angle_start_deg or 0.0) + how.angle_step_deg * count, "deg", True)
    index, unit = _choose_angle(table, heads, how.angle_column, how.angle_unit)
    called = f"{table.source}: {table.called(index)}"
    if unit not in TIME_UNITS:
        if how.angle_start_deg is not None:
            raise DataError(
                f"{called} holds angles: {argument('angle_start_deg')} is for a time or a file without an angle column"
                ": leave it out"
            )
        values = table.numbers(index)
        _check_first_row(table, values)
        looks = no_angle(values, unit) if table.width > 1 else None
        if looks is not None:
            raise DataError(
                f"{called} is not a crank angle: its values are {looks}: {_hint(table, heads, index)}, or pass "
                f"{argument('angle_step_deg', '')} with the degrees between samples"
            )
        return Angle(index, np.rad2deg(values) if unit == "rad" else values, unit, False)
    if how.speed_rpm is None:
        raise DataError(f"{called} is a time: pass {argument('speed_rpm', '')} to turn it into a crank angle")
    _check_start(called, "a time", how)
    seconds = table.numbers(index) / TIME_UNITS[unit]
    return Angle(index, (how.angle_start_deg or 0.0) + 6.0 * how.speed_rpm * (seconds - seconds[0]), "deg", True)


def _check_first_row(table: Table, values: NDArray[np.float64]) -> None:
    """Refuse a line of numbers below the names that counts the channels instead of starting the angle."""
    cells, step = table.first_row(), np.diff(values)
    if cells is None or table.lines is None or table.header is None or step.size < 2:
        return
    usual = float(np.median(step[1:]))
    counts = all(cell.isdecimal() and len(cell) < 6 for cell in cells)
    if counts and len({int(cell) - at for at, cell in enumerate(cells)}) == 1 and abs(step[0] - usual) > abs(usual) / 2:
        raise DataError(
            f"{table.source}, line {table.lines[0]}: the line counts its cells, {cells[0]} to {cells[-1]}, and the "
            "angle begins below it: if it is a further line of the header, start it with #"
        )


def at_the_speed_of_the_record(
    degrees: NDArray[np.float64], pressure: NDArray[np.float64], speed_rpm: float, firing_tdc_deg: float, source: str
) -> tuple[NDArray[np.float64], float, list[str]]:
    """Compare the stated speed with the period of the record: correct angles and speed, or refuse."""
    if not (np.isfinite(degrees).all() and np.all(np.diff(degrees) > 0.0)):
        return degrees, speed_rpm, []  # check_trace names the sample
    period = repetition(degrees, pressure, firing_tdc_deg)
    if period is None or not period.differs:
        return degrees, speed_rpm, []
    share = CYCLE_DEG / period.degrees
    stated = argument("speed_rpm", format(speed_rpm, "g"))
    remark = (
        f"the pressure repeats every {period.degrees:.6g} degrees of {stated}, not 720: over {period.cycles} cycles "
        f"the engine ran at {speed_rpm * share:.6g} rpm"
    )
    if abs(share - 1.0) > _CORRECTED:
        raise DataError(f"{source}: {remark}: correct it")
    scaled = degrees[0] + (degrees - degrees[0]) * share
    return scaled, speed_rpm * share, [f"{remark}, and its angles were made with that"]


def _check_start(where: str, what: str, how: Reading) -> None:
    if how.before_tdc:
        raise DataError(f"{where}: {argument('before_tdc')} is for an angle column: leave it out")
    if how.angle_start_deg is None and how.firing_tdc_deg is None:
        raise DataError(
            f"{where}: {what} gives no firing TDC: pass {argument('angle_start_deg', '')} with the angle of the "
            f"first sample, or {argument('firing_tdc_deg', '')} with the angle of firing TDC counted from it"
        )


def _choose_angle(
    table: Table, heads: Sequence[Heading], column: int | str | None, unit: str | None
) -> tuple[int, str]:
    """Return the column of the angle, or of the time, and its unit."""
    index = table.index(0 if column is None else column)
    head, called = heads[index], f"{table.source}: {table.called(index)}"
    others = _other_angles(table, heads, index)
    hint = _hint(table, heads, index)
    if head.unit in ANGLE_UNITS:
        if unit is not None and unit != head.unit:
            raise DataError(
                f"{called} is in {head.unit} as the file says: leave {argument('angle_unit')} out or correct the file"
            )
        if head.quantity == "time" and others and column is None:
            raise DataError(f"{called} is a time, and {others[0]!r} an angle: {hint}")
        return index, head.unit
    if column is None and head.quantity is None and others:
        raise DataError(f"{called} is the first one, and {others[0]!r} is an angle: {hint}")
    if unit is not None:
        return index, unit
    step = argument("angle_step_deg", "")
    if head.strange is not None or head.unclear is not None:
        raise DataError(
            f"{called} is in {head.strange or head.unclear!r}, which is not known: convert it, or pass "
            f"{argument('angle_unit', '')} with one of {', '.join(ANGLE_UNITS)}"
        )
    if head.quantity == "time":
        raise DataError(
            f"{called} looks like a time: {hint}, or pass {argument('angle_unit', repr('s'))} or "
            f"{argument('angle_unit', repr('ms'))} and {argument('speed_rpm', '')} to turn it into an angle"
        )
    if head.quantity == "counter":
        raise DataError(f"{called} counts samples: {hint}, or pass {step} with the degrees between samples")
    if head.quantity is not None and head.quantity != "angle":
        raise DataError(f"{called} is not a crank angle: {hint}; for a file without one pass {step}")
    return index, "deg"


def _other_angles(table: Table, heads: Sequence[Heading], index: int) -> list[str]:
    return [heads[i].name for i in range(table.width) if i != index and heads[i].quantity == "angle"]


def _hint(table: Table, heads: Sequence[Heading], index: int) -> str:
    others = _other_angles(table, heads, index)
    return f"pass {argument('angle_column', repr(others[0]))}" if others else "name the column of the crank angle"
