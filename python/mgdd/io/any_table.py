"""Columns of any file that a test bench or a program writes: text, MATLAB, HDF5, TDMS, MDF and others, by content.

Every reader gives the columns under the names and with the units that the file gives them, never resampled.
"""

from __future__ import annotations

import contextlib
import io
import warnings
import zipfile
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.io.array_table import ArrayTable, Columns, Named, Reversed, Samples, columns_of, naming_damage
from mgdd.io.extras import import_extra
from mgdd.io.files import Stamp, existing_file, read_plain_text
from mgdd.io.matlab_tags import check_tags
from mgdd.io.table import Table, parse_number, read_table, text_table
from mgdd.io.text_rows import TextRows
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

__all__ = ["cells_as_text", "format_of", "open_parts", "open_table", "read_any_table"]

_HEAD = 128  # bytes that tell a format


# Columns may be read from a file that stays open as long as the stack.
_Reader = Callable[[Path, contextlib.ExitStack], "Table | Columns"]


def read_any_table(path: str | os.PathLike[str], *, delimiter: str | None = None, decimal: str = ".") -> Table:
    """Read the columns of a file by its content, whatever its name.

    Text (also with a preamble, as of LabVIEW or INCA), MATLAB 4 to 7.3, HDF5 and netCDF, TDMS, MDF 3 and 4, Parquet,
    NPY and NPZ, XLSX. ``delimiter`` and ``decimal`` are those of `read_table`, for text.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.DataError
        Nothing with numbers in it, or a file that its own library cannot read.
    ImportError
        The extra that reads the format is not installed; the message names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from mgdd.io.any_table import read_any_table
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "log.npz"
    ...     np.savez(file, time_s=np.arange(3.0), duty=np.zeros(3))
    ...     table = read_any_table(file)
    >>> table.header, table.numbers(0).tolist()
    (('time_s', 'duty'), [0.0, 1.0, 2.0])
    """
    with open_table(path, delimiter=delimiter, decimal=decimal) as table:
        return table.loaded()


@contextlib.contextmanager
def open_table(path: str | os.PathLike[str], *, delimiter: str | None = None, decimal: str = ".") -> Iterator[Table]:
    """Open a file as `read_any_table` reads it: columns of a binary one are read where they are asked for."""
    file = existing_file(path)
    with file.open("rb") as stream:
        reader = _reader_of(stream.read(_HEAD), file)
    if reader is None:
        yield read_table(path, delimiter=delimiter, decimal=decimal)
        return
    with contextlib.ExitStack() as stack:
        stamp = Stamp.of(file)
        with naming_damage(file):
            found = reader(file, stack)
            table = found if isinstance(found, Table) else _table_of(file, stamp, found)
        yield table


@contextlib.contextmanager
def open_parts(
    path: str | os.PathLike[str], *, delimiter: str | None = None, decimal: str = "."
) -> Iterator[Callable[[int, int], Table]]:
    """Open a file as `open_table` does, and give what makes a table of some of its rows; text is read as far as asked.

    The rows of a text that are asked for begin at or behind those asked for before.
    """
    file = existing_file(path)
    with file.open("rb") as stream:
        text = _reader_of(stream.read(_HEAD), file) is None
        if text:
            yield TextRows(file, stream, delimiter=delimiter, decimal=decimal).part
            return
    with open_table(file) as table:
        yield table.part


def _table_of(file: Path, stamp: Stamp, columns: Columns) -> ArrayTable:
    if not columns:
        raise DataError(f"{file}: no column of numbers")
    names, units, values = zip(*columns, strict=True)
    header = names if any(names) else None
    return ArrayTable(str(file), header, units if any(units) else None, values, stamp)


def format_of(path: str | os.PathLike[str]) -> str:
    """Name the format by which `read_any_table` reads a file."""
    file = existing_file(path)
    with file.open("rb") as stream:
        reader = _reader_of(stream.read(_HEAD), file)
    return "text" if reader is None else _FORMATS[reader]


