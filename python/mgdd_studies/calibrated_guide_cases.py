"""Engines whose burn the guide does not know, ways to calibrate it, and what one run with them came to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.guide import GuidedEngine, ModelOptimum, OnlineCalibration
from mgdd.loop import VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking
from mgdd_studies.guide_cases import (
    BOUNDS_CAD,
    PLANT,
    WRONG,
    SteadyMap,
    curve_seeker,
    seeker_without_clip,
    verdict_on,
    verdicts,
)
from mgdd_studies.statistics import first_within, quantile_of, stays_within, with_interval, with_median_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.guide import Curve, CurveSeeking

__all__ = [
    "BURN", "CYCLES", "HEAT", "RECIPES", "STEADY", "TDC_CAD", "VARIANTS", "WIEBE_45", "Case", "Engine", "GuidedRun",
    "Recipe", "Runs", "Steps", "bars", "curve_of", "findings", "guided_run", "refit_row", "refits_of", "row",
    "setting_row", "step_row", "step_run", "uncalibrated",
]  # fmt: skip

NOISE_BAR = 0.2
_LOW, _HIGH = OperatingPoint(fuel_mg=12.0), OperatingPoint(fuel_mg=30.0)  # burn durations by the law of the cylinder
_MODEL = ModelOptimum(WRONG, bounds_cad=BOUNDS_CAD)


@dataclass(frozen=True, kw_only=True)
class Engine:
    """An engine whose burn is not that of the guide."""

    name: str
    cylinder: Cylinder

    def bench(self, seed: int = 0, *, tdc_error_cad: float = 0.0) -> VirtualEngine:
        """Make the engine with a noisy pressure sensor at the default operating point."""
        return VirtualEngine(self.cylinder, seed=seed, pressure_noise_bar=NOISE_BAR, tdc_error_cad=tdc_error_cad)

    def stepping(self, seed: int, step_cycle: int) -> VirtualEngine:
        """Make the engine with a load step from 12 to 30 mg."""
        schedule = [(0, _LOW), (step_cycle, _HIGH)]
        return VirtualEngine(self.cylinder, schedule=schedule, seed=seed, pressure_noise_bar=NOISE_BAR)

    def step_maps(self) -> tuple[SteadyMap, SteadyMap]:
        """Tabulate J before and after the load step."""
        before, after = (SteadyMap.of(VirtualEngine(self.cylinder, point)) for point in (_LOW, _HIGH))
        return before, after


def _wiebe(duration_cad: float, wall_heat: float) -> Engine:
    cylinder = PLANT.replace(burn_shape="wiebe", burn_duration_ref_cad=duration_cad, wall_heat_scale=wall_heat)
    return Engine(name=f"Wiebe {duration_cad:g}, wall heat {wall_heat:g}", cylinder=cylinder)


WIEBE_45, WIEBE_60 = _wiebe(45.0, 0.5), _wiebe(60.0, 0.35)


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What is calibrated (without parameters nothing), what counts as known, and how far the model is trusted then."""

    name: str
    parameters: tuple[str, ...] = ()
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    window_cycles: int = 5
    steady_cycles: int = 0
    method: str = "gauss_newton"
    sd_cad: float = 2.0

    def engine(
        self, seeker: CurveSeeking | ExtremumSeeking, point: OperatingPoint, *, keep_start: bool = False
    ) -> GuidedEngine:
        """Make the guided engine of a seeker."""
        calibration = None
        if self.parameters:
            calibration = OnlineCalibration(
                WRONG, method=self.method, parameters=self.parameters, uncertainty=self.uncertainty,
                window_cycles=self.window_cycles, steady_cycles=self.steady_cycles,
            )  # fmt: skip
        return GuidedEngine(
            seeker, _MODEL, point, calibration=calibration, calibrated_sd_cad=self.sd_cad, keep_start=keep_start
        )


