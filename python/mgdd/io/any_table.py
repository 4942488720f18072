"""Columns of any file that a test bench or a program writes: text, MATLAB, HDF5, TDMS, MDF and others, by content.

Every reader gives the columns under the names and with the units that the file gives them, never resampled.
"""

from __future__ import annotations

import contextlib
import io
import os
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, argument, did_you_mean
from mgdd.io.array_files import of_hdf5, of_matlab, of_mdf, of_netcdf, of_numpy, of_parquet, of_tdms
from mgdd.io.array_table import ArrayTable, Columns, Named, columns_of, naming_damage
from mgdd.io.column_names import heading
from mgdd.io.extras import import_extra
from mgdd.io.files import bytes_of, existing_file, read_plain_text
from mgdd.io.row_text import parse_number
from mgdd.io.table import Table, TextTable, read_table, text_table
from mgdd.results.labels import ANGLE

# Arguments that say how the cells of a text or a sheet become columns.
TEXT = ("delimiter", "decimal", "sheet", "cycle_per_row")
_HEAD = 128  # bytes that identify a format
_STARTS = {
    b"MATLAB 7.3": "HDF5", b"MATLAB": "MATLAB", b"\x89HDF": "HDF5", b"CDF": "netCDF 3", b"\x93NUMPY": "NumPy",
    b"TDSm": "TDMS", b"MDF ": "MDF", b"UnFinMF": "MDF", b"PAR1": "Parquet", b"PK\x03\x04": "XLSX or NPZ",
}  # fmt: skip
_SPREAD = 16  # columns of a sheet for each that has a cell
# Columns may be read from a file that stays open as long as the stack.
_READERS: dict[str, Callable[[Path, contextlib.ExitStack], Columns]] = {
    "HDF5": of_hdf5, "MATLAB": of_matlab, "netCDF 3": of_netcdf, "NumPy": of_numpy, "TDMS": of_tdms, "MDF": of_mdf,
    "Parquet": of_parquet, "XLSX or NPZ": of_numpy,
}  # fmt: skip


def read_any_table(path: str | os.PathLike[str], **how: Any) -> Table:
    """Read the columns of a file by its content, whatever its name.

    Text (also with a preamble, as of LabVIEW or INCA), MATLAB 4 to 7.3, HDF5 and netCDF, TDMS, MDF 3 and 4, Parquet,
    NPY and NPZ, XLSX. ``delimiter`` and ``decimal`` are those of `read_table`, for text; ``sheet`` names one of a
    workbook, else it is the one with the most numbers; ``cycle_per_row`` makes a column of each row.
    """
    with open_table(path, **how) as table:
        return table.loaded()


@contextlib.contextmanager
def open_table(
    path: str | os.PathLike[str],
    *,
    delimiter: str | None = None,
    decimal: str = ".",
    sheet: str | None = None,
    cycle_per_row: bool = False,
) -> Iterator[Table]:
    """Open a file as `read_any_table` reads it: columns of a binary one are read where they are asked for."""
    file = existing_file(path)
    form = _form_of(file)
    with contextlib.ExitStack() as stack:
        if form is None:
            table: Table = read_table(path, delimiter=delimiter, decimal=decimal)
        else:
            with naming_damage(file):
                content = _opened(form, file, stack, sheet=sheet, without_side_blocks=True)
                table = _table_of(file, content) if isinstance(content, list) else text_table(*content, delimiter="\t")
        if sheet is not None and (form is None or not isinstance(table, TextTable)):
            raise DataError(f"{file}: no workbook: leave {argument('sheet')} out")
        yield _of_rows(table) if cycle_per_row else table


def _of_rows(table: Table) -> ArrayTable:
    """Make a column of each row: the angle in the first, a cycle in each other, with a name in front of them or not."""
    if not isinstance(table, TextTable):
        raise DataError(f"{table.source}: a matrix is turned as it needs to be: leave {argument('cycle_per_row')} out")
    cells = [row[0] for row in table.cells]
    named = bool(cells) and parse_number(cells[0], table.decimal) is None
    rows = table.matrix(range(int(named), table.width)).T
    names: tuple[str, ...] | None = None
    if named:
        first = cells[0] if heading(cells[0]).quantity in ("angle", "time") else ANGLE
        alike = len({heading(name).series for name in cells[1:]}) == 1  # other names say nothing of the cycles
        names = (first, *(name if alike else "" for name in cells[1:]))
    return ArrayTable(table.source, names, None, tuple(column for *_, column in columns_of(map(_unnamed, rows))))


def _unnamed(row: NDArray[np.float64]) -> Named:
    return Named("", row)


def _table_of(file: Path, columns: Columns) -> ArrayTable:
    if not columns:
        raise DataError(f"{file}: no column of numbers")
    names, units, values = zip(*columns, strict=True)
    header = names if any(names) else None
    return ArrayTable(str(file), header, units if any(units) else None, values, file)


