"""Columns of any file that a test bench or a program writes: text, MATLAB, HDF5, TDMS, MDF and others, by content.

Every reader gives the columns under the names and with the units that the file gives them, never resampled.
"""

from __future__ import annotations

import contextlib
import io
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.errors import DataError
from mgdd.io.array_files import of_hdf5, of_matlab, of_netcdf, of_numpy, of_parquet
from mgdd.io.array_table import ArrayTable, Columns, naming_damage
from mgdd.io.bounded_reader import open_bounded
from mgdd.io.extras import import_extra
from mgdd.io.files import Stamp, bytes_of, existing_file, read_plain_text
from mgdd.io.recorder_files import of_mdf, of_tdms
from mgdd.io.table import Table, parse_number, read_table, spells_units, text_table
from mgdd.io.text_rows import TextRows

if TYPE_CHECKING:
    import os

__all__ = ["cells_as_text", "format_of", "open_parts", "open_table", "read_any_table", "read_format"]

_HEAD = 128  # bytes that tell a format
_STARTS = {
    b"MATLAB 7.3": "HDF5", b"MATLAB": "MATLAB", b"\x89HDF": "HDF5", b"CDF": "netCDF 3", b"\x93NUMPY": "NumPy",
    b"TDSm": "TDMS", b"MDF ": "MDF", b"UnFinMF": "MDF", b"PAR1": "Parquet", b"PK\x03\x04": "XLSX or NPZ",
}  # fmt: skip
_SPREAD = 16  # columns of a sheet for each that has a cell
_PLAIN = ("netCDF 3", "NumPy")  # mapped as they stand on the disk, neither compressed nor sparse
# Columns may be read from a file that stays open as long as the stack.
_READERS: dict[str, Callable[[Path, contextlib.ExitStack], Columns]] = {
    "HDF5": of_hdf5, "MATLAB": of_matlab, "netCDF 3": of_netcdf, "NumPy": of_numpy, "TDMS": of_tdms, "MDF": of_mdf,
    "Parquet": of_parquet, "XLSX or NPZ": of_numpy,
}  # fmt: skip


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
    form = _form_of(file)
    if form is None:
        yield read_table(path, delimiter=delimiter, decimal=decimal)
        return
    with contextlib.ExitStack() as stack:
        stamp = Stamp.of(file)
        with naming_damage(file):
            found = _opened(form, file, stack)
            table = _table_of(file, stamp, found) if isinstance(found, list) else text_table(*found, delimiter="\t")
        yield table


@contextlib.contextmanager
def open_parts(
    path: str | os.PathLike[str], *, delimiter: str | None = None, decimal: str = "."
) -> Iterator[Callable[[int, int], Table]]:
    """Open a file as `open_table` does, and give what makes a table of some of its rows; text is read as far as asked.

    The rows of a text that are asked for begin at or behind those asked for before.
    """
    file = existing_file(path)
    if _form_of(file) is None:
        with file.open("rb") as stream:
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
    form = _form_of(existing_file(path))
    return "text" if form is None else "HDF5 (or MATLAB 7.3, netCDF 4)" if form == "HDF5" else form


def cells_as_text(path: str | os.PathLike[str]) -> tuple[str, str, bool] | None:
    """Give a text file, or the sheet of an XLSX file as a text with tabs, what to call it, and whether it is a sheet.

    None for a file of columns, which `read_any_table` reads.
    """
    file = existing_file(path)
    form = _form_of(file)
    if form is None:
        return str(file), read_plain_text(file), False
    with naming_damage(file), contextlib.ExitStack() as stack:
        if form == "XLSX or NPZ" and _is_xlsx(file):
            found = _opened(form, file, stack)
            if isinstance(found, tuple):
                return *found, True
    return None


def _form_of(file: Path) -> str | None:
    """Name the format of a binary file by how it begins; None for a text."""
    with file.open("rb") as stream:
        head = stream.read(_HEAD)
    found = next((form for start, form in _STARTS.items() if head.startswith(start)), None)
    if found is None and file.suffix.lower() == ".mat":
        return "MATLAB"  # of version 4, which has no mark
    return found


def _opened(form: str, file: Path, stack: contextlib.ExitStack) -> Columns | tuple[str, str]:
    """Open a file as `read_format` does, in a process with limits where it may claim more than it has."""
    return read_format(form, file, stack) if form in _PLAIN else stack.enter_context(open_bounded(file, form))


def read_format(form: str, file: Path, stack: contextlib.ExitStack) -> Columns | tuple[str, str]:
    """Open a binary file until the stack closes it: its columns, or what to call its sheet and that as a text."""
    if form == "XLSX or NPZ" and _is_xlsx(file):
        return _sheet_text(file)
    return _READERS[form](file, stack)


def _is_xlsx(file: Path) -> bool:
    with zipfile.ZipFile(file) as archive:
        return "[Content_Types].xml" in archive.namelist()


def _sheet_text(file: Path) -> tuple[str, str]:
    """Give the sheet with the most numbers as a text with tabs, with its lines of names, and what to call it."""
    openpyxl = import_extra("openpyxl", "formats", "an XLSX file")
    book = openpyxl.load_workbook(io.BytesIO(bytes_of(file)), read_only=True, data_only=True)
    sheets = {}
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # what it says of its size would be filled with empty cells
        sheets[sheet.title] = [row for row in sheet.iter_rows(values_only=True) if row]
    held = {title: sum(isinstance(cell, int | float) for row in rows for cell in row) for title, rows in sheets.items()}
    title = max(held, key=lambda each: held[each], default="")
    if not held.get(title):
        raise DataError(f"{file}: no sheet has a number in it")
    filled = [{k: _as_text(cell) for k, cell in enumerate(row) if cell not in (None, "")} for row in sheets[title]]
    columns = sorted(set().union(*filled))
    if columns[-1] <= _SPREAD * len(columns):  # else a stray cell far to the right is the next one
        columns = list(range(columns[-1] + 1))
    rows = [[row.get(k, "") for k in columns] for row in filled if row]
    holds = [any(parse_number(cell) is not None for cell in cells) for cells in zip(*rows, strict=True)]
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
