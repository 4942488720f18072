"""Text tables: CSV (comma, semicolon, tab) or blank-separated columns, with optional header and units row."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.existing_file import existing_file

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

__all__ = ["TextTable", "parse_number", "read_table"]


@dataclass(frozen=True)
class TextTable:
    """Cells as text, with the line number (from 1) of each row."""

    source: str
    decimal: str
    header: tuple[str, ...] | None
    units: tuple[str, ...] | None
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def index(self, column: int | str) -> int:
        """Return the position of a column given by position (from 0) or header name."""
        width = len(self.rows[0])
        if isinstance(column, str):
            if self.header is None:
                raise DataError(
                    f"{self.source}: no header, so there is no column {column!r}: give its number, 0 to {width - 1}"
                )
            if self.header.count(column) != 1:
                what = "no column" if column not in self.header else "more than one column"
                names = ", ".join(map(repr, self.header))
                raise DataError(f"{self.source}: {what} {column!r}: the header has {names}")
            column = self.header.index(column)
        if isinstance(column, bool) or not 0 <= column < width:
            raise DataError(f"{self.source}: no column {column}: the {width} column(s) are numbered from 0")
        return column

    def unit(self, index: int) -> str | None:
        """Return what the units row says of a column, without brackets."""
        if self.units is None or index >= len(self.units):
            return None
        return self.units[index].strip("[]() ")

    def numbers(self, index: int) -> NDArray[np.float64]:
        """Return a column as float64, or name the first bad cell with line, column and value."""
        values = np.empty(len(self.rows))
        for position, (line, row) in enumerate(zip(self.lines, self.rows, strict=True)):
            name = f"column {index}" if self.header is None else f"column {self.header[index]!r}"
            where = f"{self.source}, line {line}, {name}"
            if index >= len(row) or not row[index]:
                raise DataError(f"{where}: the cell is empty: fill it or remove the row")
            number = parse_number(row[index], self.decimal)
            if number is None:
                remedy = "correct it or start the line with #"
                if "," in row[index] and self.decimal == ".":
                    remedy = f"pass {argument('decimal', repr(','))} if the comma is a decimal mark"
                raise DataError(f"{where}: {row[index]!r} is not a number: {remedy}")
            if not np.isfinite(number):
                raise DataError(f"{where}: {row[index]!r} is not finite: remove or repair it")
            values[position] = number
        return values


def read_table(
    path: str | os.PathLike[str], *, delimiter: str | None = None, decimal: str = ".", units_row: bool = True
) -> TextTable:
    """Read a text table; `delimiter` None detects it from the first row that is not a comment."""
    if decimal not in (".", ","):
        raise DataError.of("decimal", decimal, "'.' or ','")
    if delimiter is not None and delimiter in ("", decimal):
        raise DataError(f"delimiter = {delimiter!r}: must not be empty or the decimal mark {decimal!r}")
    file = existing_file(path)
    content = [
        (number, line.strip())
        for number, line in enumerate(_text(file).splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not content:
        raise DataError(f"{file}: the file is empty: rows of numbers are needed")
    mark = delimiter if delimiter is not None else _detect(content[0][1], decimal)
    cells = [(line, tuple(cell.strip().strip('"') for cell in text.split(mark))) for line, text in content]
    heads: list[tuple[str, ...]] = []
    if not units_row and cells:
        heads.append(cells.pop(0)[1])  # the caller's tables always have a header, and a row of empty cells is data
    while cells and units_row and len(heads) < 2 and not any(_like_number(cell) for cell in cells[0][1]):
        heads.append(cells.pop(0)[1])
    if not cells and not units_row:
        return TextTable(str(file), decimal, heads[0], None, (), ())
    if not cells:
        raise DataError(f"{file}: no numeric rows below the header: rows of numbers are needed")
    width = len(cells[0][1])
    for number, row in cells:
        if len(row) != width:
            raise DataError(
                f"{file}, line {number}: {len(row)} cell(s) where line {cells[0][0]} has {width}: "
                "every row needs the same columns"
            )
    header = heads[0] if heads and len(heads[0]) == width else None
    units = heads[1] if len(heads) == 2 else None
    lines, rows = zip(*cells, strict=True)
    return TextTable(str(file), decimal, header, units, rows, lines)


def _like_number(cell: str) -> bool:
    """Return whether a cell holds data, even misspelt, and not a name: a header must not swallow a row."""
    return parse_number(cell) is not None or re.match(r"[+-]?[.,]?\d", cell) is not None


def _text(file: Path) -> str:
    raw = file.read_bytes()
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", errors="replace")
    if b"\0" in raw:
        raise DataError(f"{file}: this is a binary file: export it as text (CSV or two columns)")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _detect(line: str, decimal: str) -> str | None:
    for mark in (";", "\t", ","):
        if mark in line and mark != decimal:
            return mark
    return None


def parse_number(cell: str, decimal: str = ".") -> float | None:
    """Return the number in a cell, or None when it holds none."""
    if "_" in cell or (decimal == "," and "." in cell):
        return None
    try:
        return float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return None
