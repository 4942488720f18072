"""The engine that is calibrated, cells and limits of its map, and the truth that a map is judged by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.guide import FeedForward, ModelOptimum, TimingMap
from mgdd.loop import VirtualEngine
from mgdd.maps import optimize_map
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.results.labels import labelled_dataset
from mgdd.sweep import sweep
from mgdd_studies.guide_cases import PLANT

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd.maps import CalibrationMap

    Array = NDArray[np.float64]

__all__ = [
    "AXES", "CELLS", "DWELL", "EARLY", "ENGINES", "LIMITS", "MIDDLES", "OBJECTIVE", "ROUGH", "TIMINGS", "Drive",
    "Truth", "as_sweep", "drive", "drive_by_map", "intake_kpa", "point_of", "rough_model", "timing_map",
]  # fmt: skip

OBJECTIVE = "efficiency_percent"
LIMITS: Mapping[str, float] = {"p_max_bar": 130.0, "dp_max_bar_per_cad": 4.2}
AXES: Mapping[str, Array] = {
    "speed_rpm": np.array([1000.0, 1400.0, 1800.0, 2200.0, 2600.0, 3000.0]),
    "fuel_mg": np.array([8.0, 14.0, 20.0, 26.0, 32.0]),
}
TIMINGS = np.linspace(-24.0, 10.0, 69)
_FINE = np.linspace(-30.0, 14.0, 441)  # of the truth [°CA aTDC]


def _changed(*, heat: float = 1.0, burn: float = 1.0, compression: float = 0.0) -> Cylinder:
    return PLANT.replace(
        wall_heat_scale=heat * PLANT.wall_heat_scale,
        burn_duration_ref_cad=burn * PLANT.burn_duration_ref_cad,
        compression_ratio=PLANT.compression_ratio + compression,
    )


# What a map may meet after it was made: one change at a time, and an engine on which several came together.
ENGINES: Mapping[str, Cylinder] = {
    "as calibrated": PLANT,
    "wall heat -30 %": _changed(heat=0.7),
    "wall heat +30 %": _changed(heat=1.3),
    "compression ratio -1": _changed(compression=-1.0),
    "compression ratio +1": _changed(compression=1.0),
    "burn 15 % shorter": _changed(burn=0.85),
    "burn 15 % longer": _changed(burn=1.15),
    "worn": _changed(heat=0.7, burn=1.15, compression=-1.0),  # deposits insulate, a nozzle cokes, gas leaks
}
ROUGH = _changed(heat=2.0)  # what is believed of the engine before anything was measured


def intake_kpa(fuel_mg: ArrayLike) -> Array:
    """Intake pressure that the charger gives at a load [kPa]."""
    return 100.0 + 3.0 * np.asarray(fuel_mg, np.float64)


def point_of(speed_rpm: float, fuel_mg: float) -> OperatingPoint:
    """Operating point of the engine at a speed and load."""
    return OperatingPoint(
        speed_rpm=float(speed_rpm), fuel_mg=float(fuel_mg), intake_pressure_kpa=float(intake_kpa(fuel_mg))
    )


def grid_of(axes: Mapping[str, Array]) -> tuple[Array, Array]:
    """Speeds and loads of all cells, the load changing fastest."""
    speeds, fuels = np.meshgrid(*axes.values(), indexing="ij")
    return speeds.ravel(), fuels.ravel()


CELLS = grid_of(AXES)
MIDDLES = grid_of({name: 0.5 * (entries[:-1] + entries[1:]) for name, entries in AXES.items()})  # between four cells


def as_sweep(columns: Mapping[str, Array], timings: Array, axes: Mapping[str, Array] = AXES) -> xr.Dataset:
    """Columns of shape (cells, timings) as the sweep that `optimize_map` takes."""
    shape = (*(entries.size for entries in axes.values()), timings.size)
    names = {"speed_rpm": ("rpm", "engine speed"), "fuel_mg": ("mg", "fuel")}
    variables: dict[str, tuple[Any, ...]] = {
        name: (name, entries, *names.get(name, ("-", name))) for name, entries in axes.items()
    }
    variables["soc_cad"] = ("soc_cad", timings)
    for name, column in columns.items():
        label = ("%", "gross indicated efficiency") if name == OBJECTIVE else ()
        variables[name] = ((*axes, "soc_cad"), np.reshape(column, shape), *label)
    return labelled_dataset(variables)


@dataclass(frozen=True, kw_only=True)
class Truth:
    """An engine without noise at some operating points: efficiency [points] and what is limited, over the timing.

    Shapes (places, timings) of the columns, over 441 timings from -30 to 14 °CA aTDC, and (places,) of all else.
    """

    columns: Mapping[str, Array]
    best_cad: Array  # under the limits
    best: Array
    free_cad: Array  # without limits
    free: Array

    @classmethod
    def of(cls, cylinder: Cylinder, places: tuple[Array, Array] = CELLS) -> Truth:
        """Simulate an engine at these speeds and loads."""
        speed, fuel = (np.repeat(column, _FINE.size) for column in places)
        inputs = {
            "speed_rpm": speed, "fuel_mg": fuel, "intake_pressure_kpa": intake_kpa(fuel),
            "soc_cad": np.tile(_FINE, places[0].size),
        }  # fmt: skip
        found = sweep(
            cylinder, OperatingPoint(), inputs, pointwise=True, outputs=["efficiency_gross", *LIMITS], workers=1
        )
        raw = {name: found[name].to_numpy().reshape(-1, _FINE.size) for name in ("efficiency_gross", *LIMITS)}
        columns = {OBJECTIVE: 100.0 * raw["efficiency_gross"], **{name: raw[name] for name in LIMITS}}
        numbered = as_sweep(columns, _FINE, {"place": np.arange(float(places[0].size))})
        held, free = (optimize_map(numbered, OBJECTIVE, limits=limits) for limits in (LIMITS, None))
        return cls(
            columns=columns, best_cad=held.values, best=held.cells["objective"], free_cad=free.values,
            free=free.cells["objective"],
        )  # fmt: skip

    def at(self, timing_cad: ArrayLike, name: str = OBJECTIVE) -> Array:
        """Read a response at one timing per place, shape (..., places)."""
        place = np.clip((np.asarray(timing_cad, np.float64) - _FINE[0]) / (_FINE[1] - _FINE[0]), 0.0, _FINE.size - 1.0)
        below = np.minimum(place.astype(np.int_), _FINE.size - 2)
        share, table, rows = place - below, self.columns[name], np.arange(self.best.size)
        return np.asarray((1.0 - share) * table[rows, below] + share * table[rows, below + 1])

    def lost(self, timing_cad: ArrayLike) -> Array:
        """Efficiency below the best under the limits [points]; what is won beyond a limit is not counted."""
        return np.maximum(self.best - self.at(timing_cad), 0.0)

    def excess(self, timing_cad: ArrayLike) -> Array:
        """How far beyond its worst limit each place runs, as a share of that limit; negative inside."""
        return np.asarray(np.max([self.at(timing_cad, name) / upper - 1.0 for name, upper in LIMITS.items()], axis=0))


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
    return TimingMap(table, prior_sd_cad=PRIOR_SD_CAD, forgetting=1.0)


def drive(cylinder: Cylinder, guide: Any, seed: int, *, learns: bool = False) -> Drive:
    """Drive a route by extremum seeking under the limits, led by a map, a model or nothing as feed-forward.

    A map that `learns` takes the settled estimate of each point before the next one; route and noise are those of the
    seed.
    """
    places = route(seed)
    points = [point_of(*place) for place in zip(*places, strict=True)]
    schedule = [(k * DWELL, point) for k, point in enumerate(points)]
    bench = VirtualEngine(cylinder, schedule=schedule, limits=tuple(LIMITS), seed=seed)
    plain = ExtremumSeeking(
        start=_START_CAD, bounds=_BOUNDS_CAD, form="moving_average", gain=_GAIN,
        amplitude=1.0, limits=[Limit(name, upper) for name, upper in LIMITS.items()],
    )  # fmt: skip
    seeker = FeedForward(plain, guide)
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


def _judged(cylinder: Cylinder, places: tuple[Array, Array], applied: Array, learnt: int) -> Drive:
    """Judge all but the first point, where a seeker without a guide stands wherever it was put."""
    truth, moved = Truth.of(cylinder, (places[0][1:], places[1][1:])), applied[1:].T
    return Drive(lost=truth.lost(moved), excess=truth.excess(moved), learnt=learnt)
