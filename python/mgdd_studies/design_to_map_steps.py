"""The seven steps of a conventional calibration: design, measurement, responses, optimum, smooth map, check, table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.design import FeasibleRegion, design_points
from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import ConvergenceError
from mgdd.loop import VirtualEngine
from mgdd.maps import CalibrationMap, optimize_map, smooth_map
from mgdd.optimize import Limit
from mgdd.results.labels import labelled_dataset
from mgdd.surrogate import fit_response
from mgdd.sweep import sweep
from mgdd_studies.design_to_map_engine import (
    AXES,
    CELLS,
    ENGINES,
    LIMITS,
    MIDDLES,
    OBJECTIVE,
    ROUGH,
    TIMINGS,
    as_sweep,
    intake_kpa,
    point_of,
)

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.surrogate.response_fit import ResponseFit

    Array = NDArray[np.float64]

__all__ = ["CASES", "POLYNOMIAL", "PROCESS", "QUICK_CASES", "SETTLING", "SLOPES", "STAGES", "Case", "Made", "make_map"]

FACTORS = {"speed_rpm": (800.0, 3200.0), "fuel_mg": (5.0, 35.0), "soc_cad": (-24.0, 8.0)}
SETTLING, CYCLES = 20, 50  # cycles of a point that do not count, and that are averaged
_SCREEN = 1.1  # of a limit: so far a rough model that may be wrong lets the bench be driven
SLOPES: Mapping[str, float] = {"speed_rpm": 5e-3, "fuel_mg": 0.35}  # [°CA/rpm, °CA/mg]
PRICES = (0.1, 0.2, 0.4, 0.8, 1.6)  # what smoothness may cost, the least that the slopes allow [points]
_MARGIN_SD = 1.64  # standard deviations of the left-out points that are kept free below a limit
_CHECKS = 3
_BEYOND_CAD, _LEAST_SLOPE = 0.25, 0.005  # beyond the limit [°CA]; share of a limit per °CA


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Points that were run: factors and mean responses over ``point``, and the engine cycles that they cost."""

    points: xr.Dataset
    cycles: int


def screen() -> FeasibleRegion:
    """Where the bench may be driven, by the prior model of the engine."""

    def indicators(columns: dict[str, Array]) -> dict[str, Array]:
        told = {**columns, "intake_pressure_kpa": intake_kpa(columns["fuel_mg"])}
        found = sweep(ROUGH, OperatingPoint(), told, pointwise=True, outputs=list(LIMITS), workers=1)
        return {name: found[name].to_numpy() for name in LIMITS}

    return FeasibleRegion.of_model(indicators, {name: _SCREEN * upper for name, upper in LIMITS.items()})


def design(n: int, seed: int) -> xr.Dataset:
    """Step 1: choose points that fill the space of speed, load and timing."""
    return design_points(FACTORS, n, feasible=screen(), seed=seed)


def measure(cylinder: Cylinder, points: xr.Dataset, *, seed: int, cycles: int = CYCLES, noise: bool = True) -> Measured:
    """Step 2: run the points one after another on the bench, and average each after it has settled."""
    speed, fuel, timing = (points[name].to_numpy() for name in FACTORS)
    dwell = SETTLING + cycles
    quiet: dict[str, Any] = {} if noise else {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}
    schedule = [(k * dwell, point_of(*at)) for k, at in enumerate(zip(speed, fuel, strict=True))]
    bench = VirtualEngine(cylinder, schedule=schedule, limits=tuple(LIMITS), seed=seed, **quiet)
    run = bench.run_columns(np.repeat(timing, dwell))

    def mean(column: Array) -> Array:
        return np.asarray(column.reshape(timing.size, dwell)[:, SETTLING:].mean(axis=1))

    limits = np.asarray(run["limits"])
    columns = {OBJECTIVE: mean(np.asarray(run["j"]))}
    columns |= {name: mean(limits[:, k]) for k, name in enumerate(LIMITS)}
    labelled = points.assign({name: ("point", column) for name, column in columns.items()})
    return Measured(points=labelled, cycles=timing.size * dwell)


def responses(measured: xr.Dataset, kind: str, *, degree: int = 3) -> dict[str, ResponseFit]:
    """Step 3: fit a model of efficiency and of every limited quantity."""
    return {
        name: fit_response(measured, name, kind=kind, factors=tuple(FACTORS), degree=degree, n_starts=1)
        for name in (OBJECTIVE, *LIMITS)
    }  # fmt: skip


def predict(models: Mapping[str, ResponseFit]) -> xr.Dataset:
    """Step 3, its use: what the models say of every cell over the timing."""
    speed, fuel = (np.repeat(column, TIMINGS.size) for column in CELLS)
    asked = {"speed_rpm": speed, "fuel_mg": fuel, "soc_cad": np.tile(TIMINGS, CELLS[0].size)}
    return as_sweep({name: fit.model.predict(asked)["mean"].to_numpy() for name, fit in models.items()}, TIMINGS)


