"""What a review found: runs that stood still, states that no run could have, and answers to wrong questions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mgdd.engine import Cylinder
from mgdd.errors import ParameterError, ShapeError
from mgdd.guide import FeedForward, ModelOptimum, OnlineCalibration
from mgdd.loop import LoopCriteria, VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import (
    ExtremumSeeking,
    GoldenSection,
    Limit,
    Spsa,
    tune,
)

SPACE = {"start": -12.0, "bounds": (-30.0, 10.0)}


def test_blocking_follows_a_plant_whose_best_value_has_dropped() -> None:
    rng = np.random.default_rng(1)
    seeker = Spsa(**SPACE, schedule="constant", gain=2.0, blocking=True, noise_sd=0.25)
    for level, best, cycles in ((56.0, -5.6, 600), (51.0, 0.0, 1500)):
        for _ in range(cycles):
            x = seeker.ask()[0]
            seeker.tell(level - 0.0255 * (x - best) ** 2 + 0.25 * rng.standard_normal())
    assert abs(seeker.estimate[0]) < 2.0


def test_golden_section_finds_its_width_again() -> None:
    """Of 200 seeds at another operating point none may end more than 1.5 CAD off (one in fifty did)."""
    from mgdd.engine import OperatingPoint

    bench = VirtualEngine(point=OperatingPoint(speed_rpm=2500.0, fuel_mg=30.0))
    best = bench.find_optimum()
    seeker = GoldenSection(start=-20.0, bounds=(-30.0, 10.0), noise_sd=0.25)
    table = monte_carlo(bench, seeker, range(200), cycles=2000, criteria=LoopCriteria(optimum=best["soc_cad"]))
    assert np.abs(table["final_soc_cad"].values - best["soc_cad"]).max() < 1.5


def test_a_limit_without_a_slope_does_not_hold_the_start_for_ever() -> None:
    """COV of IMEP looks back 50 cycles: its answer to the timing is hidden, and it is feasible at the optimum only."""
    bench = VirtualEngine(limits=["cov_imep_percent"])
    space = {"start": -20.0, "bounds": (-30.0, 10.0)}
    limits = [Limit("cov_imep_percent", 0.6)]
    table = monte_carlo(bench, ExtremumSeeking(**space, limits=limits), range(10), cycles=3000)
    assert np.abs(table["final_soc_cad"].values + 5.63).max() < 3.0


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda: run_seeker(VirtualEngine(), ExtremumSeeking(start=-100.0), 5),
            ParameterError,
            "-100 °CA aTDC: must be in",
        ),
        (
            lambda: run_seeker(VirtualEngine(), ExtremumSeeking(**SPACE), 5, criteria=LoopCriteria(tail_cycles=0)),
            ParameterError,
            "tail_cycles = 0",
        ),
        (
            lambda: run_seeker(VirtualEngine(), ExtremumSeeking(**SPACE), 5, criteria=LoopCriteria(arrival=-1.0)),
            ParameterError,
            "arrival = -1",
        ),
        (
            lambda: monte_carlo(VirtualEngine(), ExtremumSeeking(**SPACE), [0.5], cycles=5),
            ParameterError,
            "whole numbers",
        ),
        (lambda: VirtualEngine().find_optimum({"p_max_bar": float("nan")}), ParameterError, "p_max_bar = nan"),
        (lambda: VirtualEngine().find_optimum({"p_max_bar": None}), ParameterError, "p_max_bar = None"),  # type: ignore[dict-item]
        (lambda: VirtualEngine().find_optimum(cycle=-1), ParameterError, "cycle = -1"),
        (lambda: VirtualEngine().steady_map([-6.0], cycle=-1), ParameterError, "cycle = -1"),
        (lambda: VirtualEngine().steady_map([[1.0, 2.0]]), ShapeError, "2 dimensions"),
        (lambda: LoopCriteria(exceed_above={"p_max_bar": math.nan}), ParameterError, "exceed_above: p_max_bar = nan"),
        (lambda: run_seeker(object(), Spsa(**SPACE), 5), ParameterError, r"must have input_names, limit_names, apply"),  # type: ignore[arg-type]
        (lambda: ExtremumSeeking(start=[]), ShapeError, "start is empty"),
        (lambda: Spsa(**SPACE, limits=[Limit("a", 1.0), Limit("a", 2.0)]), ParameterError, "limit a: is given twice"),
        (lambda: Limit("", 1.0), ParameterError, "name is empty"),
        (
            lambda: tune(0.25, -0.051, method="moving_average", delay_cycles=38.0, compensated=False),
            ParameterError,
            "use 'batch', or compensate",
        ),
    ],
)
def test_wrong_questions_get_an_answer_that_names_them(call: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


# Numbers of what guides and benches are made of; those of seekers have a test of their own.
MADE: dict[str, Callable[..., Any]] = {
    "VirtualEngine": VirtualEngine,
    "FeedForward": lambda **own: FeedForward(ExtremumSeeking(**SPACE), **own),
    "ModelOptimum": lambda **own: ModelOptimum(Cylinder(), **own),
    "OnlineCalibration": lambda **own: OnlineCalibration(**{"cylinder": Cylinder(), "soc_scatter_cad": 0.3, **own}),
}


@pytest.mark.parametrize("name", MADE)
def test_each_number_is_refused_by_its_name_outside_of_its_domain(name: str) -> None:
    numbers = {field: value for field, value in MADE[name]().settings.items() if type(value) in (float, int)}
    assert len(numbers) >= 3
    for field, own in numbers.items():
        for value in (-(10**9), -1) if type(own) is int else (math.nan, -math.inf, -1e12):
            said = "initial" if field == "trust" else field.removeprefix("trust_")
            with pytest.raises((ParameterError, TypeError), match=f"{said}|no argument '{field}'"):
                MADE[name](**{field: value})


def test_tell_needs_a_measurement_or_a_misfire() -> None:
    seeker = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", 95.0)])
    seeker.ask()
    with pytest.raises(ShapeError, match="J is missing"):
        seeker.tell()
    with pytest.raises(ShapeError, match="limits has 2 names"):
        seeker.tell(50.0, {"p_max_bar": 90.0, "p_maxx": 1.0})
    seeker.tell(misfire=True)
    assert (seeker.cycle, seeker.misfires) == (1, 1)


def test_the_advice_of_spsa_names_a_gain_that_meets_it() -> None:
    with pytest.warns(UserWarning, match="a gain of 10 meets it"):
        Spsa(schedule="constant", gain=20.0, curvature=-0.1, **SPACE)
    assert Spsa(schedule="constant", gain=10.0, curvature=-0.1, **SPACE).settings["gain"] == [10.0]
