"""Which columns of a test-cell file are which channel: cylinder pressures, others over angle, and slower rasters."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from mgdd.errors import DataError, argument, did_you_mean
from mgdd.io.angle_column import Angle, Reading, angle_of, headings
from mgdd.io.column_names import TIME_UNITS, Heading, last_number, spelled_unit, stated_unit, stem, without_brackets
from mgdd.io.pressure import CYCLE
from mgdd.io.pressure_file import choose_pressure, odd_shape
from mgdd.io.table import Table
from mgdd.results.labels import ANGLE, VARIABLES
from mgdd.results.units import attribute_units

Kind = Literal["pressure", "fast", "slow", "other"]
# Of units that no expression of a units library spells so.
_WRITTEN = {"°c": "degC", "degc": "degC", "nm": "N m", "n m": "N m", "n·m": "N m", "1/min": "rpm", "min-1": "rpm"}
_LONGEST_NUMBER = 4
_TEMPERATURE = re.compile(r"(?<![^\W_])T(?![^\W_])")  # without a unit; a time is a small t


@dataclass(frozen=True)
class Channel:
    """One channel: its name here, its columns (several are cycles), and what it is over.

    `time` is the column of the time of a slow one; `units` is as figures print it, None where the file gives none.
    """

    name: str
    columns: tuple[int, ...]
    kind: Kind
    units: str | None
    source: str
    time: int | None = None


class Layout(NamedTuple):
    """The angle of a file, its channels, and how the angle is called."""

    heads: list[Heading]
    angle: Angle
    channels: list[Channel]
    how: Reading
    angle_source: str


def layout_of(table: Table, how: Reading) -> Layout:
    """Find angle, cylinder pressures, other channels of their raster, and the columns of other rasters."""
    heads = headings(table)
    times = _times(table, heads)
    numeric = table.numeric(range(table.width))
    if how.encoder is None and how.angle_column is None and how.angle_step_deg is None and heads[0].quantity != "angle":
        how = replace(how, angle_column=next((i for i in numeric if heads[i].quantity == "angle"), None))
    samples, clock = None, None
    if how.encoder is None and how.angle_step_deg is not None:
        at = _first_pressure(table, heads, how, numeric)
        samples, clock = table.lengths[at], _clock(table, heads, times, at)
    angle = angle_of(table, heads, how, samples=samples)
    if angle.column is not None:
        samples, clock = angle.degrees.size, _clock(table, heads, times, angle.column)
    fast = [
        i
        for i in numeric
        if i not in angle.columns and table.lengths[i] == samples and _clock(table, heads, times, i) == clock
    ]
    groups = _pressures(table, heads, how, angle, fast)
    taken = {i for group in groups for i in group}
    channels = _named_pressures(table, heads, groups)
    used = {ANGLE, CYCLE, *(channel.name for channel in channels)}
    for group in _series(table, heads, [i for i in fast if i not in taken], groups[0]):
        channels.append(_channel(table, heads, group, "fast", used))
    quick, clocks = set(fast), set(times)
    for i in numeric:
        if i in quick or i in angle.columns or i in clocks or _numbers_cycles(table, heads[i], i):
            continue
        clock = _clock(table, heads, times, i)
        channels.append(_channel(table, heads, (i,), "other" if clock is None else "slow", used, clock))
    source = f"{argument('angle_step_deg', f'{how.angle_step_deg:g}')}" if angle.column is None else ""
    return Layout(heads, angle, channels, how, source or table.called(angle.column or 0))


def kept_channels(table: Table, layout: Layout, names: Sequence[str] | None) -> list[Channel]:
    """Return the channels that are asked for by their name, or by that of a column of theirs; all for None."""
    if names is None:
        return layout.channels
    if isinstance(names, str):
        names = [names]
    by_name: dict[str, Channel] = {}
    for channel in layout.channels:
        header = [table.header[i] for i in channel.columns] if table.header else []
        stems = [stem(header[0])] if len(header) > 1 else []
        by_name |= dict.fromkeys((*stems, *header, channel.name), channel)
    strange = next((name for name in names if name not in by_name), None)
    if strange is not None:
        have = columns_shown([channel.name for channel in layout.channels])
        near = did_you_mean(str(strange), by_name)
        raise DataError(
            f"{table.source}: {argument('channels', repr(strange))}: {near or 'no such channel'}; there are {have}"
        )
    chosen = {by_name[name].name for name in names}
    return [channel for channel in layout.channels if channel.name in chosen]


def columns_shown(names: Sequence[str]) -> str:
    """List names, the inner ones of many left out."""
    quoted = [repr(name) for name in names]
    return ", ".join(quoted if len(quoted) <= 8 else [*quoted[:6], "...", quoted[-1]])


def _first_pressure(table: Table, heads: Sequence[Heading], how: Reading, numeric: Sequence[int]) -> int:
    given = how.pressure_column
    if given is not None:
        return table.index(given if isinstance(given, int | str) else next(iter(given)))
    return next((i for i in numeric if heads[i].quantity == "pressure"), 0)


def _times(table: Table, heads: Sequence[Heading]) -> list[int]:
    """Return the columns that can be the time of a raster: they are called so, and rise."""
    if table.lines is not None:
        return []  # a text has one raster
    called = [i for i, head in enumerate(heads) if head.quantity == "time" and head.unit in (None, *TIME_UNITS)]
    called = [i for i in called if heads[i].strange is None and heads[i].unclear is None]  # a unit such as min
    called = [i for i in called if heads[i].unit or not _TEMPERATURE.search(heads[i].name)]
    return [i for i in called if np.all(np.diff(table.numbers(i)) > 0.0)]


def _clock(table: Table, heads: Sequence[Heading], times: Sequence[int], index: int) -> int | None:
    """Return the time of a column's raster: the one of its length, of several that a reader made the last before it."""
    own = [i for i in times if table.lengths[i] == table.lengths[index]]
    made = [i for i in own if re.fullmatch(r"time( \d+| \(.*\))?", heads[i].name) and i <= index]
    return made[-1] if len(own) > 1 and made else next(iter(own), None)


