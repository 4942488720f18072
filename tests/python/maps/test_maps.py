"""Calibration maps: values inside and outside of the axes, refusals, the guide's table and back, comparison."""

from __future__ import annotations

import pickle
import threading
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from map_cases import FUEL, SPEED, centre, timing_table
from mgdd.engine import OperatingPoint
from mgdd.errors import DataError, Error, ParameterError, ShapeError
from mgdd.guide import FeedForward, TimingMap
from mgdd.maps import CalibrationMap, compare_maps
from mgdd.optimize import ExtremumSeeking
from mgdd.results.labels import check_labels

AXES = {"speed_rpm": SPEED, "fuel_mg": FUEL}


def plane() -> CalibrationMap:
    return CalibrationMap(AXES, centre(SPEED[:, None], FUEL), name="soc_cad")


def test_a_bilinear_function_is_exact_and_the_edge_is_held_with_a_flag() -> None:
    rng = np.random.default_rng(0)
    speed, fuel = rng.uniform(900.0, 3000.0, (40, 7)), rng.uniform(6.0, 40.0, 7)
    found = plane().lookup({"fuel_mg": fuel, "speed_rpm": speed, "intake_pressure_kpa": 180.0})
    assert found.values.shape == (40, 7)
    np.testing.assert_allclose(found.values, centre(speed, fuel), rtol=1e-13)
    assert not found.held_outside.any()
    out = plane().lookup({"speed_rpm": [100.0, 9000.0, 1000.0, np.nan], "fuel_mg": [10.0, 50.0, 41.0, 10.0]})
    np.testing.assert_allclose(
        out.values, [centre(900.0, 10.0), centre(3000.0, 40.0), centre(1000.0, 40.0), np.nan], rtol=1e-13
    )
    assert out.held_outside.all()


def test_one_point_and_an_operating_point_give_a_number() -> None:
    at = plane().lookup(OperatingPoint(speed_rpm=1200.0, fuel_mg=20.0))
    assert float(at.values) == pytest.approx(centre(1200.0, 20.0))
    assert not bool(at.held_outside)
    with pytest.raises(ParameterError, match=r"points.*speed_rpm and fuel_mg"):
        plane().lookup({"speed_rpm": 1200.0})


def test_a_line_and_its_standard_deviation() -> None:
    line = CalibrationMap({"fuel_mg": FUEL}, [1.0, -2.0, 4.0, 4.0, 0.5], name="soc_cad", cells={"sd": 0.1 * FUEL})
    assert line.lookup({"fuel_mg": [12.0, 99.0]}).values.tolist() == [1.0, 0.5]
    assert line.sd_at({"fuel_mg": 12.0}) == pytest.approx(1.2)
    assert line.lookup({"fuel_mg": [12.0, 99.0]}).held_outside.tolist() == [False, True]


def test_where_a_cell_has_no_value_the_map_says_nan_and_not_the_neighbour() -> None:
    table = timing_table()
    near = table.lookup({"speed_rpm": [3000.0, 2900.0, 3000.0, 1400.0], "fuel_mg": [40.0, 30.0, 25.0, 40.0]})
    assert np.isnan(near.values[:2]).all()
    assert not near.held_outside.any()
    np.testing.assert_allclose(near.values[2:], [centre(3000.0, 25.0), centre(1400.0, 40.0)])


