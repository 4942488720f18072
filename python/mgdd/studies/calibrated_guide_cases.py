"""Engines whose burn the guide does not know, ways to calibrate it, and what one run with them came to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.guide import GuidedEngine, ModelOptimum, OnlineCalibration
from mgdd.loop import EngineBench, run_seeker
from mgdd.optimize import ExtremumSeeking
from mgdd.studies.calibration_facts import WRONG
from mgdd.studies.guide_cases import BOUNDS_CAD, PLANT, SteadyMap, curve_seeker, seeker_without_clip

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mgdd.guide import Curve, CurveSeeking

__all__ = [
    "BURN",
    "HEAT",
    "NOISE_BAR",
    "NONE",
    "RECIPES",
    "STEADY",
    "VARIANTS",
    "WIEBE_45",
    "WIEBE_60",
    "Engine",
    "GuidedRun",
    "Recipe",
    "Refit",
    "curve_of",
    "guided_run",
    "refits_of",
    "step_run",
]

NOISE_BAR = 0.2
_LOW, _HIGH = OperatingPoint(fuel_mg=12.0), OperatingPoint(fuel_mg=30.0)  # burn durations by the law of the cylinder
_MODEL = ModelOptimum(WRONG, bounds_cad=BOUNDS_CAD)


@dataclass(frozen=True, kw_only=True)
class Engine:
    """An engine whose burn is not that of the guide."""

    name: str
    cylinder: Cylinder

    def bench(self, seed: int = 0, *, tdc_error_cad: float = 0.0) -> EngineBench:
        """Make the engine with a noisy pressure sensor at the default operating point."""
        return EngineBench(self.cylinder, seed=seed, pressure_noise_bar=NOISE_BAR, tdc_error_cad=tdc_error_cad)

    def stepping(self, seed: int, step_cycle: int) -> EngineBench:
        """Make the engine with a load step from 12 to 30 mg."""
        schedule = [(0, _LOW), (step_cycle, _HIGH)]
        return EngineBench(self.cylinder, schedule=schedule, seed=seed, pressure_noise_bar=NOISE_BAR)

    def step_maps(self) -> tuple[SteadyMap, SteadyMap]:
        """Tabulate J before and after the load step."""
        before, after = (SteadyMap.of(EngineBench(self.cylinder, point)) for point in (_LOW, _HIGH))
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


def _run(bench: EngineBench, engine: GuidedEngine, cycles: int) -> GuidedRun:
    found = run_seeker(bench, engine, cycles).dataset
    return GuidedRun(*(found[name].to_numpy() for name in ("estimate_cad", "guide_cad", "soc_requested_cad")))


def guided_run(bench: EngineBench, recipe: Recipe, start_cad: float, cycles: int) -> GuidedRun:
    """Seek by the curve of the guide while the pressure calibrates it."""
    return _run(bench, _begun(recipe, start_cad, bench.point), cycles)


def step_run(bench: EngineBench, recipe: Recipe, form: str, cycles: int) -> GuidedRun:
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


def refits_of(bench: EngineBench, recipe: Recipe, start_cad: float, cycles: int) -> list[Refit]:
    """Run, and beside every calibration that reaches the seeker tell a twin the same reading without pressure."""
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
    said = engine.history["guide_cad"].to_numpy()  # before each cycle
    return [Refit(k, without, with_it, float(said[k + 1])) for k, without, with_it in found]
