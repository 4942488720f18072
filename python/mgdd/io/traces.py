"""Columns of a result over its one dimension as plain CSV."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from mgdd.errors import ShapeError
from mgdd.io.plain_csv import write_columns
from mgdd.results.labels import check_labels

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["write_traces"]


def write_traces(dataset: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write every one-dimensional variable of a Dataset as CSV: a header, then numbers in full precision.

    The file is plain, so that any reader takes it without options; a name says its unit by its ending. What a table
    cannot hold, scalars and attributes, stands in the Dataset: ``to_netcdf`` writes all of it.

    Parameters
    ----------
    dataset : xarray.Dataset
        With one dimension, or several of which the variables share none; scalars are not written.
    path : path-like
        The file; an existing one is replaced once the Dataset has passed its checks.

    Raises
    ------
    mgdd.errors.DataError
        A variable without units.
    mgdd.errors.ShapeError
        Variables over different dimensions.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.engine import Cylinder, OperatingPoint, simulate
    >>> from mgdd.io.traces import write_traces
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "cycle.csv"
    ...     write_traces(simulate(Cylinder(), OperatingPoint()), file)
    ...     file.read_text().splitlines()[0][:28]
    'crank_angle_cad,pressure_bar'
    """
    check_labels(dataset)
    dims = [dim for dim in dataset.dims if any(v.dims == (dim,) for v in dataset.data_vars.values())]
    if len(dims) != 1 or any(v.ndim > 1 for v in dataset.variables.values()):
        raise ShapeError(f"a CSV holds columns over one dimension; this result has {dict(dataset.sizes)}")
    names = [str(dims[0]), *(str(n) for n, v in dataset.data_vars.items() if v.dims == (dims[0],))]
    write_columns({name: dataset[name].to_numpy() for name in names}, path)