def test_reading_many_points_lets_other_threads_run() -> None:
    table, ticks, stop = plane(), [], threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks.append(1)
            stop.wait(1e-4)

    points = {"speed_rpm": np.linspace(800.0, 3100.0, 2_000_000), "fuel_mg": 20.0}
    watcher = threading.Thread(target=tick)
    watcher.start()
    before = len(ticks)
    table.lookup(points)
    after = len(ticks)
    stop.set()
    watcher.join()
    assert after > before + 3


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"axes": {"speed_rpm": [900.0, 1400.0, 1400.0], "fuel_mg": FUEL}}, ParameterError, r"speed_rpm\[2\] = 1400"),
        ({"axes": {"speed_rpm": [900.0, 1400.0, np.nan], "fuel_mg": FUEL}}, ParameterError, r"speed_rpm\[2\] = nan"),
        ({"axes": {"speed_rpm": SPEED[::-1], "fuel_mg": FUEL}}, ParameterError, r"speed_rpm\[1\] = 1400"),
        ({"axes": {"speed_rpm": [SPEED], "fuel_mg": FUEL}}, ShapeError, "speed_rpm has 2 dimensions"),
        ({"axes": {}}, ParameterError, "axes"),
        ({"axes": {**AXES, "rail_bar": [1.0, 2.0]}}, ParameterError, "one or two"),
        ({"axes": {"soc_cad": SPEED, "fuel_mg": FUEL}}, ParameterError, "another name"),
        ({"values": np.zeros((5, 3))}, ShapeError, r"soc_cad has shape \(5, 3\).*make \(3, 5\)"),
        ({"values": np.full((3, 5), np.inf)}, ParameterError, "values"),
        ({"values": np.full((3, 5), np.nan)}, DataError, "speed_rpm = 900, fuel_mg = 6: the value is nan"),
        ({"labels": {"fuel_mg": ("kg", "fuel")}}, DataError, "unit of fuel_mg = 'kg': must be 'mg'"),
        ({"labels": {"soc_cad": ("bar", "soc")}}, DataError, "unit of soc_cad = 'bar'"),
        ({"labels": {"torque_nm": ("N m", "torque")}}, ParameterError, "labels = 'torque_nm'"),
        ({"cells": {"source": "guessed"}}, DataError, "source = 'guessed': must be one of given"),
        ({"cells": {"source": "infeasible"}}, DataError, "infeasible"),
        ({"cells": {"suport": 1.0}}, ParameterError, "did you mean 'support'"),
        ({"cells": {"sd": -0.1}}, DataError, "sd at speed_rpm = 900, fuel_mg = 6 = -0.1: must be finite, >= 0"),
        ({"cells": {"sd": np.zeros((2, 5))}}, ShapeError, r"sd has shape \(2, 5\)"),
        ({"name": "best timing"}, ParameterError, "name = 'best timing'"),
        ({"provenance": {"date": "one\ntwo"}}, ParameterError, "provenance date"),
    ],
)
def test_what_makes_no_map_is_named(change: dict[str, Any], error: type[Error], said: str) -> None:
    good = {"axes": AXES, "values": centre(SPEED[:, None], FUEL), "name": "soc_cad"}
    axes, values, more = (lambda axes, values, **more: (axes, values, more))(**{**good, **change})
    with pytest.raises(error, match=said):
        CalibrationMap(axes, values, **more)


def test_a_map_does_not_change_and_does_not_share_arrays() -> None:
    axis, values = SPEED.copy(), centre(SPEED[:, None], FUEL)
    table = CalibrationMap({"speed_rpm": axis, "fuel_mg": FUEL}, values, name="soc_cad")
    axis[0], values[0, 0] = 1.0, 99.0
    assert table.axes["speed_rpm"][0] == 900.0
    assert table.values[0, 0] == centre(900.0, 6.0)
    for array in (table.values, table.axes["fuel_mg"], table.cells["sd"], table.cells["source"]):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = array
    assert pickle.loads(pickle.dumps(timing_table())) == timing_table()
    assert table != table.replaced(table.values + 1e-12)
    assert table != timing_table()


def test_dataset_and_back() -> None:
    data = timing_table().to_dataset()
    check_labels(data)
    assert CalibrationMap.from_dataset(data) == timing_table()
    other = CalibrationMap.from_dataset(data[["soc_cad"]].rename(soc_cad="estimate_cad"), "estimate_cad")
    assert other.cells["source"][2].tolist() == ["given"] * 4 + ["unattainable"]
    told = CalibrationMap.from_dataset(
        data[["soc_cad"]].rename(soc_cad="estimate_cad"), "estimate_cad", source="measured"
    )
    assert told.cells["source"][2].tolist() == ["measured"] * 4 + ["unattainable"]
    foreign = data[["soc_cad"]].rename(soc_cad="estimate_cad")
    for text, source in (("predicted", "predicted"), ("CFD, version 3", "given"), ("unattainable", "given")):
        foreign["estimate_cad"].attrs["source"] = text
        assert CalibrationMap.from_dataset(foreign, "estimate_cad").cells["source"][0, 0] == source
    with pytest.raises(DataError, match="no variable 'soi_cad' over one or two axes: the Dataset has soc_cad"):
        CalibrationMap.from_dataset(data, "soi_cad")
    with pytest.raises(
        DataError, match=r"names no map: give the name of a variable .*\(it has soc_cad, .*optimize_map"
    ):
        CalibrationMap.from_dataset(data.drop_attrs(deep=False))


# --- the guide ----------------------------------------------------------------------------------------------
def test_the_guide_uses_a_map_and_what_it_learns_comes_back() -> None:
    table = plane().replaced(cells={"source": "smoothed", "sd": np.where(FUEL < 12.0, 0.4, np.nan) * np.ones((3, 1))})
    timing = table.to_timing_map(prior_sd_cad=2.0)
    np.testing.assert_array_equal(timing.timing_cad, table.values)
    np.testing.assert_allclose(timing.sd_cad, np.where(FUEL < 12.0, 0.4, 2.0) * np.ones((3, 1)))
    assert table.learned_from(timing) == table  # nothing learnt yet

    optimum = -7.5
    seeker = FeedForward(ExtremumSeeking(start=-5.0, bounds=(-30.0, 10.0)), timing)
    point = {"speed_rpm": 1400.0, "fuel_mg": 14.0}
    seeker.at(point)
    assert seeker.ask()[0] == pytest.approx(centre(1400.0, 14.0), abs=3.0)
    timing.learn(point, optimum, sd_cad=0.1)
    back = table.learned_from(timing)
    assert back.cells["source"].tolist()[1] == ["smoothed", "smoothed", "learned", "smoothed", "smoothed"]
    assert back.values[1, 2] == pytest.approx(optimum, abs=0.02)
    assert back.cells["sd"][1, 2] == pytest.approx(0.1, rel=0.01)
    assert back.cells["support"][1, 2] == 1.0
    untouched = back.cells["source"] != "learned"
    np.testing.assert_array_equal(back.values[untouched], table.values[untouched])
    assert back.to_timing_map().timing_cad[1, 2] == back.values[1, 2]