def cells_as_text(path: str | os.PathLike[str]) -> tuple[str, str, bool] | None:
    """Give a text file, or the sheet of an XLSX file as a text with tabs, what to call it, and whether it is a sheet.

    None for a file of columns, which `read_any_table` reads.
    """
    file = existing_file(path)
    with file.open("rb") as stream:
        reader = _reader_of(stream.read(_HEAD), file)
    if reader is None:
        return str(file), read_plain_text(file), False
    with naming_damage(file):
        if reader is _of_zip and _is_xlsx(file):
            return *_sheet_text(file), True
    return None


def _reader_of(head: bytes, file: Path) -> _Reader | None:
    starts: dict[bytes, _Reader] = {
        b"MATLAB 7.3": _of_hdf5, b"MATLAB": _of_matlab, b"\x89HDF": _of_hdf5, b"CDF": _of_netcdf,
        b"\x93NUMPY": _of_numpy, b"TDSm": _of_tdms, b"MDF ": _of_mdf, b"UnFinMF": _of_mdf, b"PAR1": _of_parquet,
        b"PK\x03\x04": _of_zip,
    }  # fmt: skip
    found = next((reader for start, reader in starts.items() if head.startswith(start)), None)
    if found is None and file.suffix.lower() == ".mat":
        return _of_matlab  # of version 4, which has no mark
    return found


def _of_matlab(file: Path, _: contextlib.ExitStack) -> Columns:
    from scipy.io import loadmat

    check_tags(file.read_bytes(), str(file))
    try:
        content = loadmat(file, squeeze_me=True, struct_as_record=False)
    except Exception as error:
        raise DataError(f"{file}: not a MATLAB file: {error}: save it with save(..., '-v7') or as CSV") from error
    return columns_of(
        column for name, value in content.items() if not name.startswith("__") for column in _of_struct(name, value)
    )


def _of_struct(name: str, value: Any) -> Iterator[Named]:
    for field in getattr(value, "_fieldnames", ()):
        yield from _of_struct(f"{name}.{field}", getattr(value, field))
    if isinstance(value, np.ndarray):
        yield Named(name, value)


def _of_hdf5(file: Path, stack: contextlib.ExitStack) -> Columns:
    h5py = import_extra("h5py", "formats", "a file of MATLAB 7.3, HDF5 or netCDF 4")
    found: list[Named] = []
    content = stack.enter_context(h5py.File(file, "r"))
    matlab = any("MATLAB_class" in item.attrs for item in content.values())

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.shape is not None and not name.startswith("#"):
            unit = next((item.attrs[key] for key in ("units", "unit") if key in item.attrs), "")
            unit = unit.decode() if isinstance(unit, bytes) else str(unit)
            found.append(Named(name.replace("/", "."), Reversed(item) if matlab else item, unit))

    content.visititems(visit)
    return columns_of(found)


def _of_netcdf(file: Path, stack: contextlib.ExitStack) -> Columns:
    import xarray as xr

    dataset = stack.enter_context(xr.open_dataset(file, engine="scipy"))
    found = []
    for name in sorted(dataset.variables, key=lambda each: each != ANGLE):  # the angle first, as in a text
        variable = dataset[name].variable
        turned = variable.dims[-1:] == (ANGLE,)
        found.append(Named(str(name), Reversed(variable) if turned else variable, str(variable.attrs.get("units", ""))))
    return columns_of(found, along=dataset.sizes.get(ANGLE))


def _of_numpy(file: Path, stack: contextlib.ExitStack) -> Columns:
    content = np.load(file, mmap_mode="r", allow_pickle=False)
    if isinstance(content, np.ndarray):
        named = content.dtype.names
        return columns_of([Named(name, content[name]) for name in named] if named else [Named("", content)])
    stack.enter_context(content)
    members = (name.removesuffix(".npy") for name in content.zip.namelist() if name.endswith(".npy"))
    return columns_of(Named(name, _Member(content, name)) for name in members)


