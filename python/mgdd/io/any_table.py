"""Columns of any file that a test bench or a program writes: text, MATLAB, HDF5, TDMS, MDF and others, by content.

Every reader gives the columns under the names and with the units that the file gives them, never resampled.
"""

from __future__ import annotations

import contextlib
import io
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import DataError
from mgdd.io.binary_files import read_netcdf
from mgdd.io.extras import import_extra
from mgdd.io.files import existing_file, read_plain_text
from mgdd.io.hdf5_heaps import check_heaps
from mgdd.io.matlab_tags import check_tags
from mgdd.io.table import Table, parse_number, read_table, spells_units, text_table
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["ArrayTable", "cells_as_text", "format_of", "read_any_table"]

_HEAD = 128  # bytes that tell a format
_CIRCLES = 10_000  # that a reader may go; what many channels share is read as often


_Reader = Callable[[Path], "Table | Iterable[_Column]"]


class _Column(NamedTuple):
    name: str
    values: NDArray[Any]
    unit: str = ""


@dataclass(frozen=True)
class ArrayTable(Table):
    """Columns of a binary file; those of several rasters differ in length."""

    columns: tuple[NDArray[Any], ...]

    @property
    def width(self) -> int:
        """Return the number of columns."""
        return len(self.columns)

    @property
    def height(self) -> int:
        """Return the number of rows of the first column."""
        return len(self.columns[0])

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """Return the number of rows of each column."""
        return tuple(map(len, self.columns))

    def matrix(self, indices: Sequence[int]) -> NDArray[np.float64]:
        """Return columns of one length as the rows of an array."""
        lengths = {len(self.columns[index]) for index in indices}
        if len(lengths) > 1:
            sizes = ", ".join(f"{self.called(index)} has {len(self.columns[index])}" for index in indices)
            raise DataError(f"{self.source}: columns of different rasters, {sizes}: name columns of one")
        return np.array([self.columns[index] for index in indices], np.float64)


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
    file = existing_file(path)
    with file.open("rb") as stream:
        head = stream.read(_HEAD)
    reader = _reader_of(head, file)
    if reader is None:
        return read_table(path, delimiter=delimiter, decimal=decimal)
    with _named_damage(file):
        found = reader(file)
        if isinstance(found, Table):
            return found
        columns = [each for each in found if each.values.size]
    if not columns:
        raise DataError(f"{file}: no column of numbers")
    names = tuple(each.name for each in columns)
    units = tuple(each.unit for each in columns)
    header = None if not any(names) else names
    return ArrayTable(str(file), header, units if any(units) else None, tuple(each.values for each in columns))


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
    with _named_damage(file):
        if reader is _of_zip and _is_xlsx(file):
            return *_sheet_text(file), True
    return None


@contextlib.contextmanager
def _named_damage(file: Path) -> Iterator[None]:
    try:
        yield
    except (ImportError, DataError):
        raise
    except Exception as error:  # of another library: any class
        text = f"{type(error).__name__} {error}".strip()
        raise DataError(f"{file}: cannot be read ({text}): the file was cut off or damaged; write it again") from error


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


def _flat(arrays: Iterable[_Column], along: int | None = None) -> Iterator[_Column]:
    """Give vectors as they are, and a matrix column by column: along the samples of a vector, else its longer side."""
    found = [each._replace(values=np.squeeze(each.values)) for each in arrays]
    found = [each for each in found if each.values.dtype.kind in "fiub" and each.values.ndim in (1, 2)]
    lengths = {len(each.values) for each in found if each.values.ndim == 1} if along is None else {along}
    for each in found:
        if each.values.ndim == 1:
            yield each
            continue
        rows, columns = each.values.shape
        turned = rows not in lengths and (columns in lengths or columns > rows)
        for number, values in enumerate(each.values if turned else each.values.T, start=1):
            yield each._replace(name=f"{each.name} {number}".strip(), values=values)


def _of_matlab(file: Path) -> Iterator[_Column]:
    from scipy.io import loadmat

    check_tags(file.read_bytes(), str(file))
    try:
        content = loadmat(file, squeeze_me=True, struct_as_record=False)
    except Exception as error:
        raise DataError(f"{file}: not a MATLAB file: {error}: save it with save(..., '-v7') or as CSV") from error
    return _flat(
        column for name, value in content.items() if not name.startswith("__") for column in _of_struct(name, value)
    )


