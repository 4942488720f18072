"""Measured pressure in chunks of whole cycles, for files that are larger than memory."""

from __future__ import annotations

import codecs
import inspect
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.io.angle_column import Reading, angle_of, headings
from mgdd.io.any_table import TEXT, format_of
from mgdd.io.cycle_phase import phase_warnings
from mgdd.io.cycles import SAME_ANGLE, several_cycles
from mgdd.io.files import decoded, existing_file
from mgdd.io.pressure import CYCLE, cycles_dataset, read_pressure
from mgdd.io.pressure_file import Record, choose_pressure, cycles_of
from mgdd.io.row_text import Rows
from mgdd.io.table import TextTable, check_text_options, require_width, text_table

if TYPE_CHECKING:
    import xarray as xr

# Rows that are looked at first, four times as many until they hold some cycles; and rows of text in memory at a time.
_ROWS, _CYCLES = 1 << 16, 4
_BLOCK = 1 << 20  # bytes of a text; names and what stands above them must be within
_LONGEST_LINE = 1 << 24  # bytes, of a text without ends of lines


def pressure_chunks(path: str | os.PathLike[str], *, cycles: int = 200, **options: Any) -> Iterator[xr.Dataset]:
    """Read a file of measured pressure in chunks of whole cycles: about one of them is in memory.

    Together the chunks are what `read_pressure` gives of the whole file, bit for bit. A text is read in parts where its
    cycles stand one below the other, or run on in steps that divide 720 degrees; what stands over time, beside an
    encoder or in a column per cycle is read whole, and so are other formats: see "Formats".

    Parameters
    ----------
    path : path-like
        The file.
    cycles : int
        Cycles of a chunk; the last one may have fewer.
    **options
        All of `read_pressure`.

    Yields
    ------
    xarray.Dataset
        ``pressure_bar(cycle, crank_angle_cad)`` with the attributes of `read_pressure`; ``cycle`` goes on from chunk to
        chunk, ``attrs["warnings"]`` is what is doubtful in this chunk, or between the first one and it.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.ParameterError
        ``cycles`` below 1.
    mgdd.errors.DataError
        All that `read_pressure` refuses, when the first chunk is asked for or the one that has it; a cycle whose angles
        are not those of the first. What was given before stays valid.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from mgdd.io import pressure_chunks
    >>> angle = np.arange(-180.0, 180.0)
    >>> cycle = 1.5 + 50.0 * np.exp(-((angle / 30.0) ** 2))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "cycles.csv"
    ...     np.savetxt(file, np.column_stack([np.tile(angle, 500), np.tile(cycle, 500)]), "%.17g", ",")
    ...     for chunk in pressure_chunks(file, cycles=200):
    ...         print(chunk["cycle"].values[[0, -1]], float(chunk["pressure_bar"].max()))
    [  1 200] 51.5
    [201 400] 51.5
    [401 500] 51.5
    """
    if isinstance(cycles, bool) or not isinstance(cycles, int | np.integer) or cycles < 1:
        raise ParameterError.of("cycles", cycles, "a whole number >= 1")
    given = inspect.signature(read_pressure).bind(path, **options)
    given.apply_defaults()
    how = Reading.of(given.arguments)
    text = {name: given.arguments[name] for name in TEXT}
    return _chunks(existing_file(path), int(cycles), how, text, options)


def _chunks(
    path: Path, cycles: int, how: Reading, text: dict[str, Any], options: dict[str, Any]
) -> Iterator[xr.Dataset]:
    if how.encoder is None and format_of(path) == "text" and text["sheet"] is None and not text["cycle_per_row"]:
        with path.open("rb") as stream:
            rows = TextRows(path, stream, delimiter=text["delimiter"], decimal=text["decimal"])
            plan = _planned(rows.part, how)
            if plan is not None:
                yield from plan.chunks(rows, cycles, path.name)
                return
    whole = read_pressure(path, **options)
    if CYCLE not in whole.dims:
        whole = whole.expand_dims({CYCLE: [1]})
        whole[CYCLE].attrs.update(units="1", long_name="cycle")
    for at in range(0, whole.sizes[CYCLE], cycles):
        yield whole.isel({CYCLE: slice(at, at + cycles)}).assign_attrs(warnings="" if at else whole.attrs["warnings"])