def margins_of(models: Mapping[str, ResponseFit]) -> dict[str, float]:
    """Keep 1.64 times the error at left-out points free below each limit."""
    errors = {name: models[name].test for name in LIMITS}
    return {name: 0.0 if error is None else _MARGIN_SD * error.rmse for name, error in errors.items()}


def optimum_of(
    predicted: xr.Dataset, *, margins: Mapping[str, float] | None = None, price: float = PRICES[0]
) -> CalibrationMap:
    """Step 4: find the best timing of every cell under the limits."""
    kept = [Limit(name, upper, margin=(margins or {}).get(name, 0.0)) for name, upper in LIMITS.items()]
    return optimize_map(predicted, OBJECTIVE, limits=kept, max_loss=price)


def smooth(
    predicted: xr.Dataset, *, margins: Mapping[str, float] | None = None, not_before: Array | None = None
) -> tuple[CalibrationMap, float]:
    """Step 5: smooth the map at the least of `PRICES` that the slope limits allow; give both.

    Margins are kept free below the limits; `not_before` are timings that a check of the map left, shape (cells,)
    [°CA aTDC]. ConvergenceError where no price allows the slopes.
    """
    refused: ConvergenceError | None = None
    for price in PRICES:
        best = optimum_of(predicted, margins=margins, price=price)
        if not_before is not None:
            floor = not_before.reshape(best.values.shape)
            low = np.maximum(best.cells["low"], floor)
            held = {"low": low, "high": np.maximum(best.cells["high"], low)}
            best = best.replaced(np.maximum(best.values, floor), cells=held)
        try:
            return smooth_map(best, slope_limits=SLOPES), price
        except ConvergenceError as error:
            refused = error
    raise ConvergenceError(f"no price up to {PRICES[-1]:g} points allows the slopes: {refused}")


@dataclass(frozen=True, kw_only=True)
class Checked:
    """A map after its check: itself, cells found above a limit, price of its smoothness, engine cycles of the check."""

    table: CalibrationMap
    found: int
    price: float
    cycles: int


def check_map(
    cylinder: Cylinder,
    table: CalibrationMap,
    price: float,
    predicted: xr.Dataset,
    margins: Mapping[str, float],
    seed: int,
) -> Checked:
    """Step 6: drive every cell at the timing of the map; cells above a limit are retarded and the map is made anew."""
    floor, cycles, found = np.full(CELLS[0].size, -np.inf), 0, 0
    for turn in range(_CHECKS):
        timing = table.values.ravel()
        cells = design_of_cells(timing)
        measured = measure(cylinder, cells, seed=seed + turn)
        cycles += measured.cycles
        later = np.max([_later(predicted, measured.points, timing, name) for name in LIMITS], axis=0)
        above = later > 0.0
        if turn == 0:
            found = int(above.sum())
        if not above.any():
            break
        floor[above] = timing[above] + later[above]
        table, price = smooth(predicted, margins=margins, not_before=floor)
    return Checked(table=table, found=found, price=price, cycles=cycles)


def design_of_cells(timing: Array, cells: tuple[Array, ...] = CELLS) -> xr.Dataset:
    """Give one point per cell, at these timings."""
    return labelled_dataset({
        "point": ("point", np.arange(timing.size), "-", "point"),
        "speed_rpm": ("point", cells[0], "rpm", "engine speed"),
        "fuel_mg": ("point", cells[1], "mg", "fuel"),
        "soc_cad": ("point", timing),
    })  # fmt: skip


def _later(predicted: xr.Dataset, measured: xr.Dataset, timing: Array, name: str) -> Array:
    """By how much a cell has to burn later to keep a limit, by the slope of its model [°CA]; 0 where it does."""
    over = predicted["soc_cad"].to_numpy()
    slope = np.diff(predicted[name].to_numpy().reshape(-1, over.size), axis=1) / np.diff(over)
    at = np.clip(np.searchsorted(over, timing) - 1, 0, over.size - 2)
    steep = np.fmin(slope[np.arange(at.size), at], -_LEAST_SLOPE * LIMITS[name])  # also where it was not measured
    excess = measured[name].to_numpy() - LIMITS[name]
    return np.where(excess > 0.0, _BEYOND_CAD - excess / steep, 0.0)