def _of_struct(name: str, value: Any) -> Iterator[_Column]:
    for field in getattr(value, "_fieldnames", ()):
        yield from _of_struct(f"{name}.{field}", getattr(value, field))
    if isinstance(value, np.ndarray):
        yield _Column(name, value)


def _of_hdf5(file: Path) -> Iterator[_Column]:
    h5py = import_extra("h5py", "formats", "a file of MATLAB 7.3, HDF5 or netCDF 4")
    found: list[_Column] = []
    check_heaps(file)
    with h5py.File(file, "r") as content:
        matlab = any("MATLAB_class" in item.attrs for item in content.values())

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and not name.startswith("#"):
                values = item[()]
                unit = next((text for key in ("units", "unit") if (text := _text_of_hdf5(h5py, item.attrs, key))), "")
                turned = np.transpose(values) if matlab else np.asarray(values)  # MATLAB writes columns first
                found.append(_Column(name.replace("/", "."), turned, unit))

        content.visititems(visit)
    return _flat(found)


def _text_of_hdf5(h5py: Any, attributes: Any, key: str) -> str:
    """Read an attribute that is a text; one that is damaged to a list of numbers would end the process."""
    if key not in attributes or not isinstance(attributes.get_id(key).get_type(), h5py.h5t.TypeStringID):
        return ""
    text = np.ravel(attributes[key])[0]
    return text.decode() if isinstance(text, bytes) else str(text)


def _of_netcdf(file: Path) -> Iterator[_Column]:
    dataset = read_netcdf(file).transpose(ANGLE, ..., missing_dims="ignore")
    columns = (
        _Column(str(name), dataset[name].to_numpy(), str(dataset[name].attrs.get("units", "")))
        for name in sorted(dataset.variables, key=lambda each: each != ANGLE)  # the angle first, as in a text
    )
    return _flat(columns, along=dataset.sizes.get(ANGLE))


def _of_numpy(file: Path) -> Iterator[_Column]:
    content = np.load(file, allow_pickle=False)
    if isinstance(content, np.ndarray):
        named = content.dtype.names
        return _flat([_Column(name, content[name]) for name in named] if named else [_Column("", content)])
    with content:
        return _flat([_Column(name, content[name]) for name in content.files])


class _Watched(io.BytesIO):
    """A file in memory: of a damaged length it gives what there is, and it notices who reads in a circle."""

    def __init__(self, file: Path) -> None:
        super().__init__(file.read_bytes())
        self._count, self._mark, self._met = 0, -1, 0

    def read(self, size: int | None = -1, /) -> bytes:
        self._count += 1
        if self.tell() == self._mark:
            self._met += 1
            if self._met > _CIRCLES:
                raise ValueError(f"its blocks name each other in a circle, the one at byte {self._mark} among them")
        if self._count.bit_count() == 1:  # a power of two: within the circle in the end (Brent 1980)
            self._mark, self._met = self.tell(), 0
        return super().read(size)


def _of_tdms(file: Path) -> Iterator[_Column]:
    nptdms = import_extra("nptdms", "formats", "a TDMS file")
    content = nptdms.TdmsFile.read(_Watched(file))  # not by its path: an index beside it may be of another record
    if content.file_status.incomplete_final_segment:
        warnings.warn(f"{file}: the record was cut off: its last samples are missing", UserWarning, stacklevel=2)
    channels = [channel for group in content.groups() for channel in group.channels()]
    found: list[_Column] = []
    for channel in channels:
        alone = sum(other.name == channel.name for other in channels) == 1
        name = channel.name if alone else f"{channel.group_name}.{channel.name}"
        timed = "wf_increment" in channel.properties and len(channel)
        if timed and not any(len(each.values) == len(channel) and each.unit == "s" for each in found):
            plain = not found and all(other.name != "time" for other in channels)
            found.append(_Column("time" if plain else f"time ({name})", channel.time_track(), "s"))
        unit = channel.properties.get("unit_string", channel.properties.get("NI_UnitDescription", ""))
        found.append(_Column(name, np.asarray(channel[:]), str(unit)))
    return _flat(found)


