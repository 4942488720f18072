"""A pressure trace in the form that the user has it, turned into the labelled Dataset of a trace."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.io.pressure import pressure_trace, read_pressure
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["as_trace"]

_PRESSURE = "pressure_bar"
_FORMS = (
    f"give a Dataset, DataFrame or mapping with {ANGLE} and {_PRESSURE}, a DataArray or Series over {ANGLE}, a pair "
    "(angle, pressure), or the path of a file"
)


def as_trace(trace: Any) -> xr.Dataset:
    """Return a trace as a Dataset; one that is a Dataset over crank angle already is returned as it is.

    Parameters
    ----------
    trace : Dataset, DataFrame, mapping, DataArray, Series, pair of array_like, or path-like
        Columns are ``crank_angle_cad`` [°CA aTDC], which may be the index, and ``pressure_bar`` [bar]; the index of a
        Series is the crank angle. A path is read by `read_pressure` with its defaults.

    Returns
    -------
    xarray.Dataset
        With ``pressure_bar`` over ``crank_angle_cad``, and the attributes of the source.

    Raises
    ------
    mgdd.errors.DataError
        Another form, a missing column, and all of `check_trace`.
    """
    if isinstance(trace, str | os.PathLike):
        return read_pressure(trace)
    dims = getattr(trace, "dims", None)
    if dims is not None and hasattr(trace, "variables"):  # a Dataset
        if _PRESSURE in trace.variables and trace[_PRESSURE].dims == (ANGLE,) and ANGLE in trace.variables:
            checked: xr.Dataset = trace
            return checked
        return _of_columns(trace, {str(name): trace[name].to_numpy() for name in trace.variables})
    if dims is not None and hasattr(trace, "coords"):  # a DataArray
        columns = {str(name): trace[name].to_numpy() for name in trace.coords}
        return _of_columns(trace, {**columns, _PRESSURE: trace.to_numpy()})
    if hasattr(trace, "columns") and hasattr(trace, "index"):  # a DataFrame
        flat = trace if ANGLE in trace.columns else trace.reset_index()
        return _of_columns(trace, {str(name): flat[name].to_numpy() for name in flat.columns})
    if hasattr(trace, "index") and hasattr(trace, "to_numpy"):  # a Series
        return _of_columns(trace, {_index_name(trace.index): np.asarray(trace.index), _PRESSURE: trace.to_numpy()})
    if isinstance(trace, Mapping):
        return _of_columns(trace, {str(name): values for name, values in trace.items()})
    if isinstance(trace, tuple | list) and len(trace) == 2:
        return pressure_trace(*trace)
    raise DataError(f"trace is of type {type(trace).__name__}: {_FORMS}")


def _of_columns(trace: Any, columns: Mapping[str, Any]) -> xr.Dataset:
    for name in (ANGLE, _PRESSURE):
        if name not in columns:
            have = ", ".join(columns) or "nothing"
            raise DataError(f"the trace has no {name}, it has {have}: {_FORMS}")
    attrs = dict(getattr(trace, "attrs", {}))
    made = pressure_trace(columns[ANGLE], columns[_PRESSURE], name=str(attrs.get("file", "trace")))
    return made.assign_attrs({str(name): value for name, value in attrs.items()})


def _index_name(index: Any) -> str:
    counts = getattr(index, "start", None) == 0 and getattr(index, "step", None) == 1
    return str(index.name) if index.name is not None else "an index that counts samples" if counts else ANGLE
