"""What guides of different accuracy are worth at the start and after a load step (Monte Carlo on the cycle model)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from mgdd import presets
from mgdd.engine import Cylinder, OperatingPoint, timing_sweep
from mgdd.guide import FeedForward, ModelOptimum
from mgdd.optimize import ExtremumSeeking
from mgdd.optimize.optimum import Optimum

CYLINDER = presets.load("puma_single", kind="engine").cylinder
SEEDS, SETTLED, AFTER, JUDGED = 24, 600, 800, 200


def point(fuel_mg: float, duration_cad: float) -> OperatingPoint:
    return OperatingPoint(speed_rpm=1500.0, fuel_mg=fuel_mg, burn_duration_cad=duration_cad)


LOW, HIGH = point(12.0, 24.0), point(30.0, 44.0)
GRID = np.linspace(-58.0, 19.9, 1500)


@cache
def curve(at: OperatingPoint) -> np.ndarray:
    return 100.0 * timing_sweep(CYLINDER, at, soc_cad=GRID)["efficiency_gross"].to_numpy()


def best(at: OperatingPoint) -> float:
    return float(GRID[np.argmax(curve(at))])


def wall_heat(scale: float) -> ModelOptimum:
    return ModelOptimum(Cylinder(**{**CYLINDER.to_dict(), "wall_heat_scale": scale}))


def short_burn(at: OperatingPoint) -> Optimum | None:
    return ModelOptimum(CYLINDER)(point(at.fuel_mg, 0.85 * at.burn_duration_cad))


def wrong_way(at: OperatingPoint) -> Optimum | None:
    model = ModelOptimum(CYLINDER)
    low, high = model(LOW), model(HIGH)
    assert low is not None
    assert high is not None
    if at == LOW:
        return low
    mirrored = 2.0 * low["soc_cad"] - high["soc_cad"]
    return Optimum(inputs={"soc_cad": mirrored}, objective="performance", value=0.0, curvature=high.curvature)


GUIDES: dict[str, Callable[[], Any]] = {
    "none": lambda: None,
    "exact": lambda: wall_heat(0.5),
    "less heat": lambda: wall_heat(0.35),
    "more heat": lambda: wall_heat(0.65),
    "short burn": lambda: short_burn,
    "adiabatic": lambda: wall_heat(0.0),
    "wrong way": lambda: wrong_way,
}


class Figures(NamedTuple):
    """Means over the seeds."""

    start: float
    loss: float
    final: float
    wrong: float


@cache
def figures(name: str) -> Figures:
    guide, rows = GUIDES[name](), []
    for seed in range(SEEDS):
        noise = 0.25 * np.random.default_rng(seed).standard_normal(SETTLED + AFTER)
        gain = 2.0 / (0.051 * 40.0)
        ff = FeedForward(
            ExtremumSeeking(
                start=-20.0, lower=-50.0, upper=18.0, form="moving_average", gain=gain, amplitude=1.0, rate=math.inf
            ),
            guide,
        )
        verdict = ""
        for k in range(SETTLED + AFTER):
            at = LOW if k < SETTLED else HIGH
            ff.at(at)
            ff.tell(float(np.interp(ff.ask()[0], GRID, curve(at))) + noise[k])
            verdict = ff.verdict if k == SETTLED + 2 else verdict
        history = ff.history
        estimate, applied = (history[name].to_numpy()[:, 0] for name in ("estimate", "applied"))
        near = np.abs(estimate[:SETTLED] - best(LOW)) <= 1.0
        there = np.interp(applied[SETTLED : SETTLED + JUDGED], GRID, curve(HIGH))
        rows.append((np.argmax(near), np.sum(curve(HIGH).max() - there), estimate[-400:].mean(), verdict == "wrong"))
    return Figures(*np.mean(rows, axis=0).tolist())


def excess(name: str) -> float:
    """Efficiency lost in the cycles after the step beyond that of the exact guide, over that of the plain seeker."""
    return (figures(name).loss - figures("exact").loss) / (figures("none").loss - figures("exact").loss)


@pytest.mark.parametrize("name", ["less heat", "more heat"])
def test_thirty_percent_of_wall_heat_start_four_times_as_fast(name: str) -> None:
    assert figures("none").start >= 90.0
    assert figures(name).start <= 40.0
    assert figures(name).start <= figures("none").start / 4.0


@pytest.mark.parametrize(
    ("name", "most"), [("less heat", 0.05), ("more heat", 0.05), ("short burn", 0.10), ("adiabatic", 0.50)]
)
def test_after_a_load_step_little_is_left_to_learn(name: str, most: float) -> None:
    assert abs(excess(name)) <= most


def test_a_guide_that_goes_the_wrong_way_costs_little() -> None:
    assert figures("wrong way").wrong == 1.0
    assert figures("wrong way").loss <= 1.2 * figures("none").loss
    assert excess("wrong way") <= 1.2


def test_good_guides_are_not_turned_down() -> None:
    assert [figures(name).wrong for name in ("exact", "less heat", "more heat")] == [0.0] * 3


@pytest.mark.parametrize("name", [name for name in GUIDES if name != "none"])
def test_no_guide_moves_the_place_where_the_search_ends(name: str) -> None:
    assert abs(figures(name).final - best(HIGH)) < 0.3
    assert abs(figures(name).final - figures("none").final) < 0.3