def _of_mdf(file: Path) -> Iterator[_Column]:
    asammdf = import_extra("asammdf", "mdf", "an MDF file")
    found: list[_Column] = []
    # Not by its path: in large blocks of a file asammdf believes every size.
    with asammdf.MDF(_Watched(file)) as content:
        for number in range(len(content.groups)):
            for signal in content.select([(None, number, k) for k in _channels(content, number)]):
                if not any(np.array_equal(each.values, signal.timestamps) for each in found if each.unit == "s"):
                    found.append(_Column(f"time {number}" if found else "time", signal.timestamps, "s"))
                found.append(_Column(signal.name, signal.samples, signal.unit))
    return _flat(found)


def _channels(content: Any, number: int) -> list[int]:
    """Give the channels of a group that hold numbers; one that is not within its record is refused.

    On such a channel asammdf ends the process. Numbers of the types stand in "MDF" by ASAM, versions 3.3 and 4.2.
    """
    master, group, out = content.masters_db.get(number), content.groups[number], []
    size, old = int(group.channel_group.samples_byte_nr), content.version < "4"
    rows, held = group.channel_group.cycles_nr, sum(block.original_size for block in group.get_data_blocks())
    if rows * size > held:
        raise ValueError(f"{rows} records of {size} bytes in a group of {held}")
    for k, channel in enumerate(group.channels):
        if not old and channel.channel_type in (3, 6):  # virtual ones stand in no record
            first = bits = 0
        elif old:
            first, bits = channel.start_offset // 8 + channel.additional_byte_offset, channel.bit_count
        else:
            first, bits = channel.byte_offset, channel.bit_offset + channel.bit_count
        end = first + (bits + 7) // 8
        if end > size:
            raise ValueError(f"channel {channel.name!r} ends at byte {end} of a record of {size}")
        numeric = channel.data_type != 7 if old else channel.data_type in (*range(6), 10)  # or the bytes of a bus
        if k != master and numeric and not group.channel_dependencies[k]:
            out.append(k)
    return out


def _of_parquet(file: Path) -> Iterator[_Column]:
    parquet = import_extra("pyarrow.parquet", "parquet", "a Parquet file")
    table = parquet.read_table(file)
    for field in table.schema:
        column, notes = table[field.name], field.metadata or {}
        if str(field.type).startswith(("decimal", "bool")):  # else objects, where cells are empty
            column = column.cast("double")
        unit = notes.get(b"units") or notes.get(b"unit") or b""
        yield from _flat([_Column(field.name, column.to_numpy(), unit.decode())])


def _of_zip(file: Path) -> Table | Iterable[_Column]:
    return _of_xlsx(file) if _is_xlsx(file) else _of_numpy(file)


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
    rows = [row[:width] for row in rows if any(row)]
    holds = [any(k < len(row) and parse_number(row[k]) is not None for row in rows) for k in range(width)]
    text = "\n".join("\t".join(_filled(row, holds)) for row in rows)
    return f"{file}, sheet {title!r}", text


def _filled(row: list[str], holds_numbers: list[bool]) -> list[str]:
    """Mark empty cells, as a tab at an end of the line would be lost; not those beside a remark, which is short."""
    cells = [cell for cell in row if cell]
    if 2 * len(cells) <= len(holds_numbers) and parse_number(cells[0]) is None and not spells_units(cells):
        return cells
    data = any(parse_number(cell) is not None for cell in row)
    return [cell or ("nan" if data and number else "-") for cell, number in zip(row, holds_numbers, strict=False)]


def _as_text(cell: Any) -> str:
    return repr(float(cell)) if isinstance(cell, int | float) else str(cell).replace("\t", " ").replace("\n", " ")


_FORMATS: dict[_Reader, str] = {
    _of_hdf5: "HDF5 (or MATLAB 7.3, netCDF 4)", _of_matlab: "MATLAB", _of_netcdf: "netCDF 3", _of_numpy: "NumPy",
    _of_tdms: "TDMS", _of_mdf: "MDF", _of_parquet: "Parquet", _of_zip: "XLSX or NPZ",
}  # fmt: skip