class _Member:
    """An array of an NPZ file, which holds it compressed: read whole, once, where any of it is asked for."""

    def __init__(self, archive: Any, name: str) -> None:
        self._archive, self._name = archive, name
        with archive.zip.open(f"{name}.npy") as stream:
            form = np.lib.format
            read = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}
            header = read.get(form.read_magic(stream))  # another version holds records, no columns
            found: tuple[Any, bool, Any] = header(stream) if header else ((), False, np.dtype(object))
            self.shape, _, self.dtype = found

    @cached_property
    def _values(self) -> NDArray[Any]:
        values: NDArray[Any] = self._archive[self._name]
        return values

    def __getitem__(self, index: Any) -> Any:
        return self._values[index]


def _of_tdms(file: Path, stack: contextlib.ExitStack) -> Columns:
    nptdms = import_extra("nptdms", "formats", "a TDMS file")
    content = stack.enter_context(nptdms.TdmsFile.open(file))
    if content.file_status.incomplete_final_segment:
        warnings.warn(f"{file}: the record was cut off: its last samples are missing", UserWarning, stacklevel=2)
    channels = [channel for group in content.groups() for channel in group.channels()]
    found: list[Named] = []
    for channel in channels:
        count = len(channel)
        alone = sum(other.name == channel.name for other in channels) == 1
        name = channel.name if alone else f"{channel.group_name}.{channel.name}"
        timed = "wf_increment" in channel.properties and count
        if timed and not any(each.values.shape == (count,) and each.unit == "s" for each in found):
            time = Samples(count, np.float64, partial(_part_of, channel.time_track))
            found.append(Named(f"time ({name})" if found else "time", time, "s"))
        unit = channel.properties.get("unit_string", channel.properties.get("NI_UnitDescription", ""))
        found.append(Named(name, Samples(count, channel.dtype, partial(_sliced, channel)), str(unit)))
    return columns_of(found)


def _part_of(whole: Callable[[], NDArray[Any]], start: int, stop: int) -> NDArray[Any]:
    return whole()[start:stop]


def _sliced(values: Any, start: int, stop: int) -> NDArray[Any]:
    found: NDArray[Any] = values[start:stop]
    return found


def _of_mdf(file: Path, stack: contextlib.ExitStack) -> Columns:
    asammdf = import_extra("asammdf", "mdf", "an MDF file")
    found: list[Named] = []
    content = stack.enter_context(asammdf.MDF(file))
    for number, group in enumerate(content.groups):
        own = _channels(content, number)
        count = group.channel_group.cycles_nr
        if not own or not count:
            continue
        master = partial(_records, content.get_master, number)
        if not _has_time(found, count, master):
            found.append(Named(f"time {number}" if found else "time", Samples(count, np.float64, master), "s"))
        for k in own:
            read = partial(_records, partial(_samples, content, number), k)
            first, channel = read(0, 1), group.channels[k]
            if first.ndim == 1:
                found.append(Named(channel.name, Samples(count, first.dtype, read), _unit_of(content, number, k)))
            else:
                whole = content.select([(None, number, k)])[0]
                found.append(Named(whole.name, whole.samples, whole.unit))
    return columns_of(found)


def _has_time(found: list[Named], count: int, master: Callable[[int, int], NDArray[Any]]) -> bool:
    """Whether a column of seconds holds these times already."""
    times = [each.values for each in found if each.unit == "s" and each.values.shape == (count,)]
    return bool(times) and any(np.array_equal(each[(slice(None),)], master(0, count)) for each in times)


def _samples(content: Any, group: int, index: int, **part: int) -> NDArray[Any]:
    values, _ = content.get(group=group, index=index, samples_only=True, ignore_invalidation_bits=True, **part)
    found: NDArray[Any] = values
    return found


def _records(read: Callable[..., NDArray[Any]], index: int, start: int, stop: int) -> NDArray[Any]:
    return read(index, record_offset=start, record_count=stop - start)


def _unit_of(content: Any, group: int, index: int) -> str:
    return str(content.get(group=group, index=index, record_count=1).unit)


def _channels(content: Any, number: int) -> list[int]:
    master = content.masters_db.get(number)
    return [k for k in range(len(content.groups[number].channels)) if k != master]


