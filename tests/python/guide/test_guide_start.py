"""Where a guided run begins: at the guide's best by itself, at the seeker's own start where that is kept."""

from __future__ import annotations

import copy
import json
import pickle
from typing import Any

import numpy as np
import pytest

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, ParameterError
from mgdd.guide import CurveSeeking, FeedForward, GuidedEngine, ModelOptimum
from mgdd.loop import VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking, Seeker, Spsa
from mgdd.optimize.optimum import Optimum

START_CAD, GUIDE_CAD, PLANT_BEST_CAD = -18.0, -1.53, -5.63
SPACE: dict[str, Any] = {"start": START_CAD, "bounds": (-30.0, 10.0)}
ROUGH = ModelOptimum(Cylinder(wall_heat_scale=1.0))


def by_curve(point: OperatingPoint | None = None, **settings: Any) -> CurveSeeking:
    curve = ROUGH.curve(point or OperatingPoint())
    assert curve is not None
    return CurveSeeking(**SPACE, curve=curve, **settings)


def step(fuel_mg: float) -> Optimum:
    return Optimum(inputs={"soc_cad": 2.0 - 0.35 * fuel_mg}, objective="J", value=0.0, curvature=-0.051)


def test_by_itself_a_run_begins_at_the_best_of_the_guide() -> None:
    front = FeedForward(ExtremumSeeking(**SPACE), step)
    front.at(20.0)
    assert (front.estimate[0], front.trim[0]) == pytest.approx((-5.0, 0.0))
    for seeker in (by_curve(), ExtremumSeeking(**SPACE)):
        assert GuidedEngine(seeker, ROUGH, OperatingPoint()).estimate[0] == pytest.approx(GUIDE_CAD, abs=0.05)


@pytest.mark.parametrize("seeker", [ExtremumSeeking, Spsa])
def test_with_a_kept_start_the_first_point_belongs_to_the_seeker(seeker: type[Any]) -> None:
    schedule = [(0, OperatingPoint(fuel_mg=12.0)), (80, OperatingPoint(fuel_mg=26.0))]
    runs = []
    for guide in (None, lambda point: step(point.fuel_mg)):
        front = FeedForward(seeker(**SPACE), guide, keep_start=True, noise_sd=0.25)
        if guide is None:
            front.restart()  # as the first value of a guide does
        run = run_seeker(VirtualEngine(schedule=schedule, seed=3), front, 90)
        runs.append(run.dataset["estimate"][:, 0].to_numpy())
    plain, guided = runs
    assert plain[0] == START_CAD
    assert np.array_equal(guided[:80], plain[:80])
    history = front.history
    assert float(history["guide_optimum"][0, 0]) == pytest.approx(-2.2)
    assert float(history["feed_forward"][0, 0]) == pytest.approx(-2.2)
    assert float(history["trim"][0, 0]) == pytest.approx(START_CAD + 2.2)
    assert history["testing"].to_numpy()[80:82].tolist() == [1, 2]
    assert guided[82] - guided[80] == pytest.approx(-4.9 * front.trust, abs=0.01)


def test_a_first_value_that_comes_late_moves_nothing() -> None:
    known = False
    plain = ExtremumSeeking(**SPACE)
    front = FeedForward(ExtremumSeeking(**SPACE), lambda fuel: step(fuel) if known else None, keep_start=True)
    for k in range(60):
        known = k >= 25
        assert front.at(20.0) == ("held" if k < 25 else "followed" if k == 25 else "same")
        if k == 25:
            plain.restart()
        x = front.ask()
        assert x.tobytes() == plain.ask().tobytes()
        for one in (front, plain):
            one.tell(-0.0255 * float(x[0] + 5.6) ** 2)
    assert front.seeker.state == plain.state
    assert front.feed_forward[0] == pytest.approx(-5.0)


