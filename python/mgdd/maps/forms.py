"""Forms of a calibration map: a Dataset and its file, a pickle; and when two maps are equal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd._settings import remade
from mgdd.errors import DataError
from mgdd.io.binary_files import read_netcdf
from mgdd.maps.cells import NUMBERS, SOURCES, TEXTS, WITHOUT_VALUE, MapTask
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.results.result import Result

if TYPE_CHECKING:
    import os

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray


class MapForms(Result):
    """What a calibration map turns into, and out of."""

    unit: Any
    _name: str
    _axes: Mapping[str, NDArray[np.float64]]
    _values: NDArray[np.float64]
    _labels: Mapping[str, Label]
    _cells: Mapping[str, NDArray[Any]]
    _task: MapTask | None
    _provenance: Mapping[str, str]
    replaced: Any

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
        for name, column in self._cells.items():
            unit = self.unit if name in of_value else "unit of the objective" if name == "objective" else "-"
            label = self._labels.get(name) or Label(unit, str({**NUMBERS, **TEXTS}[name][0]))
            variables[name] = (dims, column, *label)
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
            own = [str(each) for each in dataset.data_vars if each != value and set(dataset[each].dims) == set(dims)]
            cells = {each: dataset[each].transpose(*dims).to_numpy() for each in own}
            task, provenance = _task_of(dataset.attrs), _under(dataset.attrs, "provenance_")
        named = [each for each in (*dims, value, *cells) if each not in NUMBERS and each not in TEXTS]
        labels = {each: label_of(dataset[each]) for each in named}
        axes = {dim: dataset[dim].to_numpy() for dim in dims}
        make: Any = cls
        made: Self = make(axes, values, name=value, labels=labels, cells=cells, task=task, provenance=provenance)
        return made

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a file that `save` wrote.

        Parameters
        ----------
        path : path-like
            Ends in ``.nc``; `read_map` reads other forms too.

        Returns
        -------
        CalibrationMap
            Equal to the one that was saved.

        Raises
        ------
        mgdd.errors.DataError
            No netCDF file, or one that holds no map.
        """
        try:
            return cls.from_dataset(read_netcdf(path))
        except DataError as error:
            raise error if str(error).startswith(f"{path}") else DataError(f"{path}: {error}") from error

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MapForms) and self._parts() == other._parts()

    __hash__ = None  # type: ignore[assignment]

    def _parts(self) -> tuple[Any, ...]:
        columns = {**self._axes, "": self._values, **self._cells}
        exact = {name: (c.tolist() if c.dtype.kind == "U" else (c + 0.0).tobytes()) for name, c in columns.items()}
        return self._name, self._labels, exact, list(self._axes), self._task, self._provenance

    def __reduce__(self) -> tuple[Any, ...]:
        options = {"labels": self._labels, "cells": self._cells, "task": self._task, "provenance": self._provenance}
        return remade, (type(self), (self._axes, self._values), {"name": self._name, **options}, {})


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
