"""What a timing map holds, and its forms outside of the program: Dataset, parameter file, pickle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from mgdd.errors import DataError
from mgdd.guide.map_table import read_map_table, write_map_table
from mgdd.io.parameters import Entry, ParameterFile, Parameters, Wanted, wanted
from mgdd.results.labels import label_of, labelled_dataset
from mgdd.results.result import Result
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import os

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

_CAD, _SQUARED = "°CA aTDC", "degree**2"
_CELLS = {"timing_cad": _CAD, "variance_cad2": _SQUARED, "support": "-"}
_SETTINGS = {"prior_sd_cad": "°CA", "forgetting": "-"}
_CORE = dict(zip(_CELLS, ("values_cad", "variance", "support"), strict=True))


class MapForms(Parameters, Result):
    """Axes and cells of a map, as arrays, as a Dataset and as a parameter file."""

    _axes: Mapping[str, NDArray[np.float64]]
    _settings: Mapping[str, float]
    _columns: Any

    @property
    def axes(self) -> Mapping[str, NDArray[np.float64]]:
        """Entries of each axis, by name."""
        return dict(self._axes)

    @property
    def timing_cad(self) -> NDArray[np.float64]:
        """Value of every cell [°CA aTDC], one axis of the array per axis of the map."""
        return self._table("values_cad")

    @property
    def sd_cad(self) -> NDArray[np.float64]:
        """Standard deviation of every cell [°CA]."""
        return np.sqrt(self._table("variance"))

    @property
    def support(self) -> NDArray[np.float64]:
        """Confirmed optima behind every cell, forgotten ones taken off."""
        return self._table("support")

    @property
    def dataset(self) -> xr.Dataset:
        """The same as `to_dataset` gives."""
        return self.to_dataset()

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot import map_cells

        return map_cells(self, "timing_cad", ax=ax)

    def to_dataset(self) -> xr.Dataset:
        """Give the map as data.

        Returns
        -------
        xarray.Dataset
            ``timing_cad``, ``sd_cad`` and ``support`` over the axes.
        """
        dims = tuple(self._axes)
        return labelled_dataset(
            {
                **{name: (name, entries, unit_of(name), name) for name, entries in self._axes.items()},
                "timing_cad": (dims, self.timing_cad, _CAD, "best timing"),
                "sd_cad": (dims, self.sd_cad, "°CA", "standard deviation of the best timing"),
                "support": (dims, self.support, "-", "confirmed optima"),
            },
            attrs=self._settings,
        )

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Self:
        """Make a map of what `to_dataset` gave.

        Parameters
        ----------
        dataset : xarray.Dataset
            With ``timing_cad``, ``sd_cad`` and ``support``.

        Returns
        -------
        TimingMap
            The same map, its standard deviations to the last digit but one.

        Raises
        ------
        mgdd.errors.DataError
            A variable is missing, or has another unit.
        """
        for name in ("timing_cad", "sd_cad", "support"):
            if name not in dataset:
                raise DataError(f"{name} is missing: a map has timing_cad, sd_cad and support")
        unit = label_of(dataset["timing_cad"]).units
        if unit != _CAD:
            raise DataError(f"timing_cad has units {unit!r}: must be {_CAD!r}")
        dims = dataset["timing_cad"].dims
        axes = {str(name): dataset[name].to_numpy() for name in dims}
        own = {name: float(dataset.attrs[name]) for name in _SETTINGS if name in dataset.attrs}
        make: Any = cls
        made: Self = make(axes, dataset["timing_cad"].to_numpy(), **own)
        made._columns = {
            **made._columns,
            "variance": (dataset["sd_cad"].transpose(*dims).to_numpy().ravel() ** 2).tolist(),
            "support": dataset["support"].transpose(*dims).to_numpy().ravel().tolist(),
        }
        return made

    def write_csv(self, path: str | os.PathLike[str], *, source: ArrayLike = "") -> None:
        """Write a plain CSV, a row per cell, which spreadsheets and `read_csv` take without options.

        Parameters
        ----------
        path : path-like
            The file; an existing one is replaced.
        source : str or array_like of str
            Where the numbers come from, one text or one per cell, in a column of its own: without comma, quote or line
            break.

        Raises
        ------
        mgdd.errors.ParameterError, mgdd.errors.ShapeError
            Such a text, or another number of texts; nothing is written then.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> from mgdd.guide import TimingMap
        >>> timing = TimingMap({"fuel_mg": [6, 20]}, [-2.0, -5.5])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = pathlib.Path(folder) / "timing.csv"
        ...     timing.write_csv(file, source="bench run 7")
        ...     print(file.read_text(), end="")
        ...     TimingMap.read_csv(file) == timing
        fuel_mg,timing_cad,sd_cad,support,prior_sd_cad,forgetting,source
        6.0,-2.0,3.0,0.0,3.0,0.95,bench run 7
        20.0,-5.5,3.0,0.0,3.0,0.95,bench run 7
        True
        """
        write_map_table(self.to_dataset(), path, source)

    @classmethod
    def read_csv(cls, path: str | os.PathLike[str], *, decimal: str = ".") -> Self:
        """Read a table of timings: what `write_csv` wrote, or the user's own.

        Parameters
        ----------
        path : path-like
            CSV (comma, semicolon, tab) with a header, a row per cell in any order. ``timing_cad`` [°CA aTDC] is
            required; every column that is not ``sd_cad`` [°CA], ``support``, ``prior_sd_cad`` [°CA], ``forgetting`` or
            ``source`` is an axis. A second row may hold units, which must be those of the names; lines that begin with
            # are skipped.
        decimal : str
            Decimal mark.

        Returns
        -------
        TimingMap
            The same map as was written, its standard deviations to the last digit but one. What the table does not say
            is as of a new map.

        Raises
        ------
        FileNotFoundError
            No such file.
        mgdd.errors.DataError
            A cell that is missing, repeated, no number or outside its domain, another unit, no axis or more than two;
            the message names file, line, column, value and remedy.
        """
        return cls.from_dataset(read_map_table(path, decimal)[0])

    def to_parameters(self) -> ParameterFile:
        """Give axes, cells and settings, as `to_toml` writes them."""
        cells = {name: Entry(value=self._table(_CORE[name]).tolist(), unit=unit) for name, unit in _CELLS.items()}
        axes = {name: Entry(value=entries.tolist(), unit=unit_of(name)) for name, entries in self._axes.items()}
        settings = {name: Entry(value=self._settings[name], unit=unit) for name, unit in _SETTINGS.items()}
        return ParameterFile(kind="timing_map", tables={"axes": axes, "cells": cells, "settings": settings})

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> Self:
        """Make the map of a file that `to_toml` wrote."""
        file.expect(kinds=("timing_map",), tables=("axes", "cells", "settings"))
        axes = file.values("axes", {name: Wanted(unit_of(name), "numbers") for name in file.tables["axes"]})
        cells = file.values("cells", wanted(_CELLS, _CELLS, "numbers"))
        make: Any = cls
        made: Self = make(axes, cells["timing_cad"], **file.values("settings", wanted(_SETTINGS, _SETTINGS)))
        made._columns = {_CORE[name]: np.array(values, np.float64).ravel().tolist() for name, values in cells.items()}
        return made

    def _table(self, column: str) -> NDArray[np.float64]:
        return np.array(self._columns[column]).reshape([entries.size for entries in self._axes.values()])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MapForms) and self._parts() == other._parts()

    __hash__ = None  # type: ignore[assignment]

    def _parts(self) -> tuple[Any, ...]:
        return {name: entries.tolist() for name, entries in self._axes.items()}, self._settings, self._columns

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), dict(self._axes), self._settings, self._columns)


T = TypeVar("T", bound=MapForms)


def _rebuild(
    cls: type[T],
    axes: Mapping[str, NDArray[np.float64]],
    settings: Mapping[str, float],
    columns: Mapping[str, Sequence[float]],
) -> T:
    shape = [entries.size for entries in axes.values()]
    make: Any = cls
    made: T = make(axes, np.reshape(columns["values_cad"], shape), **settings)
    made._columns = {name: list(column) for name, column in columns.items()}
    return made
