"""Rows of a text table, read from the disk as they are asked for."""

from __future__ import annotations

import codecs
from dataclasses import replace
from pathlib import Path
from typing import IO

from mgdd.io.files import Stamp, decoded
from mgdd.io.table import TextTable, check_text_options, content_of, require_width, text_table

__all__ = ["TextRows"]

_BLOCK = 1 << 20  # bytes; names and what stands above them must be within
_LONGEST_LINE = 1 << 24  # bytes, of a text without ends of lines


class TextRows:
    r"""The rows of a text file; in memory are those from the first that was asked for last.

    Parameters
    ----------
    file : Path
        The file.
    stream : file object
        The same, open for its bytes; it must stay open.
    delimiter, decimal
        As in `mgdd.io.table.read_table`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io.text_rows import TextRows
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "log.csv"
    ...     _ = file.write_text("time_s,duty" + "".join(f"\n{k},{k}e-1" for k in range(9)))
    ...     with file.open("rb") as stream:
    ...         table = TextRows(file, stream).part(3, 5)
    >>> table.header, table.lines, table.numbers(1).tolist()
    (('time_s', 'duty'), (5, 6), [0.3, 0.4])
    """

    def __init__(self, file: Path, stream: IO[bytes], *, delimiter: str | None = None, decimal: str = ".") -> None:
        check_text_options(delimiter, decimal)
        self._stream, self._stamp, self._line = stream, Stamp.of(file), 1
        stream.seek(0)
        self._head = text_table(str(file), self._block(), delimiter=delimiter, decimal=decimal)
        self._lines, self._texts = list(self._head.numbered), list(self._head.texts)
        self._first, self._start = self._lines[0], 0
        self._head = replace(self._head, texts=self._head.texts[:1], numbered=self._head.numbered[:1])

    def part(self, start: int, stop: int) -> TextTable:
        """Return the table of some rows; they begin at or behind those asked for before."""
        if start < self._start:
            raise IndexError(f"row {start}: rows before {self._start} were left behind")
        self._drop(start)
        while self._start + len(self._lines) < stop:
            line = self._line
            if not (text := self._block()):
                break
            body = content_of(text, line)
            require_width(self._head.source, body, self._head.mark, self._head.width, self._first)
            self._lines += [number for number, _ in body]
            self._texts += [row for _, row in body]
            self._drop(start)
        own = slice(0, stop - start)
        return replace(self._head, texts=tuple(self._texts[own]), numbered=tuple(self._lines[own]))

    def _drop(self, start: int) -> None:
        count = min(max(start - self._start, 0), len(self._lines))
        self._start += count
        del self._lines[:count], self._texts[:count]

    def _block(self) -> str:
        """Read on to an end of a line; nothing at the end of the file."""
        self._stamp.require_same()
        raw = self._stream.read(_BLOCK)
        if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and self._line == 1:
            raw += self._stream.read()  # an end of a line is of two bytes there
        elif raw and b"\0" not in raw:  # of a binary file the end of a line may be far
            raw += self._stream.readline(_LONGEST_LINE)
        self._stamp.require_same()
        text = decoded(raw, str(self._stamp.file), line=self._line)
        self._line += len(text.splitlines())
        return text
