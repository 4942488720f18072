"""Measured limits on the virtual engine: kept by every seeker, and near enough to cost little."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.loop import EngineBench, LoopCriteria, monte_carlo
from mgdd.optimize import ExtremumSeeking, Limit

SPACE = {"start": -20.0, "lower": -30.0, "upper": 10.0}
SEEDS = range(20)
CYCLES = 3000


def seekers(name: str, upper: float, **more: object) -> dict[str, Any]:
    """One of each kind and form but the slow process and the curve, whose own tests hold them to limits."""
    made = stepped(**SPACE, limits=[Limit(name, upper, **more)])
    return {label: make() for label, make in made.items() if label not in ("GaussianProcessSeeking", "CurveSeeking")}


def run(name: str, upper: float, chosen: dict[str, object]) -> tuple[float, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Optimum, and per seeker the exceeded fraction and the mean applied set-point of cycles 1500 to 3000, per seed."""
    bench = EngineBench(limits=[name])
    best = bench.find_optimum({name: upper})
    table = monte_carlo(
        bench,
        list(chosen.values()),
        SEEDS,
        cycles=CYCLES,
        criteria=LoopCriteria(exceed_above={name: upper + 3.0 * best[f"scatter_{name}"]}),
    ).isel(bench=0)
    rows = {
        key: (table["exceeded_fraction"].values[i], table["mean_applied_soc_cad"].values[i])
        for i, key in enumerate(chosen)
    }
    return best["soc_cad"], rows


def test_p_max_is_kept_by_every_seeker_within_1_7_degrees_of_the_limit() -> None:
    optimum, rows = run("p_max_bar", 95.0, seekers("p_max_bar", 95.0))
    for name, (exceeded, applied) in rows.items():
        assert exceeded.max() < 0.01, name
        assert abs(applied.mean() - optimum) < 1.7, name  # dither, and one standard deviation of the scatter
        assert np.abs(applied - optimum).max() < 1.7, name


def test_without_the_limit_the_same_seeds_exceed_it_nearly_always() -> None:
    bench = EngineBench(limits=["p_max_bar"])
    best = bench.find_optimum({"p_max_bar": 95.0})
    assert best.free_inputs["soc_cad"] == pytest.approx(-5.63, abs=0.02)
    free = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", 1000.0)])
    above = {"p_max_bar": 95.0 + 3.0 * best["scatter_p_max_bar"]}
    table = monte_carlo(bench, free, SEEDS, cycles=CYCLES, criteria=LoopCriteria(exceed_above=above))
    assert float(table["exceeded_fraction"].min()) > 0.9


@pytest.mark.parametrize("method", ["penalty", "barrier"])
def test_shaped_objectives_keep_it_too(method: str) -> None:
    chosen = seekers("p_max_bar", 95.0, method=method, weight=0.5 if method == "barrier" else 50.0)
    kept = {
        name: chosen[name] for name in ("ExtremumSeeking batch", "ExtremumSeeking moving_average", "Spsa first_order")
    }
    optimum, rows = run("p_max_bar", 95.0, kept)
    for name, (exceeded, applied) in rows.items():
        assert exceeded.max() < 0.01, name
        assert 0.0 < applied.mean() - optimum < 3.0, name


def test_pressure_rise_in_force_at_an_early_start_lets_the_seeker_out_to_the_free_optimum() -> None:
    optimum, rows = run("dp_max_bar_per_cad", 4.0, seekers("dp_max_bar_per_cad", 4.0))
    assert optimum == pytest.approx(-5.63, abs=0.02)  # 4 bar/CAD bind at the start only
    for name, (exceeded, applied) in rows.items():
        assert exceeded.max() < 0.01, name
        assert abs(applied.mean() - optimum) < 0.5, name


def test_pressure_rise_that_binds_at_the_end() -> None:
    optimum, rows = run("dp_max_bar_per_cad", 2.6, seekers("dp_max_bar_per_cad", 2.6))
    assert optimum > -5.1
    for name, (exceeded, applied) in rows.items():
        assert exceeded.max() < 0.02, name
        assert abs(applied.mean() - optimum) < 2.0, name


def test_the_seeker_returns_below_the_limit_after_a_load_step() -> None:
    """With more fuel and boost the old timing breaks the limit by far: and soon it must be kept again."""
    from mgdd.engine import OperatingPoint

    low, high = OperatingPoint(fuel_mg=12.0), OperatingPoint(fuel_mg=30.0, intake_pressure_kpa=170.0)
    schedule = [(0, low), (1000, high)]
    bench = EngineBench(schedule=schedule, limits=["p_max_bar"])
    upper = 92.0
    best = bench.find_optimum({"p_max_bar": upper}, cycle=1000)
    seeker = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", upper)])
    above = {"p_max_bar": upper + 3.0 * best["scatter_p_max_bar"]}
    table = monte_carlo(bench, seeker, SEEDS, cycles=2500, criteria=LoopCriteria(exceed_from=1150, exceed_above=above))
    assert float(table["exceeded_fraction"].max()) < 0.01
    before = monte_carlo(bench, seeker, SEEDS, cycles=1100, criteria=LoopCriteria(exceed_from=1000, exceed_above=above))
    assert float(before["exceeded_fraction"].mean()) > 0.005  # the step does break it for some cycles


def test_a_limit_that_cannot_be_kept_holds_the_seeker_at_its_bound_without_complaint() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bench = EngineBench(limits=["p_max_bar"])
        seeker = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", 60.0)])
        table = monte_carlo(bench, seeker, range(3), cycles=2000)
    assert np.all(table["highest_soc_cad"].values <= 9.0)
