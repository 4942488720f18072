"""Twelve operating points in turn, twice, forty cycles each: one map that seeks, and the seekers that start anew."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.guide import Curve, FeedForward, GuidedEngine, ModelOptimum
from mgdd.loop import VirtualEngine
from mgdd.optimize import GaussianProcessSeeking, MapSeeking
from mgdd_studies.design_to_map_engine import AXES, Truth, point_of
from mgdd_studies.guide_cases import PLANT, curve_seeker, no_model
from mgdd_studies.map_that_seeks_cases import GUIDES, NO_GUIDE, TIMING, WRONG_WAY, guide_of, truth_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.engine import OperatingPoint

    Array = NDArray[np.float64]

__all__ = ["CURVE", "DRIVEN", "MAP", "PROCESS", "TURNS", "WAYS", "Driven", "drive"]

POINTS, TURNS, CYCLES = 12, 2, 40
MAP, CURVE, PROCESS = "map that seeks", "curve", "feed-forward around a process"
WAYS = (MAP, CURVE, PROCESS)
DRIVEN = ("wall heat +30 %", "twice the wall heat", "adiabatic", WRONG_WAY, NO_GUIDE)
_LOW, _HIGH = TIMING["soc_cad"]


@dataclass(frozen=True, kw_only=True)
class Driven:
    """J lost [points], shape (turns, points, cycles); share of the cells within 1.96 sd of the map, NaN without one."""

    lost: Array
    covered: float


class _Model:
    """What a guide says of one point: its curve, and its best timing."""

    def __init__(self, name: str) -> None:
        self.backwards = name == WRONG_WAY
        cylinder = GUIDES[name]
        self.optimum = None if cylinder is None else ModelOptimum(cylinder, bounds_cad=(_LOW, _HIGH))

    def curve(self, point: OperatingPoint) -> Curve:
        """Give J over the timing; a parabola where there is no model."""
        own = None if self.optimum is None else self.optimum.curve(point)
        if own is None:
            return no_model()
        if not self.backwards:
            return own
        over = np.linspace(own.lower, own.upper, 200)
        return Curve(over, np.asarray(own(own.lower + own.upper - over)))

    def best(self, point: OperatingPoint) -> float:
        """Give the best timing [°CA aTDC]."""
        best = None if self.optimum is None else self.optimum(point)
        if best is None:
            raise ArithmeticError(f"the guide has no best timing at {point}")
        return _LOW + _HIGH - best["soc_cad"] if self.backwards else best["soc_cad"]


def _route(seed: int) -> tuple[Array, Array]:
    draw = np.random.default_rng([seed, 5555]).random((len(AXES), POINTS))
    speed, fuel = (entries[0] + part * np.ptp(entries) for entries, part in zip(AXES.values(), draw, strict=True))
    return speed, fuel


@lru_cache(maxsize=64)  # every way and guide drives the same routes
def _truth_along(seed: int) -> Truth:
    return Truth.of(PLANT, _route(seed))


def drive(way: str, guide: str, seed: int) -> Driven:
    """Drive the points of a seed without limits; route and noise are those of the seed."""
    places = _route(seed)
    points = [point_of(*place) for place in zip(*places, strict=True)] * TURNS
    engine = VirtualEngine(PLANT, schedule=[(CYCLES * k, point) for k, point in enumerate(points)], seed=seed)
    seeker: Any = None
    model = _Model(guide)
    if way == MAP:
        own = {name: given for name, given in guide_of(guide).items() if name == "guide"}
        search = MapSeeking(TIMING, AXES, seed=seed, **own)
        seeker = search.driver()
    elif way == PROCESS:
        process = GaussianProcessSeeking(start=0.5 * (_LOW + _HIGH), bounds=(_LOW, _HIGH), seed=seed)
        seeker = FeedForward(process, None if guide == NO_GUIDE else model.best)
    elif model.optimum is not None and not model.backwards:
        seeker = GuidedEngine(curve_seeker(model.curve(points[0])), model.optimum, points[0])
    applied = np.empty((len(points), CYCLES))
    for k, point in enumerate(points):
        anew: Any = curve_seeker(model.curve(point)) if seeker is None else seeker
        for cycle in range(CYCLES):
            if seeker is not None:
                seeker.at(point)
            asked = float(anew.ask()[0])
            applied[k, cycle] = asked
            anew.tell(engine.step(asked)["j"])
    truth = _truth_along(seed)
    timing = applied.reshape(TURNS, POINTS, CYCLES)
    lost = truth.free[:, None] - np.moveaxis(truth.at(np.moveaxis(timing, 1, 2)), -1, 1)
    covered = np.nan
    if way == MAP:
        cells = search.cells()
        off = np.abs(cells["soc_cad"].to_numpy().ravel() - truth_of("as calibrated").free_cad)
        covered = float(np.mean(off <= 1.96 * cells["soc_cad_sd"].to_numpy().ravel()))
    return Driven(lost=lost, covered=covered)
