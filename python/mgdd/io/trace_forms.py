"""A pressure trace in the form that the user has it, turned into the labelled Dataset of a trace."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.column_names import Heading, heading
from mgdd.io.pressure import CYCLE, pressure_trace, read_pressure
from mgdd.io.pressure_columns import odd_shape
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["as_trace", "mean_cycle", "one_cycle"]

_PRESSURE = "pressure_bar"
_FORMS = (
    f"give a Dataset, DataFrame or mapping with {ANGLE} and {_PRESSURE}, a DataArray or Series over {ANGLE}, a "
    f"DataFrame over {ANGLE} with one column per cycle, a pair (angle, pressure), or the path of a file"
)


def one_cycle(trace: Any) -> xr.Dataset:
    """Return a trace of one cycle as a Dataset, and refuse several."""
    made = as_trace(trace)
    if CYCLE in made[_PRESSURE].dims:
        raise DataError(
            f"{made.attrs.get('file', 'trace')}: {made.sizes[CYCLE]} cycles, and one is needed: give their mean, "
            f"trace.mean('cycle', keep_attrs=True), --mean-cycle on the command line, or one column, "
            f"{argument('pressure_column', '')}"
        )
    return made


def mean_cycle(trace: xr.Dataset) -> xr.Dataset:
    """Give the mean of a trace's cycles; one of one cycle stays as it is."""
    return trace.mean(CYCLE, keep_attrs=True) if CYCLE in trace.dims else trace


def as_trace(trace: Any) -> xr.Dataset:
    """Return a trace as a Dataset; one that is a Dataset over crank angle already is returned as it is.

    Parameters
    ----------
    trace : Dataset, DataFrame, mapping, DataArray, Series, pair of array_like, or path-like
        Columns are ``crank_angle_cad`` [°CA aTDC], which may be the index, and ``pressure_bar`` [bar]; the index of a
        Series is the crank angle. Several cycles are ``pressure_bar(cycle, crank_angle_cad)``, the second array of the
        pair (cycle, angle), or the columns of a DataFrame beside the angle. A path is read by `read_pressure` with its
        defaults.

    Returns
    -------
    xarray.Dataset
        With ``pressure_bar`` over ``crank_angle_cad``, or over ``cycle`` and it, and the attributes of the source.

    Raises
    ------
    mgdd.errors.DataError
        Another form, a missing column, and all of `check_trace`.
    """
    if isinstance(trace, str | os.PathLike):
        return read_pressure(trace)
    dims = getattr(trace, "dims", None)
    if dims is not None and hasattr(trace, "variables"):  # a Dataset
        over = trace[_PRESSURE].dims if _PRESSURE in trace.variables else ()
        if ANGLE in trace.variables and over in ((ANGLE,), (CYCLE, ANGLE)):
            checked: xr.Dataset = trace
            return checked
        if over == (ANGLE, CYCLE):
            turned: xr.Dataset = trace.transpose(CYCLE, ANGLE, ...)
            return turned
        return _of_columns(trace, {str(name): trace[name].to_numpy() for name in trace.variables})
    if dims is not None and hasattr(trace, "coords"):  # a DataArray
        columns = {str(name): trace[name].to_numpy() for name in trace.coords}
        if set(dims) == {CYCLE, ANGLE}:
            trace = trace.transpose(CYCLE, ANGLE)
        return _of_columns(trace, {**columns, _PRESSURE: trace.to_numpy()})
    if hasattr(trace, "columns") and hasattr(trace, "index"):  # a DataFrame
        flat = trace if ANGLE in trace.columns else trace.reset_index()
        if _PRESSURE not in trace.columns and ANGLE in flat.columns:
            return _of_frame(trace, flat)
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
    attrs.pop("warnings", None)  # those of the check just made stand
    return made.assign_attrs({str(name): value for name, value in attrs.items()})


def _of_frame(trace: Any, flat: Any) -> xr.Dataset:
    """Take several columns beside the angle as cycles, where names and shapes are of one series."""
    names = [name for name in flat.columns if name != ANGLE]
    heads = [heading(str(name)) for name in names]
    bad = next((k for k, head in enumerate(heads) if _is_no_cycle(head, heads[0])), None)
    angle = flat[ANGLE].to_numpy()
    if bad is None and len(names) > 1:
        bad = odd_shape(angle, flat[names].to_numpy().T)
    if len(names) < 2 or bad is not None:
        have = ", ".join(map(str, flat.columns))
        which = "" if bad is None else f", and {names[bad]} is not a cycle in bar of the cylinder of {names[0]}"
        raise DataError(f"the trace has no {_PRESSURE}, it has {have}{which}: {_FORMS}")
    return _of_columns(trace, {ANGLE: angle, _PRESSURE: flat[names].to_numpy().T})


def _is_no_cycle(head: Heading, first: Heading) -> bool:
    alike = (head.series, head.cylinder) == (first.series, first.cylinder)
    return not alike or head.unit not in (None, "bar") or head.quantity not in (None, "pressure")


def _index_name(index: Any) -> str:
    counts = getattr(index, "start", None) == 0 and getattr(index, "step", None) == 1
    return str(index.name) if index.name is not None else "an index that counts samples" if counts else ANGLE
