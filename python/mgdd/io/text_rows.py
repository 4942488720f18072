"""Rows of a text table, read from the disk as they are asked for."""

from __future__ import annotations

import codecs
from dataclasses import replace
from pathlib import Path
from typing import IO

from mgdd.io.files import decoded
from mgdd.io.row_text import Rows
from mgdd.io.table import TextTable, check_text_options, require_width, text_table

_BLOCK = 1 << 20  # bytes; names and what stands above them must be within
_LONGEST_LINE = 1 << 24  # bytes, of a text without ends of lines


class TextRows:
    """The rows of a text file; in memory are those from the first that was asked for last."""

    def __init__(self, file: Path, stream: IO[bytes], *, delimiter: str | None = None, decimal: str = ".") -> None:
        check_text_options(delimiter, decimal)
        self._stream, self._source, self._line = stream, str(file), 1
        stream.seek(0)
        self._head = text_table(str(file), self._block(), delimiter=delimiter, decimal=decimal)
        self._rows, self._first, self._start = self._head.rows, int(self._head.lines[0]), 0
        self._head = self._head.part(0, 1)

    def part(self, start: int, stop: int) -> TextTable:
        """Return the table of some rows; they begin at or behind those asked for before."""
        if start < self._start:
            raise IndexError(f"row {start}: rows before {self._start} were left behind")
        blocks = [self._drop(self._rows, start)]
        while self._start + sum(map(len, blocks)) < stop:
            line = self._line
            if not (text := self._block()):
                break
            body = Rows.of(text, line)
            if self._head.mark == "\t" and len(body) and body.part(0, 1).cell_counts("\t")[0] > self._head.width:
                body = body.without_outer_tabs(0)
            require_width(self._head.source, body, self._head.mark, self._head.width, self._first)
            blocks.append(self._drop(body, start))
        self._rows = Rows.joined(blocks)
        return replace(self._head, rows=self._rows.part(0, stop - start))

    def _drop(self, rows: Rows, start: int) -> Rows:
        """Leave out the rows before `start`, of which the first of these is the one at `self._start`."""
        count = min(max(start - self._start, 0), len(rows))
        self._start += count
        return rows.part(count)

    def _block(self) -> str:
        """Read on to an end of a line; nothing at the end of the file."""
        raw = self._stream.read(_BLOCK)
        if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and self._line == 1:
            raw += self._stream.read()  # an end of a line is of two bytes there
        elif raw and b"\0" not in raw:  # of a binary file the end of a line may be far
            raw += self._stream.readline(_LONGEST_LINE)
        text = decoded(raw, self._source, line=self._line)
        self._line += Rows.of(text).line_count
        return text