def format_of(path: str | os.PathLike[str]) -> str:
    """Name the format by which `read_any_table` reads a file."""
    form = _form_of(existing_file(path))
    return "text" if form is None else "HDF5 (or MATLAB 7.3, netCDF 4)" if form == "HDF5" else form


def cells_as_text(path: str | os.PathLike[str], sheet: str | None = None) -> tuple[str, str, bool] | None:
    """Give a text file, or the sheet of an XLSX file as a text with tabs, what to call it, and whether it is a sheet.

    None for a file of columns, which `read_any_table` reads.
    """
    file = existing_file(path)
    form = _form_of(file)
    if form == "XLSX or NPZ":
        with naming_damage(file), contextlib.ExitStack() as stack:
            content = _opened(form, file, stack, sheet=sheet) if _is_xlsx(file) else None
            if isinstance(content, tuple):
                return *content, True
    if sheet is not None:
        raise DataError(f"{file}: no workbook: leave {argument('sheet')} out")
    return None if form is not None else (str(file), read_plain_text(file), False)


def _form_of(file: Path) -> str | None:
    """Name the format of a binary file by how it begins; None for a text."""
    with file.open("rb") as stream:
        head = stream.read(_HEAD)
    detected = next((form for start, form in _STARTS.items() if head.startswith(start)), None)
    if detected is None and file.suffix.lower() == ".mat":
        return "MATLAB"  # of version 4, which has no mark
    return detected


def _opened(
    form: str,
    file: Path,
    stack: contextlib.ExitStack,
    *,
    sheet: str | None = None,
    without_side_blocks: bool = False,
) -> Columns | tuple[str, str]:
    """Open a binary file until the stack closes it: its columns, or what to call its sheet and that as a text."""
    if form == "XLSX or NPZ" and _is_xlsx(file):
        return _sheet_text(file, sheet, without_side_blocks=without_side_blocks)
    return _READERS[form](file, stack)


def _is_xlsx(file: Path) -> bool:
    with zipfile.ZipFile(file) as archive:
        return "[Content_Types].xml" in archive.namelist()


def _sheet_text(file: Path, sheet: str | None = None, *, without_side_blocks: bool = False) -> tuple[str, str]:
    """Give a sheet, or that with the most numbers, as a text with tabs and its lines of names; and what to call it."""
    openpyxl = import_extra("openpyxl", "formats", "an XLSX file")
    book = openpyxl.load_workbook(io.BytesIO(bytes_of(file)), read_only=True, data_only=True)
    titles = [each.title for each in book.worksheets]
    if sheet is not None and sheet not in titles:
        near = did_you_mean(sheet, titles) or f"it has {', '.join(map(repr, titles))}"
        raise DataError(f"{file}: {argument('sheet', repr(sheet))}: no such sheet: {near}")
    sheets = {}
    for each in book.worksheets:
        if sheet in (None, each.title):
            each.reset_dimensions()  # what it says of its size would be filled with empty cells
            sheets[each.title] = [row for row in each.iter_rows(values_only=True) if row]
    held = {title: sum(isinstance(cell, int | float) for row in rows for cell in row) for title, rows in sheets.items()}
    title = max(held, key=lambda each: held[each], default="")
    if not held.get(title):
        raise DataError(f"{file}: no sheet has a number in it")
    source = f"{file}, sheet {title!r}"
    filled = [{k: _as_text(cell) for k, cell in enumerate(row) if cell not in (None, "")} for row in sheets[title]]
    columns = sorted(set().union(*filled))
    if columns[-1] <= _SPREAD * len(columns):  # else a stray cell far to the right is the next one
        columns = list(range(columns[-1] + 1))
    rows = [[row.get(k, "") for k in columns] for row in filled if row]
    if without_side_blocks:
        letter = openpyxl.utils.get_column_letter
        rows = _main_block(rows, source, [letter(k + 1) for k in columns])
    return source, "\n".join("\t".join(row) for row in rows)


def _main_block(rows: list[list[str]], source: str, letters: list[str]) -> list[list[str]]:
    """Leave out what stands beside the columns of a record: columns at either end with few cells, as notes have."""
    filled = np.array([sum(1 for row in rows if row[k]) for k in range(len(rows[0]))])
    whole = np.flatnonzero(2 * filled >= filled.max())
    first, last = int(whole[0]), int(whole[-1]) + 1
    aside = [k for k in (*range(first), *range(last, filled.size)) if filled[k]]
    if not any(parse_number(row[k]) is not None for row in rows for k in aside):
        return rows
    names = ", ".join(letters[k] for k in aside)
    warnings.warn(
        f"{source}: column(s) {names} left out: less than half as long as the others, notes beside them",
        UserWarning,
        stacklevel=2,
    )
    return [row[first:last] for row in rows]


def _as_text(cell: Any) -> str:
    return repr(float(cell)) if isinstance(cell, int | float) else str(cell).replace("\t", " ").replace("\n", " ")
