"""The rows of a text as bytes, taken apart and read by the core; where numbers begin, and what stands above them."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mgdd._core import math as core
from mgdd.errors import DataError
from mgdd.io.column_names import bare_unit, spelled_unit

_TAB = 9


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a text that are neither empty nor remarks: where each stands in its bytes, and its line."""

    raw: bytes
    begin: NDArray[np.int64]
    end: NDArray[np.int64]
    line: NDArray[np.int64]
    line_count: int = 0

    @classmethod
    def of(cls, text: str, line: int = 1) -> Rows:
        """Find the rows of a text whose first line has this number."""
        raw = text.encode("utf-8", "surrogatepass")
        return cls(raw, *core.text_rows(raw, line))

    @classmethod
    def joined(cls, parts: Sequence[Rows]) -> Rows:
        """Put the rows of texts that follow each other into one."""
        if len(parts) == 1:
            return parts[0]
        held = [part.raw[int(part.begin[0]) : int(part.end[-1])] if len(part) else b"" for part in parts]
        moved = np.cumsum([0, *(len(raw) for raw in held)])
        starts = [at - (int(part.begin[0]) if len(part) else 0) for at, part in zip(moved, parts, strict=False)]
        return cls(
            b"".join(held),
            np.concatenate([part.begin + at for at, part in zip(starts, parts, strict=True)]),
            np.concatenate([part.end + at for at, part in zip(starts, parts, strict=True)]),
            np.concatenate([part.line for part in parts]),
        )

    def __len__(self) -> int:
        return self.line.size

    def __getitem__(self, index: int) -> tuple[int, str]:
        return int(self.line[index]), self.raw[self.begin[index] : self.end[index]].decode("utf-8", "surrogatepass")

    def __iter__(self) -> Iterator[tuple[int, str]]:
        return map(self.__getitem__, range(len(self)))

    def part(self, start: int, stop: int | None = None) -> Rows:
        """Return some of the rows."""
        own = slice(start, stop)
        return Rows(self.raw, self.begin[own], self.end[own], self.line[own])

    def without_outer_tabs(self, start: int) -> Rows:
        """Return the rows without columns at both ends that are empty from row `start` on and have no name above."""
        raw, begin, end = np.frombuffer(self.raw, np.uint8), self.begin.copy(), self.end.copy()
        for places, before, step in ((end, -1, -1), (begin, 0, 1)):
            while start < len(self):
                empty = raw[places + before] == _TAB
                counts = Rows(self.raw, begin, end, self.line).cell_counts("\t")
                named = ~empty[:start] & (counts[:start] == counts[start])
                if not empty[start:].all() or named.any():
                    break
                np.add(places, step * empty, out=places)
        return Rows(self.raw, begin, end, self.line)

    def cell_counts(self, mark: str | None) -> NDArray[np.int64]:
        """Return the number of cells of each row; without a mark blanks separate them."""
        return core.cell_counts(self.raw, self.begin, self.end, mark or "")

    def numbers(
        self, columns: Sequence[int], mark: str | None, decimal: str
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return columns, which increase, as the rows of an array, and which of them hold finite numbers alone."""
        values, plain = core.row_numbers(self.raw, self.begin, self.end, mark or "", decimal == ",", list(columns))
        return values, np.asarray(plain, np.bool_)


def cells_of(text: str, mark: str | None) -> tuple[str, ...]:
    """Take a row apart; blanks and quotes around a cell do not belong to it."""
    return tuple(cell.strip().strip('"').strip() for cell in text.split(mark))


def parse_number(cell: str, decimal: str = ".") -> float | None:
    """Return the number in a cell, or None when it holds none."""
    if "_" in cell or (decimal == "," and "." in cell):
        return None
    try:
        return float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return None


_ROWS = 4  # of one width, one below the other, are data
_HEADER_ENDS = "***End_of_Header***"  # of LabVIEW, below lines that look like labelled rows
_RATIO = re.compile(r"[^\W\d_]{1,3}\d?/[^\W\d_]{1,4}\d?")  # of units that no list has: g/kWh
_COUNT = re.compile(r"\d{1,9}")  # of columns; `int` refuses thousands of digits


def first_row_of(content: Rows, delimiter: str | None, decimal: str) -> int:
    """Return where the rows of numbers begin: names, units, remarks and the lines of a preamble stand above them."""

    def mark_of(text: str) -> str | None:
        return delimiter if delimiter is not None else separator_of(text, decimal)

    def filled_cells(text: str, mark: str | None) -> tuple[str, ...]:
        cells = cells_of(text, mark)  # without the empty ones that a spreadsheet adds
        return cells[: max((k + 1 for k, cell in enumerate(cells) if cell), default=1)]

    last_head: int | None = None
    for at, (_, text) in enumerate(content):
        mark = mark_of(text)
        cells = filled_cells(text, mark)
        if _is_head(cells):
            continue
        if _like_number(cells[0]) or (not cells[0] and all(_like_number(cell) for cell in cells if cell)):
            return at  # one of another width is refused by its line
        if last_head is None:
            later = ((k, content[k][1]) for k in range(len(content) - 1, at, -1))
            last_head = next((k for k, row in later if _is_head(filled_cells(row, mark_of(row)))), at)
        if at >= last_head:
            return at
        above = filled_cells(content[at - 1][1], mark) if at else ()
        named = len(above) == len(cells) and _is_head(above)  # rows that begin with a label
        below = [filled_cells(row, mark) for _, row in content.part(at + 1, at + _ROWS)]
        if named and all(len(one) == len(cells) and one[0] != _HEADER_ENDS for one in below):
            return at
    return len(content)


def names_and_units(
    heads: Sequence[tuple[str, ...]], width: int
) -> tuple[tuple[str, ...] | None, tuple[str, ...] | None]:
    """Choose the lines above the rows that name the columns and their units; the others are remarks."""
    whole = [cells[:-1] if cells[-1] == "Comment" and len(cells) > width else cells for cells in heads]  # of LabVIEW
    wide = [cells for cells in whole if len(cells) == width or (len(cells) > width and cells[0] == "X_Value")]
    aligned = [cells[len(cells) - width :] for cells in wide]
    # A remark that a spreadsheet made as wide has empty cells instead of names.
    named = [row for row in aligned if 2 * sum(map(bool, row)) > width or spells_units(row)] or aligned[-1:]
    rows = [at for at, cells in enumerate(named) if at and spells_units(cells)]
    if rows:
        return named[rows[-1] - 1], named[rows[-1]]
    if len(heads) == len(named) == 2:
        return named[0], named[1]
    return (named[-1] if named else None), None


def units_filled(
    source: str, content: Rows, heads: Sequence[tuple[str, ...]], mark: str | None, width: int
) -> list[tuple[str, ...]]:
    """Give a row of units below the names an empty cell for each column behind the last that has one."""
    made = list(heads)
    for at in range(1, len(heads)):
        cells = heads[at]
        if not (len(heads[at - 1]) == width > len(cells) and spells_units(cells)):
            continue
        if mark is None:
            raise DataError(
                f"{source}, line {content.line[at]}: {len(cells)} units below {width} names, and blanks do not tell "
                "which column has none: write - for its unit"
            )
        made[at] = (*cells, *("",) * (width - len(cells)))
    return made


def spells_units(cells: Sequence[str]) -> bool:
    """Return whether a row holds units, and nothing else that is not empty."""
    texts = [bare_unit(cell) for cell in cells]
    are_units = [spelled_unit(text) is not None or _RATIO.fullmatch(text) is not None for text in texts if text]
    bracketed = [cell.startswith(("[", "(")) for cell in cells if cell]
    return (bool(are_units) and all(are_units)) or (bool(bracketed) and all(bracketed))


def _is_head(cells: tuple[str, ...]) -> bool:
    """Return whether a row holds names: no numbers, or behind a first name nothing but a count of columns."""
    if not any(_like_number(cell) for cell in cells):
        return True
    counted = [int(cell) for cell in cells[1:] if _COUNT.fullmatch(cell)]
    others = [cell for cell in cells[1:] if cell and not _COUNT.fullmatch(cell)]
    counts_up = all(b - a == 1 for a, b in itertools.pairwise(counted)) and (not counted or not others)
    return not _like_number(cells[0]) and counts_up and all(parse_number(cell) is None for cell in others)


def _like_number(cell: str) -> bool:
    """Return whether a cell holds data, even misspelt, and not a name or unit: a header must not swallow a row."""
    if re.fullmatch(r"1/[^\W\d]+", cell):  # 1/min
        return False
    return parse_number(cell) is not None or re.match(r"[+-]?[.,]?\d", cell) is not None


def separator_of(line: str, decimal: str) -> str | None:
    """Return what separates the cells of a line; None for blanks."""
    for mark in (";", "\t", ","):
        if mark in line and mark != decimal:
            return mark
    return None
