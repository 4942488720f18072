"""Where an engine may be driven: inside limits that a model predicts, or between points that were measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd._core.optimize import Limit
from mgdd.errors import DataError, ParameterError, ShapeError, argument
from mgdd.optimize.optimum import limits_of
from mgdd.results.describe import described
from mgdd.results.labels import labelled_dataset, named_label
from mgdd.surrogate.points import EDGE, PointHull, column_label, column_names, hull_of, points_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

Indicators = Callable[[dict[str, "NDArray[np.float64]"]], Mapping[str, "ArrayLike"]]


class _Judged(NamedTuple):
    """Per point: distance, what is nearest, whether it lies beyond all that was measured, and the indicators."""

    distance: NDArray[np.float64]
    active: NDArray[np.str_]
    extrapolated: NDArray[np.bool_]
    indicators: dict[str, NDArray[np.float64]]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Modelled:
    indicators: Indicators
    limits: tuple[Limit, ...]

    def judge(self, columns: dict[str, NDArray[np.float64]]) -> _Judged:
        size = next(iter(columns.values())).size
        given = self.indicators(columns)
        values: dict[str, NDArray[np.float64]] = {}
        room = np.empty((len(self.limits), size))
        for place, limit in enumerate(self.limits):
            if limit.name not in given:
                given_names = ", ".join(map(str, given))
                raise DataError(f"limits: the model gives no {limit.name}: it gives {given_names}; name one of these")
            value = np.asarray(given[limit.name], dtype=np.float64)
            if value.shape != (size,):
                raise ShapeError(f"{limit.name} of the model has shape {value.shape}: must be ({size},), one per point")
            allowed = limit.upper - limit.margin
            scale = limit.scale if limit.scale > 0.0 else abs(limit.upper) or 1.0
            # A model that fails at a point (NaN) does not support it: as far outside as can be.
            room[place] = np.where(np.isfinite(value), (allowed - value) / scale, -np.inf)
            values[limit.name] = value
        nearest = np.argmin(room, axis=0)
        names = np.array([limit.name for limit in self.limits])
        return _Judged(room[nearest, np.arange(size)], names[nearest], np.zeros(size, dtype=np.bool_), values)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Measured:
    hull: PointHull
    names: tuple[str, ...]
    driven: NDArray[np.float64]
    refused: NDArray[np.float64]
    margin: float

    def judge(self, columns: dict[str, NDArray[np.float64]]) -> _Judged:
        points = np.column_stack([columns[name] for name in self.names])
        depth, facet = self.hull.depth(points)
        distance = depth - self.margin
        normals = self.hull.normals[facet]
        main = np.argmax(np.abs(normals), axis=1)
        ends = np.where(normals[np.arange(main.size), main] > 0.0, "high", "low")
        active = np.array([f"{self.names[place]} {end}" for place, end in zip(main, ends, strict=True)], dtype=np.str_)
        if len(self.refused):
            apart = self._apart(points)
            active = np.where(apart < distance, "infeasible point", active)
            distance = np.minimum(distance, apart)
        return _Judged(distance, active, depth < 0.0, {})

    def _apart(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance from the plane halfway between the nearest driven and the nearest refused point."""
        from scipy.spatial import cKDTree

        at = points / self.hull.span
        driven, refused = self.driven / self.hull.span, self.refused / self.hull.span
        near, good = cKDTree(driven).query(at)
        far, bad = cKDTree(refused).query(at)
        between = np.linalg.norm(driven[good] - refused[bad], axis=1)
        return np.asarray((far**2 - near**2) / (2.0 * between) - self.margin, dtype=np.float64)


def _rows(region: FeasibleRegion) -> dict[str, Any]:
    rule = region.rule
    if isinstance(rule, _Modelled):
        return {"from": "a model", "limits": {limit.name: limit.upper - limit.margin for limit in rule.limits}}
    return {
        "from": "measured points",
        "factors": rule.names,
        "points": len(rule.driven),
        "infeasible": len(rule.refused),
        "margin": rule.margin,
    }


