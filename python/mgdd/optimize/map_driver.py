"""A search for a map as the seeker of an engine that others drive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class MapDriver:
    """A search for a map as the seeker of a driven engine: ``seek(engine, seeker=search.driver())``.

    At each operating point it asks for what is worth most there, and what is read teaches the whole map. Outside of the
    axes the nearest point is asked for and nothing is learnt.

    Parameters
    ----------
    search : MapSeeking
        Changes as the engine runs.

    Attributes
    ----------
    readings : numpy.ndarray
        How many it has learnt from, by their nearest cell.

    Examples
    --------
    >>> from mgdd.optimize import MapSeeking
    >>> search = MapSeeking({"x": (-5.0, 5.0)}, {"load": [0.0, 1.0]})
    >>> driver = search.driver()
    >>> for k in range(40):
    ...     load = k // 20 * 0.5
    ...     driver.at({"load": load})
    ...     driver.tell(-((driver.ask()[0] - 2.0 * load) ** 2))
    >>> bool(abs(driver.estimate[0] - 1.0) < 0.1)
    True
    """

    def __init__(self, search: Any) -> None:
        self.search = search
        self.readings = np.zeros(tuple(column.size for column in search.axes.values()))
        self._bounds = {one.name: (one.lower, one.upper) for one in search.settings["context"]}
        self._point: dict[str, float] | None = None
        self._outside = False
        self._asked: dict[str, float] | None = None

    def at(self, point: Any) -> None:
        """Say at which operating point the next cycle runs: numbers by name, or an object that has them."""
        own = {}
        for name in self._bounds:
            value = point.get(name) if isinstance(point, Mapping) else getattr(point, name, None)
            if value is None or not math.isfinite(value):
                raise ParameterError(f"point: {name} = {value!r}: must be a number, as the axes of the map are")
            own[name] = float(value)
        held = {name: min(max(own[name], low), high) for name, (low, high) in self._bounds.items()}
        self._outside, self._asked = held != own, None if held != self._point else self._asked
        self._point = held

    @property
    def estimate(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The best inputs at this point, as they are known now."""
        if self._point is not None and self._asked is None:
            self.ask()
        return np.asarray(self.search._estimate)

    def ask(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Give the inputs of the next cycle, in their order; ParameterError before `at`."""
        if self._asked is None:
            self._asked = self.search.ask(self._here())
        return np.array(list(self._asked.values()))

    def tell(
        self,
        J: float,  # noqa: N803
        limits: Any = None,
        *,
        misfire: bool = False,
        applied: Any = None,
    ) -> None:
        """Accept what was read in this cycle; as any seeker of one's own it maximises, the search as it was made."""
        names = self.search.input_names
        here = self._here()
        if not (misfire or self.search.settings["maximize"]):
            J = -J  # noqa: N806
        asked = self.ask() if applied is None else np.asarray(applied, np.float64)
        inputs = dict(zip(names, asked.tolist(), strict=True))
        if self._outside:
            self._asked = None
            return
        self.search.tell(here, inputs, None if misfire else J, limits, misfire=misfire)
        self.readings[nearest_cell(self.search.axes, here)] += 1.0
        self._asked = None

    def _here(self) -> dict[str, float]:
        if self._point is None:
            raise ParameterError("ask() or tell() before at(point): the operating point is not known")
        return self._point


def nearest_cell(axes: Mapping[str, ArrayLike], at: Mapping[str, float]) -> tuple[int, ...]:
    """Give the place of the cell that is nearest to a point on every axis."""
    return tuple(int(np.argmin(np.abs(np.asarray(column) - at[name]))) for name, column in axes.items())
