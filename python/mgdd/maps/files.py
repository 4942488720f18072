"""Files of calibration maps: any form is read by its content; each is written whole or is as it was before."""

from __future__ import annotations

import codecs
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.errors import DataError, Error, ParameterError, argument, did_you_mean
from mgdd.io.any_table import cells_as_text, read_any_table
from mgdd.io.binary_files import read_netcdf, write_netcdf
from mgdd.io.files import existing_file, write_whole_text
from mgdd.io.point_table import POINT
from mgdd.io.table import text_table
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.maps.cdfx import is_xml
from mgdd.maps.dcm_files import read_dcm, write_labels
from mgdd.maps.plain_grid import map_of_grid, text_of_grid
from mgdd.maps.point_list import map_of_points

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

_ENDINGS = (".nc", ".csv", ".dcm", ".cdfx")
_HEAD = 1 << 16  # bytes that identify a form


def write_map(
    table: CalibrationMap | xr.Dataset | Sequence[CalibrationMap] | Mapping[str, CalibrationMap],
    path: str | os.PathLike[str],
    *,
    values: Mapping[str, tuple[float, str]] | None = None,
    encoding: str = "utf-8",
) -> None:
    r"""Write a map in the form that the ending of the file selects; DCM and CDFX hold several, and single values.

    Parameters
    ----------
    table : CalibrationMap, or the Dataset of one
        The map. For DCM and CDFX also a sequence of maps, or a mapping of the names of their labels to them.
    path : path-like
        ``.nc`` (netCDF) holds everything, as `CalibrationMap.save`. The others hold axes, values and units, for other
        programs: ``.csv`` as a grid for spreadsheets; ``.dcm`` and ``.cdfx`` (ASAM CDF 2.0) for calibration tools, with
        long names, the first axis as x and the provenance as comments. An existing file is replaced in one step.
    values : mapping of str to (float, str), optional
        Single values with their units, for DCM and CDFX.
    encoding : {"utf-8", "latin-1", "cp1252"}
        Of a DCM or CDFX file; older tools read Latin-1 only.

    Raises
    ------
    mgdd.errors.ParameterError
        Another ending, or several maps or values for a file that holds one map.
    mgdd.errors.DataError
        In DCM or CDFX a cell without a value, a name twice, a letter that `encoding` does not have, in DCM a text with
        a quote. Nothing is written then.
    OSError
        The file cannot be written; one that was there is as before.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.maps import CalibrationMap, read_map, write_map
    >>> soc = CalibrationMap({"speed_rpm": [900, 1500], "fuel_mg": [6, 20]}, [[-1, -4], [-2, -6]], name="soc_cad")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "soc.csv"
    ...     write_map(soc, file)
    ...     print(file.read_text(encoding="utf-8"), end="")
    ...     read_map(file) == soc
    soc_cad [°CA aTDC],,
    speed_rpm [rpm] \ fuel_mg [mg],6.0,20.0
    900.0,-1.0,-4.0
    1500.0,-2.0,-6.0
    True
    """
    ending = _ending(path)
    several = isinstance(table, list | tuple) or (isinstance(table, Mapping) and not hasattr(table, "data_vars"))
    maps: Any = table if several else [map_of(table)]
    if ending in (".dcm", ".cdfx"):
        write_labels(maps, path, values=values, encoding=encoding)
        return
    if several or values:
        raise ParameterError(f"{path}: holds one map; several, and single values, go into a .dcm file or a .cdfx file")
    if encoding != "utf-8":
        raise ParameterError.of("encoding", encoding, "'utf-8' in this form; a .dcm or .cdfx file may have others")
    (single,) = maps
    if ending == ".nc":
        write_netcdf(single.to_dataset(), path)
    else:
        write_whole_text(path, text_of_grid(single))


