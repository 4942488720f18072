"""Tables and maps of the commands of `mgdd map`: in by their ending, out whole, and how messages name the options."""

from __future__ import annotations

import argparse
import contextlib
import logging
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.output import emit, save_figure, wrote
from mgdd.errors import DataError
from mgdd.io.binary_files import read_netcdf, write_netcdf
from mgdd.io.plain_csv import write_columns
from mgdd.io.point_table import POINT, read_points
from mgdd.maps import read_map, write_map
from mgdd.maps.files import map_content
from mgdd.plot import map_cells
from mgdd.plot.style import drawn

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.maps import CalibrationMap

__all__ = [
    "CSV", "FORMS", "MAP_ENDINGS", "READING", "doubts_said", "emit_map", "grid_table", "map_in", "write_table",
]  # fmt: skip
_LOG = logging.getLogger(__name__)

CSV = Options(read_points, "delimiter", "decimal")
MAP_ENDINGS = (".csv", ".json", ".nc", ".dcm", ".cdfx")
READING = Options(read_map, "name", "decimal", "rows", "columns", "sheet")
FORMS = "a map of any form: .csv, .json, .nc, .dcm, .cdfx, a grid or points of a spreadsheet or program"
_SIZE = (6.6, 4.6)


@contextlib.contextmanager
def doubts_said() -> Iterator[list[str]]:
    """Say the doubts of the library as messages of the command; the list is filled at the end."""
    said: list[str] = []
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always", UserWarning)
        yield said
    said += [str(doubt.message) for doubt in doubts]
    for text in said:
        _LOG.warning("%s", text)


def map_in(args: argparse.Namespace, file: str) -> CalibrationMap:
    """Read a map as the options of `READING` say."""
    with doubts_said():
        return read_map(file, **READING.given(args))


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
    emit(args, {**map_content(table), **more, "file": file}, text=text)
    if args.figure is not None:
        save_figure(drawn(draw, table.to_dataset(), size=_SIZE), args.figure)