@pytest.mark.parametrize("kind", ["curve", "dither"])
def test_a_guided_engine_keeps_the_start_of_its_seeker(kind: str) -> None:
    bench = VirtualEngine(seed=5)
    seeker = by_curve(rate=2.0) if kind == "curve" else ExtremumSeeking(**SPACE)
    engine = GuidedEngine(seeker, ROUGH, bench.point, keep_start=True)
    assert engine.settings["keep_start"] is True
    run = run_seeker(bench, engine, 300)
    first = {name: float(run.dataset[name][0, 0]) for name in ("estimate", "guide_optimum", "feed_forward", "trim")}
    assert first["estimate"] == START_CAD
    assert first["guide_optimum"] == pytest.approx(GUIDE_CAD, abs=0.05)
    assert first["feed_forward"] == pytest.approx(first["guide_optimum"])
    assert first["trim"] == pytest.approx(START_CAD - first["guide_optimum"])
    asked = run.dataset["asked"][:, 0].to_numpy()
    assert asked[0] == pytest.approx(START_CAD, abs=0.0 if kind == "curve" else 1.0)
    assert np.abs(np.diff(asked)).max() <= 2.0 + 1e-9
    assert run.summary["final_soc_cad"] == pytest.approx(PLANT_BEST_CAD, abs=1.0)


def test_a_seeker_that_has_run_goes_on_from_where_it_stands() -> None:
    for seeker in (by_curve(), ExtremumSeeking(**SPACE)):
        bench = VirtualEngine(seed=5)
        run_seeker(bench, seeker, 40)
        engine = GuidedEngine(seeker, ROUGH, bench.point, keep_start=True)
        assert engine.estimate[0] == pytest.approx(float(seeker.estimate[0]), abs=1e-9)


def engine_at(kind: str, bench: VirtualEngine) -> GuidedEngine | FeedForward:
    seeker: Seeker = by_curve(bench.point) if kind == "curve" else ExtremumSeeking(**SPACE)
    if kind == "feed-forward":
        return FeedForward(seeker, ROUGH, keep_start=True)
    return GuidedEngine(seeker, ROUGH, bench.point, keep_start=True)


@pytest.mark.parametrize("cut", [0, 1, 30])
@pytest.mark.parametrize("kind", ["curve", "dither", "feed-forward"])
def test_a_kept_start_survives_state_pickle_and_copy(kind: str, cut: int) -> None:
    bench = VirtualEngine(schedule=[(0, OperatingPoint()), (40, OperatingPoint(fuel_mg=28.0))], seed=5)
    whole = engine_at(kind, bench)
    if cut:
        run_seeker(bench, whole, cut)
    again = engine_at(kind, bench)
    again.state = json.loads(json.dumps(whole.state))
    others = [again, pickle.loads(pickle.dumps(whole)), copy.copy(whole)]
    benches = [copy.deepcopy(bench) for _ in others]
    expected = run_seeker(bench, whole, 60).dataset["estimate"][:, 0]
    for other, own in zip(others, benches, strict=True):
        assert run_seeker(own, other, 60).dataset["estimate"][:, 0].equals(expected)
        assert other.state == whole.state
    assert cut > 0 or float(expected[0]) == START_CAD


@pytest.mark.parametrize("kind", ["curve", "dither", "feed-forward"])
def test_the_history_numbers_cycles_as_the_state_does_and_keeps_no_refused_one(kind: str) -> None:
    bench = VirtualEngine(seed=5)
    one = engine_at(kind, bench)
    run_seeker(bench, one, 10)
    other = engine_at(kind, bench)
    other.state = one.state
    other.ask()
    with pytest.raises(DataError):
        other.tell(float("nan"))
    other.tell(misfire=True)
    other.ask()
    other.tell(50.0, applied=[-17.25])
    history = other.history
    assert history["cycle"].to_numpy().tolist() == [10, 11]
    assert history["misfire"].to_numpy().tolist() == [1, 0]
    assert np.array_equal(history["objective"], [np.nan, 50.0], equal_nan=True)
    applied = history["applied"].to_numpy().ravel()
    assert (applied[0] != -17.25, applied[1]) == (True, -17.25)


def test_what_does_not_say_whether_to_keep_it_is_refused() -> None:
    with pytest.raises(ParameterError, match="keep_start = -18: must be True or False"):
        FeedForward(ExtremumSeeking(**SPACE), step, keep_start=-18.0)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="keep_start = 'yes': must be True or False"):
        GuidedEngine(by_curve(), ROUGH, OperatingPoint(), keep_start="yes")  # type: ignore[arg-type]
