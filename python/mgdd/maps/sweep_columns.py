"""A sweep as arrays: one row per cell of a map, one column per point of the swept input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, argument, did_you_mean
from mgdd.results.labels import Label, check_labels, label_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_FEWEST = 3


@dataclass(frozen=True, kw_only=True)
class SweepColumns:
    """Variables of a sweep by name, each of shape (cells, points); the swept input increases, cells follow the axes."""

    axes: Mapping[str, Array]
    over: Array
    columns: Mapping[str, Array]
    labels: Mapping[str, Label]

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells per axis."""
        return tuple(entries.size for entries in self.axes.values())


def sweep_columns(sweep: xr.Dataset, over: str, names: tuple[str, ...], lead: str) -> SweepColumns:
    """Take variables out of a sweep, or name what is wrong with it; the axes are those of the variable `lead`."""
    for name in names:
        if name not in sweep.data_vars:
            near = did_you_mean(name, map(str, sweep.data_vars)) or f"it has {', '.join(map(str, sweep.data_vars))}"
            raise ParameterError(f"the sweep has no variable {name!r}: {near}")
    dims = [str(dim) for dim in sweep[lead].dims]
    axes = [dim for dim in dims if dim != over]
    if over not in dims or not 1 <= len(axes) <= 2:
        raise DataError(
            f"{lead} stands over {' x '.join(dims) or 'nothing'}: an optimum needs one or two operating axes and "
            f"{over!r}; name the swept input with {argument('over')}"
        )
    check_labels(sweep[list(names)])
    for dim in (*axes, over):
        _check_rising(dim, sweep[dim].to_numpy())
    if sweep.sizes[over] < _FEWEST:
        raise DataError(f"{over} has {sweep.sizes[over]} points: an optimum needs {_FEWEST} at least")
    columns = {}
    for name in names:
        odd = [str(dim) for dim in sweep[name].dims if dim not in dims]
        if odd:
            raise DataError(f"{name} stands over {odd[0]!r} too, {lead} does not: select one of its entries")
        own_variable: Any = sweep.variables[name]
        wide = own_variable.set_dims({dim: sweep.sizes[dim] for dim in (*axes, over)})
        columns[name] = np.ascontiguousarray(wide.to_numpy(), np.float64).reshape(-1, sweep.sizes[over])
    labels = {name: label_of(sweep[name]) for name in (*axes, over, *names)}
    own = {axis: sweep[axis].to_numpy().astype(np.float64) for axis in axes}
    return SweepColumns(axes=own, over=sweep[over].to_numpy().astype(np.float64), columns=columns, labels=labels)


def _check_rising(name: str, entries: NDArray[np.float64]) -> None:
    if entries.dtype.kind not in "iuf" or not np.isfinite(entries).all():
        raise DataError(f"{name}: its coordinates must be finite numbers")
    bad = np.flatnonzero(np.diff(entries) <= 0.0)
    if bad.size:
        i = int(bad[0])
        raise DataError(
            f"{name}[{i + 1}] = {entries[i + 1]:g} after {entries[i]:g}: breakpoints must increase and stand once; "
            f"sort them or take the mean of repeated ones, for example sweep.groupby({name!r}).mean()"
        )
