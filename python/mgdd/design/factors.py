"""The factors of a design of experiments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, argument
from mgdd.results.labels import Label, labelled_dataset, named_label
from mgdd.surrogate.points import EDGE, points_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Factor:
    """A range, or levels in rising order."""

    name: str
    low: float
    high: float
    levels: NDArray[np.float64] | None = None

    @property
    def label(self) -> Label:
        """Unit and long name, as far as the name gives them."""
        return named_label(self.name)

    def of_unit(self, share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn numbers in [0, 1) into values, levels in equal shares."""
        if self.levels is None:
            return self.low + (self.high - self.low) * share
        place = np.minimum((share * self.levels.size).astype(np.intp), self.levels.size - 1)
        return np.asarray(self.levels[place], dtype=np.float64)

    def grid(self, n: int) -> NDArray[np.float64]:
        """Return the levels, of a range `n` even ones."""
        return np.linspace(self.low, self.high, n) if self.levels is None else self.levels


@dataclass(frozen=True, kw_only=True, eq=False)
class Factors:
    """All factors of a design, in order."""

    items: tuple[Factor, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Return their names."""
        return tuple(factor.name for factor in self.items)

    @property
    def low(self) -> NDArray[np.float64]:
        """Return their lower ends."""
        return np.array([factor.low for factor in self.items])

    @property
    def span(self) -> NDArray[np.float64]:
        """Return their ranges."""
        return np.array([factor.high - factor.low for factor in self.items])

    def of_unit(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn rows of the unit cube into points."""
        return np.column_stack([factor.of_unit(column) for factor, column in zip(self.items, shares.T, strict=True)])

    def to_unit(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn points into rows of the unit cube, by their ranges."""
        return np.asarray((points - self.low) / self.span)

    def grid(self, levels: Mapping[str, int]) -> NDArray[np.float64]:
        """Return every combination of the levels, the last factor fastest."""
        axes = [factor.grid(levels[factor.name]) for factor in self.items]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))

    def columns(self, points: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return copies of the columns by name, for functions of the user."""
        return {name: column.copy() for name, column in zip(self.names, points.T, strict=True)}

    def existing(self, table: Any) -> NDArray[np.float64]:
        """Read the points of an earlier design, and refuse those outside the ranges."""
        points = points_of(table, self.names, what=argument("existing"))
        shares = self.to_unit(points)
        outside = (shares < -EDGE) | (shares > 1.0 + EDGE)
        if outside.any():
            row, column = (int(place) for place in np.argwhere(outside)[0])
            factor = self.items[column]
            raise DataError(
                f"{argument('existing')}: {factor.name} = {points[row, column]:g} of point {row}: must be "
                f"in [{factor.low:g}, {factor.high:g}]; {int(outside.any(axis=1).sum())} of {len(points)} "
                "points lie outside the factors: widen them or drop these points"
            )
        return points

    def dataset(self, points: NDArray[np.float64], *, first: int, attrs: Mapping[str, Any]) -> xr.Dataset:
        """Label points, numbered from `first`."""
        numbers = ("point", np.arange(first, first + len(points)), "-", "point of the design")
        named = {
            factor.name: ("point", column, *factor.label) for factor, column in zip(self.items, points.T, strict=True)
        }
        return labelled_dataset({"point": numbers, **named}, attrs=attrs)


def factors_of(factors: Any) -> Factors:
    """Check a mapping of names to ranges or levels."""
    if not isinstance(factors, Mapping) or not factors:
        raise ParameterError.of(
            "factors", factors, "a mapping of names to (low, high), for example {'fuel_mg': (5, 40)}"
        )
    items: dict[str, Factor] = {}
    for name, given in factors.items():
        if not isinstance(name, str) or not name.strip() or name == "point":
            raise ParameterError.of("factors", name, "names of factors as text, none of them 'point'")
        if name.strip().lower() in items:
            raise ParameterError.of("factors", list(factors), "names that differ in more than case and blanks")
        items[name.strip().lower()] = _factor(name, given)
    return Factors(items=tuple(items.values()))


def _factor(name: str, given: Any) -> Factor:
    need = "(low, high), three or more levels, or a set of levels"
    if isinstance(given, str | Mapping) or not (
        isinstance(given, Sequence | AbstractSet) or hasattr(given, "__array__")
    ):
        raise ParameterError.of(f"factors: {name}", given, need)
    try:
        values = np.array(list(given), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterError.of(f"factors: {name}", given, need) from error
    if values.ndim != 1 or values.size < 2:
        raise ParameterError.of(f"factors: {name}", given, f"{need}; leave a constant out of the factors")
    ParameterError.unless(np.isfinite(values).all(), f"factors: {name}", given, "finite numbers")
    if values.size == 2 and not isinstance(given, AbstractSet):
        ParameterError.unless(values[0] < values[1], f"factors: {name}", given, "(low, high) with low < high")
        return Factor(name=name, low=float(values[0]), high=float(values[1]))
    levels = np.unique(values)
    if levels.size < values.size:
        raise ParameterError.of(f"factors: {name}", given, "levels without repeats")
    return Factor(name=name, low=float(levels[0]), high=float(levels[-1]), levels=levels)
