"""A calibration map as a CSV grid for spreadsheets: head lines with names and units, then a grid per table."""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, did_you_mean
from mgdd.io.row_text import parse_number
from mgdd.maps.calibration_map import CalibrationMap
from mgdd.maps.cells import NUMBERS, TEXTS, MapTask, spoken_name

_FORMAT = "1"
_HEADS = ("mgdd_map", "value", "rows", "columns", "objective", "limit", "provenance")
_NAMED = ("limit", "provenance")  # heads that may stand in a file several times, each with another name
_VALUE = "value"
_END = "end"  # stands last in a file with the line mgdd_map, so that one that was cut off is known


def csv_of_map(table: CalibrationMap) -> str:
    """Give the text of a file; numbers come back bit for bit."""
    axes = list(table.axes)
    rows: list[list[str]] = [["mgdd_map", _FORMAT], [_VALUE, table.name, *table.labels[table.name]]]
    rows += [[head, axis, *table.labels[axis]] for head, axis in zip(("rows", "columns"), axes, strict=False)]
    if table.task is not None:
        rows.append(["objective", table.task.objective, "highest" if table.task.maximize else "lowest"])
        rows += [["limit", name, _number(upper)] for name, upper in table.task.limits.items()]
    rows += [["provenance", name, text] for name, text in table.provenance.items()]
    for name, column in {_VALUE: table.values, **table.cells}.items():
        missing = NUMBERS[name][1] if name in NUMBERS else np.nan if name == _VALUE else TEXTS[name][1]
        if name != _VALUE and _all_missing(column, missing):
            continue
        rows += [[], ["table", name], *_grid(table, column)]
    rows += [[], [_END]]
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def is_map_csv(text: str) -> bool:
    """Whether a text is in the form of `csv_of_map`, or was meant to be: it names a table, rows or columns."""
    first = [re.split(r"[;\t,]", line.strip().strip('"'), maxsplit=1)[0].strip() for line in text.splitlines()]
    return not any(first) or bool({"mgdd_map", "table", "rows", "columns"} & set(first))


def map_of_csv(text: str, origin: str, decimal: str) -> CalibrationMap:
    """Read what `csv_of_map` wrote, or a spreadsheet or a person did in its form."""
    if decimal not in (".", ","):
        raise DataError.of("decimal", decimal, "'.' or ','")
    first = next((line for line in text.splitlines() if line.strip()), "")
    mark = next(
        (mark for mark in (";", "\t", ",") if mark in first and mark != decimal), ";" if decimal == "," else ","
    )
    reader = csv.reader(io.StringIO(text), delimiter=mark, strict=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:
        raise DataError(f"{origin}, line {reader.line_num}: {error}: correct the quotes and cells there") from error
    heads, blocks = _parts([(number, cells) for number, cells in lines if any(cells)], origin)
    if not lines:
        raise DataError(f"{origin}: the file is empty: no line {_VALUE!r}; write it again")
    if "mgdd_map" in heads and _END not in heads:
        raise DataError(f"{origin}: no line {_END!r} at its end: the file was cut off; write it again")
    names = [heads[head] for head in ("rows", "columns") if head in heads]
    if _VALUE not in heads or not names:
        lack = _VALUE if _VALUE not in heads else "rows"
        example = "value,soc_cad,°CA aTDC" if lack == _VALUE else "rows,speed_rpm,rpm"
        raise DataError(f"{origin}: no line {lack!r}: a map names its value and its axes, for example {example}")
    if _VALUE not in blocks:
        raise DataError(f"{origin}: no line 'table,value': the file ends before its values, or was cut off")
    labels = {head[0]: (head[1], head[2]) for head in (heads[_VALUE], *names)}
    grids: dict[str, Any] = {}
    axes: dict[str, NDArray[np.float64]] = {}
    for name, (number, rows) in blocks.items():
        ended = _END in heads or name != next(reversed(blocks))
        table_axes, grids[name] = _read_grid(
            origin, number, rows, [head[0] for head in names], decimal, is_text=name in TEXTS, ended=ended
        )
        axes = axes or table_axes
        for axis, entries in table_axes.items():
            if not np.array_equal(entries, axes[axis]):
                raise DataError(
                    f"{origin}, line {number}: {axis} of table {name!r} differs from that of the first table"
                )
    values = grids.pop(_VALUE)
    task = heads.get("objective")
    return CalibrationMap(
        axes,
        values,
        name=heads[_VALUE][0],
        labels=labels,
        cells=grids,
        task=None
        if task is None
        else MapTask(objective=task[0], maximize=task[1] != "lowest", limits=_limits(heads, origin, decimal)),
        provenance=heads.get("provenance", {}),
    )


def _number(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value))


