"""A grid as spreadsheets write it: a corner with the names of the axes, breakpoints above and in front."""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Mapping, Sequence, Sized
from typing import NamedTuple

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.column_names import spelled_unit
from mgdd.io.row_text import parse_number
from mgdd.maps.calibration_map import CalibrationMap
from mgdd.maps.written import NOT_GIVEN, Heading, axes_of, heading_of, unit_from, unit_to, without_brackets

_EMPTY = frozenset({"", "-", "--", "–", "nan", "na", "n/a", "#n/a"})  # how a cell without a value is written
_MARKS = (";", "\t", ",", None)  # None: blanks
_LIKE_NUMBER = re.compile(r"[+-]?[.,]?\d(?!/)")  # 1/min is a unit
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:(['’.,\s])\d{3})(?:\1\d{3})*([.,]\d+)?")
_UNIT_KEYS = ("unit", "units", "einheit", "einheiten")

Rows = list[tuple[int, list[str]]]


class _Grid(NamedTuple):
    above: Rows
    head: tuple[int, list[str]]
    units: tuple[int, list[str]] | None
    body: Rows

    @property
    def width(self) -> int:
        return len(self.head[1]) - 1


def map_of_grid(
    text: str, origin: str, *, name: str | None, decimal: str, rows: str | None, columns: str | None, whole: bool
) -> CalibrationMap | None:
    """Read the grid in a text, or give None where there is none; only the rows of a sheet are known to be whole."""
    grids = [grid for mark in _MARKS if mark != decimal for grid in [_grid_in(text, mark, origin)] if grid]
    if not grids:
        return None
    grid = max(grids, key=lambda each: each.width)  # the first of the widest
    above, title, unit, remarks = _preamble(grid.above)
    line, head = grid.head
    value = value_heading(name, title, unit)
    corner = "" if head[0].casefold() in _EMPTY else head[0]
    down, across = axes_of(
        corner, rows=rows, columns=columns, above=above, taken=(value.name,), where=f"{origin}, line {line}"
    )
    if grid.units is not None:
        down, value = _with_units(grid.units, down, value, origin)
    x = [
        number_in(cell, decimal, f"{origin}, line {line}, cell {k}", across.name) for k, cell in enumerate(head[1:], 2)
    ]
    for pair in itertools.pairwise(x):
        require_rise(origin, line, across.name, pair)
    y, values = [], []
    for at, row in grid.body:
        filled, where = trimmed(row), f"{origin}, line {at}"
        if filled and not _like_number(filled[0]) and filled[0].casefold() not in _EMPTY:
            raise DataError(
                f"{where}: {filled[0][:60]!r} is not a breakpoint of {down.name}: remove the line, or begin it with #"
            )
        last = at == grid.body[-1][0] and not whole  # it may be cut off
        if len(filled) - 1 > len(x) or ((len(filled) > 1 or last) and len(row) - 1 < len(x)):
            raise DataError(
                f"{where}: {len(row) - 1} values: {len(x)} are needed, one per column; an empty cell keeps its mark"
                f"{'; the file may be cut off here' if last else ''}"
            )
        y.append(number_in(filled[0], decimal, where, down.name))
        if len(y) > 1:
            require_rise(origin, at, down.name, y[-2:])
        cells = [*filled[1:], *[""] * (len(x) + 1 - len(filled))]
        values.append([number_in(cell, decimal, where, "a value", gap=True) for cell in cells])
    require_two(origin, {down.name: y, across.name: x})
    table = np.array(values)
    return CalibrationMap(
        {down.name: y, across.name: x},
        table,
        name=value.name,
        labels={each.name: (each.unit, each.long_name) for each in (value, down, across)},
        cells={"source": np.where(np.isnan(table), "unattainable", "given")},
        provenance={"remarks": remarks} if remarks else {},
    )


def text_of_grid(table: CalibrationMap) -> str:
    """Write axes, values and units so that `map_of_grid` reads them, a map over one axis as a table of points."""
    heads = {name: f"{name} [{unit_to(label.units)}]" for name, label in table.labels.items()}
    down, *across = table.axes
    cells = table.values.reshape(table.values.shape[0], -1).tolist()
    body = [
        [repr(at), *("" if np.isnan(value) else repr(value) for value in row)]
        for at, row in zip(table.axes[down].tolist(), cells, strict=True)
    ]
    rows = [[heads[down], heads[table.name]], *body]
    if across:
        above = table.axes[across[0]].tolist()
        corner = f"{heads[down]} \\ {heads[across[0]]}"
        rows = [[heads[table.name], *[""] * len(above)], [corner, *map(repr, above)], *body]
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def require_rise(origin: str, line: int, axis: str, pair: Sequence[float]) -> None:
    """Refuse two breakpoints of which the second is not above the first."""
    if not pair[1] > pair[0]:
        raise DataError(
            f"{origin}, line {line}: {axis} = {pair[1]:g} after {pair[0]:g}: breakpoints must increase and stand once"
        )


def require_two(origin: str, axes: Mapping[str, Sized]) -> None:
    """Refuse an axis of a single breakpoint."""
    for name, entries in axes.items():
        if len(entries) < 2:
            raise DataError(
                f"{origin}: {name} has one breakpoint: a map needs two along each axis; add one, or leave the axis out"
            )


def value_heading(name: str | None, label: str, unit: str = "") -> Heading:
    """Give what the values are: called as asked for, else as the file labels them, else ``value``."""
    words, bracket = without_brackets(label)
    if name is None:
        return heading_of(label, unit=unit, fallback="value")
    made = heading_of(name, unit=unit or bracket, fallback=name)
    return made._replace(long_name=words) if words and words != name else made


def number_in(cell: str, decimal: str, where: str, what: str, *, gap: bool = False) -> float:
    """Read a cell; one that is empty is NaN where `gap` allows it."""
    if cell.casefold() in _EMPTY:
        if gap:
            return float("nan")
        raise DataError(f"{where}: the breakpoint of {what} is empty: fill it, or remove its row or column")
    number = parse_number(cell, decimal)
    if number is not None and np.isfinite(number):
        return number
    thousands = _THOUSANDS.fullmatch(cell)
    if thousands is not None:
        remedy = f"{thousands[1]!r} looks like a separator of thousands: remove it"
        if (decimal, thousands[1], thousands[2]) == (".", ",", None):
            remedy += f", or pass {argument('decimal', repr(','))} if it is a decimal mark"
    elif "," in cell and decimal == ".":
        remedy = f"pass {argument('decimal', repr(','))} if the comma is a decimal mark"
    else:
        remedy = "correct it"
    raise DataError(f"{where}: {cell[:60]!r} is not a finite number for {what}: {remedy}")


def trimmed(cells: list[str]) -> list[str]:
    """Leave out the empty cells that a spreadsheet adds at the end of a row."""
    width = len(cells)
    while width and not cells[width - 1]:
        width -= 1
    return cells[:width]


def _like_number(cell: str) -> bool:
    return _LIKE_NUMBER.match(cell) is not None


def _grid_in(text: str, mark: str | None, origin: str) -> _Grid | None:
    """Find the row of breakpoints: numbers behind a corner that is none, above rows that begin with a number."""
    lines = _cells(text, mark, origin)
    for place, (line, cells) in enumerate(lines):
        head = trimmed(cells)
        if len(head) > 1 and all(map(_like_number, head[:2])):
            return None  # rows of numbers begin here
        if (
            len(head) < 3
            or _like_number(head[0])
            or not all(_like_number(c) or c.casefold() in _EMPTY for c in head[1:])
        ):
            continue
        if not any(map(_like_number, head[1:])) or place + 1 == len(lines):
            continue
        below = lines[place + 1]
        units = below if not any(map(_like_number, below[1])) else None
        start = place + 1 + (units is not None)
        body = lines[start:]
        if head[0].casefold() in _EMPTY and place and _names_columns(lines[place - 1][1], len(head)):
            return None
        if body and any(map(_like_number, body[0][1])):
            return _Grid(lines[:place], (line, head), units, body)
    return None


def _names_columns(cells: list[str], width: int) -> bool:
    """Whether a line has a name for every column of a table of points."""
    names = trimmed(cells)
    return len(names) == width and not any(_like_number(cell) or cell.casefold() in _EMPTY for cell in names)


def _cells(text: str, mark: str | None, origin: str) -> Rows:
    """Give the cells of every line with content; of blanks only those behind a corner separate."""
    if mark is None:
        rows = []
        for number, line in enumerate(text.splitlines(), start=1):
            words = line.split()
            first = next((k for k, word in enumerate(words) if _like_number(word)), len(words))
            rows.append((number, [" ".join(words[:first]), *words[first:]] if first else words))
    else:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=mark)
        try:
            rows = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
        except csv.Error as error:
            raise DataError(f"{origin}, line {reader.line_num}: {error}: correct the quotes and cells there") from error
    return [
        (number, cells)
        for number, cells in rows
        if any(cells) and not cells[0].startswith("#") and not "".join(cells).startswith("sep=")
    ]


def _preamble(lines: Rows) -> tuple[str, str, str, str]:
    """Sort the lines above the breakpoints: label of the columns, title, unit of the values, remarks."""
    above = title = unit = ""
    remarks: list[str] = []
    for place, (_, cells) in enumerate(lines):
        filled = [cell for cell in cells if cell.casefold() not in _EMPTY]
        words, bracket = without_brackets(filled[0]) if filled else ("", "")
        if place == len(lines) - 1 and len(filled) == 1 and cells[0] != filled[0]:
            above = filled[0]
        elif len(filled) == 2 and filled[0].casefold().strip(" :") in _UNIT_KEYS:
            unit = filled[1].strip("[]() ")
        elif len(filled) == 1 and not words and bracket and (place or spelled_unit(bracket) is not None):
            unit = bracket
        elif len(filled) == 1 and not title:
            title = filled[0]
        elif filled:
            remarks.append(" ".join(filled))
    return above, title, unit, " ".join("; ".join(remarks).split())


def _with_units(row: tuple[int, list[str]], down: Heading, value: Heading, origin: str) -> tuple[Heading, Heading]:
    """Take the units of a row below the breakpoints: first that of the rows, then that of the values."""
    line, cells = row
    first, *others = ["" if cell.casefold() in _EMPTY else cell.strip("[](){} ") for cell in cells]
    units = sorted({cell for cell in others if cell})
    if len(units) > 1:
        raise DataError(
            f"{origin}, line {line}: units {', '.join(map(repr, units[:3]))}: the values have one; correct them"
        )
    made = []
    for heading, text in ((down, first), (value, units[0] if units else "")):
        unit = unit_from(text, heading.name) if text else heading.unit
        if not heading.unit.startswith(NOT_GIVEN) and unit != heading.unit:
            raise DataError(
                f"{origin}, line {line}: unit {text!r} of {heading.name}: its name or label gives {heading.unit!r}; "
                "correct one of them"
            )
        made.append(heading._replace(unit=unit))
    return made[0], made[1]
