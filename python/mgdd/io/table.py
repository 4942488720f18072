"""Text tables: CSV or blank-separated columns, with what stands above them."""

from __future__ import annotations

import os
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, argument, did_you_mean
from mgdd.io.column_names import bare_unit
from mgdd.io.files import existing_file, read_plain_text
from mgdd.io.row_text import Rows, cells_of, first_row_of, names_and_units, parse_number, separator_of, units_filled
from mgdd.results.units import unit_of

_ANGLES = frozenset({"°CA aTDC", "°CA", "deg", "degree", "cad", "°"})
_NARROW = 4  # columns
_SHOWN = 12  # names of columns in a message


@dataclass(frozen=True)
class Place:
    """How a message calls a sample and a column of a source: by line of a file, or by index."""

    source: str
    rows: Sequence[int] | NDArray[np.int64] | None = None
    columns: Mapping[str, str] | None = None

    def row(self, index: int) -> str:
        """Return "FILE, line 7" or "log, sample 5"."""
        return f"{self.source}, " + (f"sample {index}" if self.rows is None else f"line {self.rows[index]}")

    def span(self, first: int, last: int) -> str:
        """Return "FILE, lines 2 to 1001" or "log, samples 0 to 999"."""
        if self.rows is None:
            return f"{self.source}, samples {first} to {last}"
        return f"{self.source}, lines {self.rows[first]} to {self.rows[last]}"

    def column(self, name: str) -> str:
        """Return how the source calls a column."""
        return f"column {(self.columns or {}).get(name, repr(name))}"

    def cell(self, index: int, name: str) -> str:
        """Return row and column."""
        return f"{self.row(index)}, {self.column(name)}"

    def only(self, samples: NDArray[np.intp]) -> Place:
        """Return the place of some of the samples, in this order."""
        return replace(self, rows=None if self.rows is None else np.asarray(self.rows)[samples])


@dataclass(frozen=True)
class Table(ABC):
    """Columns of a file, called by position from 0 or by the name in the header."""

    source: str
    header: tuple[str, ...] | None
    units: tuple[str, ...] | None

    @property
    def lines(self) -> NDArray[np.int64] | None:
        """Return the line (from 1) of each row; None where a file has no lines."""
        return None

    @property
    @abstractmethod
    def width(self) -> int:
        """Return the number of columns."""

    @property
    @abstractmethod
    def height(self) -> int:
        """Return the number of rows."""

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """Return the number of rows of each column."""
        return (self.height,) * self.width

    def first_row(self) -> tuple[str, ...] | None:
        """Return the cells of the first row below the header as text; None where a file has no lines."""
        return None

    def loaded(self) -> Table:
        """Return the table in memory, for when its file is closed."""
        return self

    @abstractmethod
    def matrix(self, indices: Sequence[int]) -> NDArray[np.float64]:
        """Return columns as the rows of an array, or name the first bad cell."""

    def numeric(self, indices: Sequence[int]) -> list[int]:
        """Return the columns in which any cell holds a number."""
        return list(indices)

    def numbers(self, index: int) -> NDArray[np.float64]:
        """Return a column as float64, or name the first bad cell."""
        values: NDArray[np.float64] = self.matrix([index])[0]
        return values

    def index(self, column: int | str) -> int:
        """Return the position of a column given by position (from 0) or header name."""
        if isinstance(column, str):
            if self.header is None:
                raise DataError(
                    f"{self.source}: without a header no column can be called {column!r}: give its number, 0 to "
                    f"{self.width - 1}, or add a header"
                )
            if self.header.count(column) != 1:
                what = "no column" if column not in self.header else "more than one column"
                names = ", ".join(map(repr, self.header[:_SHOWN])) + (", ..." if len(self.header) > _SHOWN else "")
                near = did_you_mean(column, self.header) if what == "no column" else "give its number, from 0;"
                raise DataError(f"{self.source}: {what} {column!r}: {near}{' ' if near else ''}the header has {names}")
            column = self.header.index(column)
        if isinstance(column, bool) or not 0 <= column < self.width:
            raise DataError(f"{self.source}: no column {column}: the {self.width} column(s) are numbered from 0")
        return column

    def unit(self, index: int) -> str | None:
        """Return what the units row says of a column, without brackets."""
        if self.units is None or index >= len(self.units):
            return None
        return bare_unit(self.units[index])

    def require_units_of_names(self, *texts: str) -> None:
        """Refuse a units row that contradicts the names, which say the units; columns of `texts` have none."""
        for name in self.header or ():
            given, unit = self.unit(self.index(name)), unit_of(name)
            if given in (None, "", "-", unit) or name in texts or (unit in _ANGLES and given in _ANGLES):
                continue
            raise DataError(
                f"{self.source}, column {name!r}: unit {given!r}: must be {unit!r}; convert the values, units stand in "
                "the names"
            )

    def called(self, index: int) -> str:
        """Return what a message calls a column: its name in the header, or its number."""
        return f"column {index}" if self.header is None else f"column {self.header[index]!r}"