def _pressures(
    table: Table, heads: Sequence[Heading], how: Reading, angle: Angle, fast: Sequence[int]
) -> list[tuple[int, ...]]:
    """Return the columns of each cylinder's pressure."""
    pressures = [i for i in fast if heads[i].quantity == "pressure"]
    exact = [i for i in pressures if heads[i].name == "pressure_bar"]
    if how.pressure_column is not None or not pressures:
        columns = choose_pressure(table, heads, how.pressure_column, angle)
        if how.pressure_column is None:
            return [tuple(columns)]
    else:
        columns = exact if len(exact) == 1 else pressures
    if foreign := [i for i in columns if i not in fast]:
        raise DataError(
            f"{table.source}: {table.called(foreign[0])} has another raster than the crank angle, "
            f"{table.lengths[foreign[0]]} samples instead of {angle.degrees.size}: name a pressure of its raster, "
            f"{argument('pressure_column', '')}"
        )
    groups = _grouped(table, heads, columns)
    out: list[tuple[int, ...]] = []
    for group in groups:
        cycles = len(group) > 1 and angle.cycles < 1.5
        alike = cycles and (table.header is None or odd_shape(angle.degrees, table.matrix(group)) is None)
        out += [group] if alike else [(i,) for i in group]
    sizes = {len(group) for group in out}
    if len(sizes) > 1:
        shown = "; ".join(columns_shown([table.called(i).removeprefix("column ").strip("'") for i in g]) for g in out)
        raise DataError(
            f"{table.source}: the cylinders have {' and '.join(map(str, sorted(sizes)))} columns ({shown}): name those "
            f"of one, {argument('pressure_column', '')}"
        )
    return sorted(out)