def _all_missing(column: NDArray[Any], missing: Any) -> bool:
    if column.dtype.kind == "U":
        return bool((column == missing).all())
    return bool(np.array_equal(column, np.full(column.shape, missing), equal_nan=True))


def _grid(table: CalibrationMap, column: NDArray[Any]) -> list[list[str]]:
    """Give the rows of a table, first its columns' axis where it has one, each with its own breakpoint in front."""
    cells = column.reshape(column.shape[0], -1)
    written = [[str(cell) if column.dtype.kind == "U" else _number(cell) for cell in row] for row in cells]
    axes = [[_number(entry) for entry in entries] for entries in table.axes.values()]
    head = [["", *axes[1]]] if len(axes) == 2 else []
    return [*head, *([first, *row] for first, row in zip(axes[0], written, strict=True))]


def trimmed(cells: list[str]) -> list[str]:
    """Leave out the empty cells that a spreadsheet adds at the end of a row."""
    width = len(cells)
    while width and not cells[width - 1]:
        width -= 1
    return cells[:width]


def _parts(
    lines: list[tuple[int, list[str]]], origin: str
) -> tuple[dict[str, Any], dict[str, tuple[int, list[tuple[int, list[str]]]]]]:
    """Sort the lines into heads and tables."""
    heads: dict[str, Any] = {}
    blocks: dict[str, tuple[int, list[tuple[int, list[str]]]]] = {}
    tables = (_VALUE, *NUMBERS, *TEXTS)
    for number, row in lines:
        where, cells = f"{origin}, line {number}", trimmed(row)
        if cells[0].startswith("#"):
            continue
        if _END in heads:
            raise DataError(f"{where}: {cells[0]!r} behind the line {_END!r}: remove one of them")
        if cells == [_END]:
            heads[_END] = True
            continue
        if cells[0] == "table":
            name = cells[1] if len(cells) > 1 else ""
            if name not in tables or name in blocks:
                raise DataError(f"{where}: table {name!r}: must be one of {', '.join(tables)}, each once")
            blocks[name] = (number, [])
        elif blocks:
            next(reversed(blocks.values()))[1].append((number, row))
        elif cells[0] in (_VALUE, "rows", "columns"):
            if cells[0] in heads or not 3 <= len(cells) <= 4:
                raise DataError(
                    f"{where}: {','.join(cells)}: must be {cells[0]},NAME,UNIT,LONG NAME, once in the file; "
                    "a name with commas stands in quotes"
                )
            heads[cells[0]] = (*cells[1:3], cells[3] if len(cells) > 3 else spoken_name(cells[1]))
        elif cells[0] in heads and (cells[0] not in _NAMED or cells[1:2] in ([name] for name in heads[cells[0]])):
            raise DataError(f"{where}: {','.join(cells)}: stands in the file already: keep one of them")
        elif cells[0] == "objective" and len(cells) == 3 and cells[2] in ("highest", "lowest"):
            heads["objective"] = cells[1:]
        elif cells[0] in _NAMED and len(cells) == 3:
            heads.setdefault(cells[0], {})[cells[1]] = cells[2]
        elif cells[0] == "mgdd_map":
            if cells[1:2] != [_FORMAT]:
                raise DataError(f"{where}: format {cells[1:2]}: this version of mgdd reads format {_FORMAT}")
            heads["mgdd_map"] = _FORMAT
        else:
            near = did_you_mean(cells[0], (*_HEADS, "table")) or f"lines begin with {', '.join((*_HEADS, 'table'))}"
            raise DataError(f"{where}: {','.join(cells)[:60]!r} is not a line of a map: {near}")
    return heads, blocks


