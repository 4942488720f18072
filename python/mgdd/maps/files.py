"""Files of calibration maps: CSV grid, JSON, DCM and netCDF, each whole or as it was before."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, Error, ParameterError, did_you_mean
from mgdd.io.existing_file import existing_file
from mgdd.io.whole_file import write_whole, write_whole_text
from mgdd.maps.calibration_map import CalibrationMap
from mgdd.maps.cells import NUMBERS, MapTask
from mgdd.maps.dcm import DcmBlock, dcm_blocks, dcm_text
from mgdd.maps.grid_csv import csv_of_map, map_of_csv
from mgdd.results.labels import to_jsonable
from mgdd.results.units import attribute_units, unit_of

if TYPE_CHECKING:
    import os

__all__ = ["DcmFile", "read_dcm", "read_map", "write_dcm", "write_map"]

_KIND, _FORMAT = "calibration_map", 1
_ENDINGS = (".csv", ".json", ".dcm", ".nc")
# Units as calibration tools write them; everything else stands as it is. Where an angle counts from they do not say.
_DCM_UNITS = {
    "°KW": "°CA", "°CRK": "°CA", "deg CA": "°CA", "degCA": "°CA", "1/min": "rpm", "U/min": "rpm", "Nm": "N m",
    "°C": "degC", "°": "deg",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class DcmFile:
    """Content of a DCM file.

    Parameters
    ----------
    maps : mapping of str to CalibrationMap
        Curves and maps by the names of their labels.
    values : mapping of str to (float, str)
        Single values with their units.
    skipped : tuple of str
        Blocks of other kinds, texts and lists of functions for example, that were not read.

    Examples
    --------
    >>> from mgdd.maps.files import DcmFile
    >>> DcmFile(maps={}, values={"idle_rpm": (850.0, "rpm")}).values["idle_rpm"]
    (850.0, 'rpm')
    """

    maps: Mapping[str, CalibrationMap]
    values: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    skipped: tuple[str, ...] = ()


def write_map(table: CalibrationMap, path: str | os.PathLike[str]) -> None:
    """Write a map in the form that the ending of the file says.

    Parameters
    ----------
    table : CalibrationMap
        The map.
    path : path-like
        ``.csv``: a grid with units that a spreadsheet shows as it is; ``.json`` and ``.nc`` (netCDF): these three hold
        everything. ``.dcm``: axes, values, units and long name, for calibration tools. An existing file is replaced in
        one step.

    Raises
    ------
    mgdd.errors.ParameterError
        Another ending.
    mgdd.errors.DataError
        A cell without a value, in a DCM file. Nothing is written then.
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
    rows,speed_rpm,rpm,speed rpm
    columns,fuel_mg,mg,fuel mg
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
    if ending == ".dcm":
        write_dcm([table], path)
    elif ending == ".nc":
        dataset = table.to_dataset()
        write_whole(path, lambda half: dataset.to_netcdf(half, engine="scipy"))
    else:
        write_whole_text(path, csv_of_map(table) if ending == ".csv" else _json_of(table))


def read_map(path: str | os.PathLike[str], name: str | None = None, *, decimal: str = ".") -> CalibrationMap:
    r"""Read a map in the form that the ending of the file says.

    Parameters
    ----------
    path : path-like
        ``.csv``, ``.json``, ``.nc`` or ``.dcm``, as `write_map` writes them.
    name : str, optional
        Which map or variable, where the file holds several.
    decimal : str
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
    soc.csv: unit of fuel_mg = kg: must be 'mg', as the name says; convert the numbers or change the name
    """
    ending, file = _ending(path), existing_file(path)
    if ending == ".dcm":
        maps = read_dcm(file).maps
        if name is None and len(maps) != 1:
            raise ParameterError(f"{file}: holds {', '.join(maps) or 'no map'}: give the name of one")
        wanted = next(iter(maps)) if name is None else name
        if wanted not in maps:
            near = did_you_mean(wanted, maps) or f"it holds {', '.join(maps) or 'none'}"
            raise ParameterError(f"{file}: no map {wanted!r}: {near}")
        return maps[wanted]
    try:
        if ending == ".nc":
            import xarray as xr

            data = xr.load_dataset(io.BytesIO(file.read_bytes()), engine="scipy")
            return CalibrationMap.from_dataset(data, name)
        text = _text(file)
        made = map_of_csv(text, str(file), decimal) if ending == ".csv" else _map_of_json(text)
    except (Error, TypeError, ValueError, KeyError) as error:
        said = f"{type(error).__name__} {error}" if isinstance(error, KeyError) else str(error)
        if isinstance(error, DataError) and said.startswith(str(file)):
            raise
        raise DataError(f"{file}: {said}") from error
    if name is not None and name != made.name:
        raise ParameterError(f"{file}: holds {made.name!r}, not {name!r}")
    return made


