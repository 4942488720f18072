"""The map of the best timing from Python: forms, files, what confirms an optimum, a guide that gets better by use."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, Error, ParameterError
from mgdd.guide import FeedForward, ModelOptimum, TimingMap
from mgdd.optimize import ExtremumSeeking
from mgdd.results.labels import check_labels

AXES = {"speed_rpm": [900.0, 1500.0, 3000.0], "fuel_mg": [6.0, 12.0, 20.0, 40.0]}


def learnt() -> TimingMap:
    values = [[-2.0, -3.1, -4.3, -9.0], [-2.5, -4.0, -5.6, -11.0], [-4.0, -6.0, -8.0, -14.0]]
    timing = TimingMap(AXES, values, prior_sd_cad=2.0, forgetting=0.9)
    timing.learn({"speed_rpm": 1310.0, "fuel_mg": 17.0}, -6.2, sd_cad=0.3)
    timing.learn(OperatingPoint(speed_rpm=2000.0, fuel_mg=30.0), -9.0, sd_cad=0.7)
    return timing


@pytest.mark.parametrize(
    "point", [OperatingPoint(speed_rpm=1500.0, fuel_mg=20.0), {"fuel_mg": 20.0, "speed_rpm": 1500.0}, (1500.0, 20.0)]
)
def test_takes_points_in_several_forms(point: Any) -> None:
    assert learnt()(point) == pytest.approx(learnt().timing_cad[1, 2])


@pytest.mark.parametrize("point", [{"fuel_mg": 20.0}, (1500.0,), 20.0, "idle", {"fuel_mg": 20.0, "torque_nm": 90.0}])
def test_a_point_without_an_axis_is_refused(point: Any) -> None:
    with pytest.raises(ParameterError, match="point"):
        learnt()(point)


def test_outside_it_holds_the_edge_as_a_map_and_says_nothing_as_a_guide() -> None:
    timing = learnt()
    outside = {"speed_rpm": 1500.0, "fuel_mg": 50.0}
    assert timing(outside) is None
    found = timing.lookup(outside)
    assert found.held_outside
    assert found.timing_cad == pytest.approx(timing.timing_cad[1, 3])
    before = timing.to_toml()
    with pytest.raises(ParameterError, match="inside of the axes"):
        timing.learn(outside, -8.0, sd_cad=0.3)
    assert timing.to_toml() == before


def test_every_file_form_gives_the_map_back() -> None:
    timing = learnt()
    assert TimingMap.from_toml(timing.to_toml()) == timing
    assert pickle.loads(pickle.dumps(timing)) == timing
    dataset = timing.to_dataset()
    check_labels(dataset)
    back = TimingMap.from_dataset(dataset)
    np.testing.assert_array_equal(back.timing_cad, timing.timing_cad)
    np.testing.assert_allclose(back.sd_cad, timing.sd_cad, rtol=1e-15)
    np.testing.assert_array_equal(back.support, timing.support)
    for one in (TimingMap.from_toml(timing.to_toml()), back):
        one.learn((1500.0, 20.0), -7.0, sd_cad=0.2)
        assert one((1500.0, 20.0)) != timing((1500.0, 20.0))


def test_broken_files_are_refused() -> None:
    for field, value in (("forgetting", 1.01), ("prior_sd_cad", 0.0)):
        with pytest.raises(ParameterError, match=f"{field} = {value:g}"):
            TimingMap(AXES, 0.0, **{field: value})
    text = learnt().to_toml()
    with pytest.raises(Error, match="kind"):
        TimingMap.from_toml(text.replace("timing_map", "engine"))
    with pytest.raises(Error, match="forgetting"):
        TimingMap.from_toml("\n".join(line for line in text.splitlines() if not line.startswith("forgetting")))
    with pytest.raises(DataError, match="sd_cad"):
        TimingMap.from_dataset(learnt().to_dataset().drop_vars("sd_cad"))


@pytest.mark.parametrize(
    ("axes", "values"),
    [({}, 0.0), ({"fuel_mg": [6.0]}, 0.0), ({"fuel_mg": [6.0, 6.0]}, 0.0), (AXES, [1.0, 2.0]), (3, 0.0)],
)
def test_what_makes_no_map_is_refused(axes: Any, values: Any) -> None:
    with pytest.raises(Error):
        TimingMap(axes, values)


def settle(ff: FeedForward, fuel: float, cycles: int, seed: int = 0) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(cycles):
        ff.at({"fuel_mg": fuel})
        ff.tell(56.0 - 0.0255 * (float(ff.ask()[0]) + 0.35 * fuel) ** 2 + 0.05 * rng.standard_normal())


def test_only_a_settled_estimate_is_confirmed() -> None:
    timing = TimingMap({"fuel_mg": [10.0, 20.0, 40.0]}, -20.0)
    ff = FeedForward(ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0)), timing)
    at = {"fuel_mg": 20.0}
    settle(ff, 20.0, 60)
    assert not timing.learn_from(ff, at)  # too short
    settle(ff, 20.0, 50)
    assert not timing.learn_from(ff, at)  # still on its way
    assert timing.support.sum() == 0.0
    settle(ff, 20.0, 500)
    assert timing.learn_from(ff, at)
    assert timing(at) == pytest.approx(-7.0, abs=0.8)
    assert timing.support.tolist() == [0.0, 1.0, 0.0]
    settle(ff, 40.0, 50)
    assert not timing.learn_from(ff, {"fuel_mg": 40.0})  # of two operating points
    with pytest.raises(ParameterError, match="cycles"):
        timing.learn_from(ff, at, cycles=1)


def test_a_map_that_has_learnt_makes_the_next_step_at_once() -> None:
    timing = TimingMap({"fuel_mg": [10.0, 20.0, 40.0]}, -10.0)
    ff = FeedForward(ExtremumSeeking(start=-10.0, bounds=(-30.0, 10.0)), timing)
    for fuel in (10.0, 20.0, 40.0):
        settle(ff, fuel, 500, seed=int(fuel))
        assert timing.learn_from(ff, {"fuel_mg": fuel})
    ff.recalibrated()
    settle(ff, 40.0, 20, seed=1)
    settle(ff, 15.0, 2, seed=2)
    assert ff.verdict == "confirmed"
    assert ff.estimate[0] == pytest.approx(-0.35 * 15.0, abs=1.0)


def test_a_map_of_the_model_is_the_model_at_its_cells() -> None:
    model = ModelOptimum(Cylinder())
    timing = TimingMap.of_guide(model, AXES, make=OperatingPoint, prior_sd_cad=1.5)
    assert timing.timing_cad.shape == (3, 4)
    for speed, fuel in ((900.0, 6.0), (3000.0, 12.0), (1500.0, 40.0)):
        best = model(OperatingPoint(speed_rpm=speed, fuel_mg=fuel))
        assert best is not None
        assert timing((speed, fuel)) == pytest.approx(best["soc_cad"])
    assert timing.sd_cad == pytest.approx(np.full((3, 4), 1.5))
    with pytest.raises(DataError, match="no answer"):
        TimingMap.of_guide(model, {"fuel_mg": [0.0, 20.0]}, make=OperatingPoint)