def test_only_a_whole_timing_map_becomes_a_guide() -> None:
    with pytest.raises(DataError, match="1 cells have no value"):
        timing_table().to_timing_map()
    with pytest.raises(DataError, match="needs '°CA aTDC'"):
        CalibrationMap({"speed_rpm": SPEED}, 80.0, name="torque_nm").to_timing_map()
    with pytest.raises(DataError, match="other axes"):
        plane().learned_from(TimingMap({"fuel_mg": FUEL}, -5.0))


# --- comparison ---------------------------------------------------------------------------------------------
def test_maps_on_other_breakpoints_are_compared_at_those_of_both() -> None:
    def holds(axis: np.ndarray, slope: float) -> CalibrationMap:
        return CalibrationMap({"fuel_mg": axis}, slope * axis, name="soc_cad")

    one, two = holds(np.array([6.0, 10.0, 30.0]), -0.5), holds(np.array([8.0, 30.0, 40.0]), -0.5 - 0.05)
    one = one.replaced(cells={"sd": 0.3})
    two = two.replaced(cells={"sd": 0.4})
    found = compare_maps(one, two, tolerance=0.9)
    check_labels(found)
    np.testing.assert_array_equal(found["fuel_mg"], [8.0, 10.0, 30.0])
    np.testing.assert_allclose(found["difference"], -0.05 * found["fuel_mg"], atol=1e-14)
    np.testing.assert_allclose(found["sd"], 0.5)
    assert float(found["largest_difference"]) == pytest.approx(-1.5)
    assert float(found["rms_difference"]) == pytest.approx(np.sqrt((0.4**2 + 0.5**2 + 1.5**2) / 3.0))
    assert int(found["n_beyond"]) == 1
    on_first = compare_maps(one, two, grid="first")
    assert on_first["held_outside"].values.tolist() == [True, False, False]
    assert compare_maps(one, one)["difference"].values.tolist() == [0.0, 0.0, 0.0]


def test_maps_that_cannot_be_compared() -> None:
    one = plane()
    torque = CalibrationMap(AXES, 80.0, name="torque_nm")
    with pytest.raises(DataError, match="soc_cad has unit '°CA aTDC' in one map and 'N m'"):
        compare_maps(one, torque)
    with pytest.raises(DataError, match="the same axes"):
        compare_maps(one, CalibrationMap({"fuel_mg": FUEL}, -5.0, name="soc_cad"))
    far = CalibrationMap({"speed_rpm": SPEED + 9000.0, "fuel_mg": FUEL}, -5.0, name="soc_cad")
    with pytest.raises(DataError, match="speed_rpm: 900 to 3000 and 9900 to 12000 have nothing in common"):
        compare_maps(one, far)
    assert compare_maps(one, far, grid="first")["held_outside"].all()
    with pytest.raises(ParameterError, match="tolerance = -1"):
        compare_maps(one, one, tolerance=-1.0)
    with pytest.raises(ParameterError, match="grid"):
        compare_maps(one, one, grid="second")  # type: ignore[arg-type]


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_between_its_cells_a_map_stays_between_them(data: st.DataObject) -> None:
    sizes = data.draw(st.lists(st.integers(2, 5), min_size=1, max_size=2))
    steps = [data.draw(st.lists(st.floats(1e-3, 50.0), min_size=n, max_size=n)) for n in sizes]
    axes = {name: np.cumsum(step) for name, step in zip(("x", "y"), steps, strict=False)}
    count = int(np.prod(sizes))
    values = np.array(data.draw(st.lists(st.floats(-1e3, 1e3), min_size=count, max_size=count))).reshape(sizes)
    table = CalibrationMap(axes, values, name="z")
    point = {name: data.draw(st.floats(-100.0, 400.0)) for name in axes}
    found = table.lookup(point)
    assert values.min() - 1e-9 <= float(found.values) <= values.max() + 1e-9
    outside = any(not entries[0] <= point[name] <= entries[-1] for name, entries in axes.items())
    assert bool(found.held_outside) == outside
    grid = dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True))
    np.testing.assert_array_equal(table.lookup(grid).values, values)
