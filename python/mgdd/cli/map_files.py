"""Tables and maps of the commands of `mgdd map`: in by their ending, out whole, and as text."""

from __future__ import annotations

import argparse
import contextlib
import shutil
import string
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.output import emit, warn
from mgdd.cli.progress import is_terminal
from mgdd.errors import DataError
from mgdd.io.binary_files import read_netcdf, write_netcdf
from mgdd.io.plain_csv import write_columns
from mgdd.io.point_table import POINT, read_points
from mgdd.maps import read_map, write_map
from mgdd.plot import map_cells
from mgdd.plot.style import drawn
from mgdd.report import Table

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.maps import CalibrationMap
    from mgdd.results.labels import Label


CSV = Options(read_points, "delimiter", "decimal")
MAP_ENDINGS = (".nc", ".csv", ".dcm", ".cdfx")
READING = Options(read_map, "name", "decimal", "rows", "columns", "sheet")
FORMS = "a map of any form: .nc, .dcm, .cdfx, a grid or points of a spreadsheet or program"
_SIZE = (6.6, 4.6)


@contextlib.contextmanager
def doubts_said() -> Iterator[list[str]]:
    """Say the doubts of the library as messages of the command; the list is filled at the end."""
    said: list[str] = []
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always", UserWarning)
        yield said
    said += [str(doubt.message) for doubt in doubts]
    warn(*said)


def map_in(args: argparse.Namespace, file: str) -> CalibrationMap:
    """Read a map as the options of `READING` say."""
    with doubts_said():
        return read_map(file, **READING.given(args))


def grid_table(file: str) -> xr.Dataset:
    """Read a table over a grid of inputs."""
    if file.endswith(".csv"):
        raise DataError(
            f"{file}: a map is made of a table over a grid, which a CSV file does not keep: write it as netCDF, "
            "mgdd engine sweep or mgdd map predict with -o FILE.nc"
        )
    data = read_netcdf(file)
    if POINT in data.dims:
        raise DataError(
            f"{file}: a list of {data.sizes[POINT]} points, but a map needs a grid: sweep one (mgdd engine sweep "
            "--over ...), or fit the points (mgdd map fit) and predict a grid (mgdd map predict)"
        )
    return data


def table_writers(data: xr.Dataset) -> dict[str, Callable[[str], None]]:
    """Give what writes a table, by the ending of its file."""
    return dict.fromkeys((".csv", ".nc"), partial(_write_table, data))


def _write_table(data: xr.Dataset, file: str) -> None:
    """Write netCDF, or plain CSV, a point per row with its inputs first."""
    if Path(file).suffix == ".csv":
        if POINT not in data.dims:  # a grid: a point per row
            data = data.stack({POINT: list(data.dims)}).reset_index(POINT)
            data[POINT] = np.arange(data.sizes[POINT])
        inputs = [str(name) for name in data.coords if name != POINT and data[name].dims == (POINT,)]
        results = [str(name) for name in data.data_vars if data[name].dims == (POINT,)]
        numbers = np.array([f"{number:.15g}" for number in data[POINT].to_numpy().tolist()])
        write_columns({POINT: numbers} | {name: data[name].to_numpy() for name in (*inputs, *results)}, file)
    else:
        write_netcdf(data, file)


def map_content(table: CalibrationMap) -> dict[str, Any]:
    """Give everything that a map holds, as JSON."""
    return {
        "kind": "calibration_map",
        "format": 1,
        "name": table.name,
        "axes": [{"name": name, "entries": entries} for name, entries in table.axes.items()],
        "labels": {name: list(label) for name, label in table.labels.items()},
        "values": table.values,
        "cells": dict(table.cells),
        "task": None if table.task is None else table.task.to_dict(),
        "provenance": dict(table.provenance),
    }


def emit_map(
    args: argparse.Namespace, table: CalibrationMap, text: Any, *, draw: Callable[..., Any] = map_cells, **more: Any
) -> None:
    """Write a map to ``-o`` and its picture to ``--figure``, then print it: as text, or as JSON and more."""
    write = dict.fromkeys(MAP_ENDINGS, partial(write_map, table))
    picture = partial(drawn, draw, table.to_dataset(), size=_SIZE)
    emit(args, {**map_content(table), **more}, text=text, write=write, figure=picture)


_DIGITS = 4  # of the largest number of a table
_GAP = 2  # blanks between two columns, as `show` sets them


