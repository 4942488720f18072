"""What a calibration map holds of each cell beside its value, the one check of it, and cells around points."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import DataError, ParameterError, ShapeError, did_you_mean
from mgdd.results.labels import VARIABLES, Label, name_unit
from mgdd.results.units import attribute_units, unit_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# Where a value comes from; the last two give why there is none.
SOURCES = (
    "given", "measured", "predicted", "extrapolated", "optimised", "smoothed", "interpolated", "held", "learned",
    "infeasible", "unattainable",
)  # fmt: skip
WITHOUT_VALUE = SOURCES[-2:]
# Columns of numbers: long name, the default, and the least allowed value.
NUMBERS: Mapping[str, tuple[str, float, float]] = {
    "support": ("points behind the value", 0.0, 0.0),
    "sd": ("standard deviation", np.nan, 0.0),
    "low": ("lowest allowed value", np.nan, -np.inf),
    "high": ("highest allowed value", np.nan, -np.inf),
    "objective": ("objective", np.nan, -np.inf),
}
TEXTS: Mapping[str, tuple[str, str]] = {
    "source": ("where the value comes from", "given"),
    "active_limit": ("limit that holds the value", ""),
}
_NAME = re.compile(r"[A-Za-z_%][\w.\[\]%]*")  # labels of a control unit have dots, brackets and percent signs


@dataclass(frozen=True, kw_only=True)
class MapTask:
    """What the cells of an optimised map were optimised for.

    Parameters
    ----------
    objective : str
        Variable of the sweep.
    limits : mapping of str to float
        Highest allowed value of other variables, margins taken off.
    maximize : bool
        Whether the best objective is the highest.
    """

    objective: str
    limits: Mapping[str, float] = field(default_factory=dict)
    maximize: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "limits", MappingProxyType({name: float(v) for name, v in self.limits.items()}))

    def to_dict(self) -> dict[str, Any]:
        """Give plain values."""
        return {"objective": self.objective, "limits": dict(self.limits), "maximize": self.maximize}

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(MapTask, **self.to_dict()), ()  # a view of the limits cannot be pickled


class MapPlace(NamedTuple):
    """Where points lie in a map.

    Parameters
    ----------
    cells : numpy.ndarray of int
        The two or four cells around each point, first dimension, by their numbers in rows.
    weights : numpy.ndarray
        The share of each; they add up to one.
    held_outside : numpy.ndarray of bool
        Which points lie outside of the axes: their place is that of the edge.
    """

    cells: NDArray[np.int64]
    weights: NDArray[np.float64]
    held_outside: NDArray[np.bool_]


class MapPoints(NamedTuple):
    """What a map gives at points.

    Parameters
    ----------
    values : numpy.ndarray
        In the unit of the map; NaN where a cell without a value takes part.
    held_outside : numpy.ndarray of bool
        Which points lie outside of the axes: their value is that of the edge.
    """

    values: NDArray[np.float64]
    held_outside: NDArray[np.bool_]


def checked_name(what: str, name: object, taken: tuple[str, ...] = ()) -> str:
    """Give a name that every file form can hold, or refuse it."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ParameterError.of(what, name, "a name of letters, digits and _ such as soc_cad")
    if name in taken or name in NUMBERS or name in TEXTS:
        raise ParameterError.of(what, name, "another name: this one has a meaning of its own in a map")
    return name


def can_be_name(text: str) -> bool:
    """Whether a map or an axis can be called so."""
    return bool(_NAME.fullmatch(text)) and text not in NUMBERS and text not in TEXTS


def checked_label(name: str, given: tuple[str, str] | None) -> Label:
    """Give unit and long name of an axis or value; a unit that contradicts the ending of the name is refused."""
    usual = VARIABLES.get(name) or Label(name_unit(name), spoken_name(name))
    label = usual if given is None else Label(*map(str, given))
    try:
        written = attribute_units(label.units)
    except ValueError as error:
        raise DataError.of(f"unit of {name}", label.units, f"a unit: {error}") from None
    if usual.units != "-" and attribute_units(usual.units) != written:
        raise DataError.of(
            f"unit of {name}", label.units, f"{usual.units!r}, as the name says; convert the numbers or change the name"
        )
    DataError.unless(label.long_name.strip(), f"long name of {name}", label.long_name, "a text that figures can print")
    return label


