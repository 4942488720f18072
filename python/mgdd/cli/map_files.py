"""Tables and maps of the commands of `mgdd map`: in by their ending, out whole, and how messages name the options."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.output import emit, save_figure, wrote
from mgdd.errors import DataError
from mgdd.io.binary_files import read_netcdf, write_netcdf
from mgdd.io.plain_csv import write_columns
from mgdd.io.point_table import POINT, read_points
from mgdd.maps import write_map
from mgdd.maps.files import map_content
from mgdd.plot import map_cells
from mgdd.plot.style import drawn

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.maps import CalibrationMap

__all__ = ["CSV", "MAP_ENDINGS", "emit_map", "grid_table", "write_table"]

CSV = Options(read_points, "delimiter", "decimal")
MAP_ENDINGS = (".csv", ".json", ".nc", ".dcm")
_SIZE = (6.6, 4.6)


def grid_table(file: str) -> xr.Dataset:
    """Read a table over a grid of inputs."""
    data = read_netcdf(file)
    if POINT in data.dims:
        raise DataError(
            f"{file}: a list of {data.sizes[POINT]} points, but a map needs a grid: sweep one (mgdd engine sweep "
            "--over ...), or fit the points (mgdd map fit) and predict a grid (mgdd map predict)"
        )
    return data


def write_table(data: xr.Dataset, file: str) -> None:
    """Write netCDF, or a list of points as plain CSV with its inputs first."""
    if Path(file).suffix == ".csv":
        inputs = [str(name) for name in data.coords if name != POINT and data[name].dims == (POINT,)]
        results = [str(name) for name in data.data_vars if data[name].dims == (POINT,)]
        numbers = np.array([f"{number:.15g}" for number in data[POINT].to_numpy().tolist()])
        write_columns({POINT: numbers} | {name: data[name].to_numpy() for name in (*inputs, *results)}, file)
    else:
        write_netcdf(data, file)
    wrote(file)


def emit_map(
    args: argparse.Namespace, table: CalibrationMap, text: Any, *, draw: Callable[..., Any] = map_cells, **more: Any
) -> None:
    """Write a map to ``-o`` and its picture to ``--figure``, then print it: as text, or its JSON file and more."""
    file, args.output = args.output, None  # the object below goes to stdout, the map into the file
    if file is not None:
        write_map(table, file)
        wrote(file)
    if args.figure is not None:
        save_figure(drawn(draw, table.to_dataset(), size=_SIZE), args.figure)
    emit(args, {**map_content(table), **more, "file": file}, text=text)