NONE = Recipe(name="none")
HEAT = Recipe(name="wall heat", parameters=("wall_heat_scale",))
BURN = Recipe(
    name="wall heat and burn", parameters=("wall_heat_scale", "burn_duration_scale"),
    uncertainty={"soc_offset_cad": 3.0}, window_cycles=8, sd_cad=5.0,
)  # fmt: skip
RECIPES = (NONE, HEAT, BURN)
STEADY = replace(HEAT, name="wall heat after 20 steady cycles", steady_cycles=20)
_HALF = {"burn_duration_scale": 0.5}
VARIANTS = (
    *RECIPES,
    replace(HEAT, name="wall heat, trusted to 1 CAD", sd_cad=1.0),
    replace(HEAT, name="wall heat, trusted to 4 CAD", sd_cad=4.0),
    replace(HEAT, name="wall heat, window 10", window_cycles=10),
    replace(HEAT, name="wall heat, recursive, window 10", method="recursive", window_cycles=10),
    replace(HEAT, name="wall heat, burn known to 50 %", uncertainty=_HALF),
    replace(HEAT, name="wall heat, burn known to 50 %, trusted to 4 CAD", uncertainty=_HALF, sd_cad=4.0),
    replace(BURN, name="wall heat and burn, trusted to 2 CAD", sd_cad=2.0),
    replace(BURN, name="wall heat and burn, timing known to 0.3 CAD", uncertainty={}),
)


def curve_of(point: OperatingPoint | None = None) -> Curve:
    """Draw the curve of the guide before anything is calibrated, at the default operating point if none is given."""
    curve = _MODEL.curve(OperatingPoint() if point is None else point)
    if curve is None:
        raise ArithmeticError(f"the guide has no curve at {point}")
    return curve


class GuidedRun(NamedTuple):
    """One run, cycle by cycle: estimate and the guide's best timing before the cycle, applied timing [°CA aTDC]."""

    estimate: NDArray[np.float64]
    guide: NDArray[np.float64]
    applied: NDArray[np.float64]


def _begun(recipe: Recipe, start_cad: float, point: OperatingPoint) -> GuidedEngine:
    """Make curve-guided seeking that begins there, not at the guide's best timing."""
    return recipe.engine(curve_seeker(curve_of(point), start=start_cad), point, keep_start=True)


def _run(bench: VirtualEngine, engine: GuidedEngine, cycles: int) -> GuidedRun:
    found = run_seeker(bench, engine, cycles).dataset
    return GuidedRun(*(found[name].to_numpy()[:, 0] for name in ("estimate", "guide_optimum", "asked")))


def guided_run(bench: VirtualEngine, recipe: Recipe, start_cad: float, cycles: int) -> GuidedRun:
    """Seek by the curve of the guide while the pressure calibrates it."""
    return _run(bench, _begun(recipe, start_cad, bench.point), cycles)


def step_run(bench: VirtualEngine, recipe: Recipe, form: str, cycles: int) -> GuidedRun:
    """Seek through a load step, by the curve or with the guide's best timing as feed-forward of extremum seeking."""
    if form == "curve":
        return _run(bench, recipe.engine(curve_seeker(curve_of(bench.point)), bench.point), cycles)
    return _run(bench, recipe.engine(seeker_without_clip(), bench.point), cycles)


class Refit(NamedTuple):
    """What one calibration did in its cycle: estimate without and with it, and the guide's best timing [°CA aTDC]."""

    cycle: int
    without: float
    with_it: float
    guide: float


def refits_of(bench: VirtualEngine, recipe: Recipe, start_cad: float, cycles: int) -> list[Refit]:
    """Run, and beside every calibration that reaches the seeker give a twin the same reading without pressure."""
    engine, twin = (_begun(recipe, start_cad, bench.point) for _ in range(2))
    found = []
    for k in range(cycles + 1):
        j = bench.step(float(engine.ask()[0]))["j"]
        asked, before = engine.state, engine.recalibrations
        engine.tell(j, pressure_bar=bench.pressure()[1])
        if engine.recalibrations > before and k < cycles:
            twin.state = asked
            twin.tell(j)
            found.append((k, float(twin.estimate[0]), float(engine.estimate[0])))
    said = engine.history["guide_optimum"].to_numpy()[:, 0]  # before each cycle
    return [Refit(k, without, with_it, float(said[k + 1])) for k, without, with_it in found]


