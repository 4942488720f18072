"""What the guide makes of a map: drives through random operating points, and what the map learns on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Cylinder
from mgdd.guide import FeedForward, ModelOptimum
from mgdd.loop import EngineBench
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.studies.design_to_map_engine import AXES, LIMITS, ROUGH, Truth, point_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.guide import TimingMap
    from mgdd.maps import CalibrationMap

    Array = NDArray[np.float64]

__all__ = [
    "DWELL",
    "EARLY",
    "PLACES",
    "PRIOR_SD_CAD",
    "Drive",
    "drive",
    "drive_by_map",
    "rough_model",
    "route",
    "timing_map",
]

PLACES, DWELL, EARLY = 16, 200, 50  # operating points of a drive, cycles at each, and those that count as early
PRIOR_SD_CAD = 2.0  # how far a cell of the map may lie from the best timing
_START_CAD, _BOUNDS_CAD = 0.0, (-30.0, 14.0)
_GAIN = 0.98  # time constant 40 cycles at a curvature of -0.051 points per CAD**2
_CONFIRMED = 100  # last cycles at a point that make a confirmed optimum


@dataclass(frozen=True, kw_only=True)
class Drive:
    """J lost [points] and share beyond the worst limit, shape (cycles of a point, points but the first)."""

    lost: Array
    excess: Array
    learnt: int = 0

    @property
    def above_percent(self) -> float:
        """Cycles beyond a limit, without scatter and noise [%]."""
        return 100.0 * float((self.excess > 0.0).mean())


def route(seed: int) -> tuple[Array, Array]:
    """Draw the speeds and loads of a drive inside the axes of the map."""
    draw = np.random.default_rng([seed, 2026]).random((len(AXES), PLACES))
    speed, fuel = (entries[0] + part * np.ptp(entries) for entries, part in zip(AXES.values(), draw, strict=True))
    return speed, fuel


def timing_map(table: CalibrationMap) -> TimingMap:
    """Make the table of the guide of a map; it forgets nothing, since its engine stays as it is."""
    return table.to_timing_map(prior_sd_cad=PRIOR_SD_CAD, forgetting=1.0)


def drive(cylinder: Cylinder, guide: Any, seed: int, *, learns: bool = False) -> Drive:
    """Drive a route by extremum seeking under the limits, led by a guide.

    Parameters
    ----------
    cylinder : Cylinder
        The engine.
    guide : TimingMap, ModelOptimum, or None
        Feed-forward of the seeker.
    seed : int
        Of the route and of the noise.
    learns : bool
        The guide is a map that learns the settled estimate of each point before the next one.
    """
    places = route(seed)
    points = [point_of(*place) for place in zip(*places, strict=True)]
    schedule = [(k * DWELL, point) for k, point in enumerate(points)]
    bench = EngineBench(cylinder, schedule=schedule, limits=tuple(LIMITS), seed=seed)
    seeker = FeedForward(_seeker(), guide)
    applied, learnt = np.empty((PLACES, DWELL)), 0
    for k, point in enumerate(points):
        seeker.at(point)  # once: it stands still until the next
        for cycle in range(DWELL):
            asked = float(seeker.ask()[0])
            measured = bench.step(asked)
            applied[k, cycle] = measured["soc_applied_cad"]
            seeker.tell(measured["j"], measured["limits"])
        if learns:
            learnt += guide.learn_from(seeker, point, cycles=_CONFIRMED)
    return _judged(cylinder, places, applied, learnt)


def drive_by_map(cylinder: Cylinder, table: Callable[[Any], float | None], seed: int) -> Drive:
    """Drive the same route at the timings of a table, without a seeker."""
    places = route(seed)
    timings = [table(point_of(*place)) for place in zip(*places, strict=True)]
    return _judged(cylinder, places, np.repeat(np.array(timings, np.float64)[:, None], DWELL, axis=1), 0)


def rough_model() -> ModelOptimum:
    """Make the model that was there before anything was measured."""
    return ModelOptimum(ROUGH, bounds_cad=_BOUNDS_CAD)


def _seeker() -> ExtremumSeeking:
    return ExtremumSeeking(
        start=_START_CAD, lower=_BOUNDS_CAD[0], upper=_BOUNDS_CAD[1], form="moving_average", gain=_GAIN,
        limits=[Limit(name, upper) for name, upper in LIMITS.items()],
    )  # fmt: skip


def _judged(cylinder: Cylinder, places: tuple[Array, Array], applied: Array, learnt: int) -> Drive:
    """Judge all but the first point, where a seeker without a guide stands wherever it was put."""
    truth, moved = Truth.of(cylinder, (places[0][1:], places[1][1:])), applied[1:].T
    return Drive(lost=truth.lost(moved), excess=truth.excess(moved), learnt=learnt)