def _numbers_cycles(table: Table, head: Heading, index: int) -> bool:
    return head.name == CYCLE and np.array_equal(table.numbers(index), np.arange(1, table.lengths[index] + 1))


def _grouped(table: Table, heads: Sequence[Heading], columns: Sequence[int]) -> list[tuple[int, ...]]:
    """Put columns of one name together that differ in their last number, and in no cylinder."""
    groups: dict[object, list[int]] = {}
    for i in columns:
        key = (stem(heads[i].name).lower(), heads[i].cylinder, stated_unit(heads[i].name, table.unit(i)))
        groups.setdefault(key, []).append(i)
    return [tuple(group) for group in groups.values()]


def _series(
    table: Table, heads: Sequence[Heading], columns: Sequence[int], pressure: Sequence[int]
) -> list[tuple[int, ...]]:
    """Put columns of one name together that are numbered as the cycles of the pressure."""
    groups = _grouped(table, heads, columns) if table.header is not None else [(i,) for i in columns]

    def numbers(group: Sequence[int]) -> list[str | None]:
        return [last_number(heads[i].name) for i in group]

    target = numbers(pressure)
    return sorted(part for group in groups for part in ([group] if numbers(group) == target else [(i,) for i in group]))


def _named_pressures(table: Table, heads: Sequence[Heading], groups: Sequence[tuple[int, ...]]) -> list[Channel]:
    """Call one pressure pressure_bar, several by the number of their cylinder, or by their order."""
    first = [heads[group[0]] for group in groups]
    numbers = [head.cylinder or last_number(head.name) for head in first]
    sure = all(number is not None and len(number) < _LONGEST_NUMBER for number in numbers)
    if not sure or len({int(number or 0) for number in numbers}) < len(numbers):
        numbers = [str(k + 1) for k in range(len(groups))]
    names = [f"pressure_{int(number or 0)}_bar" for number in numbers] if len(groups) > 1 else ["pressure_bar"]
    return [
        Channel(name, group, "pressure", "bar", _source(table, group))
        for name, group in zip(names, groups, strict=True)
    ]


def _channel(
    table: Table,
    heads: Sequence[Heading],
    columns: tuple[int, ...],
    kind: Kind,
    used: set[str],
    time: int | None = None,
) -> Channel:
    """Name a channel as none in `used` is, and add its name there."""
    index = columns[0]
    header = heads[index].name
    unit = stated_unit(header, table.unit(index))
    units = None if unit is None else _printed(unit)
    words = stem(header) if len(columns) > 1 else without_brackets(header)
    name = re.sub(r"\W+", "_", words).strip("_") or f"column_{index}"
    name = f"c_{name}" if name[0].isdigit() else name
    name_units = VARIABLES[name].units if name in VARIABLES else units
    reserved = name in used or re.fullmatch(r"time_\d+_s", name)
    if reserved or attribute_units(name_units or "-") != attribute_units(units or "-"):
        name = f"{name}_of_file"
    tried = itertools.chain([name], (f"{name}_{k}" for k in itertools.count(2)))
    name = next(each for each in tried if each not in used)
    used.add(name)
    return Channel(name, columns, kind, units, _source(table, columns), time)


def _source(table: Table, columns: Sequence[int]) -> str:
    first, last = table.called(columns[0]), table.called(columns[-1])
    if len(columns) == 1:
        return first
    return f"columns {first.removeprefix('column ')} to {last.removeprefix('column ')}, one per cycle"


def _printed(text: str) -> str:
    """Return a unit as results print it; one that is not a product of units is kept as a remark."""
    unit = spelled_unit(text)
    bare = text.strip().strip("[](){}").strip()
    if unit in (None, "other"):
        written = _WRITTEN.get(bare.lower(), re.sub(r"(?<=[A-Za-z])([23])(?!\d)", r"^\1", bare))
    else:
        written = re.sub(r"(?<=[A-Za-z])2$", "^2", unit or "")
    try:
        attribute_units(written)
    except ValueError:
        return f"unit of {bare}"
    return written
