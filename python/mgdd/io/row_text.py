"""The rows of a text as bytes: found, taken apart into cells and read as numbers by the core, without a loop here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mgdd._core import math as core

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
        return int(self.line[index]), self._text(int(self.begin[index]), int(self.end[index]))

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

    def _text(self, begin: int, end: int) -> str:
        return self.raw[begin:end].decode("utf-8", "surrogatepass")


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
