"""Curve-guided seeking where something happens that its guide does not know."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.guide import Curve
from mgdd.loop import EngineBench, SensorDynamics
from mgdd.studies.guide_cases import GUIDES, SteadyMap, curve_seeker, drive, first_within, stays_within, verdict_on
from mgdd.studies.statistics import rms, with_interval, with_median_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["HARD", "Hard", "HardCase", "hard_bars", "run_hard"]

CYCLES, CHANGE_AT, LATE = 500, 200, 200
_DELAY, _LAG, _CLIFF_PER_CAD = 38, 25.0, 2.0
_LOST_CAD = 2.0  # a run is lost whose mean estimate of the last 100 cycles lies farther off
_BY_NAME = {guide.name: guide for guide in GUIDES}


@dataclass(frozen=True, kw_only=True)
class HardCase:
    """A trouble, the curve that guides (a parabola at -10 without a name) and what the seeker is told of a delay."""

    name: str
    guide: str | None = "wall heat +30 %"
    start_cad: float | None = None
    jump_cad: float = 0.0
    drift_cad_per_kcycle: float = 0.0
    cliff: bool = False
    told_delay: float | None = None
    noise_percent: float = 0.25
    reading_noise_percent: float = 0.0  # behind delay and lag

    def curve(self) -> Curve:
        """Give the guide's curve at the default point."""
        if self.guide is None:
            return Curve.parabola(curvature=-0.05, best=-10.0, reach=60.0)
        return _BY_NAME[self.guide].curve(OperatingPoint())

    def bench(self, seed: int) -> EngineBench:
        """Make the engine of one run."""
        late: dict[str, Any] = {}
        if self.told_delay is not None:
            sensor = SensorDynamics(delay_cycles=_DELAY, lag_cycles=_LAG, noise_fraction=0.0)
            late = {"analyser": sensor, "delay_whole_objective": True, "nox_sensor": "true_value"}
        return EngineBench(efficiency_noise_percent=self.noise_percent, seed=seed, **late)

    def late_by_cad(self, cycle: int) -> float:
        """Give by how much combustion is later than asked for [°CA]."""
        return (self.jump_cad if cycle >= CHANGE_AT else 0.0) + 1e-3 * self.drift_cad_per_kcycle * cycle


HARD: tuple[HardCase, ...] = (
    HardCase(name="jump by 6 CAD, wall heat +30 %", jump_cad=6.0),
    HardCase(name="jump by -6 CAD, wall heat +30 %", jump_cad=-6.0),
    HardCase(name="jump by 6 CAD, adiabatic", guide="adiabatic", jump_cad=6.0),
    HardCase(name="J late, delay known", start_cad=-20.0, told_delay=38.0, reading_noise_percent=0.25),
    HardCase(name="J late, delay told 4 short", start_cad=-20.0, told_delay=34.0, reading_noise_percent=0.25),
    HardCase(name="J late, delay told 4 long", start_cad=-20.0, told_delay=42.0, reading_noise_percent=0.25),
    HardCase(name="J late, noise before the lag only", start_cad=-20.0, told_delay=38.0),
    HardCase(name="cliff behind the optimum, wall heat +30 %", start_cad=-20.0, cliff=True),
    HardCase(name="cliff behind the optimum, from its steep side", start_cad=0.0, cliff=True),
    HardCase(name="three times the noise, parabola", guide=None, start_cad=-20.0, noise_percent=0.75),
    HardCase(name="drift of 10 CAD per 1000 cycles", drift_cad_per_kcycle=10.0),
)


@dataclass(frozen=True, kw_only=True)
class Hard:
    """What a case came to: its row, and the error of the estimate by seed and cycle [°CA]."""

    case: HardCase
    row: dict[str, Any]
    error: NDArray[np.float64]

    @property
    def name(self) -> str:
        """Of the case."""
        return self.case.name


