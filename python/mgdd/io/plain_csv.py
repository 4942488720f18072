"""Plain CSV, which reads back bit by bit: measured traces and logs, columns, and the traces of a Dataset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ShapeError
from mgdd.io.files import write_whole_text
from mgdd.io.pressure import CYCLE
from mgdd.io.pressure_checks import check_trace
from mgdd.io.throttle_checks import check_throttle_log
from mgdd.results.labels import ANGLE, check_labels, label_of, name_unit

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

_LOG = ("time_s", "duty", "angle_deg", "current_a", "supply_v")


def write_csv(data: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a trace or log as CSV that `read_pressure` or `read_throttle_log` reads back bit by bit.

    Parameters
    ----------
    data : xarray.Dataset
        A trace, ``pressure_bar(crank_angle_cad)`` or ``pressure_bar(cycle, crank_angle_cad)``, which becomes a column
        per cycle, counted from 1; or a log as `throttle_log` makes it. Other variables and attributes are not written.
    path : path-like
        The file; an existing one is replaced once the Dataset has passed its checks.

    Raises
    ------
    DataError
        Neither a trace nor a log, missing units, and what `pressure_trace` and `throttle_log` refuse.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from mgdd.io import pressure_trace, read_pressure, write_csv
    >>> angle = np.arange(-30.0, 31.0)
    >>> trace = pressure_trace(angle, 60.0 - 0.01 * angle**2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "mean.csv"
    ...     write_csv(trace, file)
    ...     read_pressure(file).equals(trace)
    True
    """
    if "time_s" in data.variables:
        check_throttle_log(data)
        write_columns({name: data[name].to_numpy() for name in _LOG if name in data}, path)
        return
    if "pressure_bar" not in data or set(data["pressure_bar"].dims) not in ({ANGLE}, {CYCLE, ANGLE}):
        raise DataError(
            f"data has no pressure_bar({ANGLE}) and no time_s: make a trace with mgdd.io.pressure_trace, or a log with "
            "mgdd.io.throttle_log"
        )
    check_labels(data[["pressure_bar"]])
    measured = data["pressure_bar"].transpose(..., ANGLE)
    angle, pressure = check_trace(measured[ANGLE].to_numpy(), measured.to_numpy(), source="data")
    names = ["pressure_bar"] if pressure.ndim == 1 else [f"pressure_bar_{k + 1}" for k in range(len(pressure))]
    write_columns({ANGLE: angle, **dict(zip(names, np.atleast_2d(pressure), strict=True))}, path)


def write_columns(columns: Mapping[str, ArrayLike], path: str | os.PathLike[str]) -> None:
    """Write columns of one length as CSV that any reader takes without options: a header, then rows.

    Numbers come back bit for bit; texts, which hold no comma, quote or line break, stand as they are.
    """
    cells = [
        column.tolist() if column.dtype.kind == "U" else [repr(value) for value in column.astype(np.float64).tolist()]
        for column in map(np.asarray, columns.values())
    ]
    rows = [",".join(columns), *(",".join(row) for row in zip(*cells, strict=True))]
    write_whole_text(path, "\n".join(rows) + "\n")


def write_traces(dataset: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write every variable of a Dataset over its one dimension by `write_columns`; its scalars are left out.

    A variable without units is a DataError, variables over different dimensions are a ShapeError.
    """
    check_labels(dataset)
    dims = [dim for dim in dataset.dims if any(v.dims == (dim,) for v in dataset.data_vars.values())]
    if len(dims) != 1 or any(v.ndim > 1 for v in dataset.variables.values()):
        raise ShapeError(f"a CSV holds columns over one dimension; this result has {dict(dataset.sizes)}")
    names = [str(dims[0]), *(str(n) for n, v in dataset.data_vars.items() if v.dims == (dims[0],))]
    write_columns({name: dataset[name].to_numpy() for name in names}, path)


def long_columns(dataset: xr.Dataset) -> dict[str, tuple[NDArray[Any], str, str]]:
    """Return name: (values, unit, long name) of a Dataset as columns of one length, cycle below cycle; no scalars.

    Coordinates come first; the number of a cycle is left out where the angle says where one begins. Variables that are
    not all over the same dimensions are a ShapeError.
    """
    check_labels(dataset)
    names = [str(name) for name, variable in dataset.data_vars.items() if variable.ndim]
    dims = max((dataset[name].dims for name in names), key=len, default=())
    if not dims:
        raise ShapeError("a table holds columns: nothing here is over a dimension")
    other = next((name for name in names if set(dataset[name].dims) != set(dims)), None)
    if other is not None:
        over = ", ".join(map(str, dataset[other].dims))
        raise ShapeError(
            f"a table holds columns of one length: {other} is over {over}, others over {', '.join(map(str, dims))}: "
            "write netCDF (.nc), or less of it"
        )
    whole = dataset[names].transpose(*dims)
    index_dims = [str(dim) for dim in dims if not (dim == CYCLE and ANGLE in dims)]
    out = {}
    for name in (*index_dims, *names):
        values = whole[name].broadcast_like(whole[names[0]]).transpose(*dims).to_numpy().ravel()
        out[name] = (values, *label_of(dataset[name]))
    return out


def write_long(dataset: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write the columns of `long_columns` by `write_columns`; a unit that no name says stands in brackets behind it."""
    columns = long_columns(dataset)
    heads = [
        name if name_unit(name) == units != "-" else _bracketed(name, units) for name, (_, units, _) in columns.items()
    ]
    write_columns(dict(zip(heads, (values for values, _, _ in columns.values()), strict=True)), path)


def _bracketed(name: str, units: str) -> str:
    return f"{name} [{units.removeprefix('unit of ')}]".replace(",", " ").replace('"', " ")