def further_columns(given: Mapping[str, Any], labels: Mapping[str, Any], taken: tuple[str, ...]) -> tuple[str, ...]:
    """Name the columns that not every map has; each needs a unit."""
    names = tuple(name for name in given if name not in NUMBERS and name not in TEXTS)
    for name in names:
        if name not in labels and name not in VARIABLES:
            near = did_you_mean(name, (*NUMBERS, *TEXTS)) or f"known are {', '.join((*NUMBERS, *TEXTS))}"
            raise ParameterError(f"cells: unknown column {name!r}: {near}; labels gives another its unit and long name")
        checked_name("column", name, taken)
    return names


def checked_cells(
    values: NDArray[np.float64],
    axes: Mapping[str, NDArray[np.float64]],
    given: Mapping[str, ArrayLike],
    further: tuple[str, ...] = (),
) -> dict[str, NDArray[Any]]:
    """Give every column with the shape of the values; NaN is allowed only where the source gives the reason."""
    cells: dict[str, NDArray[Any]] = {}
    for name, (_, missing, least) in {**NUMBERS, **dict.fromkeys(further, ("", np.nan, -np.inf))}.items():
        cells[name] = _shaped(name, np.array(given.get(name, missing), np.float64), values.shape)
        bad = (cells[name] < least) | np.isinf(cells[name])
        if bad.any():
            at = int(np.argmax(bad))
            raise DataError.of(
                f"{name} at {cell_at(axes, at)}", float(cells[name].ravel()[at]), f"finite, >= {least:g}"
            )
    for name, (_, absent) in TEXTS.items():
        cells[name] = _shaped(name, np.array(given.get(name, absent), np.str_), values.shape)
    for text in np.unique(cells["active_limit"]).tolist():
        if any(mark in text for mark in "\r\n"):
            raise DataError.of("active_limit", text, "a text of one line")
    unknown = [text for text in np.unique(cells["source"]).tolist() if text not in SOURCES]
    if unknown:
        raise DataError.of("source", unknown[0], f"one of {', '.join(SOURCES)}")
    missing_value = np.isin(cells["source"], WITHOUT_VALUE)
    bad = np.isfinite(values) == missing_value
    if bad.any():
        at = int(np.argmax(bad))
        source = str(cells["source"].ravel()[at])
        conflict = f"{cell_at(axes, at)}: the value is {values.ravel()[at]:g} and its source {source!r}"
        raise DataError(
            f"{conflict}: a value must be finite, and NaN where the source is {' or '.join(WITHOUT_VALUE)}; "
            "fill the cell or set its source"
        )
    for column in cells.values():
        column.setflags(write=False)
    return cells


def cell_at(axes: Mapping[str, NDArray[np.float64]], place: int) -> str:
    """Name a cell by its coordinates, for messages."""
    at = np.unravel_index(place, tuple(entries.size for entries in axes.values()))
    return ", ".join(f"{name} = {entries[i]:g}" for (name, entries), i in zip(axes.items(), at, strict=True))


def spoken_name(name: str) -> str:
    """Give a name in words, without the unit at its end."""
    parts, unit = name.split("_"), name_unit(name)
    ends = [k for k in range(1, len(parts)) if unit != "-" and unit_of("_" + "_".join(parts[k:])) == unit]
    return " ".join(parts[: max(ends)] if ends else parts)


def _shaped(name: str, column: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    if column.ndim == 0:
        return np.full(shape, column)
    if column.shape != shape:
        raise ShapeError(f"cells: {name} has shape {column.shape}: the map has {shape}")
    return column
