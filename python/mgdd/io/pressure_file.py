"""A table of measured pressure: its columns, its angles in degrees, its pressures in one unit, and what is doubtful."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, argument
from mgdd.io.angle_column import Angle, Reading, angle_of, at_the_speed_of_the_record, headings
from mgdd.io.column_names import Heading
from mgdd.io.cycle_phase import phase_warnings
from mgdd.io.cycles import Cycles, arranged
from mgdd.io.encoder import on_even_angles
from mgdd.io.pressure_checks import (
    MIN_SAMPLES,
    PRESSURE_UNITS,
    check_span,
    check_trace,
    level_warning,
    steep_warning,
)
from mgdd.io.table import Place, Table
from mgdd.io.wrong_channel import no_pressure

# Cycles of one cylinder, fired or not, share their compression; another cylinder has its peak elsewhere.
_MIN_CORRELATION = 0.5
_PEAK_WITHIN_CAD = 40.0
_LARGEST_OFFSET_CAD = 20.0
# A misfire still looks like a late burn by half; the turn of the gas exchange does not look like the other one at all.
_OTHER_TURN = 0.3


class Pressure(NamedTuple):
    """Columns of a pressure: values as rows, the unit, whether the file says it, whether it is absolute, notes."""

    columns: list[int]
    values: NDArray[np.float64]
    unit: str
    unit_of_file: bool
    level: bool
    notes: list[str]


class Record(NamedTuple):
    """Angle [°CA aTDC], pressure [bar] (cycle, angle), what was cut with it (channel, cycle, angle), and notes.

    `taken` and `total` are those of `Cycles`, `rows` the row of each angle in the first cycle; `speed_rpm` is that of a
    time, and `over_time` whether the angle was made of that alone.
    """

    angle: NDArray[np.float64]
    bar: NDArray[np.float64]
    along: NDArray[np.float64]
    notes: list[str]
    taken: tuple[int, ...] | None
    total: int
    rows: NDArray[np.intp]
    speed_rpm: float | None = None
    over_time: bool = False


def cycles_of(table: Table, how: Reading) -> Record:
    """Read the cycles of one cylinder."""
    heads, samples = headings(table), None
    if how.encoder is None and how.angle_step_deg is not None and len(set(table.lengths)) > 1:
        samples = table.lengths[choose_pressure(table, heads, how.pressure_column)[0]]
    angle = angle_of(table, heads, how, samples=samples)
    columns = choose_pressure(table, heads, how.pressure_column, angle)
    return record_of(table, angle, pressure_of(table, heads, columns, how, angle), how)


def pressure_of(
    table: Table,
    heads: Sequence[Heading],
    columns: list[int],
    how: Reading,
    angle: Angle,
) -> Pressure:
    """Take columns for cycles of one cylinder; refuse another shape or unit."""
    gain, notes = how.gain_bar_per_v, []
    unit, unit_of_file = _unit_of_pressure(table, heads, columns, how.pressure_unit, gain=gain is not None)
    values = table.matrix(columns)
    if how.pressure_column is None and len(columns) > 1:
        odd = odd_shape(angle.degrees, values)
        if odd is not None:
            names = f"{table.called(columns[odd])} has another shape than {table.called(columns[0])}"
            raise _doubtful(table, columns, f"may not be cycles of one cylinder ({names})")
    cycles = angle.cycles
    for index, row in zip(columns, values, strict=True):
        looks = no_pressure(row, cycles)
        if looks is not None:
            raise DataError(
                f"{table.source}: {table.called(index)} is not a cylinder pressure: its values are {looks}: name the "
                f"pressure, {argument('pressure_column', '')}"
            )
    level = not any(heads[i].gauge for i in columns)
    if not level:
        notes.append("the file says gauge pressure, 1 atmosphere below the absolute one: peg it")
    if gain is not None:
        values = values * (gain * (1e-3 if unit == "mV" else 1.0)) + (how.offset_bar or 0.0)
        unit, unit_of_file, level = "bar", False, how.offset_bar is not None
        if not level:
            notes.append(f"no {argument('offset_bar')}: the pressure is relative, peg it")
    return Pressure(columns, values, unit, unit_of_file, level, notes)


def record_of(
    table: Table,
    angle: Angle,
    pressure: Pressure,
    how: Reading,
    along: NDArray[np.float64] | None = None,
    *,
    source: str | None = None,
) -> Record:
    """Cut a pressure into cycles, check it, and cut further channels (channel, column, sample) with it."""
    degrees, values, tdc, speed = angle.degrees, pressure.values, how.firing_tdc_deg, how.speed_rpm
    notes, rows, flagged = list(pressure.notes), table.lines, angle.turning is not None
    if angle.turning is not None:
        count, columns, samples = 0 if along is None else len(along), len(values), values.shape[1]
        channels = values if along is None else np.concatenate([values[None], along]).reshape(-1, samples)
        degrees, even, tdc = on_even_angles(
            angle.turning,
            channels,
            step_deg=how.angle_step_deg,
            tdc_deg=float(tdc or 0.0),
            source=source or table.source,
        )
        values, flag = even[:columns], np.broadcast_to(even[-1], (1, columns, degrees.size))
        along = np.concatenate([even[columns:-1].reshape(count, columns, degrees.size), flag])
        speed, rows = angle.turning.speed_rpm, None
        notes += angle.turning.notes
    if angle.made and tdc is None and degrees[-1] > 360.5:
        tdc = 0.0  # angle_start_deg is in °CA aTDC
    over_time = angle.made and how.angle_step_deg is None
    if over_time and tdc is not None and len(values) == 1 and np.isfinite(values).all():
        degrees, speed, more = at_the_speed_of_the_record(degrees, values[0], float(speed or 0.0), tdc, table.source)
        notes += more
    record = checked(
        degrees,
        values,
        along=along,
        unit=pressure.unit,
        angle_unit=angle.unit,
        firing_tdc_deg=tdc,
        before_tdc=how.before_tdc,
        tdc_offset_cad=how.tdc_offset_cad,
        source=source or table.source,
        rows=rows,
        flagged=flagged,
        counts_turns=angle.turning is not None and angle.turning.has_mark,
        level=pressure.level,
        unit_of_file=pressure.unit_of_file,
        over_time=over_time,
    )
    return record._replace(speed_rpm=speed, notes=notes + record.notes, over_time=over_time and angle.turning is None)


def checked(
    degrees: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    along: NDArray[np.float64] | None = None,
    unit: str = "bar",
    angle_unit: str = "deg",
    firing_tdc_deg: float | None,
    before_tdc: bool,
    tdc_offset_cad: float = 0.0,
    source: str,
    rows: Sequence[int] | NDArray[np.int64] | None = None,
    level: bool = True,
    unit_of_file: bool = False,
    over_time: bool = False,
    flagged: bool = False,
    counts_turns: bool = False,
) -> Record:
    """Cut a record into cycles and check them; angles are in degrees, `angle_unit` is what they came in.

    Cycles in which the last channel of `along` is not 0 are left out, and the channel with them, where it is `flagged`.
    """
    if not abs(tdc_offset_cad) <= _LARGEST_OFFSET_CAD:
        raise DataError.of("tdc_offset_cad", tdc_offset_cad, f"within ±{_LARGEST_OFFSET_CAD:g} °CA")
    cut = Cycles(degrees, values[None], np.arange(degrees.size))
    if np.isfinite(degrees).all() and np.isfinite(values).all() and degrees.size >= MIN_SAMPLES:
        check_span(degrees, angle_unit, source, several=firing_tdc_deg is not None)
        place = Place(source, rows)
        together = cut.values if along is None else np.concatenate([cut.values, along])
        cut = arranged(
            degrees,
            together,
            firing_tdc_deg=firing_tdc_deg,
            before_tdc=before_tdc,
            place=place,
            counts_turns=counts_turns,
        )
        if flagged:
            cut = _without_flagged(cut, source)
        _check_turns(cut.degrees, cut.values[0], source)
        degrees, values = cut.degrees - tdc_offset_cad, cut.values[0]
        rows = place.only(cut.rows).rows
    one = values[0] if len(values) == 1 else values  # check_trace names what is not finite or too short
    angle, bar = check_trace(degrees, one, unit=unit, source=source, rows=rows, unit_of_file=unit_of_file)
    doubts = [*level_warning(angle, values, unit), *steep_warning(angle, bar)] if level else []
    doubts += phase_warnings(angle, np.atleast_2d(bar), over_time=over_time, source=source)
    return Record(angle, np.atleast_2d(bar), cut.values[1:], [*cut.notes, *doubts], cut.taken, cut.total, cut.rows)


def _without_flagged(cut: Cycles, source: str) -> Cycles:
    values, bad = cut.values[:-1], cut.values[-1].max(axis=1) > 0.0
    if bad.all():
        raise DataError(
            f"{source}: in each of the {bad.size} cycle(s) the encoder's edges are miscounted or displaced: set the "
            "level of its edges, or record it again"
        )
    if not bad.any():
        return cut._replace(values=values)
    numbers = ", ".join(str(k + 1) for k in np.flatnonzero(bad)[:8])
    which = f"cycle {numbers}{', ...' if bad.sum() > 8 else ''} of {bad.size}"
    note = f"{which} left out: the encoder's edges are miscounted or displaced"
    taken = tuple(int(k) for k in np.flatnonzero(~bad))
    return cut._replace(values=values[:, ~bad], notes=(*cut.notes, note), taken=taken, total=bad.size)


def _check_turns(degrees: NDArray[np.float64], rows: NDArray[np.float64], source: str) -> None:
    """Refuse an angle that returns in every turn where every second turn has another pressure: a cycle has two."""
    step = float(np.median(np.diff(degrees)))
    if len(rows) < 2 or abs(degrees[-1] - degrees[0] + step - 360.0) > 1.5 * step:
        return
    one, other = (rows[k::2].mean(axis=0) for k in (0, 1))
    one, other = one - one.mean(), other - other.mean()
    if one @ other < _OTHER_TURN * np.sqrt((one @ one) * (other @ other)):
        raise DataError(
            f"{source}: the angle returns every 360 degrees, and every second turn has another pressure: it counts "
            f"turns and not cycles: pass {argument('angle_step_deg', format(step, 'g'))} instead of its column, and "
            f"{argument('firing_tdc_deg', '')} with the angle of firing TDC counted from the first sample, 0 to 720"
        )


def choose_pressure(
    table: Table,
    heads: Sequence[Heading],
    column: int | str | Sequence[int | str] | None,
    crank: Angle | None = None,
) -> list[int]:
    """Return the columns of the cycles: those named, or all behind the angle that can be cycles by their header."""
    beside = crank.columns if crank is not None else ()
    angle = crank.column if crank is not None else None
    if column is not None:
        given = [column] if isinstance(column, int | str) else list(column)
        named = [table.index(one) for one in given]
        if not named or len(set(named)) != len(named) or set(beside) & set(named):
            raise DataError(f"{table.source}: pressure_column = {given}: give one or several columns beside the angle")
        return named
    first = 0 if angle is None or crank is None or crank.turning is not None else angle + 1
    others = (i for i in range(first, table.width) if i not in beside)
    possible = [i for i in others if heads[i].quantity in (None, "pressure")]
    if angle is not None:
        possible = [i for i in possible if table.lengths[i] == table.lengths[angle]]
    possible = [i for i in table.numeric(possible) if angle is not None or not _counts(table.numbers(i))]
    if not possible and table.width == 1:
        raise DataError(
            f"{table.source}: one column only: give angle and pressure, or for a pressure without an angle column pass "
            f"{argument('angle_step_deg', '')} with the degrees between samples"
        )
    if not possible:
        names = [heads[i].name for i in range(table.width) if i != angle and heads[i].quantity == "pressure"]
        column = argument("pressure_column", repr(names[0]) if names else "")
        log = "; a log of a throttle is for read_throttle_log" if any("duty" in one.name for one in heads) else ""
        raise DataError(f"{table.source}: no pressure behind the angle column: name it, {column}{log}")
    exact = [i for i in possible if heads[i].name == "pressure_bar"]
    if len(possible) == 1 or len(exact) == 1:
        return exact or possible
    cylinders = {heads[i].cylinder for i in possible}
    if table.header is not None and (len(cylinders) > 1 or len({heads[i].series for i in possible}) > 1):
        raise _doubtful(table, possible, "are of several cylinders" if len(cylinders) > 1 else "have unlike names")
    return possible


def odd_shape(degrees: NDArray[np.float64], rows: NDArray[np.float64]) -> int | None:
    """Return the first row that is not of the shape of row 0: another cylinder, or another quantity."""
    step = float(np.median(np.abs(np.diff(degrees))))
    spread = rows - rows.mean(axis=1, keepdims=True)
    norms = np.sqrt(np.einsum("ij,ij->i", spread, spread))
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
    units = {heads[i].unit for i in columns}
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
    if len(units) > 1:
        raise DataError(
            f"{table.source}: pressures in {', '.join(map(str, sorted(units, key=str)))}: name columns of one unit"
        )
    (file_unit,) = units
    volts = file_unit in ("V", "mV")
    foreign = [i for i in columns if heads[i].other]
    if foreign or (file_unit is not None and file_unit not in PRESSURE_UNITS and not volts):
        at = (foreign or list(columns))[0]
        what = f"{table.called(at)} is in {heads[at].other or file_unit}, which is not a pressure"
        raise DataError(f"{table.source}: {what}: name another")
    if volts and not gain:
        raise DataError(
            f"{table.source}: the file says {file_unit} for the pressure: pass {argument('gain_bar_per_v', '')} and "
            f"{argument('offset_bar', '')} of the charge amplifier"
        )
    if gain and (unit is not None or (file_unit is not None and not volts)):
        raise DataError(
            f"{table.source}: {argument('gain_bar_per_v')} is for volts, and the pressure is given in "
            f"{unit or file_unit}: give one of them"
        )
    if unit is not None and file_unit is not None and unit != file_unit:
        raise DataError(
            f"{table.source}: the file says {file_unit!r} for the pressure: pass "
            f"{argument('pressure_unit', repr(file_unit))} instead of {unit!r}, or correct the file"
        )
    return (file_unit or "V") if gain else (unit or file_unit or "bar"), file_unit is not None


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