def _of_parquet(file: Path, stack: contextlib.ExitStack) -> Columns:
    parquet = import_extra("pyarrow.parquet", "parquet", "a Parquet file")
    content = stack.enter_context(parquet.ParquetFile(file))
    found = []
    for field in content.schema_arrow:
        notes = field.metadata or {}
        unit = (notes.get(b"units") or notes.get(b"unit") or b"").decode()
        found.append(Named(field.name, _ArrowColumn(content, field), unit))
    return columns_of(found)


class _ArrowColumn:
    """A column of a Parquet file, read by groups of rows; the last one is kept for rows that follow."""

    def __init__(self, content: Any, field: Any) -> None:
        self._content, self._name = content, field.name
        meta = content.metadata
        self._ends = np.cumsum([meta.row_group(k).num_rows for k in range(meta.num_row_groups)], dtype=np.int64)
        self.shape = (meta.num_rows,)
        try:
            self.dtype = np.dtype(field.type.to_pandas_dtype())
        except (NotImplementedError, TypeError):
            self.dtype = np.dtype(object)
        self._kept: tuple[int, NDArray[Any]] = (-1, np.empty(0))

    def __getitem__(self, index: tuple[slice]) -> NDArray[Any]:
        start, stop, _ = index[0].indices(self.shape[0])
        first, last = (int(np.searchsorted(self._ends, at, side="right")) for at in (start, max(stop - 1, start)))
        begin = int(self._ends[first - 1]) if first else 0
        parts = [self._group(k) for k in range(first, min(last + 1, self._ends.size))]
        return np.concatenate(parts)[start - begin : stop - begin]

    def _group(self, number: int) -> NDArray[Any]:
        if self._kept[0] != number:
            found = self._content.read_row_group(number, columns=[self._name])[self._name]
            self._kept = number, (found.cast("float64") if self.dtype.kind == "b" else found).to_numpy()
        return self._kept[1]


def _of_zip(file: Path, stack: contextlib.ExitStack) -> Table | Columns:
    return _of_xlsx(file) if _is_xlsx(file) else _of_numpy(file, stack)


def _is_xlsx(file: Path) -> bool:
    with zipfile.ZipFile(file) as archive:
        return "[Content_Types].xml" in archive.namelist()


def _of_xlsx(file: Path) -> Table:
    source, text = _sheet_text(file)
    return text_table(source, text, delimiter="\t")


def _sheet_text(file: Path) -> tuple[str, str]:
    """Give the sheet with the most numbers as a text with tabs, with its lines of names, and what to call it."""
    openpyxl = import_extra("openpyxl", "formats", "an XLSX file")
    book = openpyxl.load_workbook(io.BytesIO(file.read_bytes()), read_only=True, data_only=True)
    sheets = {sheet.title: list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets}
    held = {title: sum(isinstance(cell, int | float) for row in rows for cell in row) for title, rows in sheets.items()}
    title = max(held, key=lambda each: held[each], default="")
    if not held.get(title):
        raise DataError(f"{file}: no sheet has a number in it")
    rows = [["" if cell is None else _as_text(cell) for cell in row] for row in sheets[title]]
    width = max(1 + k for row in rows for k, cell in enumerate(row) if cell)
    text = "\n".join("\t".join(_filled(row[:width])) for row in rows if any(row))
    return f"{file}, sheet {title!r}", text


def _filled(row: list[str]) -> list[str]:
    """Mark empty cells: a tab at an end of the line would be lost."""
    mark = "nan" if any(parse_number(cell) is not None for cell in row) else "-"
    return [cell or mark for cell in row]


def _as_text(cell: Any) -> str:
    return repr(float(cell)) if isinstance(cell, int | float) else str(cell).replace("\t", " ").replace("\n", " ")


_FORMATS: dict[_Reader, str] = {
    _of_hdf5: "HDF5 (or MATLAB 7.3, netCDF 4)", _of_matlab: "MATLAB", _of_netcdf: "netCDF 3", _of_numpy: "NumPy",
    _of_tdms: "TDMS", _of_mdf: "MDF", _of_parquet: "Parquet", _of_zip: "XLSX or NPZ",
}  # fmt: skip
