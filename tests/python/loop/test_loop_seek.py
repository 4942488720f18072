"""Closed loops from Python: the same run in one piece, in pieces, cycle by cycle; whole loops at once."""

import math
import os
import signal
import threading
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd.engine import OperatingPoint, Performance
from mgdd.errors import Interrupted, ParameterError
from mgdd.loop import (
    LoopCriteria,
    VirtualEngine,
    monte_carlo,
    run_seeker,
)
from mgdd.loop.summary import summarize_cycles
from mgdd.optimize import ExtremumSeeking, GoldenSection, Limit, Spsa
from mgdd.results.labels import check_labels
from mgdd.rig import SimulatedRig

SPACE = {"start": -14.0, "bounds": (-30.0, 10.0)}


def bench(**more: Any) -> VirtualEngine:
    return VirtualEngine(
        schedule=[(0, OperatingPoint()), (160, OperatingPoint(fuel_mg=28.0))],
        performance=Performance.efficiency_and_nox(),
        nox_sensor="soft",
        limits=["p_max_bar"],
        misfire_probability=0.02,
        seed=11,
        **more,
    )


def seeker(kind: str) -> Any:
    limits = [Limit("p_max_bar", 120.0)]
    if kind == "spsa":
        return Spsa(**SPACE, limits=limits, seed=3)
    return ExtremumSeeking(**SPACE, limits=limits, form=kind)


@pytest.mark.parametrize("kind", ["batch", "moving_average", "spsa"])
def test_one_run_is_its_pieces_is_ask_and_tell(kind: str) -> None:
    whole = run_seeker(bench(), seeker(kind), 400)
    plant, pieces = bench(), seeker(kind)
    joined = xr.concat([run_seeker(plant, pieces, n).dataset for n in (1, 130, 200, 69)], "cycle")
    np.testing.assert_array_equal(whole.dataset["estimate"][:, 0], joined["estimate"][:, 0])
    np.testing.assert_array_equal(whole.dataset["j"], joined["j"])

    plant, single = bench(), seeker(kind)
    for k in range(400):
        if k == 160:
            single.restart()
        assert single.estimate[0] == whole.dataset["estimate"][k, 0]
        cycle = plant.step(single.ask()[0])
        single.tell(cycle["j"], cycle["limits"], misfire=cycle["misfire"])
    assert whole.summary["misfires"] == single.misfires > 0
    np.testing.assert_array_equal(single.history["applied"].values[:, 0], whole.dataset["asked"][:, 0])


