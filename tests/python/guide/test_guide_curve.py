"""Curve-guided seeking and the whole guided loop from Python."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import ParameterError, ShapeError
from mgdd.guide import Curve, CurveSeeking, FeedForward, GuidedEngine, ModelOptimum, OnlineCalibration
from mgdd.loop import Measurement, VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.rig import SimulatedRig

PLANT_BEST_CAD = -5.63
ROUGH = Cylinder(wall_heat_scale=1.0)


def parabola(best: float = 3.0) -> Curve:
    return Curve.parabola(curvature=-0.05, best=best, reach=60.0)


def seeking(**other: Any) -> CurveSeeking:
    return CurveSeeking(**{"start": 3.0, "bounds": (-30.0, 10.0), "curve": parabola(), **other})


def seek(seeker: Any, cycles: int, seed: int = 0) -> list[float]:
    noise = np.random.default_rng(seed).normal(0.0, 0.25, cycles)
    asked = []
    for extra in noise:
        asked.append(float(seeker.ask()[0]))
        seeker.tell(56.0 - 0.0255 * (asked[-1] + 6.0) ** 2 + extra)
    return asked


def test_a_curve_is_read_at_one_input_or_many() -> None:
    curve = Curve(range(-20, 21, 4), [-0.02 * (x - 2) ** 2 for x in range(-20, 21, 4)])
    assert curve(2.0) == pytest.approx(0.0, abs=1e-4)
    assert curve([[0.0, 4.0], [2.0, -20.0]]) == pytest.approx(np.array([[-0.08, -0.08], [0.0, -9.68]]), abs=1e-3)
    assert curve.best == pytest.approx(2.0, abs=1e-3)
    assert (curve.lower, curve.upper) == (-20.0, 20.0)
    assert curve.curvature(3.0) == pytest.approx(-0.04, rel=1e-3)
    assert pickle.loads(pickle.dumps(curve)) == curve
    assert curve != parabola()


@pytest.mark.parametrize(
    ("inputs", "values", "said"),
    [
        ([0.0, 1.0], [1.0, 2.0], "needs 3"),
        ([0.0, 1.0, 2.0], [1.0, 2.0], r"values has 2 entries: must have 3"),
        ([0.0, 2.0, 1.0], [1.0, 2.0, 1.0], r"inputs\[2\] = 1: must be above the one before, 2"),
        ([0.0, 1.0, 2.0], [1.0, np.nan, 1.0], r"values\[1\] = nan: must be finite"),
    ],
)
def test_points_that_make_no_curve_are_refused(inputs: list[float], values: list[float], said: str) -> None:
    with pytest.raises((ParameterError, ShapeError), match=said):
        Curve(inputs, values)


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        ({"bounds": (-30.0, np.inf)}, "upper = inf: must be finite"),
        ({"curve": Curve([0.0, 1.0, 2.0], [0.0, 1.0, 2.5])}, "does not bend down"),
        (
            {"curve": Curve(np.linspace(-30, 10, 9), [0.0, 2.0, 4.0, 6.0, 8.0, 2.0, 7.0, 4.0, 1.0])},
            "several maxima",
        ),
        ({"curve": parabola(40.0)}, r"best input at 40.*must be in \[-30, 10\]"),
        ({"prior_sd": 0.1}, "prior_sd = 0.1: must be at least 5"),
        ({"start": 11.0}, "start = 11: must lie in"),
        ({"start": [1.0, 2.0]}, "a curve guides one input"),
        ({"memory_cycles": 1.0}, "memory_cycles = 1: must be in"),
        ({"limits": [Limit("p_max_bar", 95.0)], "limit_curves": [parabola(), parabola()]}, "one per limit"),
    ],
)
def test_what_cannot_be_sought_is_refused(spoilt: dict[str, Any], said: str) -> None:
    with pytest.raises((ParameterError, ShapeError), match=said):
        seeking(**spoilt)


def test_a_state_that_would_scale_j_by_nothing_is_refused() -> None:
    seeker = seeking()
    before = seeker.state
    with pytest.raises(ParameterError, match="taken_over_scale"):
        seeker.state = {**before, "taken_over_scale": [0.0]}
    assert seeker.state == before


def test_a_new_curve_keeps_the_error_of_the_old_one() -> None:
    seeker = seeking()
    seek(seeker, 150)
    error = seeker.estimate[0] - 3.0
    assert seeker.guide(parabola(-2.0))
    assert seeker.estimate[0] == pytest.approx(-2.0 + error)
    assert not seeker.guide(parabola(40.0))


def test_limits_by_the_guides_curves_are_kept_while_it_arrives() -> None:
    above = []
    for seed in range(10):
        bench = VirtualEngine(limits=["p_max_bar"], seed=seed)
        model = ModelOptimum(ROUGH)
        curve, drawn = model.curve(bench.point), model.limit_curves(bench.point, ["p_max_bar"])
        assert curve is not None
        seeker = CurveSeeking(
            start=curve.best,
            bounds=(-30.0, 10.0),
            curve=curve,
            limits=[Limit("p_max_bar", 95.0)],
            limit_curves=drawn,
        )
        run = run_seeker(bench, seeker, 300)
        above.append(run.summary["noise_free_above_fraction_p_max_bar"])
        assert seeker.limit_states == {"p_max_bar": "active"}
        assert abs(run.summary["final_soc_cad"] - bench.find_optimum({"p_max_bar": 95.0})["soc_cad"]) < 1.0
    assert np.mean(above) <= 0.01


def test_model_without_a_cycle_draws_no_curve() -> None:
    model = ModelOptimum(Cylinder())
    assert model.curve(OperatingPoint(fuel_mg=0.0)) is None
    assert model.limit_curves(OperatingPoint(), ["nothing"]) is None
    with pytest.raises(ParameterError, match="point = 3"):
        model.curve(3)  # type: ignore[arg-type]


# --- the whole loop -------------------------------------------------------------------------------------------


def guided(bench: VirtualEngine, *, calibrate: bool = True, plain: bool = False) -> GuidedEngine:
    model = ModelOptimum(ROUGH)
    curve = model.curve(bench.point)
    assert curve is not None
    seeker: Any = CurveSeeking(start=curve.best, bounds=(-30.0, 10.0), curve=curve)
    if plain:
        seeker = ExtremumSeeking(start=-15.0, bounds=(-30.0, 10.0))
    calibration = OnlineCalibration(ROUGH, steady_cycles=0, window_cycles=5) if calibrate else None
    return GuidedEngine(seeker, model, bench.point, calibration=calibration)


def test_the_record_says_what_came_from_where() -> None:
    bench = VirtualEngine(seed=1)
    engine = guided(bench)
    run = run_seeker(bench, engine, 60)
    table = run.dataset
    assert float(table["guide_optimum"][0, 0]) == pytest.approx(-1.53, abs=0.05)
    assert float(table["guide_optimum"][-1, 0]) == pytest.approx(PLANT_BEST_CAD, abs=0.3)
    assert np.allclose(table["feed_forward"][:, 0] + table["trim"][:, 0], table["estimate"][:, 0])
    assert float(engine.cylinder.wall_heat_scale) == pytest.approx(0.5, rel=0.03)
    assert engine.recalibrations > 0
    assert (engine.refusals, engine.calibration_status) == (0, "updated")
    assert 0.7 < engine.trust <= 1.0
    assert all("units" in table[name].attrs for name in table.variables)
    assert run_seeker(bench, engine, 5).dataset.sizes["cycle"] == 5
    assert engine.history.sizes["cycle"] == 65


@pytest.mark.parametrize("plain", [False, True])
def test_a_rig_and_the_bench_go_the_same_way(plain: bool) -> None:
    schedule = [(0, OperatingPoint(fuel_mg=12.0)), (40, OperatingPoint(fuel_mg=28.0))]
    bench, same = VirtualEngine(schedule=schedule, seed=4), VirtualEngine(schedule=schedule, seed=4)
    one, other = guided(bench, plain=plain), guided(same, plain=plain)
    run = run_seeker(bench, one, 90)
    for _ in range(90):
        other.at(same.point)
        cycle = same.step(other.ask()[0])
        other.tell(cycle["j"], pressure_bar=same.pressure()[1], misfire=cycle["misfire"])
    assert other.history["estimate"][:, 0].equals(one.history["estimate"][:, 0])
    guide = run.dataset["guide_optimum"][:, 0].to_numpy()
    assert guide[41] < guide[39] - 2.0
    with SimulatedRig(VirtualEngine(schedule=schedule, seed=4)) as rig:
        third = guided(VirtualEngine(schedule=schedule), plain=plain)
        run_seeker(rig, third, 90)
    assert third.history["estimate"][:, 0].equals(one.history["estimate"][:, 0])


def test_a_point_without_a_best_timing_is_refused_and_the_run_goes_on() -> None:
    bench = VirtualEngine(seed=2)
    engine = guided(bench, calibrate=False)
    run_seeker(bench, engine, 30)
    held = engine.estimate[0]
    assert engine.at(OperatingPoint(fuel_mg=0.0)) == "refused"
    assert (engine.estimate[0], engine.refusals) == (held, 1)
    assert engine.at(bench.point) == "followed"
    engine.ask()
    with pytest.raises(ParameterError, match="between ask"):
        engine.at(OperatingPoint(fuel_mg=30.0))


class WithoutPoint:
    """A plant that does not say its operating point."""

    input_names, limit_names = ("soc_cad",), ()

    def apply(self, inputs: Any) -> None:
        self.soc_cad = inputs["soc_cad"]

    def measure(self) -> Measurement:
        return Measurement(components=(-((self.soc_cad + 6.0) ** 2),))


def test_a_guide_that_would_never_be_asked_is_refused() -> None:
    front = FeedForward(ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0)), lambda fuel_mg: -0.3 * fuel_mg)
    with pytest.raises(ParameterError, match="would never be asked"):
        run_seeker(WithoutPoint(), front, 5)
    assert front.cycle == 0
    front.at(20.0)
    assert run_seeker(WithoutPoint(), front, 5).dataset["estimate"][0, 0] == -6.0


def test_what_makes_no_guided_engine_is_refused() -> None:
    bench, model = VirtualEngine(), ModelOptimum(ROUGH)
    plain = ExtremumSeeking(start=-15.0, bounds=(-30.0, 10.0))
    with pytest.raises(ParameterError, match="model = 3"):
        GuidedEngine(plain, 3, bench.point)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="calibration = 3"):
        GuidedEngine(plain, model, bench.point, calibration=3)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="no best timing"):
        GuidedEngine(plain, model, OperatingPoint(fuel_mg=0.0))
    with pytest.raises(ParameterError, match="geometry"):
        GuidedEngine(plain, model, bench.point, calibration=OnlineCalibration(Cylinder(bore_mm=90.0)))
    with pytest.raises(ParameterError, match="changed_share"):
        GuidedEngine(plain, model, bench.point, changed_share=0.0)


def test_a_feed_forward_runs_in_the_loop() -> None:
    schedule = [(0, OperatingPoint(fuel_mg=12.0)), (150, OperatingPoint(fuel_mg=30.0))]
    bench = VirtualEngine(schedule=schedule, seed=1)
    front = FeedForward(
        ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0)), ModelOptimum(Cylinder(wall_heat_scale=0.65))
    )
    run = run_seeker(bench, front, 300)
    jump = run.dataset["estimate"][:, 0].to_numpy()
    assert jump[155] < jump[149] - 1.0
    assert front.verdict != "wrong"
    assert front.settings["noise_sd"] is None
