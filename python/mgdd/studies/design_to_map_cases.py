"""Ways to calibrate a map, each run once per seed: its timings after every step, its cost, and what it is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.maps import CalibrationMap
from mgdd.studies.design_to_map_engine import AXES, CELLS, ENGINES, LIMITS, MIDDLES, OBJECTIVE, as_sweep
from mgdd.studies.design_to_map_steps import (
    CYCLES,
    Measured,
    check_map,
    design,
    design_of_cells,
    margins_of,
    measure,
    optimum_of,
    predict,
    responses,
    screen,
    smooth,
)

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["CASES", "POLYNOMIAL", "PROCESS", "QUICK_CASES", "STAGES", "Case", "Made", "make_map"]

STAGES = ("response model", "noise", "margin", "smoothing", "check")
_SWEEP = np.arange(-24.0, 8.1, 4.0)  # timings of a sweep in every cell [°CA aTDC]
_ENGINE = ENGINES["as calibrated"]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A way to calibrate: what is fitted to how many points of how many averaged cycles.

    Parameters
    ----------
    kind : str
        ``polynomial`` or ``gaussian_process`` over all factors, or ``sweep``: one of timings in every cell, no model.
    points : int
        Points of the design; of a sweep as many as the rough model permits.
    degree : int
        Of a polynomial.
    cycles : int
        Averaged per point.
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
    """One calibration of one seed.

    Parameters
    ----------
    table : CalibrationMap
        The map as it goes into the controller.
    timings : mapping of str to ndarray, shape (cells,)
        After each of `STAGES` [°CA aTDC]; the first only where the responses were also fitted without noise.
    between : ndarray
        What the map says between four cells [°CA aTDC].
    points, cycles, check_cycles : int
        Points that were measured, and engine cycles of them and of the check.
    broken : int
        Measured points beyond a limit.
    found : int
        Cells that the check found beyond a limit.
    price : float
        What smoothness was allowed to cost by the model [points].
    by_model : float
        Largest loss of a cell by the model that the map was made of, before the check [points].
    """

    table: CalibrationMap
    timings: Mapping[str, Array]
    between: Array
    points: int
    cycles: int
    check_cycles: int
    broken: int
    found: int
    price: float
    by_model: float


def make_map(case: Case, seed: int, *, noise_free: bool = False) -> Made:
    """Calibrate once: choose points, run them, fit, optimise, smooth, check.

    Parameters
    ----------
    case : Case
        How.
    seed : int
        Of the design and of all noise.
    noise_free : bool
        Fit the same points without noise as well, for what is lost by the form of the response model alone.
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
    return Made(
        table=checked.table,
        timings=stages,
        between=checked.table.lookup(dict(zip(AXES, MIDDLES, strict=True))).values,
        points=measured.points.sizes["point"],
        cycles=measured.cycles,
        check_cycles=checked.cycles,
        broken=_beyond(measured),
        found=checked.found,
        price=checked.price,
        by_model=float(np.nanmax(held.cells["objective"].ravel() - _read(predicted, stages["smoothing"]))),
    )


def _flat(table: CalibrationMap) -> Array:
    return np.array(table.values, np.float64).ravel()


def _stream(seed: int, part: int) -> int:
    """Give the design's measurement and each check noise of their own."""
    return 1000 * seed + 100 * part


def _beyond(measured: Measured) -> int:
    above = [measured.points[name].to_numpy() > upper for name, upper in LIMITS.items()]
    return int(np.any(above, axis=0).sum())


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