CYCLES, LATE = 200, 60
TDC_CAD = 0.3
_STAY_CAD, _BACK_CAD, _NEAR_AFTER = 1.5, 1.0, 10


@dataclass(frozen=True, kw_only=True)
class Case:
    """An engine, where seeking starts on it, how the guide is calibrated, and how late TDC is read."""

    engine: Engine
    start_cad: float
    recipe: Recipe
    tdc_error_cad: float = 0.0
    cycles: int = CYCLES

    @property
    def name(self) -> str:
        """For a progress line."""
        tdc = f", TDC {self.tdc_error_cad:g} CAD late" if self.tdc_error_cad else ""
        return f"{self.engine.name} from {self.start_cad:g}, calibrated: {self.recipe.name}{tdc}"


@dataclass(frozen=True, kw_only=True)
class Runs:
    """Of one case, one row per seed: errors of estimate and guide [°CA], J lost by what was applied [points]."""

    case: Case
    error: NDArray[np.float64]
    guide_error: NDArray[np.float64]
    lost: NDArray[np.float64]
    best_cad: float

    @property
    def late(self) -> NDArray[np.float64]:
        """Mean absolute error of the estimate after the first sixty cycles, by seed."""
        return np.asarray(np.abs(self.error[:, LATE:]).mean(axis=1))


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Load steps of one engine, form and recipe, one row per seed; errors from the load step on."""

    engine: Engine
    form: str
    recipe: Recipe
    error: NDArray[np.float64]
    guide_error: NDArray[np.float64]  # of the first cycle of the new point
    lost: NDArray[np.float64]


def uncalibrated(own: Runs, runs: list[Runs]) -> Runs:
    """Find the runs without calibration on the same noise; pressure has no part in those."""
    same = (own.case.engine.name, own.case.start_cad)
    return next(r for r in runs if r.case.recipe == NONE and (r.case.engine.name, r.case.start_cad) == same)


def setting_row(own: Runs, plain: Runs) -> dict[str, Any]:
    """Put one case into figures, beside the same runs without calibration."""
    stays = [stays_within(error, 0.0, _STAY_CAD) for error in own.error]
    return {
        "engine": own.case.engine.name,
        "start_cad": own.case.start_cad,
        "calibrated": own.case.recipe.name,
        **with_median_interval("median_stays", stays),
        "stays_90_percent": quantile_of(stays, 0.9),
        **with_interval("late_error_cad", own.late),
        **with_interval("late_error_less_cad", plain.late - own.late),
        **with_interval("late_lost_percent", own.lost[:, LATE:].mean(axis=1)),
        "guide_error_end_cad": float(np.median(own.guide_error[:, -1])),
    }


def row(own: Runs, plain: Runs) -> dict[str, Any]:
    """Put one case into figures, with the error of the guide over cycles."""
    said = setting_row(own, plain)
    end = said.pop("guide_error_end_cad")
    at = {"guide_error_cad": 0, "guide_error_10_cad": 10, "guide_error_60_cad": 60}
    return {
        **{name: said.pop(name) for name in ("engine", "start_cad", "calibrated")},
        "tdc_error_cad": own.case.tdc_error_cad,
        **said,
        **{name: float(np.median(own.guide_error[:, k])) for name, k in at.items()},
        "guide_error_end_cad": end,
    }


def refit_row(engine: Engine, recipe: Recipe, found: list[list[Refit]], best: float) -> dict[str, Any]:
    """Say what calibrations did to the estimate, run by run."""
    early = [_change(refit, best) for refits in found for refit in refits if refit.cycle < _NEAR_AFTER]
    late = [[refit for refit in refits if refit.cycle >= _NEAR_AFTER] for refits in found]
    changes = [_change(refit, best) for refits in late for refit in refits]
    thrown = [abs(refit.without - best) <= _STAY_CAD < abs(refit.with_it - best) for refits in late for refit in refits]
    return {
        "engine": engine.name,
        "calibrated": recipe.name,
        "refits_per_run": sum(map(len, found)) / len(found),
        "early_change_cad": float(np.mean(early)) if early else math.nan,
        **with_interval("late_change_cad", [np.mean([_change(r, best) for r in own]) for own in late if own]),
        "late_worst_cad": max(changes, default=math.nan),
        "thrown_back": sum(thrown),
        "late_refits": len(thrown),
    }


def _change(refit: Refit, best: float) -> float:
    """Give by how much the calibration made the estimate worse."""
    return abs(refit.with_it - best) - abs(refit.without - best)


def step_row(own: Steps, steps: list[Steps]) -> dict[str, Any]:
    """Put the load steps of one form and recipe into figures, beside the same without calibration."""
    plain = next(s for s in steps if (s.engine, s.form) == (own.engine, own.form) and s.recipe == NONE)
    back = [first_within(error, 0.0, _BACK_CAD) for error in own.error]
    return {
        "engine": own.engine.name,
        "form": own.form,
        "calibrated": own.recipe.name,
        "guide_error_cad": float(np.median(own.guide_error)),
        **with_median_interval("median_back", back),
        "back_90_percent": quantile_of(back, 0.9),
        **with_interval("lost", own.lost),
        **with_interval("lost_less", plain.lost - own.lost),
    }


def findings(rows: list[dict[str, Any]], steps: list[dict[str, Any]]) -> list[str]:
    """Say in words what calibration gains over the same guide without it."""
    said = []
    for name in (HEAT.name, BURN.name):
        own = [row for row in rows if row["calibrated"] == name and row["tdc_error_cad"] == 0.0]
        if own:
            text = f"One operating point, {name}: the mean error after {LATE} cycles is"
            said.append(f"{text} {_gain(own, 'late_error_less_cad', 2, '°CA')}")
    for form in ("curve", "feed-forward"):
        for name in (HEAT.name, BURN.name):
            own = [row for row in steps if (row["form"], row["calibrated"]) == (form, name)]
            if own:
                text = f"After a load step, {form}, {name}: the loss is"
                said.append(f"{text} {_gain(own, 'lost_less', 1, 'points x cycles')}")
    return said


def _gain(rows: list[dict[str, Any]], name: str, digits: int, unit: str) -> str:
    gains = [row[name] for row in rows]
    better = sum(row[f"{name}_low"] > 0.0 for row in rows)
    worse = sum(row[f"{name}_high"] < 0.0 for row in rows)
    span = f"{min(gains):.{digits}f} to {max(gains):.{digits}f} {unit}"
    beyond = f"beyond the 95 % interval better in {better} of {len(rows)} cases, worse in {worse}"
    return f"{span} less than without calibration, {beyond}."


def bars(rows: list[dict[str, Any]], refits: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Compare with what was demanded of a guide that learns."""
    said = []
    for recipe in (HEAT, BURN):
        for tdc in (0.0, TDC_CAD):
            own = [row for row in rows if row["calibrated"] == recipe.name and row["tdc_error_cad"] == tdc]
            if not own:
                continue
            text = recipe.name + (f", TDC {tdc:g} CAD late" if tdc else "")
            said += verdicts([
                (f"{text}: stays within 1.5 CAD, median [cycles]", [row["median_stays"] for row in own], 8.0),
                (f"{text}: mean error after 60 cycles [CAD]", [row["late_error_cad"] for row in own], 0.5),
            ])  # fmt: skip
            if not tdc:
                better = [row["late_error_less_cad_low"] for row in own]
                text += ": less error after 60 cycles than without calibration, low end of the interval [CAD]"
                said.append(verdict_on(text, better, "at least 0", low=0.0))
    for name in (HEAT.name, BURN.name):
        found = [row for row in refits if row["calibrated"] == name]
        if found:
            thrown = [100.0 * row["thrown_back"] / max(row["late_refits"], 1) for row in found]
            said.append(verdict_on(f"{name}: refits that throw the estimate back [%]", thrown, "none", high=0.0))
    return said