def _read_grid(
    origin: str,
    number: int,
    rows: list[tuple[int, list[str]]],
    axes: list[str],
    decimal: str,
    *,
    is_text: bool,
    ended: bool,
) -> tuple[dict[str, NDArray[np.float64]], NDArray[Any]]:
    if len(rows) < len(axes) + 1:
        raise DataError(f"{origin}, line {number}: the table ends after {len(rows)} rows: the file was cut off")
    table_axes: dict[str, NDArray[np.float64]] = {}
    width = 1
    if len(axes) == 2:
        line, head = rows[0]
        if head[0]:
            raise DataError(
                f"{origin}, line {line}: {head[0]!r}: the first row of a table has an empty cell and the entries of "
                f"{axes[1]}"
            )
        table_axes[axes[1]] = np.array([_read(origin, line, cell, decimal, axes[1]) for cell in trimmed(head)[1:]])
        for pair in itertools.pairwise(table_axes[axes[1]]):
            require_rise(origin, line, axes[1], pair)
        width, rows = table_axes[axes[1]].size, rows[1:]
    first, cells = [], []
    for line, row in rows:
        filled = trimmed(row)
        # A row without any value may end where a spreadsheet ends it; in any other a lost cell would shift the rest.
        # The last row of a file without an end mark may be one that was cut off.
        last = not ended and line == rows[-1][0]
        if len(filled) - 1 > width or ((len(filled) > 1 or last) and len(row) - 1 < width):
            cut = "; the file may be cut off here" if last else ""
            raise DataError(
                f"{origin}, line {line}: {len(row) - 1} values: {width} are needed, one per column; an empty cell "
                f"keeps its separator{cut}"
            )
        full = [*filled, *[""] * (width + 1 - len(filled))]
        first.append(_read(origin, line, full[0], decimal, axes[0]))
        if len(first) > 1:
            require_rise(origin, line, axes[0], first[-2:])
        cells.append(full[1:] if is_text else [_read(origin, line, c, decimal, "a value", gap=True) for c in full[1:]])
    table_axes = {axes[0]: np.array(first), **table_axes}
    shape = tuple(entries.size for entries in table_axes.values())
    return table_axes, np.array(cells, np.str_ if is_text else np.float64).reshape(shape)


def require_rise(origin: str, line: int, axis: str, pair: Sequence[float]) -> None:
    """Refuse two breakpoints of which the second is not above the first."""
    if not pair[1] > pair[0]:
        raise DataError(
            f"{origin}, line {line}: {axis} = {pair[1]:g} after {pair[0]:g}: breakpoints must increase and stand once"
        )


def _read(origin: str, line: int, cell: str, decimal: str, what: str, *, gap: bool = False) -> float:
    if gap and not cell:
        return float("nan")
    number = parse_number(cell, decimal)
    if number is None or not np.isfinite(number):
        remedy = "pass decimal=',' if the comma is a decimal mark" if "," in cell and decimal == "." else "correct it"
        raise DataError(f"{origin}, line {line}: {cell!r} is not a finite number for {what}: {remedy}")
    return number


def _limits(heads: Mapping[str, Any], origin: str, decimal: str) -> dict[str, float]:
    limits = heads.get("limit", {})
    return {name: _read(origin, 0, text, decimal, f"limit {name}") for name, text in limits.items()}