def map_blocks(table: CalibrationMap, column: str = "value") -> list[str | Table]:
    """Lay out a map: its headline, the grid of one column, and the flags of its cells.

    Parameters
    ----------
    table : CalibrationMap
        The map.
    column : str
        ``value``, or a column of the cells.

    Returns
    -------
    list of str and Table
        As `mgdd.cli.output.show` takes it.
    """
    cells = table.values if column == "value" else table.cells[column]
    unit = table.unit if column in ("value", "low", "high") else ""
    unit = table.unit.removesuffix(" aTDC") if column == "sd" else unit  # a difference of angles has no zero
    unit = table.labels[column].units if column in table.labels else unit
    what = f"{table.labels[table.name].long_name}{'' if column == 'value' else f', {column}'}"
    flags = _flags(table)
    out: list[str | Table] = [repr(table)[1:-1]]
    out += [f"  {name}: {text}" for name, text in table.provenance.items()]
    if table.task is not None:
        limits = [f"{name} <= {upper:g}" for name, upper in table.task.limits.items()]
        out.append(f"  for the {'highest' if table.task.maximize else 'lowest'} {table.task.objective}")
        out[-1] = ", ".join([str(out[-1]), *limits])
    return [*out, "", *grid_blocks(table.axes, table.labels, cells, f"{what} [{unit}]" if unit else what, flags)]


def shown_map(args: argparse.Namespace, *tables: CalibrationMap) -> list[str | Table]:
    """Lay out maps, and say how to keep them where no file is given."""
    blocks = [block for table in tables for block in (*map_blocks(table), "")]
    name = f"{tables[0].name}.nc" if len(tables) == 1 else "maps.cdfx"
    return blocks[:-1] if args.output else [*blocks, f"-o {name} keeps the map{'s' if len(tables) > 1 else ''}"]


def grid_blocks(
    axes: Mapping[str, NDArray[np.float64]],
    labels: Mapping[str, Label],
    cells: NDArray[Any],
    title: str,
    flags: Mapping[str, NDArray[np.bool_]],
) -> list[str | Table]:
    """Lay out cells over one or two axes; a letter behind a number is explained below the grid."""
    names = list(axes)
    marks = np.full(cells.shape, "", dtype=object)
    letters = dict(zip((said for said, where in flags.items() if where.any()), string.ascii_letters, strict=False))
    for said, letter in letters.items():
        marks[flags[said]] = [mark + letter for mark in marks[flags[said]]]
    wide = max((len(mark) for mark in marks.ravel()), default=0)
    texts = _texts(cells)
    if wide:
        texts = [f"{text} {mark:{wide}}" for text, mark in zip(texts, marks.ravel(), strict=True)]
    shown = np.array(texts).reshape(cells.shape[0], -1)
    heads = [f"{labels[name].long_name} [{labels[name].units}]" for name in names]
    above = [f"{entry:g}" for entry in axes[names[1]]] if len(names) == 2 else [title]
    out: list[str | Table] = [title, f"down: {heads[0]}; across: {heads[1]}"] if len(names) == 2 else []
    corner = names[0] if len(names) == 2 else heads[0]
    for part in _parts([max(len(head), *map(len, shown[:, k])) for k, head in enumerate(above)], len(corner)):
        body = [(f"{at:g}", *row[part].tolist()) for at, row in zip(axes[names[0]], shown, strict=True)]
        heads_of = [head + " " * (wide + 1 if wide and len(names) == 2 else 0) for head in above[part]]
        out.append(Table(columns=(corner, *heads_of), rows=tuple(body)))
    out += [f"{letter}: {said}, {_count(flags[said])}" for said, letter in letters.items()]
    return out


def _flags(table: CalibrationMap) -> dict[str, NDArray[np.bool_]]:
    """Say what is special about cells: a source that most do not have, a limit that holds them."""
    sources, counts = np.unique(table.cells["source"], return_counts=True)
    usual = str(sources[np.argmax(counts)])
    flags = {str(source): table.cells["source"] == source for source in sources.tolist() if source != usual}
    held = table.cells["active_limit"]
    return flags | {f"held by {name}": held == name for name in np.unique(held).tolist() if name}


def _texts(cells: NDArray[Any]) -> list[str]:
    flat = cells.ravel()
    if flat.dtype.kind in "Ub":
        return [str(text) or "–" for text in flat.tolist()]
    known = np.abs(flat[np.isfinite(flat)])
    largest = float(known.max()) if known.size else 0.0
    if largest and not 1e-4 <= largest < 1e7:
        return [f"{value:.{_DIGITS - 1}e}" if np.isfinite(value) else "–" for value in flat.tolist()]
    digits = max(0, _DIGITS - 1 - int(np.floor(np.log10(largest)))) if largest else 0
    digits = 0 if known.size and (known == np.round(known)).all() else digits
    return [f"{value:z.{digits}f}" if np.isfinite(value) else "–" for value in flat.tolist()]


def _parts(widths: Sequence[int], first: int) -> list[slice]:
    """Cut the columns into tables that fit the terminal; one table where nobody reads a terminal."""
    if not is_terminal():
        return [slice(0, len(widths))]
    room = max(40, shutil.get_terminal_size().columns) - first
    parts, begun, used = [], 0, 0
    for place, width in enumerate(widths):
        if place > begun and used + width + _GAP > room:
            parts.append(slice(begun, place))
            begun, used = place, 0
        used += width + _GAP
    return [*parts, slice(begun, len(widths))]


def _count(where: NDArray[np.bool_]) -> str:
    count = int(where.sum())
    return f"{count} cell{'s' if count != 1 else ''}"