def test_limits_are_judged_in_short_runs_too() -> None:
    goal = LoopCriteria(exceed_above={"p_max_bar": 110.0})
    for cycles in (1, 7, 200):
        run = run_seeker(bench(), seeker("batch"), cycles, criteria=goal)
        over = run.dataset["limits"].sel(limit="p_max_bar")[cycles // 2 :] > 110.0
        assert run.summary["exceeded_fraction"] == pytest.approx(float(over.mean()), abs=1e-12)
        assert summarize_cycles(run.dataset, goal)["exceeded_fraction"] == run.summary["exceeded_fraction"]
    assert LoopCriteria().counted_from(5000) == 1000
    late = LoopCriteria(exceed_from=200, exceed_above={"p_max_bar": 110.0})
    for plant in (own := bench(), SimulatedRig(rigged := bench())):
        with pytest.raises(ParameterError, match="exceed_from = 200: must be < cycles = 200, or no cycle counts"):
            run_seeker(plant, seeker("batch"), 200, criteria=late)
    with pytest.raises(ParameterError, match="exceed_from = 200"):
        monte_carlo(own, seeker("batch"), range(2), cycles=200, criteria=late)
    assert own.cycle == rigged.cycle == 0


def test_monte_carlo_is_labelled_and_the_same_on_any_thread_count() -> None:
    plants = [VirtualEngine(), VirtualEngine(point=OperatingPoint(fuel_mg=30.0))]
    gains = [ExtremumSeeking(**SPACE, gain=g) for g in (0.5, 1.0)]
    goals = [LoopCriteria(optimum=-5.6), LoopCriteria(optimum=-8.5)]
    one = monte_carlo(plants, gains, range(6), cycles=300, workers=1, criteria=goals)
    two = monte_carlo(plants, gains, range(6), cycles=300, workers=2, criteria=goals)
    few = monte_carlo(plants, gains, [4], cycles=300, criteria=goals)
    check_labels(one)
    xr.testing.assert_identical(one, two)
    alone = run_seeker(
        VirtualEngine(point=OperatingPoint(fuel_mg=30.0), seed=4), gains[1], 300, criteria=LoopCriteria(optimum=-8.5)
    )
    assert float(one["rms_soc_cad"][1, 1, 4]) == pytest.approx(alone.summary["rms_soc_cad"], rel=1e-9)  # side by side
    assert float(few["rms_soc_cad"][1, 1, 0]) == alone.summary["rms_soc_cad"]  # one by one


def test_ctrl_c_leaves_a_usable_partial_result() -> None:
    plant, it = VirtualEngine(seed=2), ExtremumSeeking(**SPACE)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(Interrupted, match=r"what was finished is in \.partial") as stop:
        run_seeker(plant, it, 200_000)
    run = stop.value.partial
    assert run.interrupted
    n = run.dataset.sizes["cycle"]
    assert 0 < n < 200_000
    whole = run_seeker(VirtualEngine(seed=2), ExtremumSeeking(**SPACE), n)
    np.testing.assert_equal(dict(run.summary), dict(whole.summary))
    assert plant.cycle == it.cycle == n
    twin = run_seeker(VirtualEngine(seed=2), ExtremumSeeking(**SPACE), n + 50)
    more = run_seeker(plant, it, 50)
    np.testing.assert_array_equal(more.dataset["estimate"][:, 0], twin.dataset["estimate"][n:, 0])

    for wait_s in (0.3, 10.0):  # under a sanitizer no loop may be through at once
        timer = threading.Timer(wait_s, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(Interrupted) as stop:
            monte_carlo(VirtualEngine(), it, range(20_000), cycles=1000)
        table = stop.value.partial
        finished = table["finished"].values
        if finished.any():
            break
    assert 0 < finished.sum() < finished.size
    assert np.isfinite(table["mean_soc_cad"].values[finished]).all()
    assert np.isnan(table["mean_soc_cad"].values[~finished]).all()


def test_steady_optimum_agrees_with_the_model_and_with_the_long_run() -> None:
    from mgdd.engine import Cylinder, find_optimum

    free = VirtualEngine().find_optimum()
    assert free["soc_cad"] == pytest.approx(find_optimum(Cylinder(), OperatingPoint())["soc_cad"], abs=0.002)
    assert free.curvature == pytest.approx(-0.051, rel=0.05)
    limited = VirtualEngine(limits=["p_max_bar"]).find_optimum({"p_max_bar": 95.0})
    model = find_optimum(Cylinder(), OperatingPoint(), limits={"p_max_bar": 95.0})
    assert limited["soc_cad"] == pytest.approx(model["soc_cad"], abs=0.002)
    scattered = VirtualEngine(limits=["p_max_bar"], efficiency_noise_percent=0.0).run(np.full(4000, limited["soc_cad"]))
    assert float(scattered["p_max_bar"].std()) == pytest.approx(limited["scatter_p_max_bar"], rel=0.05)


def test_steady_map_is_quiet_and_labelled() -> None:
    table = VirtualEngine(soc_scatter_cad=2.0, misfire_probability=0.5).steady_map([-10.0, -6.0, 0.0])
    check_labels(table)
    np.testing.assert_allclose(table["efficiency_gross"], [0.5568, 0.5618, 0.5543], rtol=5e-4)
    with pytest.raises(ParameterError, match="soc_cad = 45: must lie in"):
        VirtualEngine().steady_map([45.0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: run_seeker(VirtualEngine(), ExtremumSeeking(**SPACE), 0), "cycles = 0: must be >= 1"),
        (
            lambda: run_seeker(VirtualEngine(), ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", 95.0)]), 5),
            r"limits of the seeker \['p_max_bar'\] are not all measured by the plant, which has \[\]",
        ),
        (
            lambda: run_seeker(
                VirtualEngine(), GoldenSection(**SPACE), 5, criteria=LoopCriteria(exceed_above={"p_max_bar": 1.0})
            ),
            "exceed_above: .*p_max_bar",
        ),
        (lambda: monte_carlo([], ExtremumSeeking(**SPACE), [1], cycles=5), "benches is empty"),
        (lambda: monte_carlo(VirtualEngine(), ExtremumSeeking(**SPACE), [-1], cycles=5), "seeds: -1 must be"),
        (lambda: monte_carlo(VirtualEngine(), ExtremumSeeking(**SPACE), [], cycles=5), "seeds is empty"),
        (lambda: monte_carlo(VirtualEngine(), ExtremumSeeking(**SPACE), [1], cycles=0), "cycles = 0: must be >= 1"),
        (lambda: monte_carlo(VirtualEngine(), [3.0], [1], cycles=5), "seeker = 3: must be a seeker, as"),
        (lambda: VirtualEngine().find_optimum({"nonsense": 1.0}), "'nonsense' is not an indicator"),
        (lambda: VirtualEngine().find_optimum(bounds={"soc_cad": (5.0, -5.0)}), "must increase"),
    ],
)
def test_bad_calls_name_what_is_wrong(call: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        call()


def test_a_refused_run_moves_neither_bench_nor_seeker() -> None:
    plant, it = VirtualEngine(), Spsa(**SPACE, limits=[Limit("p_max_bar", 95.0)])
    state = it.state
    with pytest.raises(ParameterError):
        run_seeker(plant, it, 10)
    assert plant.cycle == 0
    assert it.state == state
    assert math.isfinite(run_seeker(VirtualEngine(limits=["p_max_bar"]), it, 10).summary["mean_j"])