def write_dcm(
    maps: Sequence[CalibrationMap] | Mapping[str, CalibrationMap],
    path: str | os.PathLike[str],
    *,
    values: Mapping[str, tuple[float, str]] | None = None,
) -> None:
    """Write maps and single values to one DCM file, for calibration tools.

    Parameters
    ----------
    maps : sequence or mapping of CalibrationMap
        In their order; the keys of a mapping are the names of the labels, else those of the maps. The first axis is x.
        Source, support and standard deviation of the cells have no place in this format; the provenance becomes
        comments.
    path : path-like
        The file; an existing one is replaced in one step.
    values : mapping of str to (float, str), optional
        Single values with their units.

    Raises
    ------
    mgdd.errors.DataError
        A cell without a value, a text with a quote, a name twice. Nothing is written then.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.maps import CalibrationMap, read_dcm, write_dcm
    >>> soc = CalibrationMap({"fuel_mg": [6, 20]}, [-1, -4], name="soc_cad")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "engine.dcm"
    ...     write_dcm({"SocBase": soc}, file, values={"idle_rpm": (850.0, "rpm")})
    ...     print(file.read_text(encoding="utf-8"), end="")
    ...     read_dcm(file).values
    <BLANKLINE>
    KONSERVIERUNG_FORMAT 2.0
    <BLANKLINE>
    FESTWERT idle_rpm
       LANGNAME      "idle rpm"
       EINHEIT_W     "rpm"
       WERT          850.0
    END
    <BLANKLINE>
    KENNLINIE SocBase 2
       LANGNAME      "start of combustion"
       EINHEIT_X     "mg"
       EINHEIT_W     "°CA aTDC"
    *SSTX   fuel_mg
       ST/X          6.0   20.0
       WERT          -1.0   -4.0
    END
    {'idle_rpm': (850.0, 'rpm')}
    """
    named = [*(maps.items() if isinstance(maps, Mapping) else ((table.name, table) for table in maps))]
    blocks = []
    for name, (number, unit) in (values or {}).items():
        if not np.isfinite(number):
            raise DataError.of(f"value {name}", number, "finite")
        blocks.append(DcmBlock(name=name, long_name=name.replace("_", " "), unit=unit, values=[[float(number)]]))
    blocks += [_block_of(name, table) for name, table in named]
    for block in blocks:
        if [other.name for other in blocks].count(block.name) > 1:
            raise DataError(f"{block.name}: stands in the file twice: give the maps other names")
        for text in (block.long_name, block.unit, block.unit_x, block.unit_y, block.name):
            if '"' in text or "\n" in text:
                raise DataError(f"{block.name}: {text!r}: a DCM text has no quotes and no line breaks")
    comments = [f"{name}, {key}: {text}" for name, table in named for key, text in table.provenance.items()]
    write_whole_text(path, dcm_text(blocks, comments))


def read_dcm(path: str | os.PathLike[str]) -> DcmFile:
    """Read the curves, maps and single values of a DCM file.

    Parameters
    ----------
    path : path-like
        Format 2.0, UTF-8 or Latin-1. Axes have the names that ``*SSTX`` and ``*SSTY`` give, else ``x`` and ``y``.

    Returns
    -------
    DcmFile
        Values with the source ``given``; what else the file holds is named in ``skipped``.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.DataError
        Another format, a file that is cut off, counts that contradict each other, breakpoints that do not increase; the
        message names file, line and remedy.

    Examples
    --------
    See `write_dcm`.

    >>> from mgdd.maps import read_dcm
    >>> try:
    ...     read_dcm("no_such_file.dcm")
    ... except FileNotFoundError as error:
    ...     print(error.strerror)
    no such file: check the path
    """
    file = existing_file(path)
    blocks, skipped = dcm_blocks(_text(file), str(file))
    maps, values = {}, {}
    for block in blocks:
        if not block.x:
            values[block.name] = (block.values[0][0], _unit_from(block.unit, block.name))
            continue
        try:
            maps[block.name] = _map_of(block)
        except Error as error:
            raise DataError(f"{file}, line {block.line}, {block.name}: {error}") from error
    return DcmFile(maps=maps, values=values, skipped=tuple(skipped))


def _ending(path: str | os.PathLike[str]) -> str:
    ending = Path(path).suffix.lower()
    if ending not in _ENDINGS:
        raise ParameterError(f"{path}: a map is written to and read from {', '.join(_ENDINGS)}; give such an ending")
    return ending


def _text(file: Path) -> str:
    raw = file.read_bytes()
    if b"\0" in raw:
        raise DataError(f"{file}: this is a binary file: a text is needed")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _json_of(table: CalibrationMap) -> str:
    content: dict[str, Any] = {
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
    return json.dumps(to_jsonable(content), ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def _map_of_json(text: str) -> CalibrationMap:
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise DataError(f"not valid JSON: {error}; the file was cut off or edited") from error
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


def _block_of(name: str, table: CalibrationMap) -> DcmBlock:
    if not np.isfinite(table.values).all():
        raise DataError(
            f"{name}: {np.count_nonzero(~np.isfinite(table.values))} cells have no value, a DCM file needs all: fill "
            "them with smooth_map(fill=True)"
        )
    x, y = [*table.axes, ""][:2]
    rows = table.values.reshape(table.values.shape[0], -1).T
    return DcmBlock(
        name=name,
        x=table.axes[x].tolist(),
        y=table.axes[y].tolist() if y else [],
        values=rows.tolist(),
        long_name=table.labels[table.name].long_name,
        unit=table.unit,
        unit_x=table.labels[x].units,
        unit_y=table.labels[y].units if y else "",
        axis_x=x,
        axis_y=y,
    )


def _map_of(block: DcmBlock) -> CalibrationMap:
    axes = {block.axis_x or "x": block.x}
    if block.y:
        axes[block.axis_y or "y"] = block.y
    units = dict(zip(axes, (block.unit_x, block.unit_y), strict=False))
    labels = {name: (_unit_from(unit, name), name.replace("_", " ")) for name, unit in units.items()}
    labels[block.name] = (_unit_from(block.unit, block.name), block.long_name or block.name.replace("_", " "))
    rows = np.array(block.values)
    return CalibrationMap(axes, rows.T if block.y else rows[0], name=block.name, labels=labels)


def _unit_from(written: str, name: str) -> str:
    """Give a unit of a file as mgdd prints it; a name that says the same unit settles how."""
    unit = _DCM_UNITS.get(written, written) or "-"
    try:
        same = attribute_units(unit) == attribute_units(unit_of(name))
    except ValueError:
        return f"not given ({unit})"
    return unit_of(name) if same else unit
