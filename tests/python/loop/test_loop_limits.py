"""Measured limits on the virtual engine: kept by every seeker, and near enough to cost little."""

from __future__ import annotations

from tests.python.support.stepped import stepped

from mgdd.engine import OperatingPoint
from mgdd.loop import LoopCriteria, VirtualEngine, monte_carlo
from mgdd.optimize import ExtremumSeeking, Limit

SPACE = {"start": -20.0, "lower": -30.0, "upper": 10.0}
SEEDS = range(20)


def test_p_max_is_kept_by_every_seeker_within_1_7_degrees_of_the_limit() -> None:
    """All but the slow process and the curve, whose own tests hold them to limits."""
    bench = VirtualEngine(limits=["p_max_bar"])
    best = bench.find_optimum({"p_max_bar": 95.0})
    made = stepped(**SPACE, limits=[Limit("p_max_bar", 95.0)])
    chosen = [make() for name, make in made.items() if name not in ("GaussianProcessSeeking", "CurveSeeking")]
    above = LoopCriteria(exceed_above={"p_max_bar": 95.0 + 3.0 * best["scatter_p_max_bar"]})
    table = monte_carlo(bench, chosen, SEEDS, cycles=3000, criteria=above).isel(bench=0)
    assert float(table["exceeded_fraction"].max()) < 0.01
    away = table["mean_applied_soc_cad"] - best["soc_cad"]  # of cycles 1500 to 3000
    assert float(abs(away).max()) < 1.7  # dither, and one standard deviation of the scatter


def test_the_seeker_returns_below_the_limit_after_a_load_step() -> None:
    """With more fuel and boost the old timing breaks the limit by far: and soon it must be kept again."""
    low, high = OperatingPoint(fuel_mg=12.0), OperatingPoint(fuel_mg=30.0, intake_pressure_kpa=170.0)
    schedule = [(0, low), (1000, high)]
    bench = VirtualEngine(schedule=schedule, limits=["p_max_bar"])
    upper = 92.0
    best = bench.find_optimum({"p_max_bar": upper}, cycle=1000)
    seeker = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", upper)])
    above = {"p_max_bar": upper + 3.0 * best["scatter_p_max_bar"]}
    table = monte_carlo(bench, seeker, SEEDS, cycles=2500, criteria=LoopCriteria(exceed_from=1150, exceed_above=above))
    assert float(table["exceeded_fraction"].max()) < 0.01
    before = monte_carlo(bench, seeker, SEEDS, cycles=1100, criteria=LoopCriteria(exceed_from=1000, exceed_above=above))
    assert float(before["exceeded_fraction"].mean()) > 0.005  # the step does break it for some cycles
