"""A look-up table of the best timing that serves as a guide and learns from confirmed optima."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.guide.conditions import numbers_of
from mgdd.guide.map_forms import MapForms
from mgdd.guide.map_table import SETTINGS
from mgdd.optimize.optimum import Optimum
from mgdd.results.describe import Row, rows_of
from mgdd.results.result import Result

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

__all__ = ["MapValue", "TimingMap"]

_LEAST_SHARE = 1e-3  # of the spread: standard deviation of an estimate that does not move at all


@dataclass(frozen=True, kw_only=True)
class MapValue:
    """What a map says of one operating point.

    Parameters
    ----------
    timing_cad : float
        Best timing [°CA aTDC].
    sd_cad : float
        Its standard deviation [°CA].
    support : float
        Confirmed optima behind it, forgotten ones taken off.
    held_outside : bool
        The point lies outside of the axes: the value is that of the edge.
    """

    timing_cad: float
    sd_cad: float
    support: float
    held_outside: bool


class TimingMap(_core.guide.TimingMap, MapForms):
    """A table of the best timing over one or two axes: bilinear between its cells, held at its edges.

    As a guide of `FeedForward` it answers inside of its axes only. A confirmed optimum is shared by the cells around it
    with their bilinear weights, against what they knew, as a Kalman filter with a diagonal covariance does; each cell
    has its standard deviation and its support.

    Parameters
    ----------
    axes : mapping of str to array_like
        One or two, each strictly increasing with two entries at least: ``speed_rpm`` and ``fuel_mg``, or other numbers
        of the operating point.
    timing_cad : array_like
        Start values [°CA aTDC], one axis of the array per axis; a number for all cells.
    prior_sd_cad : float
        Standard deviation of a value that was never learnt [°CA].
    forgetting : float
        What a cell keeps of its knowledge per confirmed optimum, in (0, 1]; 1 for a plant that never changes.

    Raises
    ------
    mgdd.errors.ParameterError, mgdd.errors.ShapeError
        Axes or values that make no map.

    Examples
    --------
    >>> from mgdd.guide import TimingMap
    >>> timing = TimingMap({"speed_rpm": [900, 1500, 3000], "fuel_mg": [6, 20, 40]}, -5.0)
    >>> point = {"speed_rpm": 1500, "fuel_mg": 20}
    >>> timing.learn(point, -6.4, sd_cad=0.3)
    >>> round(timing(point), 2), timing.lookup({"speed_rpm": 4000, "fuel_mg": 20}).held_outside
    (-6.39, True)
    """

    def __init__(
        self,
        axes: Mapping[str, ArrayLike],
        timing_cad: ArrayLike,
        *,
        prior_sd_cad: float = SETTINGS["prior_sd_cad"],
        forgetting: float = SETTINGS["forgetting"],
    ) -> None:
        if not isinstance(axes, Mapping) or not axes:
            raise ParameterError.of("axes", axes, "names with their entries, for example {'fuel_mg': [6, 20, 40]}")
        own = {str(name): np.array(entries, np.float64, ndmin=1).ravel() for name, entries in axes.items()}
        shape = tuple(entries.size for entries in own.values())
        given = np.array(timing_cad, np.float64)
        values = np.full(shape, given) if given.ndim == 0 else given
        if values.shape != shape:
            raise ShapeError(f"timing_cad has shape {values.shape}: the axes {', '.join(own)} make {shape}")
        super().__init__(
            axes=[entries.tolist() for entries in own.values()],
            values_cad=values.ravel().tolist(),
            prior_sd_cad=prior_sd_cad,
            forgetting=forgetting,
        )
        for entries in own.values():
            entries.setflags(write=False)
        self._axes, self._settings = own, {"prior_sd_cad": float(prior_sd_cad), "forgetting": float(forgetting)}

    @classmethod
    def of_guide(
        cls,
        guide: Callable[[Any], Any],
        over: Mapping[str, ArrayLike],
        *,
        make: Callable[..., Any],
        **settings: float,
    ) -> Self:
        """Fill a map with what another guide says.

        Parameters
        ----------
        guide : callable
            For example a `ModelOptimum`.
        over : mapping of str to array_like
            The axes.
        make : callable
            ``make(**numbers)`` gives the operating point of a cell, for example `mgdd.engine.OperatingPoint`.
        **settings : float
            ``prior_sd_cad`` and ``forgetting``.

        Returns
        -------
        TimingMap
            With the guide's optima as start values.

        Raises
        ------
        mgdd.errors.DataError
            The guide has no answer at a cell.

        Examples
        --------
        >>> from mgdd.engine import Cylinder, OperatingPoint
        >>> from mgdd.guide import ModelOptimum, TimingMap
        >>> axes = {"speed_rpm": [1200, 2000], "fuel_mg": [10, 20, 30]}
        >>> timing = TimingMap.of_guide(ModelOptimum(Cylinder()), axes, make=OperatingPoint)
        >>> round(timing(OperatingPoint(speed_rpm=1200, fuel_mg=20)), 1)
        -3.5
        """
        own = {str(name): np.array(entries, np.float64, ndmin=1).ravel() for name, entries in over.items()}
        cells = np.stack(np.meshgrid(*own.values(), indexing="ij"), axis=-1).reshape(-1, len(own))
        values = []
        for cell in cells.tolist():
            numbers = dict(zip(own, cell, strict=True))
            reply = guide(make(**numbers))
            if reply is None:
                raise DataError(f"guide: no answer at {numbers}: narrow the axes")
            values.append(next(iter(reply.inputs.values())) if isinstance(reply, Optimum) else float(reply))
        return cls(own, np.reshape(values, [entries.size for entries in own.values()]), **settings)

    def __call__(self, point: Any) -> float | None:
        """Give the best timing as a guide does.

        Parameters
        ----------
        point : OperatingPoint, mapping of str to float, or sequence of float
            It names the axes, or has one number for each.

        Returns
        -------
        float or None
            [°CA aTDC]; None outside of the axes.

        Raises
        ------
        mgdd.errors.ParameterError
            The point lacks an axis.
        """
        cell = self.lookup(point)
        return None if cell.held_outside else cell.timing_cad

    def lookup(self, point: Any) -> MapValue:
        """Read the map, outside of its axes too.

        Parameters
        ----------
        point : OperatingPoint, mapping of str to float, or sequence of float
            As of a call.

        Returns
        -------
        MapValue
            Timing, standard deviation, support, and whether it is held at the edge.

        Raises
        ------
        mgdd.errors.ParameterError
            The point lacks an axis.
        """
        timing, sd, support, outside = self._lookup(self._coordinates(point))
        return MapValue(timing_cad=timing, sd_cad=sd, support=support, held_outside=outside)

    def learn(self, point: Any, timing_cad: float, *, sd_cad: float) -> None:
        """Write a confirmed optimum back.

        Parameters
        ----------
        point : OperatingPoint, mapping of str to float, or sequence of float
            Where it was found.
        timing_cad : float
            The optimum [°CA aTDC].
        sd_cad : float
            Its standard deviation [°CA], > 0.

        Raises
        ------
        mgdd.errors.ParameterError
            A point outside of the axes, or numbers that are not an optimum; nothing has changed then.
        """
        if not self._learn(self._coordinates(point), timing_cad, sd_cad):
            raise ParameterError(
                f"learn: timing_cad = {timing_cad:g} with sd_cad = {sd_cad:g} at {numbers_of(point)}: must be finite, "
                "sd_cad > 0, and the point inside of the axes"
            )

    def learn_from(self, seeker: Any, point: Any, *, cycles: int = 100, spread_cad: float = 1.0) -> bool:
        """Write the estimate of a finished or running seeker back if it has settled.

        Parameters
        ----------
        seeker : Seeker, FeedForward
            With one input and a history.
        point : OperatingPoint, mapping of str to float, or sequence of float
            The operating point of its last cycles.
        cycles : int
            How many of the last cycles must agree, >= 2; all at one operating point, as a `FeedForward` knows.
        spread_cad : float
            Their mean absolute deviation from their mean, and the distance between the means of their halves, must lie
            below this [°CA].

        Returns
        -------
        bool
            Whether the estimate counted as confirmed and was learnt. Its standard deviation is taken from the scatter
            of the estimates and the distance of the halves.

        Raises
        ------
        mgdd.errors.ParameterError
            As by `learn`, or fewer than two cycles.
        """
        settled = _settled_estimate(seeker.history, cycles, spread_cad)
        if settled is None:
            return False
        self.learn(point, settled[0], sd_cad=settled[1])
        return True

    def _coordinates(self, point: Any) -> list[float]:
        numbers = numbers_of(point)
        named = set(self._axes) <= set(numbers)
        if not named and (isinstance(point, Mapping) or len(numbers) != len(self._axes)):
            raise ParameterError.of("point", point, f"an operating point with {' and '.join(self._axes)}")
        return [numbers[name] for name in self._axes] if named else list(numbers.values())

    __reduce__ = MapForms.__reduce__  # that of the core knows no axes

    def __repr__(self) -> str:
        size = " x ".join(f"{entries.size} {name}" for name, entries in self._axes.items())
        return f"<TimingMap {size}, {np.count_nonzero(self.support > 0.0)} cells with support>"

    _repr_html_ = Result._repr_html_  # that of the core would come first

    def _rows(self) -> list[Row]:
        return rows_of({**self._axes, "timing_cad": self.timing_cad, **self._settings})


def _settled_estimate(history: xr.Dataset, cycles: int, spread: float) -> tuple[float, float] | None:
    """Give mean and standard deviation of the last cycles of a seeker with one input; None where they do not agree."""
    if cycles < 2:
        raise ParameterError.of("cycles", cycles, ">= 2")
    last = history.isel(cycle=slice(-cycles, None))
    if last.sizes["cycle"] < cycles:
        return None
    if "point" in last and (np.ptp(last["point"].to_numpy()) > 0 or bool(last["testing"].to_numpy().any())):
        return None
    estimate = last["estimate"].to_numpy()[:, 0]
    early, late = estimate[: cycles // 2], estimate[cycles // 2 :]
    drift = abs(float(np.mean(late) - np.mean(early)))
    scatter = float(np.mean(np.abs(estimate - np.mean(estimate))))
    if not (scatter < spread and drift < spread):
        return None
    return float(np.mean(estimate)), max(math.hypot(scatter, drift), _LEAST_SHARE * spread)