STAGES = ("response model", "noise", "margin", "smoothing", "check")
_SWEEP = np.arange(-24.0, 8.1, 4.0)  # timings of a sweep in every cell [°CA aTDC]
_ENGINE = ENGINES["as calibrated"]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A way to calibrate: what is fitted to how many points of how many averaged cycles.

    The kind is ``polynomial`` or ``gaussian_process`` over all factors, or ``sweep``: one of timings in every cell,
    as many as the rough model permits, and no model.
    """

    kind: str
    points: int = 0
    degree: int = 3
    cycles: int = CYCLES

    @property
    def name(self) -> str:
        """Name of what is done, without its size."""
        said = {"sweep": "sweep in every cell", "gaussian_process": "Gaussian process"}
        return said.get(self.kind, f"polynomial of degree {self.degree}")

    @property
    def label(self) -> str:
        """Name with its size, each once in `CASES`."""
        return f"{self.name}, {self.points or 'all'} x {self.cycles}"


POLYNOMIAL, PROCESS = Case(kind="polynomial", points=64), Case(kind="gaussian_process", points=64)
CASES = (
    Case(kind="sweep"),
    Case(kind="polynomial", points=64, degree=2),
    Case(kind="polynomial", points=32),
    POLYNOMIAL,
    Case(kind="polynomial", points=64, cycles=5),
    Case(kind="polynomial", points=128),
    Case(kind="gaussian_process", points=32),
    PROCESS,
    Case(kind="gaussian_process", points=128),
)
QUICK_CASES = (Case(kind="sweep"), POLYNOMIAL, PROCESS)


@dataclass(frozen=True, kw_only=True)
class Made:
    """One calibration of one seed."""

    table: CalibrationMap  # as it goes into the controller
    timings: Mapping[str, Array]  # of the cells after each of `STAGES`, the first only where it was asked for
    between: Array  # four cells
    points: int
    cycles: int
    check_cycles: int
    broken: int  # measured points beyond a limit
    found: int  # cells that the check found beyond a limit
    price: float  # what smoothness was allowed to cost by the model [points]
    by_model: float  # largest loss of a cell by the model that the map was made of, before the check [points]


def make_map(case: Case, seed: int, *, noise_free: bool = False) -> Made:
    """Calibrate once: choose points, run them, fit, optimise, smooth, check.

    With `noise_free` the same points are fitted without noise as well: what the form of the response model loses alone.
    """
    stages: dict[str, Array] = {}
    if case.kind == "sweep":
        measured = measure(_ENGINE, _sweep_points(), seed=_stream(seed, 0), cycles=case.cycles)
        predicted, margins = _as_measured(measured.points), {}
    else:
        plan = design(case.points, seed)
        measured = measure(_ENGINE, plan, seed=_stream(seed, 0), cycles=case.cycles)
        models = responses(measured.points, case.kind, degree=case.degree)
        predicted, margins = predict(models), margins_of(models)
        if noise_free:
            clean = measure(_ENGINE, plan, seed=0, cycles=1, noise=False).points
            stages["response model"] = _flat(optimum_of(predict(responses(clean, case.kind, degree=case.degree))))
    stages["noise"] = _flat(optimum_of(predicted))
    held = optimum_of(predicted, margins=margins)
    stages["margin"] = _flat(held)
    smoothed, price = smooth(predicted, margins=margins)
    stages["smoothing"] = _flat(smoothed)
    checked = check_map(_ENGINE, smoothed, price, predicted, margins, _stream(seed, 1))
    stages["check"] = _flat(checked.table)
    above = np.any([measured.points[name] > upper for name, upper in LIMITS.items()], axis=0)
    return Made(
        table=checked.table, timings=stages, between=checked.table.lookup(dict(zip(AXES, MIDDLES, strict=True))).values,
        points=measured.points.sizes["point"], cycles=measured.cycles, check_cycles=checked.cycles,
        broken=int(above.sum()), found=checked.found, price=checked.price,
        by_model=float(np.nanmax(held.cells["objective"].ravel() - _read(predicted, stages["smoothing"]))),
    )  # fmt: skip


def _flat(table: CalibrationMap) -> Array:
    return np.array(table.values, np.float64).ravel()


def _stream(seed: int, part: int) -> int:
    """Give the design's measurement and each check noise of their own."""
    return 1000 * seed + 100 * part


def _read(predicted: xr.Dataset, timing: Array) -> Array:
    """Read the objective of a sweep at one timing per cell, linear between its points."""
    over = predicted["soc_cad"].to_numpy()
    table = predicted[OBJECTIVE].to_numpy().reshape(-1, over.size)
    rows = []
    for at, row in zip(timing, table, strict=True):
        known = np.isfinite(row)
        rows.append(np.interp(at, over[known], row[known]))
    return np.array(rows)


def _sweep_points() -> xr.Dataset:
    """Give the timings of every cell that the rough model permits."""
    timing = np.tile(_SWEEP, CELLS[0].size)
    every = design_of_cells(timing, tuple(np.repeat(column, _SWEEP.size) for column in CELLS))
    allowed = np.flatnonzero(screen().contains(every))
    return every.isel(point=allowed).assign_coords(point=("point", np.arange(allowed.size), every["point"].attrs))


def _as_measured(points: xr.Dataset) -> xr.Dataset:
    """Arrange measured timings by cell; what was not run is NaN."""
    cell = {place: k for k, place in enumerate(zip(*CELLS, strict=True))}
    rows = [cell[place] for place in zip(points["speed_rpm"].to_numpy(), points["fuel_mg"].to_numpy(), strict=True)]
    columns = np.searchsorted(_SWEEP, points["soc_cad"].to_numpy())
    table = {}
    for name in (OBJECTIVE, *LIMITS):
        table[name] = np.full((CELLS[0].size, _SWEEP.size), np.nan)
        table[name][rows, columns] = points[name].to_numpy()
    return as_sweep(table, _SWEEP)