@dataclass(frozen=True)
class TextTable(Table):
    """Rows as text, with the line number (from 1) of each."""

    decimal: str
    mark: str | None
    rows: Rows

    @property
    def lines(self) -> NDArray[np.int64]:
        """Return the line (from 1) of each row."""
        return self.rows.line

    @property
    def height(self) -> int:
        """Return the number of rows."""
        return len(self.rows)

    def part(self, start: int, stop: int) -> TextTable:
        """Return the table of some rows."""
        return replace(self, rows=self.rows.part(start, stop))

    @cached_property
    def cells(self) -> tuple[tuple[str, ...], ...]:
        """Return the cells as text."""
        return tuple(cells_of(text, self.mark) for _, text in self.rows)

    def first_row(self) -> tuple[str, ...] | None:
        """Return the cells of the first row below the header as text."""
        return cells_of(self.rows[0][1], self.mark) if self.height else None

    @cached_property
    def width(self) -> int:
        """Return the number of columns, which every row has."""
        return len(self.first_row() or self.header or ())

    def numeric(self, indices: Sequence[int]) -> list[int]:
        """Return the columns in which any cell holds a number."""
        self._read(indices)
        return [i for i in indices if i in self._parsed or self._holds_number(i)]

    def matrix(self, indices: Sequence[int]) -> NDArray[np.float64]:
        """Return columns as the rows of an array, or name the first bad cell."""
        self._read(indices)
        return np.stack([self._parsed[index] if index in self._parsed else self._slow(index) for index in indices])

    @cached_property
    def _parsed(self) -> dict[int, NDArray[np.float64]]:
        """Columns that were read already and hold nothing but finite numbers."""
        return {}

    def _read(self, indices: Sequence[int]) -> None:
        # To find a row's cells costs as much as a few numbers: of a narrow table all columns are read in one go.
        needed = range(self.width) if self.width <= _NARROW and not self._parsed else indices
        lacking = sorted(set(needed) - self._parsed.keys())
        if lacking:
            values, plain = self.rows.numbers(lacking, self.mark, self.decimal)
            self._parsed.update((index, values[k]) for k, index in enumerate(lacking) if plain[k])

    def _holds_number(self, index: int) -> bool:
        return any(index < len(row) and parse_number(row[index], self.decimal) is not None for row in self.cells)

    def _slow(self, index: int) -> NDArray[np.float64]:
        values = np.empty(self.height)
        for position, (line, row) in enumerate(zip(self.lines.tolist(), self.cells, strict=True)):
            where = f"{self.source}, line {line}, {self.called(index)}"
            if index >= len(row) or not row[index]:
                raise DataError(f"{where}: the cell is empty: fill it or remove the row")
            number = parse_number(row[index], self.decimal)
            if number is None:
                remedy = "correct it or start the line with #"
                if position == 0 and self.header is not None:
                    remedy = "if the line is a further one of the header, start it with #, else correct it"
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
    check_text_options(delimiter, decimal)
    file = existing_file(path)
    return text_table(str(file), read_plain_text(path), delimiter=delimiter, decimal=decimal, units_row=units_row)


