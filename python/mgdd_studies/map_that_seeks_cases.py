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
from mgdd_studies.design_to_map_engine import AXES, CELLS, ENGINES, LIMITS, ROUGH, Truth, intake_kpa, point_of
from mgdd_studies.guide_cases import PLANT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.engine import Cylinder, OperatingPoint
    from mgdd.optimize import MapSeeking

    Array = NDArray[np.float64]

__all__ = [
    "GUIDES", "NO_GUIDE", "OLD_MAP", "TIMING", "VISIT_CYCLES", "Path", "Search", "guide_of", "mirrored",
    "sought_per_cell", "truth_of", "walk",
]  # fmt: skip

TIMING = {"soc_cad": (-24.0, 8.0)}
VISIT_CYCLES = 70  # 20 to settle, 50 averaged: those of a point of the design
START_CAD = 0.0  # without a guide, where the limits hold
NO_GUIDE, OLD_MAP = "none", "engine as calibrated"
GUIDES: Mapping[str, Cylinder | None] = {
    "twice the wall heat": ROUGH,
    "wall heat +30 %": PLANT.replace(wall_heat_scale=1.3 * PLANT.wall_heat_scale),
    "adiabatic": PLANT.replace(wall_heat_scale=0.0),
    "wrong way": ROUGH,  # its efficiency mirrored over the timing
    OLD_MAP: PLANT,
    NO_GUIDE: None,
}


@dataclass(frozen=True, kw_only=True)
class Search:
    """What is sought on: engine, guide, trouble, and the visits after which the map is looked at."""

    engine: str = "as calibrated"
    guide: str = "twice the wall heat"
    trouble: str = ""
    stops: tuple[int, ...] = (6, 8, 10, 12, 16, 24, 32)

    @property
    def label(self) -> str:
        """Name, each once in a study."""
        return ", ".join(part for part in (self.engine, self.guide, self.trouble) if part)


@dataclass(frozen=True, kw_only=True)
class Path:
    """One search: timings at its stops, what its visits drove, and how much of the guide it took."""

    timings: Array  # (stops, cells) [°CA aTDC]
    places: NDArray[np.int_]  # (visits,), cells that were visited
    asked: Array  # (visits,) [°CA aTDC]
    trust: float
    judged: NDArray[np.bool_]  # (cells,), those where the engine runs


@cache
def truth_of(engine: str) -> Truth:
    """Simulate an engine of `ENGINES`, or a model of `GUIDES`, in the cells."""
    return Truth.of(ENGINES[engine] if engine in ENGINES else _model(engine))


def _model(guide: str) -> Cylinder:
    model = GUIDES[guide]
    if model is None:
        raise ValueError(f"{guide}: is no model")
    return model


def mirrored(table: Any) -> Any:
    """Mirror a response over the timing: its best lies as far on the other side of the middle."""
    return table.copy(data=table.transpose(..., "soc_cad").to_numpy()[..., ::-1])


@cache
def guide_of(name: str) -> Mapping[str, Any]:
    """Give efficiency and limits of a guide over the cells and the timing, as `seek_map` takes them."""
    if GUIDES[name] is None:
        return {"start": {"soc_cad": START_CAD}}
    bed = VirtualTestBed(PLANT, point=point_of, limits=tuple(LIMITS))
    j, limits = model_of(bed, _model(name), AXES, [Input("soc_cad", *TIMING["soc_cad"])], list(LIMITS))
    return {"guide": mirrored(j) if name == "wrong way" else j, "limit_guides": limits}


NOISE_PERCENT = 0.042  # standard deviation of the efficiency of a visit [points]
_OUTLIER_PERCENT, _EVERY = 1.0, 20  # of an outlier [points]; visits


class TroubledBed:
    """The test bed with a level of the efficiency that drifts, a visit of twenty that lies, or a cell that fails."""

    def __init__(self, bed: VirtualTestBed, trouble: str, seed: int) -> None:
        draw = np.random.default_rng([seed, 55])
        self.input_names, self.limit_names = bed.input_names, bed.limit_names
        self._bed, self._trouble, self._visit = bed, trouble, 0
        self._lies = {_EVERY * k + int(at): float(draw.choice([-1.0, 1.0])) for k, at in enumerate(draw.integers(20, size=8))}
        self.failing = int(draw.integers(CELLS[0].size))
        self._fails = False

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Begin a visit."""
        self._visit += 1
        self._fails = self._trouble == "a cell that fails" and _cell_of(inputs) == self.failing
        self._bed.apply(inputs)

    def measure(self) -> Measurement:
        """Run one cycle."""
        measured = self._bed.measure()
        if self._fails:
            return replace(measured, misfire=True)
        off = 0.0
        if self._trouble.startswith("drift"):
            off = NOISE_PERCENT * self._visit / _EVERY
        elif self._trouble.startswith("outlier"):
            off = _OUTLIER_PERCENT * self._lies.get(self._visit - 1, 0.0)
        return replace(measured, components=(measured.performance + off,))


def _cell_of(at: Mapping[str, float]) -> int:
    off = sum(np.abs(column - at[name]) / np.ptp(column) for name, column in zip(AXES, CELLS, strict=True))
    return int(np.argmin(off))


def walk(search: Search, seed: int) -> Path:
    """Seek one map."""
    bed = VirtualTestBed(ENGINES[search.engine], point=point_of, limits=tuple(LIMITS), seed=seed)
    plant = TroubledBed(bed, search.trouble, seed)
    found, seeker, timings, visits = None, None, [], []
    for stop in search.stops:
        how = {"seeker": seeker} if seeker else {"limits": LIMITS, "seed": seed, **guide_of(search.guide)}
        found = seek_map(plant, TIMING, AXES, visits=stop, **how)
        seeker = found.seeker
        visits += found.visits
        timings.append(found.map.values.ravel())
    driven = [visit for visit in visits if not visit.failed]
    fails = search.trouble == "a cell that fails"
    return Path(
        timings=np.array(timings), places=np.array([_cell_of(visit.at) for visit in driven]),
        asked=np.array([visit.inputs["soc_cad"] for visit in driven]),
        trust=float(seeker.trust) if seeker is not None else np.nan,
        judged=~(fails & (np.arange(CELLS[0].size) == plant.failing)),
    )  # fmt: skip


def sought_per_cell(cycles: int, seed: int, *, guided: bool) -> tuple[Array, Array]:
    """Seek every cell on its own; give the timings found, and those that were driven, shape (cycles, cells)."""
    found, driven = [], []
    for number, place in enumerate(zip(*CELLS, strict=True)):
        engine = VirtualEngine(PLANT, point_of(*place), limits=tuple(LIMITS), seed=1000 * seed + number)
        guide = {"guide": EngineGuide(ROUGH)} if guided else {}
        one = seek(engine, TIMING, limits=LIMITS, cycles=cycles, seed=seed, **guide)
        found.append(one.inputs["soc_cad"])
        driven.append(one.run.dataset["applied"].to_numpy()[:, 0])
    return np.array(found), np.array(driven).T
