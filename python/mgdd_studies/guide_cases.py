"""Guides that are wrong in a stated way, the engine they guide, and what one guided run came to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.engine import Cylinder, OperatingPoint
from mgdd.guide import Curve, CurveSeeking, FeedForward, GuidedEngine, ModelOptimum
from mgdd.loop import VirtualEngine
from mgdd.optimize import ExtremumSeeking
from mgdd.optimize.optimum import Optimum

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

__all__ = [
    "BOUNDS_CAD", "GUIDES", "HIGH", "LOW", "PLANT", "WRONG", "Guide", "SpeedLoadPlane", "SteadyMap", "curve_seeker",
    "drive", "guided_by", "no_model", "seeker_without_clip", "trimmed", "verdict_on", "verdicts",
]  # fmt: skip

BOUNDS_CAD = (-30.0, 10.0)
PLANT: Cylinder = presets.load("puma_single", kind="engine").cylinder
WRONG: Cylinder = PLANT.replace(wall_heat_scale=1.0)  # twice the wall heat of the engine
SPEEDS_RPM = tuple(np.linspace(900.0, 3000.0, 8).tolist())
FUELS_MG = tuple(np.round(np.linspace(6.0, 40.0, 8), 1).tolist())
LOW = OperatingPoint(speed_rpm=1500.0, fuel_mg=12.0, burn_duration_cad=24.0)
HIGH = OperatingPoint(speed_rpm=1500.0, fuel_mg=30.0, burn_duration_cad=44.0)
_UNGUIDED_START_CAD, _WIDE_CAD = -20.0, (-50.0, 18.0)
_GAIN = 2.0 / (0.051 * 40.0)  # amplitude 1, time constant 40 cycles at a curvature of -0.051 points per CAD**2
_GRID_STEP_CAD = 0.05


@dataclass(frozen=True)
class Guide:
    """A cycle model with wrong parameters of the engine."""

    name: str
    cylinder: Cylinder
    burn_duration: float = 1.0  # scale of the burn duration that it is told [-]
    backwards: bool = False  # from the point `LOW` on its optimum moves as far as the model's, the other way

    @cached_property
    def model(self) -> ModelOptimum:
        """The model that is asked, by the duration law where a point has no burn duration of its own."""
        burn = self.burn_duration * self.cylinder.burn_duration_ref_cad
        return ModelOptimum(self.cylinder.replace(burn_duration_ref_cad=burn), bounds_cad=BOUNDS_CAD)

    def _told(self, point: OperatingPoint) -> OperatingPoint:
        if point.burn_duration_cad is None:
            return point
        return point.replace(burn_duration_cad=self.burn_duration * point.burn_duration_cad)

    def _shift(self, point: OperatingPoint) -> float:
        if not self.backwards:
            return 0.0
        return 2.0 * (self._best(LOW)["soc_cad"] - self._best(point)["soc_cad"])

    def _best(self, point: OperatingPoint) -> Optimum:
        best = self.model(self._told(point))
        if best is None:
            raise ArithmeticError(f"guide {self.name!r} has no optimum at {point}")
        return best

    def __call__(self, point: OperatingPoint) -> Optimum:
        """Give the optimum of the model, as a `FeedForward` asks for it."""
        best, shift = self._best(point), self._shift(point)
        if not shift:
            return best
        moved = {"soc_cad": best["soc_cad"] + shift}
        return Optimum(inputs=moved, objective="performance", value=best.value, curvature=best.curvature)

    def curve(self, point: OperatingPoint) -> Curve:
        """Give J of the model over SOC, as a `CurveSeeking` takes it."""
        curve = self.model.curve(self._told(point))
        if curve is None:
            raise ArithmeticError(f"guide {self.name!r} has no curve at {point}")
        shift = self._shift(point)
        if not shift:
            return curve
        grid = np.linspace(curve.lower, curve.upper, 200)
        return Curve(grid + shift, curve(grid))


def _heat(scale: float) -> Cylinder:
    return PLANT.replace(wall_heat_scale=scale)


GUIDES: tuple[Guide, ...] = (
    Guide("exact", PLANT),
    Guide("wall heat -30 %", _heat(0.35)),
    Guide("wall heat +30 %", _heat(0.65)),
    Guide("duration -15 %", PLANT, burn_duration=0.85),
    Guide("duration +15 %", PLANT, burn_duration=1.15),
    Guide("compression ratio -1", PLANT.replace(compression_ratio=PLANT.compression_ratio - 1.0)),
    Guide("compression ratio +1", PLANT.replace(compression_ratio=PLANT.compression_ratio + 1.0)),
    Guide("adiabatic", _heat(0.0)),
    Guide("wrong sign", PLANT, backwards=True),
)


def seeker_without_clip() -> ExtremumSeeking:
    """Make extremum seeking with a moving average, no clip, start at -20 CAD: what a feed-forward leads."""
    return ExtremumSeeking(
        start=_UNGUIDED_START_CAD, bounds=_WIDE_CAD, form="moving_average", gain=_GAIN,
        amplitude=1.0, rate=math.inf,
    )  # fmt: skip


def no_model() -> Curve:
    """Draw a parabola in the middle of the bounds, as bent as J of an engine is [points/CAD**2]."""
    return Curve.parabola(curvature=-0.05, best=-10.0, reach=60.0)


def trimmed(guide: Callable[[OperatingPoint], Optimum] | None) -> FeedForward:
    """Make extremum seeking with the guide as feed-forward."""
    return FeedForward(seeker_without_clip(), guide)


def curve_seeker(curve: Curve, *, start: float | None = None, delay: float = 0.0, lag: float = 0.0) -> CurveSeeking:
    """Make a seeker by the curve with default settings; it starts at the curve's best input by default."""
    return CurveSeeking(
        start=curve.best if start is None else start, bounds=BOUNDS_CAD, curve=curve,
        delay_cycles=delay, lag_cycles=lag,
    )  # fmt: skip


