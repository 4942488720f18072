"""A table of measured pressure: its columns, its angles in degrees, its pressures in one unit, and what is doubtful."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.column_names import Heading, check_choice, heading
from mgdd.io.cycle_phase import CYCLE_DEG, phase_warnings, repetition
from mgdd.io.cycles import arranged
from mgdd.io.pressure_checks import (
    MIN_SAMPLES,
    PRESSURE_UNITS,
    check_span,
    check_trace,
    level_warning,
    steep_warning,
)
from mgdd.io.table import Place, Table

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["ANGLE_UNITS", "Reading", "checked", "cycles_of", "odd_shape"]

_TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6}
ANGLE_UNITS = ("deg", "rad", *_TIME_UNITS)
# Cycles of one cylinder, fired or not, share their compression; another cylinder has its peak elsewhere.
_MIN_CORRELATION = 0.5
_PEAK_WITHIN_CAD = 40.0
_LARGEST_OFFSET_CAD = 20.0
# A speed is stated to a digit or read off a display; one that is further off is of another point.
_CORRECTED = 0.01


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
            if self.angle_step_deg is not None and value is not None:
                raise DataError(
                    f"{argument('angle_step_deg')} is for samples without an angle column, {argument(other)} for a "
                    "column: give one of them"
                )


def cycles_of(table: Table, how: Reading) -> tuple[NDArray[np.float64], NDArray[np.float64], float | None, list[str]]:
    """Return angle [°CA aTDC], pressures [bar] as (cycle, angle), the speed [rpm] of a time, and warnings."""
    heads = _headings(table)
    index, degrees, unit, made = _angle(table, heads, how)
    columns = _choose_pressure(table, heads, how.pressure_column, index)
    gain = how.gain_bar_per_v
    pressure_unit, unit_of_file = _unit_of_pressure(table, heads, columns, how.pressure_unit, gain=gain is not None)
    values = table.matrix(columns)
    if how.pressure_column is None and len(columns) > 1:
        _check_alike(table, columns, degrees, values)
    warnings = []
    level = not any(heads[i].gauge for i in columns)
    if not level:
        warnings.append("the file says gauge pressure, 1 atmosphere below the absolute one: peg it")
    if gain is not None:
        values = values * (gain * (1e-3 if pressure_unit == "mV" else 1.0)) + (how.offset_bar or 0.0)
        pressure_unit, unit_of_file, level = "bar", False, how.offset_bar is not None
        if not level:
            warnings.append(f"no {argument('offset_bar')}: the pressure is relative, peg it")
    tdc = how.firing_tdc_deg
    if made and tdc is None and degrees[-1] > 360.5:
        tdc = 0.0  # angle_start_deg is in °CA aTDC
    speed = how.speed_rpm
    over_time = made and how.angle_step_deg is None
    if over_time and tdc is not None and len(values) == 1 and np.isfinite(values).all():
        degrees, speed, notes = _at_the_speed_of_the_record(degrees, values[0], float(speed or 0.0), tdc, table.source)
        warnings += notes
    angle, bar, more = checked(
        degrees,
        values,
        unit=pressure_unit,
        angle_unit=unit,
        firing_tdc_deg=tdc,
        before_tdc=how.before_tdc,
        tdc_offset_cad=how.tdc_offset_cad,
        source=table.source,
        rows=table.lines,
        level=level,
        unit_of_file=unit_of_file,
        over_time=over_time,
    )
    return angle, bar, speed, warnings + more


def checked(
    degrees: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    unit: str = "bar",
    angle_unit: str = "deg",
    firing_tdc_deg: float | None,
    before_tdc: bool,
    tdc_offset_cad: float = 0.0,
    source: str,
    rows: Sequence[int] | None = None,
    level: bool = True,
    unit_of_file: bool = False,
    over_time: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[str]]:
    """Cut a record into cycles and check them; angles are in degrees, `angle_unit` is what they came in."""
    if not abs(tdc_offset_cad) <= _LARGEST_OFFSET_CAD:
        raise DataError.of("tdc_offset_cad", tdc_offset_cad, f"within ±{_LARGEST_OFFSET_CAD:g} °CA")
    if np.isfinite(degrees).all() and np.isfinite(values).all() and degrees.size >= MIN_SAMPLES:
        check_span(degrees, angle_unit, source, several=firing_tdc_deg is not None)
        place = Place(source, rows)
        cut = arranged(degrees, values, firing_tdc_deg=firing_tdc_deg, before_tdc=before_tdc, place=place)
        degrees, values, notes = cut.degrees - tdc_offset_cad, cut.pressure, list(cut.notes)
        rows = place.only(cut.rows).rows
    else:
        notes = []  # check_trace names what is not finite or too short
    one = values[0] if len(values) == 1 else values
    angle, bar = check_trace(degrees, one, unit=unit, source=source, rows=rows, unit_of_file=unit_of_file)
    doubts = [*level_warning(angle, values, unit), *steep_warning(angle, bar)] if level else []
    doubts += phase_warnings(angle, np.atleast_2d(bar), over_time=over_time, source=source)
    return angle, np.atleast_2d(bar), notes + doubts


def _headings(table: Table) -> list[Heading]:
    """Read header and units row of a table, column by column."""
    names = table.header or ("",) * table.width
    return [
        heading(name, table.unit(index), where=f"{table.source}, {table.called(index)}")
        for index, name in enumerate(names)
    ]


def _angle(table: Table, heads: Sequence[Heading], how: Reading) -> tuple[int | None, NDArray[np.float64], str, bool]:
    """Return column, degrees, the unit that they came in, and whether they were made from a step or a time."""
    if how.angle_step_deg is not None:
        _check_start(table.source, "a count of samples", how)
        count = np.arange(table.height, dtype=np.float64)
        return None, (how.angle_start_deg or 0.0) + how.angle_step_deg * count, "deg", True
    index, unit = _choose_angle(table, heads, how.angle_column, how.angle_unit)
    called = f"{table.source}: {table.called(index)}"
    if unit not in _TIME_UNITS:
        if how.angle_start_deg is not None:
            raise DataError(
                f"{called} holds angles: {argument('angle_start_deg')} is for a time or a file without an angle column"
                ": leave it out"
            )
        values = table.numbers(index)
        return index, np.rad2deg(values) if unit == "rad" else values, unit, False
    if how.speed_rpm is None:
        raise DataError(f"{called} is a time: pass {argument('speed_rpm', '')} to turn it into a crank angle")
    _check_start(called, "a time", how)
    seconds = table.numbers(index) / _TIME_UNITS[unit]
    return index, (how.angle_start_deg or 0.0) + 6.0 * how.speed_rpm * (seconds - seconds[0]), "deg", True


def _at_the_speed_of_the_record(
    degrees: NDArray[np.float64], pressure: NDArray[np.float64], speed_rpm: float, firing_tdc_deg: float, source: str
) -> tuple[NDArray[np.float64], float, list[str]]:
    """Compare the stated speed with the period of the record: correct angles and speed, or refuse."""
    if not (np.isfinite(degrees).all() and np.all(np.diff(degrees) > 0.0)):
        return degrees, speed_rpm, []  # check_trace names the sample
    found = repetition(degrees, pressure, firing_tdc_deg)
    if found is None or not found.differs:
        return degrees, speed_rpm, []
    share = CYCLE_DEG / found.degrees
    stated = argument("speed_rpm", format(speed_rpm, "g"))
    said = (
        f"the pressure repeats every {found.degrees:.6g} degrees of {stated}, not 720: over {found.cycles} cycles the "
        f"engine ran at {speed_rpm * share:.6g} rpm"
    )
    if abs(share - 1.0) > _CORRECTED:
        raise DataError(f"{source}: {said}: correct it")
    scaled = degrees[0] + (degrees - degrees[0]) * share
    return scaled, speed_rpm * share, [f"{said}, and its angles were made with that"]


def _check_start(where: str, what: str, how: Reading) -> None:
    if how.before_tdc:
        raise DataError(f"{where}: {argument('before_tdc')} is for an angle column: leave it out")
    if how.angle_start_deg is None and how.firing_tdc_deg is None:
        raise DataError(
            f"{where}: {what} says nothing of firing TDC: pass {argument('angle_start_deg', '')} with the angle of the "
            f"first sample, or {argument('firing_tdc_deg', '')} with the angle of firing TDC counted from it"
        )


def _check_range(name: str, value: float | None, low: float, high: float) -> None:
    if value is not None and not low < value <= high:
        raise DataError.of(name, value, f"> {low:g} and <= {high:g}")


def _choose_angle(
    table: Table, heads: Sequence[Heading], column: int | str | None, unit: str | None
) -> tuple[int, str]:
    """Return the column of the angle, or of the time, and its unit."""
    index = table.index(0 if column is None else column)
    head, called = heads[index], f"{table.source}: {table.called(index)}"
    others = [heads[i].name for i in range(table.width) if i != index and heads[i].quantity == "angle"]
    hint = f"pass {argument('angle_column', repr(others[0]))}" if others else "name the column of the crank angle"
    if head.unit in ANGLE_UNITS:
        if unit is not None and unit != head.unit:
            raise DataError(
                f"{called} is in {head.unit} as the file says: leave {argument('angle_unit')} out or correct the file"
            )
        if head.quantity == "time" and others and column is None:
            raise DataError(f"{called} is a time, and {others[0]!r} an angle: {hint}")
        return index, head.unit
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


def _choose_pressure(
    table: Table,
    heads: Sequence[Heading],
    column: int | str | Sequence[int | str] | None,
    angle: int | None,
) -> list[int]:
    """Return the columns of the cycles: those named, or all behind the angle that can be cycles by their header."""
    if column is not None:
        given = [column] if isinstance(column, int | str) else list(column)
        named = [table.index(one) for one in given]
        if not named or len(set(named)) != len(named) or angle in named:
            raise DataError(f"{table.source}: pressure_column = {given}: give one or several columns beside the angle")
        return named
    first = 0 if angle is None else angle + 1
    possible = [i for i in range(first, table.width) if heads[i].quantity in (None, "pressure")]
    possible = [i for i in table.numeric(possible) if angle is not None or not _counts(table.numbers(i))]
    if not possible and table.width == 1:
        raise DataError(
            f"{table.source}: one column only: give angle and pressure, or for a pressure without an angle column pass "
            f"{argument('angle_step_deg', '')} with the degrees between samples"
        )
    if not possible:
        names = [heads[i].name for i in range(table.width) if i != angle and heads[i].quantity == "pressure"]
        column = argument("pressure_column", repr(names[0]) if names else "")
        raise DataError(f"{table.source}: no pressure behind the angle column: name it, {column}")
    exact = [i for i in possible if heads[i].name == "pressure_bar"]
    if len(possible) == 1 or len(exact) == 1:
        return exact or possible
    cylinders = {heads[i].cylinder for i in possible}
    if table.header is not None and (len(cylinders) > 1 or len({heads[i].series for i in possible}) > 1):
        raise _doubtful(table, possible, "are of several cylinders" if len(cylinders) > 1 else "have unlike names")
    return possible


def _check_alike(table: Table, columns: Sequence[int], degrees: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
    """Refuse columns of which one differs in shape from the first as no other cycle of the cylinder would."""
    odd = odd_shape(degrees, rows)
    if odd is not None:
        names = f"{table.called(columns[odd])} has another shape than {table.called(columns[0])}"
        raise _doubtful(table, columns, f"may not be cycles of one cylinder ({names})")


def odd_shape(degrees: NDArray[np.float64], rows: NDArray[np.float64]) -> int | None:
    """Return the first row that is not of the shape of row 0: another cylinder, or another quantity."""
    step = float(np.median(np.abs(np.diff(degrees))))
    spread = rows - rows.mean(axis=1, keepdims=True)
    norms = np.sqrt((spread**2).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = spread @ spread[0] / (norms * norms[0])
    away = np.abs(rows.argmax(axis=1) - rows[0].argmax()) * step
    away = np.minimum(away, np.abs(720.0 - away))
    odd = np.flatnonzero(~((alike >= _MIN_CORRELATION) & (away <= _PEAK_WITHIN_CAD)))
    return int(odd[0]) if odd.size else None


def _unit_of_pressure(
    table: Table, heads: Sequence[Heading], columns: Sequence[int], unit: str | None, *, gain: bool
) -> tuple[str, bool]:
    """Return the unit of the pressure columns, and whether the file says it; volts need a gain."""
    said = {heads[i].unit for i in columns}
    strange = next((heads[i].strange for i in columns if heads[i].strange), None)
    if strange is not None:
        raise DataError(
            f"{table.source}: the file says {strange!r} for the pressure: convert it to one of "
            f"{', '.join(PRESSURE_UNITS)} first"
        )
    unclear = next((heads[i].unclear for i in columns if heads[i].unit is None and heads[i].unclear), None)
    if unclear is not None and unit is None and not gain:
        raise DataError(
            f"{table.source}: {unclear!r} in the header may be a unit, and none that is known: convert it to one of "
            f"{', '.join(PRESSURE_UNITS)}, or pass {argument('pressure_unit', '')} if the pressure is in one of them"
        )
    if len(said) > 1:
        raise DataError(
            f"{table.source}: pressures in {', '.join(map(str, sorted(said, key=str)))}: name columns of one unit"
        )
    (known,) = said
    volts = known in ("V", "mV")
    foreign = [i for i in columns if heads[i].other]
    if foreign or (known is not None and known not in PRESSURE_UNITS and not volts):
        at = (foreign or list(columns))[0]
        what = f"{table.called(at)} is in {heads[at].other or known}, which is not a pressure"
        raise DataError(f"{table.source}: {what}: name another")
    if volts and not gain:
        raise DataError(
            f"{table.source}: the file says {known} for the pressure: pass {argument('gain_bar_per_v', '')} and "
            f"{argument('offset_bar', '')} of the charge amplifier"
        )
    if gain and (unit is not None or (known is not None and not volts)):
        raise DataError(
            f"{table.source}: {argument('gain_bar_per_v')} is for volts, and the pressure is said to be in "
            f"{unit or known}: give one of them"
        )
    if unit is not None and known is not None and unit != known:
        raise DataError(
            f"{table.source}: the file says {known!r} for the pressure: pass "
            f"{argument('pressure_unit', repr(known))} instead of {unit!r}, or correct the file"
        )
    return (known or "V") if gain else (unit or known or "bar"), known is not None


def _counts(values: NDArray[np.float64]) -> bool:
    """Return whether a column only counts up: samples or a time."""
    steps = np.diff(values)
    return bool(steps.size and steps[0] > 0.0 and np.allclose(steps, steps[0], rtol=1e-3, atol=0.0))


def _doubtful(table: Table, columns: Sequence[int], what: str) -> DataError:
    names = [repr(table.header[i]) if table.header else str(i) for i in columns]
    shown = ", ".join(names if len(names) <= 8 else [*names[:6], "...", names[-1]])
    return DataError(
        f"{table.source}: columns {shown} {what}: name the pressure, for example "
        f"{argument('pressure_column', names[0])}; all cycles of one cylinder are given by all their names"
    )