def run_hard(case: HardCase, seeds: int) -> Hard:
    """Run a case; a jump or drift is a combustion that comes later than asked for, so that J keeps its height."""
    curve, steady = case.curve(), SteadyMap.of(EngineBench())
    best = steady.best_cad
    target = best - np.array([case.late_by_cad(cycle) for cycle in range(CYCLES)])

    def fall(soc_cad: Any) -> Any:
        return -_CLIFF_PER_CAD * np.maximum(soc_cad - best, 0.0) if case.cliff else 0.0 * np.asarray(soc_cad)

    errors, lost, inside = [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)

        def told(soc_cad: float, rng: np.random.Generator = rng) -> float:
            return float(fall(soc_cad)) + case.reading_noise_percent * float(rng.standard_normal())

        sensor = {} if case.told_delay is None else {"delay": case.told_delay, "lag": _LAG}
        seeker = curve_seeker(curve, start=case.start_cad, **sensor)
        run = drive(case.bench(seed), seeker, CYCLES, late_by_cad=case.late_by_cad, beyond=told)
        error = run.estimate - target
        errors.append(error)
        lost.append((steady.lost(run.applied) - fall(run.applied))[-LATE:].mean())
        with np.errstate(invalid="ignore"):
            inside.append(100.0 * np.mean(np.abs(error) <= 1.96 * run.estimate_sd, where=np.arange(CYCLES) >= LATE))
    table = np.stack(errors)
    first = np.array([first_within(error, 0.0, 1.0) for error in table])
    stays = np.array([stays_within(error[:CHANGE_AT], 0.0, 1.5) for error in table])
    back = np.array([first_within(error[CHANGE_AT:], 0.0, 2.0) for error in table])
    stays_back = np.array([stays_within(error[CHANGE_AT : CHANGE_AT + 60], 0.0, 2.0) for error in table])
    off = np.abs(table[:, -100:].mean(axis=1)) > _LOST_CAD
    jumps = case.jump_cad != 0.0
    row = {
        "trouble": case.name,
        "start_cad": curve.best if case.start_cad is None else case.start_cad,
        **with_median_interval("median_first", first),
        "first_95_percent": _quantile(first),
        **with_median_interval("median_stays", stays),
        **with_median_interval("median_back", back if jumps else []),
        "back_95_percent": _quantile(back) if jumps else None,
        **with_median_interval("median_stays_back", stays_back if jumps else []),
        **with_interval("late_loss_percent", lost),
        "late_rms_cad": rms(table[:, -LATE:]),
        **with_interval("covered_percent", inside),
        "lost_runs_percent": 100.0 * float(off.mean()),
    }
    return Hard(case=case, row=row, error=table)


def _quantile(values: NDArray[np.float64]) -> float | None:
    value = float(np.quantile(values, 0.95, method="inverted_cdf"))
    return value if math.isfinite(value) else None


def hard_bars(done: list[Hard]) -> list[dict[str, Any]]:
    """Say which bars the cases met."""

    def values(key: str, which: Any) -> list[float]:
        found = [hard.row[key] for hard in done if which(hard.case)]
        return [math.inf if value is None else value for value in found]

    wanted = (
        ("jump: back within 2 CAD, median [cycles]", "median_back", lambda c: c.jump_cad, 6.0),
        ("jump: back within 2 CAD, 95th percentile [cycles]", "back_95_percent", lambda c: c.jump_cad, 25.0),
        ("J late: first within 1 CAD, median [cycles]", "median_first", lambda c: c.told_delay == _DELAY, 45.0),
        ("J late, delay told ±4: lost runs [%]", "lost_runs_percent", lambda c: c.told_delay in (34.0, 42.0), 0.0),
        (
            "J late, noise before the lag only: lost runs [%]",
            "lost_runs_percent",
            lambda c: c.told_delay is not None and not c.reading_noise_percent,
            0.0,
        ),
        ("cliff: loss of the last 200 cycles [points]", "late_loss_percent", lambda c: c.cliff, 0.05),
    )
    bars = []
    for text, key, which, most in wanted:
        if found := values(key, which):
            bars.append(verdict_on(f"curve, {text}", found, f"at most {most:g}", high=most))
    return bars
