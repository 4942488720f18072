"""Many loops of seekers with a guide: the numbers of `run_seeker`, however they are cut."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd.engine import Cylinder, OperatingPoint, Performance
from mgdd.errors import ParameterError
from mgdd.guide import CurveSeeking, FeedForward, GuidedEngine, ModelOptimum, OnlineCalibration
from mgdd.loop import LoopCriteria, VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import ComponentLag, ExtremumSeeking, GaussianProcessSeeking, GradientDescent, Spsa

SPACE = {"start": -12.0, "bounds": (-30.0, 10.0)}
GOAL = LoopCriteria(optimum=-6.0, arrival=2.0)
CYCLES, SEED = 420, 11
# Two steps of the load, of which the guide below says nothing and nonsense, a drift of 3 %, and one that it follows.
FUEL_MG = {0: 12.0, 120: 30.0, 190: 50.0, 260: 51.5, 330: 20.0}
POINTS = {first: OperatingPoint(fuel_mg=fuel) for first, fuel in FUEL_MG.items()}


def by_fuel(point: OperatingPoint) -> float | None:
    """Say nothing of 30 mg, and what lies out of the bounds above 40."""
    fuel = point.to_dict()["fuel_mg"]
    return None if fuel == 30.0 else 99.0 if fuel > 40.0 else -0.3 * fuel + 1.0


def bench(seed: int = 0, **settings: Any) -> VirtualEngine:
    return VirtualEngine(schedule=list(POINTS.items()), misfire_probability=0.02, seed=seed, **settings)


def rough() -> ModelOptimum:
    return ModelOptimum(Cylinder(wall_heat_scale=1.0))


def begun() -> FeedForward:
    """One that has run before, at another operating point."""
    out = FeedForward(ExtremumSeeking(**SPACE), by_fuel, trust=0.7)
    for k in range(25):
        out.at(OperatingPoint(fuel_mg=16.0 + k % 2))
        out.tell(50.0 - 0.02 * float(out.ask()[0] + 4.0) ** 2)
    return out


def calibrated(seeker: Any) -> GuidedEngine:
    calibration = OnlineCalibration(Cylinder(wall_heat_scale=1.0), steady_cycles=0, window_cycles=10)
    return GuidedEngine(seeker, rough(), POINTS[0], calibration=calibration)


SEEKERS: dict[str, Callable[[], Any]] = {
    "feed-forward": lambda: FeedForward(ExtremumSeeking(**SPACE), by_fuel),
    "one whose trust alone decides": lambda: FeedForward(ExtremumSeeking(**SPACE), by_fuel, probe_cycles=0),
    "one that has run": begun,
    "one that keeps its start": lambda: FeedForward(GradientDescent(**SPACE), by_fuel, keep_start=True),
    "one that draws": lambda: FeedForward(Spsa(**SPACE, seed=SEED), by_fuel),
    "one without a guide": lambda: FeedForward(ExtremumSeeking(**SPACE)),
    "a guide that fails": lambda: FeedForward(ExtremumSeeking(**SPACE), lambda _: 1.0 / 0.0),
    "model": lambda: FeedForward(ExtremumSeeking(**SPACE), rough()),
    "guided engine": lambda: GuidedEngine(ExtremumSeeking(**SPACE), rough(), POINTS[0], keep_start=True),
    "one that draws, calibrated": lambda: calibrated(Spsa(**SPACE, seed=SEED)),
    "curve": lambda: CurveSeeking(**SPACE, curve=rough().curve(POINTS[0])),
    "curve, calibrated": lambda: calibrated(CurveSeeking(**SPACE, curve=rough().curve(POINTS[0]))),
}


def same_figures(loop: xr.Dataset, alone: dict[str, float], rel: float) -> None:
    shared = {name: value for name, value in alone.items() if not name.startswith("noise_free_") and name in loop}
    assert sum(map(np.isfinite, shared.values())) >= 8, sorted(shared)
    for name, value in shared.items():
        assert float(loop[name]) == pytest.approx(value, rel=rel, abs=1e-12, nan_ok=True), name


@pytest.mark.parametrize("name", SEEKERS)
def test_a_loop_has_the_numbers_of_run_seeker(name: str) -> None:
    alone = run_seeker(bench(SEED), SEEKERS[name](), CYCLES, criteria=GOAL)
    few = monte_carlo(bench(), SEEKERS[name](), [4, SEED], cycles=CYCLES, criteria=GOAL)
    many = monte_carlo(bench(), SEEKERS[name](), [*range(16), SEED], cycles=CYCLES, criteria=GOAL)
    same_figures(few.isel(bench=0, seeker=0, seed=1), alone.summary, 1e-13)
    for figure in ("lowest_soc_cad", "highest_soc_cad", "misfires", "cycles_to"):  # no sum that could round
        np.testing.assert_equal(float(few[figure][0, 0, 1]), alone.summary[figure])
    same_figures(many.isel(bench=0, seeker=0, seed=-1), alone.summary, 1e-9)
    assert few["mean_soc_cad"][0, 0, 0] != few["mean_soc_cad"][0, 0, 1]


def test_a_process_with_a_mean_and_late_components_has_them_too() -> None:
    curve = rough().curve(POINTS[0])
    seeker = GaussianProcessSeeking(
        start={"soc_cad": -12.0}, inputs={"soc_cad": (-30.0, 10.0)}, seed=SEED,
        guide=[lambda x: curve(x["soc_cad"]), lambda x: -0.5 * x["soc_cad"]],
        components=[ComponentLag(), ComponentLag(delay_cycles=20.0, lag_cycles=8.0)],
    )  # fmt: skip
    late = {"performance": Performance.efficiency_and_nox(), "nox_sensor": "analyser"}
    few = monte_carlo(bench(**late), seeker, [SEED], cycles=150)
    alone = run_seeker(bench(SEED, **late), seeker, 150)
    same_figures(few.isel(bench=0, seeker=0, seed=0), alone.summary, 1e-13)


class Posted(Executor):
    """Runs what it is given from its pickle, as a process would."""

    def submit(self, call: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        done: Future[Any] = Future()
        call, given, named = pickle.loads(pickle.dumps((call, given, named)))
        done.set_result(call(*given, **named))
        return done


def test_workers_and_pieces_change_no_bit() -> None:
    plants = [bench(), VirtualEngine(point=POINTS[120])]
    of_here = FeedForward(Spsa(**SPACE), lambda point: -0.3 * point.to_dict()["fuel_mg"])  # no pickle
    seekers = [of_here, calibrated(ExtremumSeeking(**SPACE)), ExtremumSeeking(**SPACE)]
    run_seeker(bench(), of_here, 30)
    kept = (of_here.state, of_here.history)

    def loops(**how: Any) -> xr.Dataset:
        return monte_carlo(plants, seekers, [3, 1, 4, 15, 9], cycles=200, **how)

    one = loops(workers=1)
    xr.testing.assert_identical(one, loops(workers=2))
    xr.testing.assert_identical(one, loops(progress=lambda *_: None))
    xr.testing.assert_identical(one, loops(executor=Posted()))
    assert of_here.state == kept[0]
    xr.testing.assert_identical(of_here.history, kept[1])


def test_a_guide_is_asked_once_at_every_point_and_once_more_where_it_gives_nothing() -> None:
    asked = list[float]()

    def guide(point: OperatingPoint) -> float | None:
        asked.append(point.to_dict()["fuel_mg"])
        return by_fuel(point)

    monte_carlo(bench(), FeedForward(ExtremumSeeking(**SPACE), guide), range(5), cycles=300)
    assert asked == [12.0, 30.0, 30.0, 50.0, 50.0, 51.5, 51.5]


def test_what_run_seeker_refuses_is_refused() -> None:
    two = Spsa(start=[-12.0, 0.1], bounds=([-30.0, 0.0], [10.0, 0.5]))
    far = ExtremumSeeking(start=-70.0, bounds=(-90.0, 10.0))
    between = [FeedForward(ExtremumSeeking(**SPACE), by_fuel), SEEKERS["guided engine"]()]
    for seeker in between:
        seeker.ask()
    for call in (run_seeker, lambda bench, seeker, cycles: monte_carlo(bench, seeker, [1], cycles=cycles)):
        with pytest.raises(ParameterError, match="start has 2 entries"):
            call(bench(), FeedForward(two, by_fuel), 5)
        for seeker in between:
            with pytest.raises(ParameterError, match="tell what was measured first"):
                call(bench(), seeker, 5)
    with pytest.raises(ParameterError, match="estimate of the seeker = -70"):
        monte_carlo(bench(), FeedForward(far), [1], cycles=5)
    assert math.isnan(between[0].guide_optimum[0])
