"""Measured traces and logs as plain CSV, which reads back bit by bit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError
from mgdd.io.pressure import CYCLE
from mgdd.io.pressure_checks import check_trace
from mgdd.io.table import write_columns
from mgdd.io.throttle_checks import check_throttle_log
from mgdd.results.labels import ANGLE, check_labels

if TYPE_CHECKING:
    import os

    import xarray as xr

__all__ = ["write_csv"]

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
