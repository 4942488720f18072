"""A coupled map of two inputs whose optimum or level moves, whose readings come late or not at all, or that fails."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mgdd_studies.several_maps import (
    AWAY,
    CURVATURE,
    CYCLES,
    LOWER,
    NEAR,
    NOISE,
    UPPER,
    WIDTH,
    SeekingMap,
    Setting,
    coupled,
)

INPUTS = 2
FAILED = 10.0  # J lost by a cycle that fails
EDGE = 3.0  # fortieths of the bounds from the optimum to where the plant fails


@dataclass(frozen=True)
class Scenario:
    """What goes on while it is sought; lengths in fortieths of the bounds, J in points."""

    name: str
    drift: float = 0.0  # of the optimum over the run, in a drawn direction
    jump: float = 0.0  # of the optimum half-way, likewise
    level_drift: float = 0.0  # over the run, up and down by turns
    level_jump: float = 0.0  # half-way, likewise
    delay: int = 0  # cycles from the input to J
    lag: float = 0.0  # time constant of the reading [cycles]
    wrong_by: int = 0  # how much less and more, by turns, the delay is told [cycles]
    missing: float = 0.0  # share of the readings
    fails: bool = False  # beyond an oblique edge

    def told_delay(self, seed: int) -> int:
        """Return the delay that a seeker is told [cycles]."""
        return self.delay + (self.wrong_by if seed % 2 else -self.wrong_by)

    def map(self) -> SeekingMap:
        """Make the map, whose runs go through the scenario."""

        def setting(seed: int, noisy: bool) -> Setting:
            run = Run(self, seed, noisy)
            return Setting(run.start, lambda x: run.lost(x) <= NEAR * INPUTS, run.read, run.lost, run.top)

        return SeekingMap(self.name, LOWER[:INPUTS], UPPER[:INPUTS], NOISE, CURVATURE, setting)


class Run:
    """One run: `read` is what moves on to the next cycle."""

    def __init__(self, scenario: Scenario, seed: int, noisy: bool) -> None:
        rng = np.random.default_rng(seed)
        self._scenario, self._cycle = scenario, 0
        self._lower, self._upper = LOWER[:INPUTS], UPPER[:INPUTS]
        self._unit = (self._upper - self._lower) / WIDTH
        sides = np.array([1 if seed >> k & 1 else -1 for k in range(INPUTS)])
        self._first = (self._lower + self._upper) / 2 + sides * rng.uniform(4.0, 5.0, INPUTS) * self._unit
        away, self._way = (drawn / np.linalg.norm(drawn) for drawn in rng.standard_normal((2, INPUTS)))
        self._noise = (NOISE if noisy else 0.0) * rng.standard_normal(CYCLES)
        self._is_missing = rng.uniform(size=CYCLES) < scenario.missing
        self._up = 1.0 if seed % 2 else -1.0
        self._outward = np.array([1.0, 1.0 if seed >> 2 & 1 else -1.0]) / math.sqrt(2.0)
        if scenario.fails and away @ self._outward > 0.0:
            away = -away
        self.start = self._first + AWAY * away * self._unit
        self._past = [self.j(self.start)] * (scenario.delay + 1)
        self._sensor = self._past[0]
        self._keep = math.exp(-1.0 / scenario.lag) if scenario.lag > 0.0 else 0.0

    def _moved(self, drift: float, jump: float) -> float:
        return drift * self._cycle / CYCLES + (jump if self._cycle >= CYCLES // 2 else 0.0)

    def top(self) -> float:
        """Return J of the best input."""
        return self._up * self._moved(self._scenario.level_drift, self._scenario.level_jump)

    def _from_best(self, x: np.ndarray) -> np.ndarray:
        if np.any(x < self._lower - 1e-9 * self._unit) or np.any(x > self._upper + 1e-9 * self._unit):
            raise ValueError(f"{x} is outside {self._lower} to {self._upper}")
        return (x - self._first) / self._unit - self._way * self._moved(self._scenario.drift, self._scenario.jump)

    def fails(self, x: np.ndarray) -> bool:
        """Whether the plant fails at x."""
        return self._scenario.fails and bool(self._from_best(x) @ self._outward > EDGE)

    def lost(self, x: np.ndarray) -> float:
        """Return J lost at x."""
        return FAILED if self.fails(x) else -coupled(self._from_best(x))

    def j(self, x: np.ndarray) -> float:
        """Return J at x without noise."""
        return self.top() - self.lost(x)

    def read(self, x: np.ndarray) -> float:
        """Return what is read in this cycle, NaN where nothing is, and go on to the next."""
        self._past = [self.j(x), *self._past[:-1]]
        self._sensor = self._past[-1] + self._keep * (self._sensor - self._past[-1])
        found = self._sensor + self._noise[self._cycle]
        is_missing = self._is_missing[self._cycle] or self.fails(x)
        self._cycle += 1
        return math.nan if is_missing else float(found)


def scenarios() -> list[Scenario]:
    return [
        Scenario("drift of the optimum", drift=8.0),
        Scenario("drift of the level", level_drift=3.0),
        Scenario("jump", jump=8.0, level_jump=1.0),
        Scenario("delay 20, lag 10", delay=20, lag=10.0),
        Scenario("delay 8, told 5 or 11", delay=8, wrong_by=3),
        Scenario("half of the readings missing", missing=0.5),
        Scenario("a region that fails", fails=True),
    ]
