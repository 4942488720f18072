"""Maps of J over one input that seekers are judged on, and the plant that keeps count of a run on any map."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from peers.peer_seekers import FinishedError, Point

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.guide import Curve, ModelOptimum
from mgdd.loop import VirtualEngine
from mgdd_studies.several_maps import AWAY, CURVATURE, CYCLES, EARLY, NOISE, WIDTH, SeekingMap, Setting

NEAR = 1.0
STATED_FROM, STATED_SDS = 20, 1.44  # cycle; half width of an interval of 85 %
ENGINE_BOUNDS, ENGINE_STARTS = (-30.0, 10.0), (-20.0, 0.0)
ENGINE_NOISE, ENGINE_SCATTER = 0.25, 0.3


def within(best: float) -> Callable[[Point], bool]:
    """Whether an input is within 1 of the best one."""
    return lambda x: abs(x - best) <= NEAR


class CountedPlant:
    """Adds up J lost by what is applied, knows when the estimate arrived, and ends the run after 300 cycles.

    Whoever states J at its estimate with a standard deviation sets `stated`; from cycle 20 on it is judged.
    """

    def __init__(self, setting: Setting) -> None:
        self.estimate, self.cycles, self.lost, self.lost_early = setting.start, 0, 0.0, 0.0
        self.arrived = math.inf
        self.stated: tuple[float, float] | None = None
        self.judged = self.covered = 0
        self._setting = setting

    def __call__(self, x: Point) -> float:
        """Return what is read at x, or raise FinishedError."""
        if self.arrived == math.inf and self.near():
            self.arrived = self.cycles
        if self.cycles >= CYCLES:
            raise FinishedError
        if self.stated is not None and self.cycles >= STATED_FROM and self.stated[1] > 0.0:
            expected, sd = self.stated
            self.judged += 1
            self.covered += abs(self._setting.top() - self.lost_by_estimate() - expected) <= STATED_SDS * sd
        self.cycles += 1
        self.lost += self._setting.lost(x)
        if self.cycles == EARLY:
            self.lost_early = self.lost
        return self._setting.read(x)

    def near(self) -> bool:
        """Whether the estimate is near the best input."""
        return self._setting.near(self.estimate)

    def lost_by_estimate(self) -> float:
        """J lost where the estimate is applied."""
        return self._setting.lost(self.estimate)


def drawn(name: str, drop: Callable[[float], float], *, noise_sd: float = NOISE) -> SeekingMap:
    """Make a map of its formula; where between 4 and 5 the optimum lies is drawn, so that no grid hits it."""

    def setting(seed: int, noisy: bool) -> Setting:
        rng = np.random.default_rng(seed)
        best = (1 if seed % 4 < 2 else -1) * rng.uniform(4.0, 5.0)
        noise = ((noise_sd if noisy else 0.0) * rng.standard_normal(CYCLES)).tolist()
        start = best + (AWAY if seed % 2 == 0 else -AWAY)
        return Setting(start, within(best), lambda x: drop(x - best) + noise.pop(), lambda x: -drop(x - best))

    parabola = Curve.parabola(curvature=-0.05, best=0.0, reach=1.5 * WIDTH)
    return SeekingMap(name, -WIDTH / 2, WIDTH / 2, noise_sd, CURVATURE, setting, {"parabola": parabola}, prior_sd=12.0)


def engine() -> SeekingMap:
    """Make the map of the virtual bench at its default point, over the start of combustion."""
    lower, upper = ENGINE_BOUNDS
    point = OperatingPoint()
    quiet = VirtualEngine(soc_scatter_cad=0.0, efficiency_noise_percent=0.0)
    timings = np.linspace(lower, upper, 4001)
    true = np.array(quiet.run_columns(timings)["j"])
    best = float(timings[true.argmax()])
    bend = Curve(timings, true).curvature(3.0)

    def setting(seed: int, noisy: bool) -> Setting:
        bench = VirtualEngine(
            soc_scatter_cad=ENGINE_SCATTER if noisy else 0.0,
            efficiency_noise_percent=ENGINE_NOISE if noisy else 0.0,
            seed=seed,
        )
        return Setting(
            ENGINE_STARTS[seed % 2],
            within(best),
            lambda x: bench.step(x)["j"],
            lambda x: float(true.max() - np.interp(x, timings, true)),
            lambda: float(true.max()),
        )

    heats = {"wall heat +30 %": 0.65, "adiabatic": 0.0, "twice the wall heat": 1.0}
    drawn_curves = {name: ModelOptimum(Cylinder(wall_heat_scale=heat)).curve(point) for name, heat in heats.items()}
    guides = {name: curve for name, curve in drawn_curves.items() if curve is not None}
    guides["parabola"] = Curve.parabola(curvature=-0.05, best=(lower + upper) / 2, reach=1.5 * WIDTH)
    return SeekingMap("engine", lower, upper, ENGINE_NOISE, bend, setting, guides)


def all_maps() -> list[SeekingMap]:
    return [
        engine(),
        drawn("quadratic", lambda d: -0.03 * d * d),
        drawn("skewed", lambda d: -0.06 * (math.exp(0.1 * d) - 1.0 - 0.1 * d) / 0.01),
        drawn("flat top", lambda d: 3.0 * (math.exp(-d * d / 100.0) - 1.0)),
        drawn("cliff", lambda d: -0.03 * d * d - 2.0 * max(0.0, d - 1.0)),
        drawn("ten times the noise", lambda d: -0.03 * d * d, noise_sd=10.0 * NOISE),
    ]
