"""One search for a map on one engine: guides of every quality, trouble on the way, and what each visit costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import EngineGuide, Measurement, VirtualEngine, VirtualTestBed, seek, seek_map
from mgdd.loop.seek_map import model_of
from mgdd.optimize import Input
from mgdd_studies.design_to_map_engine import AXES, CELLS, ENGINES, LIMITS, ROUGH, Truth, point_of
from mgdd_studies.guide_cases import PLANT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.engine import Cylinder
    from mgdd.loop.map_result import Visit
    from mgdd.optimize import MapSeeking

    Array = NDArray[np.float64]

__all__ = [
    "GUIDES", "NO_GUIDE", "OLD_MAP", "STOPS", "TIMING", "TROUBLES", "VISIT_CYCLES", "WRONG_WAY", "Path", "Search",
    "guide_of", "sought_per_cell", "truth_of", "walk", "walk_of_two",
]  # fmt: skip

TIMING = {"soc_cad": (-24.0, 8.0)}
VISIT_CYCLES = 70  # 20 to settle, 50 averaged: those of a point of the design
START_CAD = 0.0  # without a guide, where the limits hold
NO_GUIDE, OLD_MAP, WRONG_WAY = "none", "engine as calibrated", "wrong way"
STOPS = (6, 8, 10, 12, 16, 24, 32)
GUIDES: Mapping[str, Cylinder | None] = {
    "twice the wall heat": ROUGH,
    "wall heat +30 %": PLANT.replace(wall_heat_scale=1.3 * PLANT.wall_heat_scale),
    "adiabatic": PLANT.replace(wall_heat_scale=0.0),
    WRONG_WAY: ROUGH,  # its efficiency mirrored over the timing
    OLD_MAP: PLANT,
    NO_GUIDE: None,
}


@dataclass(frozen=True, kw_only=True)
class Search:
    """What is sought on: engine, guide, trouble, and the visits after which the map is looked at."""

    engine: str = "as calibrated"
    guide: str = "twice the wall heat"
    trouble: str = ""
    stops: tuple[int, ...] = STOPS

    @property
    def label(self) -> str:
        """Name, each once in a study."""
        return ", ".join(part for part in (self.engine, self.guide, self.trouble) if part)


@dataclass(frozen=True, kw_only=True)
class Path:
    """One search: timings at its stops, and what its visits drove."""

    timings: Array  # (stops, cells) [°CA aTDC]
    named: NDArray[np.bool_]  # (stops, cells), that no input is known to be safe there
    places: NDArray[np.int_]  # (visits,), cells that were visited
    asked: Array  # (visits,) [°CA aTDC]
    runs: NDArray[np.bool_]  # (cells,), where the engine does


@cache
def truth_of(engine: str) -> Truth:
    """Simulate an engine of `ENGINES`, or a model of `GUIDES`, in the cells."""
    return Truth.of(ENGINES[engine] if engine in ENGINES else _model(engine))


def _model(guide: str) -> Cylinder:
    model = GUIDES[guide]
    if model is None:
        raise ValueError(f"{guide}: is no model")
    return model


@cache
def guide_of(name: str) -> Mapping[str, Any]:
    """Give efficiency and limits of a guide over the cells and the timing, as `seek_map` takes them."""
    if GUIDES[name] is None:
        return {"start": {"soc_cad": START_CAD}}
    bed = VirtualTestBed(PLANT, point=point_of, limits=tuple(LIMITS))
    j, limits = model_of(bed, _model(name), AXES, [Input("soc_cad", *TIMING["soc_cad"])], list(LIMITS))
    if name == WRONG_WAY:  # mirrored over the timing, the last dimension
        j = j.copy(data=j.to_numpy()[..., ::-1])
    return {"guide": j, "limit_guides": limits}


_EVERY = 20  # visits in which the level drifts by that much, or one lies
_OUTLIER_PERCENT = 1.0  # 24 standard deviations of the efficiency of a visit
_DRIFTS = {"slow drift": 0.042, "fast drift": 0.3}  # standard deviations of a visit, and of a cycle [points]
_LIES, _FAILS = "outliers", "a cell that fails"
TROUBLES = (*_DRIFTS, _LIES, _FAILS)


class TroubledBed:
    """The test bed with a level of the efficiency that drifts, a visit of twenty that lies, or a cell that fails."""

    def __init__(self, bed: VirtualTestBed, trouble: str, seed: int) -> None:
        draw = np.random.default_rng([seed, 55])
        self.input_names, self.limit_names = bed.input_names, bed.limit_names
        self._bed, self._trouble, self._visit = bed, trouble, 0
        lies = enumerate(draw.integers(_EVERY, size=8).tolist())
        self._lies = {_EVERY * k + at: float(draw.choice([-1.0, 1.0])) for k, at in lies}
        self.failing = int(draw.integers(CELLS[0].size)) if trouble == _FAILS else -1
        self._fails = False

    def begin(self, visit: int) -> None:
        """Say that a visit with this number begins: drift and outliers count visits, not cycles."""
        self._visit = visit
        self._bed.begin(visit)

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set operating point and timing of the next cycle."""
        self._fails = _cell_of(inputs) == self.failing
        self._bed.apply(inputs)

    def measure(self) -> Measurement:
        """Run one cycle."""
        measured = self._bed.measure()
        if self._fails:
            return replace(measured, misfire=True)
        off = _DRIFTS.get(self._trouble, 0.0) * self._visit / _EVERY
        if self._trouble == _LIES:
            off = _OUTLIER_PERCENT * self._lies.get(self._visit, 0.0)
        return replace(measured, components=(measured.performance + off,))


