"""Two maps side by side, and a map against the sweep that it was made of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mgdd.errors import DataError, ParameterError, argument
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.maps.optimum import optimize_map
from mgdd.maps.sweep_columns import between, sweep_columns
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr


def compare_maps(
    first: CalibrationMap | xr.Dataset,
    second: CalibrationMap | xr.Dataset,
    *,
    grid: Literal["union", "first"] = "union",
    tolerance: float | None = None,
) -> xr.Dataset:
    """Subtract the first map from the second.

    Parameters
    ----------
    first, second : CalibrationMap, or the Dataset of one
        Of the same value over the same axes; their breakpoints may differ.
    grid : {"union", "first"}
        Where they are compared: at the breakpoints of both inside of both, or at those of the first.
    tolerance : float, optional
        Differences beyond it are counted, in the unit of the value.

    Returns
    -------
    xarray.Dataset
        Over the axes: both maps, ``difference`` (second minus first), ``sd`` of the difference, NaN where one is not
        known, ``held_outside`` where a map is held at its edge, and ``beyond`` the tolerance; further
        ``largest_difference`` by size, ``rms_difference`` and ``n_beyond``. Cells without a value count for none.

    Raises
    ------
    mgdd.errors.DataError
        Other axes or units, or axes that have nothing in common.
    mgdd.errors.ParameterError
        An unknown grid, a negative tolerance.

    Examples
    --------
    >>> from mgdd.maps import CalibrationMap, compare_maps
    >>> old = CalibrationMap({"fuel_mg": [10, 20, 30]}, [-4, -6, -9], name="soc_cad")
    >>> new = CalibrationMap({"fuel_mg": [10, 30]}, [-4, -8], name="soc_cad")
    >>> found = compare_maps(old, new, tolerance=0.5)
    >>> found["difference"].values.tolist(), int(found["n_beyond"])
    ([0.0, 0.0, 1.0], 1)
    """
    first, second = map_of(first, "first"), map_of(second, "second")
    ParameterError.unless(grid in ("union", "first"), "grid", grid, "'union' or 'first'")
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance >= 0.0):
        raise ParameterError.of("tolerance", tolerance, f">= 0 {first.unit}")
    if list(first.axes) != list(second.axes):
        raise DataError(
            f"one map stands over {', '.join(first.axes)}, the other over {', '.join(second.axes)}: the same axes in "
            "the same order are needed"
        )
    for label, other in zip((*first.axes, first.name), (*second.axes, second.name), strict=True):
        if first.labels[label].units != second.labels[other].units:
            raise DataError(
                f"{label} has unit {first.labels[label].units!r} in one map and {second.labels[other].units!r} in the "
                "other: convert one"
            )
    axes = {name: _common(name, entries, second.axes[name], grid) for name, entries in first.axes.items()}
    points = dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True))
    first_values, second_values = first.lookup(points), second.lookup(points)
    difference = second_values.values - first_values.values
    sd = np.hypot(first.sd_at(points), second.sd_at(points))
    finite = difference[np.isfinite(difference)]
    beyond = np.abs(difference) > (np.inf if tolerance is None else tolerance)
    largest = finite[np.argmax(np.abs(finite))] if finite.size else np.nan
    dims, unit, name = tuple(axes), first.unit, first.labels[first.name].long_name
    of_unit = (unit.removesuffix(" aTDC"),)  # a difference of angles has no zero
    return labelled_dataset(
        {
            **{axis: (axis, entries, *first.labels[axis]) for axis, entries in axes.items()},
            "first": (dims, first_values.values, unit, f"{name}, first map"),
            "second": (dims, second_values.values, unit, f"{name}, second map"),
            "difference": (dims, difference, *of_unit, f"{name}, second minus first"),
            "sd": (dims, sd, *of_unit, "standard deviation of the difference"),
            "held_outside": (dims, first_values.held_outside | second_values.held_outside, "-", "held at an edge"),
            "beyond": (dims, beyond, "-", "beyond the tolerance"),
            "largest_difference": ((), float(largest), *of_unit, "largest difference by size"),
            "rms_difference": ((), _rms(finite), *of_unit, "root mean square difference"),
            "n_beyond": ((), int(beyond.sum()), "-", "cells beyond the tolerance"),
        },
        attrs={"map": "difference", "of": first.name} | ({} if tolerance is None else {"tolerance": float(tolerance)}),
    )


def apply_map(table: CalibrationMap | xr.Dataset, sweep: xr.Dataset) -> xr.Dataset:
    """Read a sweep at the values of a map: what the map achieves.

    Parameters
    ----------
    table : CalibrationMap, or the Dataset of one
        Whose name is the swept input, on the operating points of the sweep.
    sweep : xarray.Dataset
        As of `optimize_map`.

    Returns
    -------
    xarray.Dataset
        The map and every variable of the sweep over the operating axes, linear between the points of the sweep; NaN
        where the map has no value. A map that has its objective has ``loss`` too: how far the objective lies from
        that of `optimize_map` under the limits of the map.

    Raises
    ------
    mgdd.errors.DataError
        The sweep has other operating points, or the map leaves its range.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.maps import apply_map, optimize_map
    >>> from mgdd.results.labels import labelled_dataset
    >>> soc, fuel = np.linspace(-12, 4, 17), np.array([10.0, 20.0])
    >>> sweep = labelled_dataset({
    ...     "soc_cad": ("soc_cad", soc), "fuel_mg": ("fuel_mg", fuel, "mg", "fuel"),
    ...     "efficiency_gross": (("fuel_mg", "soc_cad"), 0.5 - 2e-4 * (soc + 0.3 * fuel[:, None]) ** 2),
    ... })
    >>> best = optimize_map(sweep, "efficiency_gross")
    >>> apply_map(best.replaced(best.values + 2), sweep)["loss"].values.round(4).tolist()
    [0.0008, 0.0008]
    """
    table = map_of(table)
    dims_of_map = (*table.axes, table.name)
    names = tuple(str(each) for each in sweep.data_vars if set(dims_of_map) == set(map(str, sweep[each].dims)))
    if not names:
        raise DataError(f"the sweep has no variable over {', '.join(dims_of_map)}: it does not belong to this map")
    data = sweep_columns(sweep, table.name, names, names[0])
    if set(data.axes) != set(table.axes) or any(
        not np.array_equal(data.axes[name], entries) for name, entries in table.axes.items()
    ):
        raise DataError(f"{', '.join(table.axes)}: the sweep has other breakpoints than the map")
    at = np.transpose(table.values, [list(table.axes).index(name) for name in data.axes]).ravel()
    finite = np.isfinite(at)
    if (at[finite] < data.over[0]).any() or (at[finite] > data.over[-1]).any():
        low, high = data.over[0], data.over[-1]
        raise DataError(f"{table.name}: the map leaves the sweep, {low:g} to {high:g}: widen the sweep")
    place = np.where(finite, at, data.over[0])
    interval = np.clip(np.searchsorted(data.over, place, side="right") - 1, 0, data.over.size - 2)
    share = (place - data.over[interval]) / np.diff(data.over)[interval]
    dims = tuple(data.axes)
    out: dict[str, tuple[Any, ...]] = {name: (name, entries, *data.labels[name]) for name, entries in data.axes.items()}
    out[table.name] = (dims, at.reshape(data.shape), *table.labels[table.name])
    achieved = {name: np.where(finite, between(data.columns[name], share, interval), np.nan) for name in names}
    for name, column in achieved.items():
        out[name] = (dims, column.reshape(data.shape), *data.labels[name])
    task = table.task
    if task is not None and task.objective in achieved and set(task.limits) <= set(names):
        best = optimize_map(
            sweep[list(names)], task.objective, over=table.name, limits=task.limits, maximize=task.maximize,
            infeasible="keep",
        )  # fmt: skip
        order = [list(best.axes).index(name) for name in data.axes]
        sign = 1.0 if task.maximize else -1.0
        loss = sign * (np.transpose(best.cells["objective"], order).ravel() - achieved[task.objective])
        unit = data.labels[task.objective].units
        out["loss"] = (dims, loss.reshape(data.shape), unit, f"loss of {data.labels[task.objective].long_name}")
    return labelled_dataset(out)


def _common(name: str, one: Any, two: Any, grid: str) -> Any:
    if grid == "first":
        return one
    both = np.union1d(one, two)
    inside = both[(both >= max(one[0], two[0])) & (both <= min(one[-1], two[-1]))]
    if inside.size < 2:
        raise DataError(
            f"{name}: {one[0]:g} to {one[-1]:g} and {two[0]:g} to {two[-1]:g} have nothing in common: pass "
            f"{argument('grid', repr('first'))}"
        )
    return inside


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def achieved_figures(table: CalibrationMap, achieved: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Give mean, ends and place of the highest of what `apply_map` found: of loss, objective and limits, or all."""
    task = table.task
    named = [] if task is None else [name for name in ("loss", task.objective, *task.limits) if name in achieved]
    figures: dict[str, dict[str, Any]] = {}
    for name in named or [str(name) for name in achieved.data_vars if name != table.name]:
        values = achieved[name].transpose(*table.axes).to_numpy()
        if not np.isfinite(values).any():
            continue
        places = np.unravel_index(int(np.nanargmax(values)), values.shape)
        figures[name] = {
            "mean": float(np.nanmean(values)),
            "lowest": float(np.nanmin(values)),
            "highest": float(np.nanmax(values)),
            "highest_at": {axis: float(table.axes[axis][k]) for axis, k in zip(table.axes, places, strict=True)},
        }
    return figures


def steepest(table: CalibrationMap, axis: str) -> float | None:
    """Give the largest change per unit of an axis; None where no two neighbours have a value."""
    place = list(table.axes).index(axis)
    shape = [1] * table.values.ndim
    shape[place] = -1
    slopes = np.abs(np.diff(table.values, axis=place)) / np.diff(table.axes[axis]).reshape(shape)
    return float(np.nanmax(slopes)) if np.isfinite(slopes).any() else None
