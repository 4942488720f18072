"""Measured pressure in chunks of whole cycles, for files that are larger than memory."""

from __future__ import annotations

import codecs
import inspect
import itertools
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.io.angle_column import Angle, angle_of, headings
from mgdd.io.any_table import TEXT, format_of
from mgdd.io.column_names import Heading
from mgdd.io.cycle_phase import phase_warnings
from mgdd.io.cycles import SAME_ANGLE, several_cycles
from mgdd.io.files import decoded, existing_file
from mgdd.io.pressure import CYCLE, cycles_dataset, read_pressure
from mgdd.io.pressure_file import Pressure, Record, checked, choose_pressure, pressure_of, record_of
from mgdd.io.reading import Reading
from mgdd.io.row_text import Rows
from mgdd.io.table import TextTable, check_text_options, require_width, text_table

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

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
                yield from plan.chunks(cycles, path.name)
                return
    whole = read_pressure(path, **options)
    if CYCLE not in whole.dims:
        whole = whole.expand_dims({CYCLE: [1]})
        whole[CYCLE].attrs.update(units="1", long_name="cycle")
    for at in range(0, whole.sizes[CYCLE], cycles):
        yield whole.isel({CYCLE: slice(at, at + cycles)}).assign_attrs(warnings="" if at else whole.attrs["warnings"])


class _Plan(NamedTuple):
    """Where the cycles of a file stand: sample ``place[i] + every * k`` is angle i of cycle k.

    A cycle needs `reach` samples from its first on; `angles` are those of the first `every` of them [deg, as in the
    file], higher by `turn` a cycle later.
    """

    part: Callable[[int, int], TextTable]
    source: str
    heads: list[Heading]
    how: Reading
    angle: Angle
    column: int
    record: Record
    place: NDArray[np.intp]
    every: int
    reach: int
    angles: NDArray[np.float64]
    turn: float

    @property
    def first(self) -> int:
        """Sample at which the first cycle begins."""
        return int(self.place.min())

    def count(self, samples: int) -> int:
        """Whole cycles in so many samples from the first of one on."""
        return (samples - self.reach) // self.every + 1

    def chunks(self, cycles: int, name: str) -> Iterator[xr.Dataset]:
        """Give the cycles, so many at a time."""
        at, done, mean = self.first, 0, None
        notes = [f"{at} samples before the first cycle left out: incomplete"] if at else []
        asked = cycles * self.every + self.reach  # shows whether another cycle follows
        last = False
        while not last:
            source = f"{self.source} from cycle {done + 1} on" if done else self.source
            samples = self.samples(at, at + asked, source)
            held = samples.values.shape[1]
            last = self.count(held) <= cycles
            count = self.count(held) if last else cycles
            left = held - (count - 1) * self.every - int(np.ptp(self.place)) - 1
            if last and left:
                notes.append(f"{left} samples behind the last cycle left out: incomplete")
            record = self.cut(samples, count, source)
            here = record.bar.mean(axis=0)
            if mean is not None:
                ends = ("the first chunk", f"cycles {done + 1} to {done + count}")
                pair = np.stack([mean, here])
                notes += phase_warnings(record.angle, pair, over_time=False, source=source, ends=ends)
            mean = here if mean is None else mean
            yield cycles_dataset(record._replace(notes=notes + record.notes), name, done + 1)
            at, done, notes = at + count * self.every, done + count, []

    def samples(self, start: int, stop: int, source: str) -> Pressure:
        """Read samples of the pressure, as one row, and refuse angles that are not those of the first cycle."""
        indices = [*self.angle.columns, self.column]
        parts, lines = [np.empty((len(indices), 0))], [np.empty(0, np.int64)]
        following = stop - self.reach  # where the next chunk begins, which must not be passed by
        table = self.part(start, start)
        for at, end in itertools.pairwise([*range(start, following, _ROWS), following, stop]):
            table = self.part(at, end)
            if not table.height:
                break
            parts.append(table.matrix(indices))
            lines.append(table.lines)
        values = np.concatenate(parts, axis=1)
        degrees: NDArray[Any] = np.arange(values.shape[1]) * (self.how.angle_step_deg or 0.0)
        if not self.angle.made:
            degrees = np.rad2deg(values[0]) if self.angle.unit == "rad" else values[0]
            self._require_angles(degrees, start, source, np.concatenate(lines))
        angle = self.angle._replace(degrees=degrees)
        return pressure_of(table, self.heads, [self.column], self.how, angle, values[-1:])

    def cut(self, pressure: Pressure, count: int, source: str) -> Record:
        """Cut samples from the first of a cycle on, and check them."""
        at = self.place - self.first + self.every * np.arange(count)[:, None]
        record = checked(
            self.record.angle,
            pressure.values[0][at],
            unit=pressure.unit,
            firing_tdc_deg=None,
            before_tdc=False,
            source=source,
            level=pressure.level,
            unit_of_file=pressure.unit_of_file,
        )
        return record._replace(notes=[*pressure.notes, *record.notes], speed_rpm=self.record.speed_rpm)

    def _require_angles(self, degrees: NDArray[np.float64], start: int, source: str, lines: NDArray[np.int64]) -> None:
        at = start - self.first + np.arange(degrees.size)
        meant = self.angles[at % self.every] + self.turn * (at // self.every)
        step = float(np.median(np.abs(np.diff(self.angles))))
        bad = np.flatnonzero(~(np.abs(degrees - meant) <= SAME_ANGLE * step))
        if bad.size:
            k = int(bad[0])
            raise DataError(
                f"{source}, line {lines[k]}: the crank angle is {degrees[k]:g}, and {meant[k]:g} if each cycle has the "
                f"{self.every} samples of the first: repair or remove the cycle there; a record whose angles do not "
                "repeat is read whole, by mgdd.io.read_pressure"
            )


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
    pressure = pressure_of(table, heads, columns, how, angle)
    record = record_of(table, angle, pressure, how)
    degrees, first = angle.degrees, int(record.rows.min())
    falls, _ = several_cycles(-degrees if how.before_tdc else degrees)
    every = int(falls[1] - falls[0]) if falls.size > 1 else record.rows.size
    turn = 0.0 if falls.size else 720.0
    # Where cycles are joined of two parts, the second is in the next block of samples, which must be whole.
    joined = np.where(record.rows < record.rows[0], record.rows + every, record.rows)
    for place, reach in ((record.rows, np.ptp(record.rows) + 1), (joined, first + 2 * every - joined.min())):
        angles = degrees[place.min() :][:every]
        plan = _Plan(part, table.source, heads, how, angle, columns[0], record, place, every, int(reach), angles, turn)
        own = pressure._replace(values=pressure.values[:, plan.first :])
        count = plan.count(own.values.shape[1])
        if count == len(record.bar):
            made = plan.cut(own, count, table.source)
            if np.array_equal(made.angle, record.angle) and np.array_equal(made.bar, record.bar):
                return plan
    return None


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