def _cell_of(at: Mapping[str, float]) -> int:
    off = sum(np.abs(column - at[name]) / np.ptp(column) for name, column in zip(AXES, CELLS, strict=True))
    return int(np.argmin(off))


def walk(search: Search, seed: int) -> Path:
    """Seek one map."""
    bed = VirtualTestBed(ENGINES[search.engine], point=point_of, limits=tuple(LIMITS), seed=seed)
    plant = TroubledBed(bed, search.trouble, seed)
    seeker: MapSeeking | None = None
    timings: list[Array] = []
    named: list[NDArray[np.bool_]] = []
    visits: list[Visit] = []
    for stop in search.stops:
        first = {"limits": LIMITS, "seed": seed, **guide_of(search.guide)}
        how: dict[str, Any] = {"seeker": seeker} if seeker else first
        found = seek_map(plant, TIMING, AXES, visits=stop, **how)
        seeker = found.seeker
        visits.extend(found.visits)
        timings.append(found.map.values.ravel())
        named.append(found.cells["excess"].to_numpy().ravel() > 0.0)
    return Path(
        timings=np.array(timings), named=np.array(named), places=np.array([_cell_of(visit.at) for visit in visits]),
        asked=np.array([visit.inputs["soc_cad"] for visit in visits]),
        runs=np.arange(CELLS[0].size) != plant.failing,
    )  # fmt: skip


def sought_per_cell(cycles: int, seed: int, *, guided: bool) -> tuple[Array, Array]:
    """Seek every cell on its own; give the timings found, and those that were driven, shape (cycles, cells)."""
    found, driven = [], []
    for number, place in enumerate(zip(*CELLS, strict=True)):
        engine = VirtualEngine(PLANT, point_of(*place), limits=tuple(LIMITS), seed=1000 * seed + number)
        guide = EngineGuide(cylinder=ROUGH) if guided else None
        one = seek(engine, TIMING, limits=LIMITS, cycles=cycles, guide=guide, seed=seed)
        found.append(one.inputs["soc_cad"])
        driven.append(one.run.dataset["applied"].to_numpy()[:, 0])
    return np.array(found), np.array(driven).T


PAIR = {**TIMING, "intake_pressure_kpa": (110.0, 200.0)}
_PAIR_NODES = (97, 61)  # timings and pressures of the truth in a cell


@cache
def pair_truth() -> tuple[list[Any], Array]:
    """Give efficiency and limits of the engine as calibrated over both inputs, by cell, and the best efficiency."""
    from scipy.interpolate import RegularGridInterpolator

    bed = _pair_bed(0)
    axes = [np.linspace(*bounds, count) for bounds, count in zip(PAIR.values(), _PAIR_NODES, strict=True)]
    timing, pressure = (column.ravel() for column in np.meshgrid(*axes, indexing="ij"))
    columns = {name: np.repeat(column, timing.size) for name, column in zip(AXES, CELLS, strict=True)}
    tiled = zip(PAIR, (timing, pressure), strict=True)
    found = bed.steady(columns | {name: np.tile(column, CELLS[0].size) for name, column in tiled})
    tables = np.stack([found[name] for name in ("j", *LIMITS)], axis=-1).reshape(-1, *_PAIR_NODES, 1 + len(LIMITS))
    surfaces = [RegularGridInterpolator(axes, table) for table in tables]
    fine = np.stack(np.meshgrid(*(np.linspace(column[0], column[-1], 4 * column.size - 3) for column in axes)), axis=-1)
    best = []
    for surface in surfaces:
        j, *limits = np.moveaxis(surface(fine.reshape(-1, 2)), -1, 0)
        held = np.all([column <= upper for column, upper in zip(limits, LIMITS.values(), strict=True)], axis=0)
        best.append(float(j[held].max()))
    return surfaces, np.array(best)


def _pair_bed(seed: int) -> VirtualTestBed:
    return VirtualTestBed(PLANT, point=point_of, limits=tuple(LIMITS), seed=seed, inputs=list(PAIR))


@cache
def _pair_guide() -> Mapping[str, Any]:
    sought = [Input(name, *bounds) for name, bounds in PAIR.items()]
    j, limits = model_of(_pair_bed(0), ROUGH, AXES, sought, list(LIMITS))
    return {"guide": j, "limit_guides": limits}


def walk_of_two(stops: tuple[int, ...], seed: int) -> tuple[Array, Array]:
    """Seek timing and intake pressure together; give loss [points] and excess of each cell, shape (stops, cells)."""
    bed, seeker = _pair_bed(seed), None
    lost: list[Array] = []
    excess: list[Array] = []
    surfaces, best = pair_truth()
    for stop in stops:
        how: dict[str, Any] = {"seeker": seeker} if seeker else {"limits": LIMITS, "seed": seed, **_pair_guide()}
        found = seek_map(bed, PAIR, AXES, visits=stop, **how)
        seeker = found.seeker
        at = np.stack([found.maps[name].values.ravel() for name in PAIR], axis=-1)
        read = np.array([surface(own)[0] for surface, own in zip(surfaces, at, strict=True)])
        lost.append(np.maximum(best - read[:, 0], 0.0))
        excess.append(np.max(read[:, 1:] / list(LIMITS.values()) - 1.0, axis=1))
    return np.array(lost), np.array(excess)
