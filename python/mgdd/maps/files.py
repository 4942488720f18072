"""Files of calibration maps: CSV grid, JSON, DCM and netCDF, each whole or as it was before."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, Error, ParameterError, did_you_mean
from mgdd.io.binary_files import read_netcdf, write_netcdf
from mgdd.io.files import existing_file, parsed, read_plain_text, write_whole_text
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.maps.cells import NUMBERS, MapTask
from mgdd.maps.dcm_files import read_dcm, write_dcm
from mgdd.maps.grid_csv import csv_of_map, map_of_csv
from mgdd.results.labels import to_jsonable

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

__all__ = ["map_content", "read_map", "write_map"]

_KIND, _FORMAT = "calibration_map", 1
_ENDINGS = (".csv", ".json", ".dcm", ".nc")


def write_map(
    table: CalibrationMap | xr.Dataset | Sequence[CalibrationMap] | Mapping[str, CalibrationMap],
    path: str | os.PathLike[str],
    *,
    values: Mapping[str, tuple[float, str]] | None = None,
) -> None:
    """Write a map in the form that the ending of the file says; a DCM file holds several, and single values.

    Parameters
    ----------
    table : CalibrationMap, or the Dataset of one
        The map. For a DCM file also a sequence of maps, or a mapping of the names of their labels to them.
    path : path-like
        ``.csv``: a grid with units that a spreadsheet shows as it is; ``.json`` and ``.nc`` (netCDF): these three hold
        everything. ``.dcm``: axes (the first is x), values, units and long name, for calibration tools; the provenance
        becomes comments, and source, support and standard deviation of the cells have no place. An existing file is
        replaced in one step.
    values : mapping of str to (float, str), optional
        Single values with their units, for a DCM file.

    Raises
    ------
    mgdd.errors.ParameterError
        Another ending, or several maps or values for a file that holds one map.
    mgdd.errors.DataError
        In a DCM file a cell without a value, a text with a quote, a name twice. Nothing is written then.
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
    mgdd_map,1
    value,soc_cad,°CA aTDC,start of combustion
    rows,speed_rpm,rpm,speed
    columns,fuel_mg,mg,fuel
    <BLANKLINE>
    table,value
    ,6.0,20.0
    900.0,-1.0,-4.0
    1500.0,-2.0,-6.0
    <BLANKLINE>
    end
    True
    """
    ending = _ending(path)
    several = isinstance(table, list | tuple) or (isinstance(table, Mapping) and not hasattr(table, "data_vars"))
    maps: Any = table if several else [map_of(table)]
    if ending == ".dcm":
        write_dcm(maps, path, values=values)
        return
    if several or values:
        raise ParameterError(f"{path}: holds one map; several, and single values, go into a .dcm file")
    (own,) = maps
    if ending == ".nc":
        write_netcdf(own.to_dataset(), path)
    else:
        write_whole_text(path, csv_of_map(own) if ending == ".csv" else _json_of(own))


def read_map(path: str | os.PathLike[str], name: str | None = None, *, decimal: str = ".") -> CalibrationMap:
    r"""Read a map in the form that the ending of the file says.

    Parameters
    ----------
    path : path-like
        ``.csv``, ``.json``, ``.nc`` or ``.dcm``, as `write_map` writes them.
    name : str, optional
        Which map or variable, where the file holds several.
    decimal : {".", ","}
        Decimal mark of a CSV file.

    Returns
    -------
    CalibrationMap
        Equal to the one that was written; of a DCM file what it holds.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.ParameterError
        Another ending, or a name that the file does not have.
    mgdd.errors.DataError
        A file that is cut off, lacks an axis, repeats a breakpoint, has another unit than its names say, an empty cell
        without a reason or another number of values; the message names file, line or field, and remedy.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.errors import DataError
    >>> from mgdd.maps import read_map
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "soc.csv"
    ...     _ = file.write_text("value,soc_cad,°CA aTDC\nrows,fuel_mg,kg\ntable,value\n6,-1\n20,-4\n")
    ...     try:
    ...         read_map(file)
    ...     except DataError as error:
    ...         print(str(error).rpartition("/")[2])
    soc.csv: unit of fuel_mg = 'kg': must be 'mg', as the name says; convert the numbers or change the name
    """
    ending, file = _ending(path), existing_file(path)
    if ending == ".dcm":
        content = read_dcm(file)
        maps = content.maps
        if name is None and len(maps) != 1:
            raise ParameterError(f"{file}: holds {', '.join(maps) or 'no map'}: give the name of one")
        wanted = next(iter(maps)) if name is None else name
        if wanted not in maps:
            left_out = next((said for said in content.skipped if said.startswith(f"{wanted}: ")), None)
            near = left_out or did_you_mean(wanted, maps) or f"it holds {', '.join(maps) or 'none'}"
            raise ParameterError(f"{file}: no map {wanted!r}: {near}")
        return maps[wanted]
    try:
        if ending == ".nc":
            return CalibrationMap.from_dataset(read_netcdf(file), name)
        text = read_plain_text(file, only_utf8=ending == ".json")
        made = map_of_csv(text, str(file), decimal) if ending == ".csv" else _map_of_json(text, str(file))
    except (Error, TypeError, ValueError, KeyError) as error:
        said = f"{type(error).__name__} {error}" if isinstance(error, KeyError) else str(error)
        if isinstance(error, DataError) and said.startswith(str(file)):
            raise
        raise DataError(f"{file}: {said}") from error
    if name is not None and name != made.name:
        raise ParameterError(f"{file}: holds {made.name!r}, not {name!r}")
    return made


def _ending(path: str | os.PathLike[str]) -> str:
    ending = Path(path).suffix.lower()
    if ending not in _ENDINGS:
        raise ParameterError(f"{path}: a map is written to and read from {', '.join(_ENDINGS)}; give such an ending")
    return ending


def map_content(table: CalibrationMap) -> dict[str, Any]:
    """Give everything that a map holds, as its JSON file has it."""
    return {
        "kind": _KIND,
        "format": _FORMAT,
        "name": table.name,
        "axes": [{"name": name, "entries": entries} for name, entries in table.axes.items()],
        "labels": {name: list(label) for name, label in table.labels.items()},
        "values": table.values,
        "cells": dict(table.cells),
        "task": None if table.task is None else table.task.to_dict(),
        "provenance": dict(table.provenance),
    }


def _json_of(table: CalibrationMap) -> str:
    return json.dumps(to_jsonable(map_content(table)), ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def _map_of_json(text: str, origin: str) -> CalibrationMap:
    content = parsed(text, origin, "JSON")
    if not isinstance(content, dict) or content.get("kind") != _KIND:
        raise DataError(f"kind must be {_KIND!r}: this is another file")
    if content.get("format") != _FORMAT:
        raise DataError(f"format = {content.get('format')!r}: this version of mgdd reads format = {_FORMAT}")
    for key in ("name", "axes", "values"):
        if key not in content:
            raise DataError(f"the field {key!r} is missing: a map has name, axes and values")
    cells = {
        name: np.array(column, np.float64) if name in NUMBERS else column
        for name, column in content.get("cells", {}).items()
    }
    task = content.get("task")
    return CalibrationMap(
        {axis["name"]: axis["entries"] for axis in content["axes"]},
        np.array(content["values"], np.float64),
        name=content["name"],
        labels={name: tuple(label) for name, label in content.get("labels", {}).items()},
        cells=cells,
        task=None if task is None else MapTask(**task),
        provenance=content.get("provenance"),
    )
