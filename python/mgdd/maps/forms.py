"""Forms of a calibration map: the guide's table, a Dataset, a pickle; and when two maps are equal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.guide import TimingMap
from mgdd.guide.map_table import SETTINGS
from mgdd.maps.cells import NUMBERS, SOURCES, TEXTS, WITHOUT_VALUE, MapTask
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.results.result import Result

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

_TIMING = "°CA aTDC"


class MapForms(Result):
    """What a calibration map turns into, and out of."""

    _name: str
    _axes: Mapping[str, NDArray[np.float64]]
    _values: NDArray[np.float64]
    _labels: Mapping[str, Label]
    _cells: Mapping[str, NDArray[Any]]
    _task: MapTask | None
    _provenance: Mapping[str, str]
    replaced: Any

    def to_timing_map(self, *, prior_sd_cad: float | None = None, forgetting: float | None = None) -> TimingMap:
        """Make the guide's table of it, which learns from confirmed optima.

        Parameters
        ----------
        prior_sd_cad, forgetting : float, optional
            As of `mgdd.guide.TimingMap`.

        Returns
        -------
        mgdd.guide.TimingMap
            With the values as best timings, at most as certain as by `sd`: a cell without it has ``prior_sd_cad``. It
            has no support yet: that counts confirmed optima.

        Raises
        ------
        mgdd.errors.DataError
            The values are not timings, or a cell has none.
        """
        if self._labels[self._name].units != _TIMING:
            raise DataError(f"{self._name} has unit {self._labels[self._name].units!r}: a timing map needs {_TIMING!r}")
        empty = ~np.isfinite(self._values)
        if empty.any():
            raise DataError(
                f"{self._name}: {empty.sum()} cells have no value: smooth the map with {argument('fill', 'True')}"
            )
        prior = SETTINGS["prior_sd_cad"] if prior_sd_cad is None else prior_sd_cad
        made = TimingMap(
            self._axes, self._values, prior_sd_cad=prior,
            forgetting=SETTINGS["forgetting"] if forgetting is None else forgetting,
        )  # fmt: skip
        data = made.to_dataset()
        finite = np.isfinite(self._cells["sd"]) & (self._cells["sd"] > 0.0)
        data["sd_cad"].values[:] = np.where(finite, np.minimum(self._cells["sd"], prior), prior)
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
        if not same or self._labels[self._name].units != _TIMING:
            raise DataError(f"the timing map has other axes than {self._name} over {', '.join(self._axes)}")
        learnt = timing.support > 0.0
        new: dict[str, Any] = {"source": "learned", "sd": timing.sd_cad, "support": timing.support, "objective": np.nan}
        cells = {column: np.where(learnt, entries, self._cells[column]) for column, entries in new.items()}
        made: Self = self.replaced(np.where(learnt, timing.timing_cad, self._values), cells=cells)
        return made

    @property
    def dataset(self) -> xr.Dataset:
        """The same as `to_dataset` gives."""
        return self.to_dataset()

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot import map_cells

        return map_cells(self, ax=ax)

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
        for name, (long_name, *_) in NUMBERS.items():
            unit = (
                self._labels[self._name].units
                if name in of_value
                else "unit of the objective"
                if name == "objective"
                else "-"
            )
            variables[name] = (dims, self._cells[name], unit, long_name)
        for name, (long_name, _) in TEXTS.items():
            variables[name] = (dims, self._cells[name], "-", long_name)
        attrs: dict[str, Any] = {"map": self._name}
        if self._task is not None:
            attrs |= {"task_objective": self._task.objective, "task_maximize": int(self._task.maximize)}
            attrs |= {f"task_limit_{name}": upper for name, upper in self._task.limits.items()}
        attrs |= {f"provenance_{name}": text for name, text in self._provenance.items()}
        return labelled_dataset(variables, attrs=attrs)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset, name: str | None = None, *, source: str | None = None) -> Self:
        """Make a map of what `to_dataset` gave, or of any variable over one or two axes.

        Parameters
        ----------
        dataset : xarray.Dataset
            With units and long names, as every Dataset of mgdd has them.
        name : str, optional
            The variable; the map that the Dataset names, if left out.
        source : str, optional
            Source of the cells of any other Dataset than a map. If left out: the attribute ``source`` of the variable,
            where it is one of those of a map, and ``extrapolated`` where the variable ``NAME_extrapolated`` is set;
            otherwise ``given``. Cells without a value are ``unattainable``.

        Returns
        -------
        CalibrationMap
            The map.

        Raises
        ------
        mgdd.errors.DataError
            No such variable, or one without axes or units.
        """
        value = str(dataset.attrs.get("map", "")) if name is None else name
        if value not in dataset or not 1 <= dataset[value].ndim <= 2:
            have = ", ".join(str(each) for each in dataset.data_vars if 1 <= dataset[each].ndim <= 2) or "none"
            if not value:
                raise DataError(
                    f"the Dataset names no map: give the name of a variable over one or two axes (it has {have}); "
                    "of a sweep make a map first, with optimize_map or mgdd map optimize"
                )
            raise DataError(f"no variable {value!r} over one or two axes: the Dataset has {have}; give its name")
        variable = dataset[value]
        dims = [str(dim) for dim in variable.dims]
        lacking = [dim for dim in dims if dim not in dataset.coords]
        if lacking:
            raise DataError(f"{value}: the axis {lacking[0]} has no coordinates: add them")
        for each in (*dims, value):
            if not {"units", "long_name"} <= set(dataset[each].attrs):
                raise DataError(f"{each} has no units or no long_name: set both in its attributes")
        values = variable.to_numpy()
        sources = np.full(values.shape, source or _source_of(variable), "U64")
        if source is None and f"{value}_extrapolated" in dataset:
            sources[dataset[f"{value}_extrapolated"].transpose(*dims).to_numpy() > 0] = "extrapolated"
        cells: dict[str, Any] = {"source": np.where(np.isfinite(values), sources, "unattainable")}
        task, provenance = None, {}
        if dataset.attrs.get("map") == value:
            cells = {each: dataset[each].to_numpy() for each in (*NUMBERS, *TEXTS) if each in dataset}
            task, provenance = _task_of(dataset.attrs), _under(dataset.attrs, "provenance_")
        labels = {each: label_of(dataset[each]) for each in (*dims, value)}
        axes = {dim: dataset[dim].to_numpy() for dim in dims}
        make: Any = cls
        made: Self = make(axes, values, name=value, labels=labels, cells=cells, task=task, provenance=provenance)
        return made

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MapForms) and self._parts() == other._parts()

    __hash__ = None  # type: ignore[assignment]

    def _parts(self) -> tuple[Any, ...]:
        columns = {**self._axes, "": self._values, **self._cells}
        exact = {name: (c.tolist() if c.dtype.kind == "U" else (c + 0.0).tobytes()) for name, c in columns.items()}
        return self._name, self._labels, exact, list(self._axes), self._task, self._provenance

    def __reduce__(self) -> tuple[Any, ...]:
        options = {"labels": self._labels, "cells": self._cells, "task": self._task, "provenance": self._provenance}
        return _rebuild, (type(self), self._axes, self._values, {"name": self._name, **options})


def _source_of(variable: xr.DataArray) -> str:
    source = str(variable.attrs.get("source", ""))  # an attribute that other files use for texts of their own
    return source if source in SOURCES and source not in WITHOUT_VALUE else "given"


def _under(attrs: Mapping[Any, Any], prefix: str) -> dict[str, Any]:
    return {str(key).removeprefix(prefix): value for key, value in attrs.items() if str(key).startswith(prefix)}


def _task_of(attrs: Mapping[Any, Any]) -> MapTask | None:
    if "task_objective" not in attrs:
        return None
    limits = {name: float(value) for name, value in _under(attrs, "task_limit_").items()}
    return MapTask(objective=str(attrs["task_objective"]), limits=limits, maximize=bool(attrs.get("task_maximize", 1)))


def _rebuild(cls: type[MapForms], axes: Any, values: Any, options: dict[str, Any]) -> MapForms:
    make: Any = cls
    made: MapForms = make(axes, values, **options)
    return made
