"""A calibration map: values over one or two axes, and for each cell where its value comes from."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.guide import TimingMap
from mgdd.guide.conditions import numbers_of
from mgdd.guide.map_table import SETTINGS
from mgdd.maps.cells import NUMBERS, TEXTS, MapTask, checked_cells, checked_label, checked_name
from mgdd.results.describe import as_html, rows_of
from mgdd.results.labels import Label, label_of, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = ["CalibrationMap", "MapPoints"]

_TIMING = "°CA aTDC"


class MapPoints(NamedTuple):
    """What a map says at points.

    Parameters
    ----------
    values : numpy.ndarray
        In the unit of the map; NaN where a cell without a value takes part.
    held_outside : numpy.ndarray of bool
        Which points lie outside of the axes: their value is that of the edge.
    """

    values: NDArray[np.float64]
    held_outside: NDArray[np.bool_]


class CalibrationMap:
    """A table over one or two axes as a control unit holds it: (bi)linear between its cells, held at its edges.

    It does not change. Beside its value each cell knows its source, its support, its standard deviation, the range in
    which the value may lie and the limit that holds it.

    Parameters
    ----------
    axes : mapping of str to array_like
        One or two, strictly increasing, two entries at least; the ending of a name says its unit.
    values : array_like
        One axis of the array per axis; a number for all cells. NaN only where the source says why.
    name : str
        What the values are, for example ``soc_cad``.
    labels : mapping of str to (str, str), optional
        Unit and long name of the value and of axes; left out, they are those of the name.
    cells : mapping of str to array_like, optional
        Columns of one entry per cell, or of one for all: ``source`` (``given``, ``measured``, ``optimised``,
        ``smoothed``, ``interpolated``, ``held``, ``learned``; without a value ``infeasible`` or ``unattainable``),
        ``support`` (points behind the value), ``sd``, ``low`` and ``high`` [unit of the value], ``objective`` and
        ``active_limit``.
    task : MapTask, optional
        What the cells were optimised for, as `optimize_map` notes it.
    provenance : mapping of str to str, optional
        What it is and where it comes from: ``from``, ``date``, ``version`` and whatever else has to travel with it.

    Raises
    ------
    mgdd.errors.ParameterError, mgdd.errors.ShapeError, mgdd.errors.DataError
        Axes, values, units or cells that make no map; the message names the entry or the cell.

    Examples
    --------
    >>> from mgdd.maps import CalibrationMap
    >>> axes = {"speed_rpm": [900, 1500, 3000], "fuel_mg": [6, 20]}
    >>> soc = CalibrationMap(axes, [[-1, -4], [-2, -6], [-5, -9]], name="soc_cad", provenance={"from": "bench run 7"})
    >>> soc
    <CalibrationMap soc_cad [°CA aTDC], 3 speed_rpm x 2 fuel_mg, 6 given>
    >>> at = soc.lookup({"speed_rpm": [1200, 4000], "fuel_mg": 13})
    >>> at.values.tolist(), at.held_outside.tolist()
    ([-3.25, -7.0], [False, True])
    """

    def __init__(
        self,
        axes: Mapping[str, ArrayLike],
        values: ArrayLike,
        *,
        name: str,
        labels: Mapping[str, tuple[str, str]] | None = None,
        cells: Mapping[str, ArrayLike] | None = None,
        task: MapTask | None = None,
        provenance: Mapping[str, str] | None = None,
    ) -> None:
        self._name = checked_name("name", name)
        if not isinstance(axes, Mapping) or not 1 <= len(axes) <= 2:
            raise ParameterError.of("axes", axes, "one or two names with entries, as {'fuel_mg': [6, 20, 40]}")
        own = {checked_name("axis", axis, (name,)): _column(axis, entries) for axis, entries in axes.items()}
        shape = tuple(entries.size for entries in own.values())
        table = np.array(values, np.float64)
        if table.ndim and table.shape != shape:
            raise ShapeError(f"{name} has shape {table.shape}: the axes {', '.join(own)} make {shape}")
        self._values = np.ascontiguousarray(np.broadcast_to(table, shape))
        self._table = _table(own, self._values)
        said = dict(labels or {})
        self._labels = {each: checked_label(each, said.pop(each, None)) for each in (*own, name)}
        if said:
            raise ParameterError.of("labels", next(iter(said)), f"of {', '.join(self._labels)}")
        self._cells = checked_cells(self._values, own, cells or {})
        self._task, self._provenance = task, _texts(provenance or {})
        for array in (*own.values(), self._values):
            array.setflags(write=False)
        self._axes = own

    @property
    def name(self) -> str:
        """What the values are."""
        return self._name

    @property
    def unit(self) -> str:
        """Unit of the values, as figures print it."""
        return self._labels[self._name].units

    @property
    def axes(self) -> Mapping[str, NDArray[np.float64]]:
        """Entries of each axis, by name; not writable."""
        return MappingProxyType(self._axes)

    @property
    def values(self) -> NDArray[np.float64]:
        """Value of every cell, one axis of the array per axis of the map; not writable."""
        return self._values

    @property
    def cells(self) -> Mapping[str, NDArray[Any]]:
        """What is known of every cell, by the names of the columns; not writable."""
        return MappingProxyType(self._cells)

    @property
    def labels(self) -> Mapping[str, Label]:
        """Unit and long name of axes and value."""
        return MappingProxyType(self._labels)

    @property
    def task(self) -> MapTask | None:
        """What the cells were optimised for."""
        return self._task

    @property
    def provenance(self) -> Mapping[str, str]:
        """Where the map comes from."""
        return MappingProxyType(self._provenance)

    def lookup(self, points: Mapping[str, ArrayLike] | Any) -> MapPoints:
        """Read the map at points, in the C++ core.

        Parameters
        ----------
        points : mapping of str to array_like, or OperatingPoint
            Coordinates by the names of the axes, broadcast together; other names are ignored.

        Returns
        -------
        MapPoints
            Values and which of them are held at the edge, in the shape of the points.

        Raises
        ------
        mgdd.errors.ParameterError
            An axis is missing.
        """
        return self._read(self._table, points)

    def replaced(self, values: ArrayLike | None = None, **changes: Any) -> Self:
        """Give a map on the same axes with other values, cells, task or provenance.

        Parameters
        ----------
        values : array_like, optional
            As of a new map.
        **changes
            ``cells`` (columns that are not named stay), ``task``, ``provenance`` (entries that are not named stay).

        Returns
        -------
        CalibrationMap
            A new one.

        Raises
        ------
        mgdd.errors.Error
            As by a new map.
        """
        return type(self)(
            self._axes,
            self._values if values is None else values,
            name=self._name,
            labels=self._labels,
            cells={**self._cells, **changes.pop("cells", {})},
            provenance={**self._provenance, **changes.pop("provenance", {})},
            **{"task": self._task, **changes},
        )

    def to_timing_map(self, *, prior_sd_cad: float | None = None, forgetting: float | None = None) -> TimingMap:
        """Make the guide's table of it, which learns from confirmed optima.

        Parameters
        ----------
        prior_sd_cad, forgetting : float, optional
            As of `mgdd.guide.TimingMap`.

        Returns
        -------
        mgdd.guide.TimingMap
            With the values as best timings, at most as certain as `sd` says: a cell without it has ``prior_sd_cad``. It
            has no support yet: that counts confirmed optima.

        Raises
        ------
        mgdd.errors.DataError
            The values are no timing, or a cell has none.
        """
        if self.unit != _TIMING:
            raise DataError(f"{self._name} has unit {self.unit!r}: a timing map needs {_TIMING!r}")
        empty = ~np.isfinite(self._values)
        if empty.any():
            raise DataError(f"{self._name}: {empty.sum()} cells have no value: fill them with smooth_map(fill=True)")
        prior = SETTINGS["prior_sd_cad"] if prior_sd_cad is None else prior_sd_cad
        made = TimingMap(
            self._axes, self._values, prior_sd_cad=prior,
            forgetting=SETTINGS["forgetting"] if forgetting is None else forgetting,
        )  # fmt: skip
        data = made.to_dataset()
        known = np.isfinite(self._cells["sd"]) & (self._cells["sd"] > 0.0)
        data["sd_cad"].values[:] = np.where(known, np.minimum(self._cells["sd"], prior), prior)
        return TimingMap.from_dataset(data)

    def learned_from(self, timing: TimingMap) -> Self:
        """Take over what a timing map has learnt since it was made of this map.

        Parameters
        ----------
        timing : mgdd.guide.TimingMap
            On the same axes.

        Returns
        -------
        CalibrationMap
            Cells with confirmed optima behind them have the source ``learned`` with timing, standard deviation and
            support of the timing map; their ranges and limits stay.

        Raises
        ------
        mgdd.errors.DataError
            Other axes.
        """
        same = list(timing.axes) == list(self._axes) and all(
            np.array_equal(timing.axes[name], entries) for name, entries in self._axes.items()
        )
        if not same or self.unit != _TIMING:
            raise DataError(f"the timing map has other axes than {self._name} over {', '.join(self._axes)}")
        learnt = timing.support > 0.0
        new: dict[str, Any] = {"source": "learned", "sd": timing.sd_cad, "support": timing.support, "objective": np.nan}
        cells = {column: np.where(learnt, entries, self._cells[column]) for column, entries in new.items()}
        return self.replaced(np.where(learnt, timing.timing_cad, self._values), cells=cells)

    def to_dataset(self) -> xr.Dataset:
        """Give the map as data, which figures and netCDF take.

        Returns
        -------
        xarray.Dataset
            The value by its name and every column of the cells, over the axes; ``map`` among the attributes names it.
        """
        dims, of_value = tuple(self._axes), ("sd", "low", "high")
        variables: dict[str, tuple[Any, ...]] = {
            name: (name, entries, *self._labels[name]) for name, entries in self._axes.items()
        }
        variables[self._name] = (dims, self._values, *self._labels[self._name])
        for name, (said, *_) in NUMBERS.items():
            unit = self.unit if name in of_value else "unit of the objective" if name == "objective" else "-"
            variables[name] = (dims, self._cells[name], unit, said)
        for name, (said, _) in TEXTS.items():
            variables[name] = (dims, self._cells[name], "-", said)
        attrs: dict[str, Any] = {"map": self._name}
        if self._task is not None:
            attrs |= {"task_objective": self._task.objective, "task_maximize": int(self._task.maximize)}
            attrs |= {f"task_limit_{name}": upper for name, upper in self._task.limits.items()}
        attrs |= {f"provenance_{name}": text for name, text in self._provenance.items()}
        return labelled_dataset(variables, attrs=attrs)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset, name: str | None = None, *, source: str = "measured") -> Self:
        """Make a map of what `to_dataset` gave, or of any variable over one or two axes.

        Parameters
        ----------
        dataset : xarray.Dataset
            With units and long names, as every Dataset of mgdd has them.
        name : str, optional
            The variable; the map that the Dataset names, if left out.
        source : str
            Source of the cells where the Dataset has none; those without a value are ``unattainable``.

        Returns
        -------
        CalibrationMap
            The map.

        Raises
        ------
        mgdd.errors.DataError
            No such variable, or one without axes or units.
        """
        own = str(dataset.attrs.get("map", "")) if name is None else name
        if own not in dataset or not 1 <= dataset[own].ndim <= 2:
            have = ", ".join(str(each) for each in dataset.data_vars if 1 <= dataset[each].ndim <= 2) or "none"
            raise DataError(f"no variable {own!r} over one or two axes: the Dataset has {have}; give its name")
        variable = dataset[own]
        dims = [str(dim) for dim in variable.dims]
        lacking = [dim for dim in dims if dim not in dataset.coords]
        if lacking:
            raise DataError(f"{own}: the axis {lacking[0]} has no coordinates: add them")
        for each in (*dims, own):
            if not {"units", "long_name"} <= set(dataset[each].attrs):
                raise DataError(f"{each} has no units or no long_name: say both in its attributes")
        values = variable.to_numpy()
        cells: dict[str, Any] = {"source": np.where(np.isfinite(values), source, "unattainable")}
        task, provenance = None, {}
        if dataset.attrs.get("map") == own:
            cells = {each: dataset[each].to_numpy() for each in (*NUMBERS, *TEXTS) if each in dataset}
            task, provenance = _task_of(dataset.attrs), _under(dataset.attrs, "provenance_")
        labels = {each: label_of(dataset[each]) for each in (*dims, own)}
        axes = {dim: dataset[dim].to_numpy() for dim in dims}
        return cls(axes, values, name=own, labels=labels, cells=cells, task=task, provenance=provenance)

    def _read(self, table: Any, points: Any) -> MapPoints:
        given = points if isinstance(points, Mapping) else numbers_of(points)
        lacking = [name for name in self._axes if name not in given]
        if lacking:
            raise ParameterError.of("points", list(given), f"coordinates with {' and '.join(self._axes)}")
        columns = np.broadcast_arrays(*(np.asarray(given[name], np.float64) for name in self._axes))
        values, outside = table.at(np.stack([column.ravel() for column in columns]))
        return MapPoints(values.reshape(columns[0].shape), outside.reshape(columns[0].shape))

    def sd_at(self, points: Mapping[str, ArrayLike] | Any) -> NDArray[np.float64]:
        """Read the standard deviation at points, linear between the cells: never below that of independent cells.

        Parameters
        ----------
        points : mapping of str to array_like, or OperatingPoint
            As by `lookup`.

        Returns
        -------
        numpy.ndarray
            [unit of the value]; NaN where it is not known.
        """
        return self._read(_table(self._axes, self._cells["sd"]), points).values

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CalibrationMap) and self._parts() == other._parts()

    __hash__ = None  # type: ignore[assignment]

    def _parts(self) -> tuple[Any, ...]:
        columns = {**self._axes, "": self._values, **self._cells}
        exact = {name: (c.tolist() if c.dtype.kind == "U" else (c + 0.0).tobytes()) for name, c in columns.items()}
        return self._name, self._labels, exact, list(self._axes), self._task, self._provenance

    def __reduce__(self) -> tuple[Any, ...]:
        said = {"labels": self._labels, "cells": self._cells, "task": self._task, "provenance": self._provenance}
        return _rebuild, (type(self), self._axes, self._values, {"name": self._name, **said})

    def __repr__(self) -> str:
        size = " x ".join(f"{entries.size} {name}" for name, entries in self._axes.items())
        kinds, counts = np.unique(self._cells["source"], return_counts=True)
        said = ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts, strict=True))
        return f"<CalibrationMap {self._name} [{self.unit}], {size}, {said}>"

    def _repr_html_(self) -> str:
        return as_html(repr(self)[1:-1], rows_of({**self._axes, self._name: self._values, **self._provenance}))


def _column(name: str, entries: ArrayLike) -> NDArray[np.float64]:
    column = np.array(entries, np.float64)
    if column.ndim != 1:
        raise ShapeError(f"{name} has {column.ndim} dimensions: an axis is one column of entries")
    return column


def _table(axes: Mapping[str, NDArray[np.float64]], values: NDArray[np.float64]) -> Any:
    entries = [column.tolist() for column in axes.values()]
    return _core.math.LookupTable(names=list(axes), axes=entries, values=values)


def _texts(provenance: Mapping[str, str]) -> dict[str, str]:
    for key, text in provenance.items():
        checked_name("provenance", key)
        if not isinstance(text, str) or not text.strip() or text != " ".join(text.split()):
            raise ParameterError.of(f"provenance {key}", text, "a text of one line, not empty, single blanks in it")
    return dict(provenance)


def _under(attrs: Mapping[Any, Any], prefix: str) -> dict[str, Any]:
    return {str(key).removeprefix(prefix): value for key, value in attrs.items() if str(key).startswith(prefix)}


def _task_of(attrs: Mapping[Any, Any]) -> MapTask | None:
    if "task_objective" not in attrs:
        return None
    limits = {name: float(value) for name, value in _under(attrs, "task_limit_").items()}
    return MapTask(objective=str(attrs["task_objective"]), limits=limits, maximize=bool(attrs.get("task_maximize", 1)))


def _rebuild(cls: type[CalibrationMap], axes: Any, values: Any, said: dict[str, Any]) -> CalibrationMap:
    return cls(axes, values, **said)
