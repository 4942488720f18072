"""A calibration map: values over one or two axes, and for each cell where its value comes from."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd import _core
from mgdd._arguments import shown
from mgdd.errors import ParameterError, ShapeError
from mgdd.maps.cells import (
    MapPlace,
    MapPoints,
    MapTask,
    checked_cells,
    checked_label,
    checked_name,
    further_columns,
)
from mgdd.maps.forms import MapForms
from mgdd.presets.meant import numbers_of
from mgdd.results.describe import Row, rows_of
from mgdd.results.labels import Label

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class CalibrationMap(MapForms):
    """A table over one or two axes as a control unit holds it: (bi)linear between its cells, held at its edges.

    It does not change; `mgdd.guide.TimingMap` learns. Beside its value each cell has its source, its support, its
    standard deviation, the range in which the value may lie and the limit that holds it, and whatever columns are added
    with their units: values of further inputs, probabilities of limits. ``save`` to ``.nc`` and `load` keep all of it.

    Parameters
    ----------
    axes : mapping of str to array_like
        One or two, strictly increasing, two entries at least; the ending of a name gives its unit.
    values : array_like
        One axis of the array per axis; a number for all cells. NaN only where the source gives the reason.
    name : str
        What the values are, for example ``soc_cad``.
    labels : mapping of str to (str, str), optional
        Unit and long name of the value, of axes and of further columns; left out, they are those of the name.
    cells : mapping of str to array_like, optional
        Columns of one entry per cell, or of one for all: ``source`` (``given``, ``measured``, ``predicted``,
        ``extrapolated``, ``optimised``, ``smoothed``, ``interpolated``, ``held``, ``learned``; without a value
        ``infeasible`` or ``unattainable``), ``support`` (points behind the value), ``sd``, ``low`` and ``high`` [unit
        of the value], ``objective`` and ``active_limit``; and numbers by any other name, which needs a label.
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
    >>> float(soc(speed_rpm=1200, fuel_mg=13))
    -3.25
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
        columns = {checked_name("axis", axis, (name,)): _column(axis, entries) for axis, entries in axes.items()}
        shape = tuple(entries.size for entries in columns.values())
        table = np.array(values, np.float64)
        if table.ndim and table.shape != shape:
            raise ShapeError(f"{name} has shape {table.shape}: the axes {', '.join(columns)} make {shape}")
        self._values = np.ascontiguousarray(np.broadcast_to(table, shape))
        entries = [column.tolist() for column in columns.values()]
        self._table = _core.math.TableAxes(names=list(columns), entries=entries)
        given = dict(labels or {})
        further = further_columns(cells or {}, given, (*columns, name))
        self._labels = {each: checked_label(each, given.pop(each, None)) for each in (*columns, name, *further)}
        if given:
            raise ParameterError.of("labels", next(iter(given)), f"of {', '.join(self._labels)}")
        self._cells = checked_cells(self._values, columns, cells or {}, further)
        self._task, self._provenance = task, _texts(provenance or {})
        for array in (*columns.values(), self._values):
            array.setflags(write=False)
        self._axes = columns

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
        """Unit and long name of axes, value and further columns."""
        return MappingProxyType(self._labels)

    @property
    def task(self) -> MapTask | None:
        """What the cells were optimised for."""
        return self._task

    @property
    def provenance(self) -> Mapping[str, str]:
        """Where the map comes from."""
        return MappingProxyType(self._provenance)

    def __call__(self, points: Mapping[str, ArrayLike] | Any = None, **coordinates: ArrayLike) -> NDArray[np.float64]:
        """Read the values alone, as `lookup` does."""
        return self.lookup(points, column=None, **coordinates).values

    def lookup(
        self, points: Mapping[str, ArrayLike] | Any = None, *, column: str | None = None, **coordinates: ArrayLike
    ) -> MapPoints:
        """Read the map at points.

        Parameters
        ----------
        points : mapping of str to array_like, or OperatingPoint
            Coordinates by the names of the axes, broadcast together; other names are ignored.
        column : str, optional
            A column of numbers of `cells` instead of the value.
        **coordinates
            The same by keyword, ``speed_rpm=1200.0, fuel_mg=13.0``.

        Returns
        -------
        MapPoints
            Values and which of them are held at the edge, in the shape of the points.

        Raises
        ------
        mgdd.errors.ParameterError
            An axis or the column is missing.
        """
        at = self.place(points, **coordinates)
        numbers = [name for name, entries in self._cells.items() if entries.dtype.kind == "f"]
        ParameterError.unless(column is None or column in numbers, "column", column, f"one of {', '.join(numbers)}")
        table = (self._values if column is None else self._cells[column]).ravel()
        parts = at.weights * table[at.cells]
        parts[at.weights == 0.0] = 0.0  # a cell without weight does not count, whatever it holds
        return MapPoints(parts.sum(axis=0), at.held_outside)

    def place(self, points: Mapping[str, ArrayLike] | Any = None, **coordinates: ArrayLike) -> MapPlace:
        """Find the cells around points, in the C++ core.

        Parameters
        ----------
        points : mapping of str to array_like, or OperatingPoint
            As by `lookup`.
        **coordinates
            The same by keyword.

        Returns
        -------
        MapPlace
            Cells, weights and which points lie outside; NaN weights of a point that is NaN.

        Raises
        ------
        mgdd.errors.ParameterError
            An axis is missing.
        """
        if coordinates:
            points = {**({} if points is None else points), **coordinates}
        given = points if isinstance(points, Mapping) else {} if points is None else numbers_of(points)
        lacking = [name for name in self._axes if name not in given]
        if lacking:
            raise ParameterError.of("points", list(given), f"coordinates with {' and '.join(self._axes)}")
        columns = np.broadcast_arrays(*(np.asarray(given[name], np.float64) for name in self._axes))
        cells, weights, outside = self._table.places(np.stack([column.ravel() for column in columns]))
        shape = columns[0].shape
        return MapPlace(cells.reshape(-1, *shape), weights.reshape(-1, *shape), outside.reshape(shape))

    def replaced(self, values: ArrayLike | None = None, **changes: Any) -> Self:
        """Give a map on the same axes with other values, cells, task or provenance.

        Parameters
        ----------
        values : array_like, optional
            As of a new map.
        **changes
            ``cells``, ``labels`` and ``provenance`` (entries that are not named stay), ``task``.

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
            labels={**self._labels, **changes.pop("labels", {})},
            cells={**self._cells, **changes.pop("cells", {})},
            provenance={**self._provenance, **changes.pop("provenance", {})},
            **{"task": self._task, **changes},
        )

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
        return self.lookup(points, column="sd").values

    def __repr__(self) -> str:
        size = " x ".join(f"{entries.size} {name}" for name, entries in self._axes.items())
        kinds, counts = np.unique(self._cells["source"], return_counts=True)
        sources = ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts, strict=True))
        return f"<CalibrationMap {self._name} [{self.unit}], {size}, {sources}>"

    def _title(self) -> str:
        return repr(self)[1:-1]

    def _rows(self) -> list[Row]:
        return rows_of({**self._axes, self._name: self._values, **self._provenance})


def map_of(given: Any, argument: str = "table") -> CalibrationMap:
    """Return the map that is meant: a CalibrationMap, or the Dataset or DataArray of one."""
    if isinstance(given, CalibrationMap):
        return given
    if hasattr(given, "to_dataset") and hasattr(given, "name"):
        given = given.to_dataset(name=given.name or "value").assign_attrs(map=str(given.name or "value"))
    if hasattr(given, "data_vars"):
        return CalibrationMap.from_dataset(given)
    bound = "a CalibrationMap, or a Dataset or DataArray over its axes; read_map and optimize_map make one"
    raise ParameterError(f"{argument} = {shown(given)}: must be {bound}", field=argument, value=given, bound=bound)


def _column(name: str, entries: ArrayLike) -> NDArray[np.float64]:
    column = np.array(entries, np.float64)
    if column.ndim != 1:
        raise ShapeError(f"{name} has {column.ndim} dimensions: an axis is one column of entries")
    return column


def _texts(provenance: Mapping[str, str]) -> dict[str, str]:
    for key, text in provenance.items():
        checked_name("provenance", key)
        if not isinstance(text, str) or not text.strip() or text != " ".join(text.split()):
            raise ParameterError.of(f"provenance {key}", text, "a text of one line, not empty, single blanks in it")
    return dict(provenance)