class _Plan(NamedTuple):
    """How a file is cut: rows before its first cycle, rows of a cycle, and rows that the last one needs beside these.

    Rows from ``every * k`` on are then read as the file would be if it began there.
    """

    how: Reading
    first: Record
    head: int
    every: int
    spare: int

    def chunks(self, rows: TextRows, cycles: int, name: str) -> Iterator[xr.Dataset]:
        """Give the cycles, so many at a time."""
        done, mean, last = 0, None, False
        notes = [f"{self.head} samples before the first cycle left out: incomplete"] if self.head else []
        while not last:
            again = min(done, 1)  # a single cycle of an angle that runs on would be taken for one in 0 to 720 degrees
            start, asked = (done - again) * self.every, self.head + (again + cycles) * self.every + self.spare
            table = rows.part(start, start + asked + self.every)
            last = table.height < asked + self.every  # else another cycle follows
            record = self.cycles_in(table if last else table.part(0, asked), done - again)
            count = len(record.bar) - again
            left = table.height - self.head - len(record.bar) * self.every
            if last and left:
                notes.append(f"{left} samples behind the last cycle left out: incomplete")
            record = record._replace(bar=record.bar[again:])
            here = record.bar.mean(axis=0)
            if mean is not None:
                ends = ("the first chunk", f"cycles {done + 1} to {done + count}")
                pair = np.stack([mean, here])
                notes += phase_warnings(record.angle, pair, over_time=False, source=table.source, ends=ends)
            mean = here if mean is None else mean
            yield cycles_dataset(record._replace(notes=notes + record.notes), name, done + 1)
            done, notes = done + count, []

    def cycles_in(self, table: TextTable, done: int) -> Record:
        """Read the cycles behind those that are `done`; they must stand as the first ones do."""
        source = f"{table.source} from cycle {done + 1} on" if done else table.source
        record = cycles_of(replace(table, source=source), self.how)
        step = float(np.median(np.diff(self.first.angle)))
        whole = (table.height - self.head - self.spare) // self.every
        alike = np.array_equal(record.rows, self.first.rows) and len(record.bar) == whole
        if not alike or np.abs(record.angle - self.first.angle).max() > SAME_ANGLE * step:
            raise DataError(
                f"{source}, lines {table.lines[0]} to {table.lines[-1]}: other crank angles than those of the first "
                "cycles: repair or remove the cycle there; a record whose angles do not repeat is read whole, by "
                "mgdd.io.read_pressure"
            )
        notes = [note for note in record.notes if "left out: incomplete" not in note]
        return record._replace(angle=self.first.angle, notes=notes)


def _planned(part: Callable[[int, int], TextTable], how: Reading) -> _Plan | None:
    """Look at the first cycles as `read_pressure` does; None for a record that must be read whole."""
    rows = _ROWS
    while True:
        table = part(0, rows)
        heads = headings(table)
        angle = angle_of(table, heads, how)
        samples = angle.degrees.size
        if samples < rows or angle.cycles >= _CYCLES:
            break
        rows *= 4
    if angle.made and how.angle_step_deg is None:
        return None  # the speed is judged by the whole record
    columns = choose_pressure(table, heads, how.pressure_column, angle)
    if samples < rows or len(columns) > 1:
        return None  # short, or a column per cycle
    how = replace(how, pressure_column=columns)
    record = cycles_of(table, how)
    falls, _ = several_cycles(-angle.degrees if how.before_tdc else angle.degrees)
    every = int(falls[1] - falls[0]) if falls.size > 1 else record.rows.size
    head = int(record.rows.min())
    again, two = cycles_of(table.part(every, samples), how), cycles_of(table.part(0, head + 2 * every), how)
    if not np.array_equal(again.bar, record.bar[1:]):
        return None  # steps that do not divide a cycle, or samples that are missing
    return _Plan(how, record, head, every, spare=(2 - len(two.bar)) * every)


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