class FeasibleRegion:
    """Where an engine may be driven: where a model keeps limits, or between points that were driven.

    Make one with `of_model` or `of_points`; `mgdd.design.design_points` takes it as ``feasible``.

    Parameters
    ----------
    rule : object
        What `of_model` or `of_points` prepare.

    Examples
    --------
    >>> from mgdd.design import FeasibleRegion
    >>> from mgdd.engine import Cylinder, OperatingPoint, timing_sweep
    >>> def indicators(columns):
    ...     return timing_sweep(Cylinder(), OperatingPoint(), soc_cad=columns["soc_cad"])
    >>> region = FeasibleRegion.of_model(indicators, {"p_max_bar": 95.0, "dp_max_bar_per_cad": 5.0})
    >>> region.contains({"soc_cad": [-20.0, -6.0, 5.0]}).tolist()
    [False, False, True]
    >>> driven = {"speed_rpm": [1000.0, 1000.0, 3000.0, 3000.0], "fuel_mg": [5.0, 30.0, 5.0, 40.0]}
    >>> region = FeasibleRegion.of_points(driven)
    >>> region.contains({"speed_rpm": 1000.0, "fuel_mg": [20.0, 38.0]}).tolist()
    [True, False]
    """

    def __init__(self, rule: _Modelled | _Measured) -> None:
        self.rule = rule

    @classmethod
    def of_model(cls, indicators: Indicators, limits: Mapping[str, float] | Sequence[Limit]) -> FeasibleRegion:
        """Make the region in which a model keeps limits.

        Parameters
        ----------
        indicators : callable
            ``indicators(columns) -> mapping of arrays``: columns of n points by name, to quantities of shape (n,) by
            name, for example a sweep over the cycle model. A NaN is not feasible.
        limits : mapping of str to float, or sequence of Limit
            Upper limits in the units of the quantities; the margin of a `Limit` is kept free.

        Returns
        -------
        FeasibleRegion
            The region.

        Raises
        ------
        mgdd.errors.ParameterError
            No limits, a limit twice or not finite, indicators that cannot be called.
        """
        if not callable(indicators):
            raise ParameterError.of("indicators", indicators, "a function of columns that returns columns")
        checked = limits_of(limits)
        ParameterError.unless(checked, "limits", limits, "at least one upper limit, for example {'p_max_bar': 150.0}")
        return cls(_Modelled(indicators=indicators, limits=checked))

    @classmethod
    def of_points(cls, points: Any, *, margin: float = 0.0, infeasible: Any = None) -> FeasibleRegion:
        """Make the region between points that were driven: their convex hull, each factor scaled by its range.

        Parameters
        ----------
        points : xarray.Dataset, DataFrame or mapping of columns
            Points that were driven, one column per factor, at most six factors.
        margin : float
            Kept free inside the boundary, in ranges of the factors [-]; 0.05 is 5 % of each range.
        infeasible : xarray.Dataset, DataFrame or mapping of columns, optional
            Points that could not be driven: what lies nearer to one of them than to a driven point is not feasible.

        Returns
        -------
        FeasibleRegion
            The region; no point outside the hull is ever in it.

        Raises
        ------
        mgdd.errors.ParameterError
            A negative margin.
        mgdd.errors.DataError
            Too few points, points in a plane, a factor that does not vary, a point that is in both sets.
        """
        if not (np.isfinite(margin) and 0.0 <= margin < 0.5):
            raise ParameterError.of(argument("margin"), margin, "in [0, 0.5) of the range of a factor")
        names = column_names(points, "points")
        driven = points_of(points, names)
        refused = np.empty((0, len(names))) if infeasible is None else points_of(infeasible, names, what="infeasible")
        both = [row for row in refused.tolist() if row in driven.tolist()]
        if both:
            at = ", ".join(f"{name} {value:g}" for name, value in zip(names, both[0], strict=True))
            option = argument("infeasible")
            raise DataError(f"{option}: the point {at} is also among the points that were driven: keep it in one")
        hull = hull_of(driven, names)
        return cls(_Measured(hull=hull, names=names, driven=driven, refused=refused, margin=float(margin)))

    def contains(self, points: Any) -> NDArray[np.bool_]:
        """Return which points are feasible.

        Parameters
        ----------
        points : xarray.Dataset, DataFrame or mapping of columns
            One column per factor; a single number counts for every point.

        Returns
        -------
        ndarray of bool, shape (n,)
            True inside and on the boundary.

        Raises
        ------
        mgdd.errors.DataError
            A missing column, a number that is not finite, a limit that the model does not compute.
        """
        return self._judged(points)[1].distance >= -EDGE

    def evaluate(self, points: Any) -> xr.Dataset:
        """Return how far points lie inside, and what bounds them.

        Parameters
        ----------
        points : xarray.Dataset, DataFrame or mapping of columns
            As in `contains`.

        Returns
        -------
        xarray.Dataset
            Over ``point``: the columns; ``feasible``; ``distance`` [-], negative outside: of a model the room below the
            nearest limit over that limit, of measured points the distance from the boundary in ranges of the factors;
            ``active_limit``, the limit or the side of the hull that it is measured from; ``extrapolated``, outside of
            all measured points; and what the model computed for the limits.

        Raises
        ------
        mgdd.errors.DataError
            As in `contains`.

        Examples
        --------
        >>> from mgdd.design import FeasibleRegion
        >>> from mgdd.optimize import Limit
        >>> region = FeasibleRegion.of_model(lambda c: {"t_max_k": 100.0 * c["fuel_mg"]}, [Limit("t_max_k", 2000.0)])
        >>> region.evaluate({"fuel_mg": [15.0, 25.0]})["distance"].values.tolist()
        [0.25, -0.25]
        """
        columns, judged = self._judged(points)
        variables: dict[str, tuple[Any, ...]] = {
            "point": ("point", np.arange(judged.distance.size), "-", "point"),
            **{name: ("point", values, *column_label(points, name)) for name, values in columns.items()},
            "feasible": ("point", judged.distance >= -EDGE, "-", "inside the region"),
            "distance": ("point", judged.distance, "-", "distance from the boundary, positive inside"),
            "active_limit": ("point", judged.active, "-", "nearest limit"),
            "extrapolated": ("point", judged.extrapolated, "-", "outside of all measured points"),
        }
        outputs = {name: ("point", values, *named_label(name)) for name, values in judged.indicators.items()}
        return labelled_dataset({**outputs, **variables})

    def _judged(self, points: Any) -> tuple[dict[str, NDArray[np.float64]], _Judged]:
        names = self.rule.names if isinstance(self.rule, _Measured) else column_names(points, "points")
        matrix = points_of(points, names)
        columns = {name: column.copy() for name, column in zip(names, matrix.T, strict=True)}
        return columns, self.rule.judge(columns)


described(FeasibleRegion, rows=_rows)


def inside_of(feasible: Any, columns: dict[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Ask a region, or a function of the columns, which points are feasible; None takes all."""
    size = next(iter(columns.values())).size
    if feasible is None:
        return np.ones(size, dtype=np.bool_)
    if isinstance(feasible, FeasibleRegion):
        return feasible.contains(columns)
    if not callable(feasible):
        raise ParameterError.of("feasible", feasible, "a FeasibleRegion or a function of columns that returns booleans")
    answer = np.asarray(feasible(columns))
    if answer.shape != (size,) or answer.dtype != np.bool_:
        raise ShapeError(
            f"feasible returned {answer.dtype} of shape {answer.shape}: must be bool of shape ({size},), one per point"
        )
    return answer