def guided_by(form: str, guide: Guide | None, point: OperatingPoint) -> FeedForward | GuidedEngine:
    """Make what a guide does in a changing engine: the trim of `trimmed`, or for ``curve`` a curve that follows it."""
    if form != "curve":
        return trimmed(guide)
    if guide is None:
        raise ValueError("a curve needs a guide")
    return GuidedEngine(curve_seeker(guide.curve(point)), guide.model, point)


@dataclass(frozen=True)
class SteadyMap:
    """J of a plant at one point over SOC, without noise and scatter [°CA aTDC; points]."""

    soc_cad: NDArray[np.float64]
    j: NDArray[np.float64]

    @classmethod
    def of(cls, bench: VirtualEngine, *, cycle: int = 0) -> SteadyMap:
        """Tabulate the map of a bench at the operating point of a cycle."""
        low, high = _WIDE_CAD
        grid = np.linspace(low, high, round((high - low) / _GRID_STEP_CAD) + 1)
        return cls(grid, bench.steady_map(grid, cycle=cycle)["j"].to_numpy().astype(np.float64))

    @property
    def best_cad(self) -> float:
        """Input of the largest J."""
        return float(self.soc_cad[np.argmax(self.j)])

    def lost(self, applied_cad: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give what J loses against its best."""
        return np.asarray(self.j.max() - np.interp(applied_cad, self.soc_cad, self.j))


class SpeedLoadPlane:
    """Cells over speed [rpm] and fuel [mg] on the default intake, each with its operating point and J of the engine.

    Without arguments 8 x 8 cells.
    """

    def __init__(self, speeds: Sequence[float] = SPEEDS_RPM, fuels: Sequence[float] = FUELS_MG) -> None:
        self.speeds, self.fuels = speeds, fuels
        self.points = [[OperatingPoint(speed_rpm=float(n), fuel_mg=float(m)) for m in fuels] for n in speeds]
        self.maps = [[SteadyMap.of(VirtualEngine(point=point)) for point in row] for row in self.points]

    @classmethod
    def of(cls, *, quick: bool) -> SpeedLoadPlane:
        """Give the whole plane, or 3 x 3 of its cells."""
        return cls(SPEEDS_RPM[::3], FUELS_MG[::3]) if quick else cls()


@dataclass(frozen=True)
class Run:
    """One run, cycle by cycle: estimate and its stated sd before the cycle, start of combustion that was set [°CA]."""

    estimate: NDArray[np.float64]
    estimate_sd: NDArray[np.float64]
    applied: NDArray[np.float64]


def drive(
    bench: VirtualEngine,
    seeker: FeedForward | CurveSeeking | GuidedEngine,
    cycles: int,
    *,
    curve_at: Callable[[OperatingPoint], Curve] | None = None,
    late_by_cad: Callable[[int], float] | None = None,
    soc_of: Callable[[OperatingPoint, float], float] | None = None,
    beyond: Callable[[float], float] | None = None,
) -> Run:
    """Let a guided seeker steer a bench; both advance.

    Parameters
    ----------
    bench, seeker, cycles
        All seekers but a bare curve get every operating point.
    curve_at : callable, optional
        Draws the curve of a new operating point, for a bare curve.
    late_by_cad : callable, optional
        By how much combustion starts later than asked for, by cycle [°CA]; unknown to the seeker.
    soc_of : callable, optional
        Start of combustion of an injection at an operating point: the seeker then steers the injection.
    beyond : callable, optional
        What J gains at an input beside what the bench measures [points].
    """
    estimate, sd, applied = np.empty(cycles), np.full(cycles, np.nan), np.empty(cycles)
    point = bench.point
    for k in range(cycles):
        now = bench.point
        if isinstance(seeker, FeedForward | GuidedEngine):
            seeker.at(now)
        elif curve_at is not None and now != point:
            seeker.guide(curve_at(now))
        point = now
        asked = float(seeker.ask()[0])
        estimate[k] = seeker.estimate[0]
        if isinstance(seeker, CurveSeeking):
            sd[k] = seeker.estimate_sd
        burns = soc_of(now, asked) if soc_of else asked
        applied[k] = burns + (late_by_cad(k) if late_by_cad else 0.0)
        j = bench.step(applied[k])["j"]
        seeker.tell(j + (beyond(applied[k]) if beyond else 0.0))
    return Run(estimate, sd, applied)


def verdict_on(
    bar: str, values: Sequence[float | None], limit: str, *, low: float = -math.inf, high: float = math.inf
) -> dict[str, Any]:
    """Say of one bar what the worst case came to, and whether all of them are within it; a missing one is not."""
    known = [math.inf if value is None or not math.isfinite(value) else value for value in values]
    outside = [max(low - value, value - high) for value in known]
    worst = known[int(np.argmax(outside))]
    return {
        "bar": bar,
        "limit": limit,
        "worst": worst if math.isfinite(worst) else None,
        "cases": len(known),
        "cases_met": sum(excess <= 0.0 for excess in outside),
        "met": all(excess <= 0.0 for excess in outside),
    }


def verdicts(wanted: Iterable[tuple[str, Sequence[float | None], float]]) -> list[dict[str, Any]]:
    """Say of each bar that has cases whether they are at most that: text, cases and limit."""
    return [verdict_on(text, values, f"at most {most:g}", high=most) for text, values, most in wanted if values]