def read_map(
    path: str | os.PathLike[str],
    name: str | None = None,
    *,
    decimal: str = ".",
    rows: str | None = None,
    columns: str | None = None,
    sheet: str | None = None,
) -> CalibrationMap:
    r"""Read a map of any form by the content of the file, whatever its name.

    Parameters
    ----------
    path : path-like
        What `write_map` writes; DCM and CDFX of other tools; a grid of a spreadsheet (text or XLSX) with breakpoints
        above and in front of its values; a table with a row per point, or vectors and a matrix over them, in any format
        that `mgdd.io.any_table.read_any_table` reads.
    name : str, optional
        Which map, variable or column of values, where the file holds several; in a grid what the values are.
    decimal : {".", ","}
        Decimal mark of a text file.
    rows : str, optional
        Axis that runs down a grid, by its label in the corner or by the name that it gets; in a table the column of the
        first axis; as the file states if left out.
    columns : str, optional
        The same of the axis that runs across, the second one.
    sheet : str, optional
        Of a workbook the sheet; None takes the one with the most numbers.

    Returns
    -------
    CalibrationMap
        What the file holds; of netCDF equal to the one that was written. Cells that are empty are ``unattainable``;
        points of a table that are repeated count with their mean, which ``provenance`` states.

    Warns
    -----
    UserWarning
        A grid does not name an axis.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.ParameterError
        A name that the file does not have, `rows` or `columns` where a file names its axes.
    mgdd.errors.DataError
        A file that is cut off, lacks an axis, repeats a breakpoint, has another unit than by its names, another number
        of values, a corner that leaves open which axis runs down, or points that are no grid; the message names file,
        line or field, and remedy.
    ImportError
        The extra that reads the format is not installed; the message names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.errors import DataError
    >>> from mgdd.maps import read_map
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "soc.csv"
    ...     _ = file.write_text("fuel_mg [kg],soc_cad\n6,-1\n20,-4\n")
    ...     try:
    ...         read_map(file)
    ...     except DataError as error:
    ...         print(str(error).rpartition("/")[2])
    soc.csv: unit of fuel_mg = 'kg': must be 'mg', as the name says; convert the numbers or change the name
    """
    file = existing_file(path)
    DataError.unless(decimal in (".", ","), "decimal", decimal, "'.' or ','")
    form = _form_of(file)
    try:
        data = read_netcdf(file) if form == "nc" else None
        if data is not None and len(data.dims) == 1 and (POINT in data.dims or not data.coords):
            form = ""  # a list of points
        if form == "":
            return _of_any(file, name=name, decimal=decimal, rows=rows, columns=columns, sheet=sheet)
        for option, given in (("rows", rows), ("columns", columns)):
            if given is not None:
                raise ParameterError(f"{file}: names its axes itself: leave {argument(option)} out")
        if sheet is not None:
            raise ParameterError(f"{file}: no workbook: leave {argument('sheet')} out")
        return _of_labels(file, name) if data is None else CalibrationMap.from_dataset(data, name)
    except (Error, TypeError, ValueError, KeyError) as error:
        message = f"{type(error).__name__} {error}" if isinstance(error, KeyError) else str(error)
        if isinstance(error, DataError | ParameterError) and message.startswith(str(file)):
            raise
        raise DataError(f"{file}: {message}") from error


def _form_of(file: Path) -> str:
    """Detect a form by its content, by the ending of the file only where that is open; "" for grids and points."""
    with file.open("rb") as stream:
        head = stream.read(_HEAD)
    ending = file.suffix.lower()
    if ending in (".toml", ".json"):
        _ending(file)  # parameters, what a command printed
    if head.startswith(b"CDF") or (ending == ".nc" and not head.startswith(b"\x89HDF")):
        return "nc"
    if is_xml(head):
        return "labels"
    wide = head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    if b"\0" in head and not wide:
        return ""
    text = head.decode("utf-16" if wide else "utf-8", "replace").lstrip("\ufeff").lstrip()
    first = next((line for line in text.splitlines() if line.strip() and line.lstrip()[0] not in "*!."), "")
    return "labels" if first.lstrip().startswith("KONSERVIERUNG_FORMAT") or ending in (".dcm", ".cdfx") else ""


def _of_labels(file: Path, name: str | None) -> CalibrationMap:
    content = read_dcm(file)
    maps = content.maps
    if name is None and len(maps) != 1:
        raise ParameterError(
            f"{file}: holds {', '.join(maps) or 'no map'}: give the name of one with {argument('name', repr('…'))}"
        )
    label = next(iter(maps)) if name is None else name
    if label not in maps:
        left_out = next((text for text in content.skipped if text.startswith(f"{label}: ")), None)
        near = left_out or did_you_mean(label, maps) or f"it holds {', '.join(maps) or 'none'}"
        raise ParameterError(f"{file}: no map {label!r}: {near}")
    return maps[label]


def _of_any(
    file: Path, *, name: str | None, decimal: str, rows: str | None, columns: str | None, sheet: str | None
) -> CalibrationMap:
    """Read a grid or a table of points."""
    cells = cells_as_text(file, sheet)
    if cells is None:
        return map_of_points(read_any_table(file), name=name, rows=rows, columns=columns)
    source, text, is_sheet = cells
    mark = "." if is_sheet else decimal  # the numbers of a sheet have no mark of their own
    grid = map_of_grid(text, source, name=name, decimal=mark, rows=rows, columns=columns, whole=is_sheet)
    if grid is not None:
        return grid
    table = text_table(source, text, delimiter="\t" if is_sheet else None, decimal=mark)
    return map_of_points(table, name=name, rows=rows, columns=columns, decimal=mark)


def _ending(path: str | os.PathLike[str]) -> str:
    ending = Path(path).suffix.lower()
    if ending not in _ENDINGS:
        raise ParameterError(f"{path}: a map is written to and read from {', '.join(_ENDINGS)}; give such an ending")
    return ending