def check_text_options(delimiter: str | None, decimal: str) -> None:
    """Refuse a decimal mark that is not one, or that separates columns too."""
    DataError.unless(decimal in (".", ","), "decimal", decimal, "'.' or ','")
    if delimiter is not None and delimiter in ("", decimal):
        raise DataError(f"delimiter = {delimiter!r}: must not be empty or the decimal mark {decimal!r}")


def text_table(
    source: str, text: str, *, delimiter: str | None = None, decimal: str = ".", units_row: bool = True
) -> TextTable:
    """Take a text for a table, as `read_table` does; messages call it by its source."""
    content = Rows.of(text)
    if not len(content):
        raise DataError(f"{source}: the file is empty: rows of numbers are needed")
    start = first_row_of(content, delimiter, decimal) if units_row else 1  # tables of ours have one line of names
    shown = content[min(start, len(content) - 1) if units_row else 0][1]
    mark = delimiter if delimiter is not None else separator_of(shown, decimal)
    if mark == "\t" and delimiter is None:
        content = content.without_outer_tabs(start)
    above, body = list(content.part(0, start)), content.part(start)
    heads = [cells_of(row, mark) for _, row in above]
    if not len(body) and units_row:
        raise DataError(f"{source}: no numeric rows below the header: rows of numbers are needed")
    width = int(body.part(0, 1).cell_counts(mark)[0]) if len(body) else len(heads[0])
    require_width(source, body, mark, width, body[0][0] if len(body) else 0)
    _check_commas(source, above, heads, body, mark)
    heads = units_filled(source, content, heads, mark, width)
    header, units = names_and_units(heads, width)
    return TextTable(source, header, units, decimal, mark, body)


def require_width(source: str, body: Rows, mark: str | None, width: int, first: int) -> None:
    """Refuse a row that has not as many cells as the row of line `first`."""
    counts = body.cell_counts(mark)
    odd = np.flatnonzero(counts != width)
    if odd.size:
        at = int(odd[0])
        cut = at == len(body) - 1 and counts[at] < width
        remedy = "; the file is cut off there: remove its last line" if cut else ", or start it with # to leave it out"
        raise DataError(
            f"{source}, line {body.line[at]}: {counts[at]} cell(s) where line {first} has {width}: "
            f"every row needs the same columns{remedy}"
        )


def _check_commas(
    source: str,
    lines: Sequence[tuple[int, str]],
    heads: Sequence[tuple[str, ...]],
    body: Rows,
    mark: str | None,
) -> None:
    """Refuse commas that are decimal marks beside blanks, or separate cells as well: twice as many cells as names."""
    first = body[0][1] if mark == "," and len(body) else "."
    whole = [cell for cell in first.split(",") if len(cell.split()) > 1]
    if whole and re.fullmatch(r'[\d\s",eE+-]+', first):
        raise DataError(
            f"{source}, line {body[0][0]}: {whole[0]!r} between commas: they are decimal marks and blanks separate "
            f"the columns: pass {argument('decimal', repr(','))}"
        )
    if mark != "," or not heads or not len(body) or len(heads[-1]) < 2:
        return
    names, cells = len(heads[-1]), cells_of(body[0][1], mark)
    if len(cells) == 2 * names and all(cell.isdecimal() for cell in cells[1::2]):
        raise DataError(
            f"{source}, line {lines[-1][0]}: {names} columns, and the rows have {len(cells)} cells: commas are "
            "separators and decimal marks as well: write the file with another separator"
        )
