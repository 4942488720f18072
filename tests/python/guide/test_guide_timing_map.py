"""The map of the best timing as a guide: what one optimum teaches its cells, forgetting, what confirms an optimum."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.engine import OperatingPoint
from mgdd.errors import DataError, Error, ParameterError
from mgdd.guide import FeedForward, TimingMap
from mgdd.maps import CalibrationMap
from mgdd.optimize import ExtremumSeeking

AXES = {"speed_rpm": [900.0, 1500.0, 3000.0], "fuel_mg": [6.0, 12.0, 20.0, 40.0]}
VALUES = [[-2.0, -3.1, -4.3, -9.0], [-2.5, -4.0, -5.6, -11.0], [-4.0, -6.0, -8.0, -14.0]]
CELL = {"speed_rpm": 1500.0, "fuel_mg": 20.0}


def timings(values: Any = VALUES, axes: Any = AXES, **settings: Any) -> TimingMap:
    return TimingMap(CalibrationMap(axes, values, name="soc_cad"), **settings)


def sd_at(timing: TimingMap, point: Any) -> float:
    return float(timing.table.sd_at(point))


# --- one optimum and its cells ------------------------------------------------------------------------------
def test_a_cell_learns_the_weighted_mean_of_prior_and_optima() -> None:
    timing, rng, total = timings(0.0, prior_sd_cad=3.0, forgetting=1.0), np.random.default_rng(3), 0.0
    for count in range(1, 51):
        optimum = float(rng.normal(-6.0, 0.5))
        total += optimum
        timing.learn(CELL, optimum, sd_cad=0.5)
        information = 1.0 / 9.0 + count / 0.25
        assert timing(CELL) == pytest.approx(total / 0.25 / information, abs=1e-9)
        assert sd_at(timing, CELL) == pytest.approx(1.0 / math.sqrt(information), abs=1e-12)
        assert timing.table.cells["support"][1, 2] == pytest.approx(count)
    taught = timing.table.cells["source"] == "learned"
    assert np.argwhere(taught).tolist() == [[1, 2]]
    assert not timing.table.values[~taught].any()
    assert np.isnan(timing.table.cells["sd"][~taught]).all()


def test_an_optimum_between_cells_is_shared_as_a_kalman_filter_does() -> None:
    """Against the filter in its matrix form, its covariance cut to the diagonal after every optimum."""
    timing, rng = timings(prior_sd_cad=2.0, forgetting=0.9), np.random.default_rng(5)
    state, covariance = np.ravel(VALUES), 4.0 * np.eye(12)
    x, y = (np.array(entries) for entries in AXES.values())
    for _ in range(30):
        point = np.array([rng.uniform(900.0, 3000.0), rng.uniform(6.0, 40.0)])
        row, column = (np.clip(np.searchsorted(a, c) - 1, 0, a.size - 2) for a, c in zip((x, y), point, strict=True))
        u, v = (point[0] - x[row]) / (x[row + 1] - x[row]), (point[1] - y[column]) / (y[column + 1] - y[column])
        shares = np.zeros((3, 4))
        shares[row : row + 2, column : column + 2] = np.outer([1.0 - u, u], [1.0 - v, v])
        weight, optimum, sd = shares.ravel(), float(rng.normal(-6.0, 2.0)), float(rng.uniform(0.2, 1.0))
        spread = np.minimum(np.diag(covariance) / 0.9**weight, 4.0)
        gain = spread * weight / (weight @ (spread * weight) + sd**2)
        state = state + gain * (optimum - weight @ state)
        covariance = np.diag(np.diag((np.eye(12) - np.outer(gain, weight)) @ np.diag(spread)))
        timing.learn(dict(zip(AXES, point, strict=True)), optimum, sd_cad=sd)
        np.testing.assert_allclose(timing.table.values.ravel(), state, rtol=1e-10)
        known = (timing.table.cells["source"] == "learned").ravel()
        np.testing.assert_allclose(timing.table.cells["sd"].ravel()[known] ** 2, np.diag(covariance)[known], rtol=1e-10)
    assert known.sum() > 6


def test_one_optimum_counts_once_in_all_of_its_cells() -> None:
    timing = timings()
    timing.learn({"speed_rpm": 1400.0, "fuel_mg": 18.0}, -9.0, sd_cad=0.1)
    support = timing.table.cells["support"]
    assert support.sum() == pytest.approx(1.0)
    assert support[1, 2] > support[1, 1] > support[0, 1] > support[2, 2] == 0.0


def test_it_forgets_as_it_is_set() -> None:
    forgets, keeps = timings(0.0, forgetting=0.8), timings(0.0, forgetting=1.0)
    for optimum in [-6.0] * 60 + [-2.0] * 60:
        for timing in (forgets, keeps):
            timing.learn(CELL, optimum, sd_cad=0.5)
    assert forgets(CELL) == pytest.approx(-2.0, abs=0.01)
    assert keeps(CELL) == pytest.approx(-4.0, abs=0.05)
    assert forgets.table.cells["support"][1, 2] == pytest.approx(5.0, abs=0.01)  # 1/(1 - 0.8)
    assert sd_at(forgets, CELL) > sd_at(keeps, CELL)
    vague = timings(0.0, forgetting=0.5)
    for _ in range(20):
        vague.learn(CELL, -6.0, sd_cad=50.0)
    assert sd_at(vague, CELL) <= 3.0


def test_what_a_cell_knew_before_counts_but_support_is_of_confirmed_optima() -> None:
    cells = {"sd": 0.4, "support": 40.0, "source": "smoothed", "objective": 50.0}
    table = CalibrationMap(AXES, -5.0, name="soc_cad", cells=cells)
    timing = TimingMap(table, prior_sd_cad=2.0, forgetting=1.0)
    timing.learn(CELL, -7.0, sd_cad=0.3)
    assert timing(CELL) == pytest.approx(-5.0 - 2.0 * 0.16 / (0.16 + 0.09))
    assert timing.table.cells["support"][1, 2] == 1.0
    assert timing.table.cells["support"][1, 1] == 40.0
    assert np.isnan(timing.table.cells["objective"][1, 2])  # that of another timing
    assert timing.table.replaced(table.values, cells=table.cells) == table  # labels, task and provenance stay
    again = TimingMap(timing.table, prior_sd_cad=2.0, forgetting=1.0)
    again.learn(CELL, -7.0, sd_cad=0.3)
    assert again.table.cells["support"][1, 2] == 2.0
    sure = TimingMap(table.replaced(cells={"sd": 9.0}), prior_sd_cad=1.0, forgetting=1.0)
    sure.learn(CELL, -6.0, sd_cad=1.0)
    assert sure(CELL) == pytest.approx(-5.5)  # not less certain than the prior


# --- as a guide, in and out ---------------------------------------------------------------------------------
@pytest.mark.parametrize("point", [{"fuel_mg": 20.0}, (1500.0,), 20.0, "idle", {"fuel_mg": 20.0, "torque_nm": 90.0}])
def test_a_point_without_an_axis_is_refused(point: Any) -> None:
    for use in (timings(), lambda at: timings().learn(at, -5.0, sd_cad=0.3)):
        with pytest.raises(ParameterError, match="point"):
            use(point)


def test_outside_it_says_nothing_as_a_guide_and_learns_nothing() -> None:
    timing = timings()
    assert timing(OperatingPoint(**CELL)) == timing(CELL) == -5.6
    before = timing.table
    for change, optimum, sd in (
        ({"fuel_mg": 50.0}, -8.0, 0.3),
        ({"fuel_mg": 5.9}, -8.0, 0.3),
        ({"speed_rpm": math.nan}, -8.0, 0.3),
        ({}, math.nan, 0.3),
        ({}, -8.0, 0.0),
        ({}, -8.0, math.nan),
        ({}, -8.0, math.inf),
    ):
        if change:
            assert timing(CELL | change) is None
        with pytest.raises(ParameterError, match="inside of the axes"):
            timing.learn(CELL | change, optimum, sd_cad=sd)
    assert timing.table is before
    timing.learn(CELL, -8.0, sd_cad=0.3)
    assert timing.table is not before


def test_what_it_learnt_is_in_the_file_of_its_map(tmp_path: Path) -> None:
    timing = timings(prior_sd_cad=2.0, forgetting=0.9)
    timing.learn({"speed_rpm": 1310.0, "fuel_mg": 17.0}, -6.2, sd_cad=0.3)
    timing.learn(OperatingPoint(speed_rpm=2000.0, fuel_mg=30.0), -9.0, sd_cad=0.7)
    timing.table.save(tmp_path / "timing.nc")
    back = TimingMap(CalibrationMap.load(tmp_path / "timing.nc"), prior_sd_cad=2.0, forgetting=0.9)
    for other in (back, pickle.loads(pickle.dumps(timing))):
        assert other == timing
        other.learn(CELL, -7.0, sd_cad=0.2)
        assert other != timing
    timing.learn(CELL, -7.0, sd_cad=0.2)
    assert back == timing


@pytest.mark.parametrize("settings", [{"forgetting": 1.01}, {"forgetting": 0.0}, {"prior_sd_cad": 0.0}])
def test_settings_out_of_their_domain_are_named(settings: dict[str, float]) -> None:
    with pytest.raises(ParameterError) as refusal:
        timings(**settings)
    assert {refusal.value.field: refusal.value.value} == settings


def test_only_a_whole_map_of_timings_guides() -> None:
    holed = CalibrationMap(AXES, np.where(np.eye(3, 4), np.nan, -5.0), name="soc_cad",
                           cells={"source": np.where(np.eye(3, 4), "infeasible", "given")})  # fmt: skip
    for table, message in (
        (holed, "3 cells have no value"),
        (CalibrationMap(AXES, 80.0, name="torque_nm"), "needs '°CA aTDC'"),
        (-5.0, "must be a CalibrationMap"),
    ):
        with pytest.raises(Error, match=message):
            TimingMap(table)  # type: ignore[arg-type]
    with pytest.raises(DataError):
        TimingMap(holed.to_dataset())  # a Dataset is taken, and judged


# --- seekers ------------------------------------------------------------------------------------------------
def settle(ff: FeedForward, fuel: float, cycles: int, seed: int = 0) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(cycles):
        ff.at({"fuel_mg": fuel})
        ff.tell(56.0 - 0.0255 * (float(ff.ask()[0]) + 0.35 * fuel) ** 2 + 0.05 * rng.standard_normal())


def test_only_a_settled_estimate_is_confirmed() -> None:
    timing = timings(-20.0, {"fuel_mg": [10.0, 20.0, 40.0]})
    ff = FeedForward(ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0)), timing)
    at = {"fuel_mg": 20.0}
    settle(ff, 20.0, 60)
    assert not timing.learn_from(ff, at)  # too short
    settle(ff, 20.0, 50)
    assert not timing.learn_from(ff, at)  # still on its way
    assert set(timing.table.cells["source"]) == {"given"}
    settle(ff, 20.0, 500)
    assert timing.learn_from(ff, at)
    assert timing(at) == pytest.approx(-7.0, abs=0.8)
    assert timing.table.cells["support"].tolist() == [0.0, 1.0, 0.0]
    settle(ff, 40.0, 50)
    assert not timing.learn_from(ff, {"fuel_mg": 40.0})  # of two operating points
    with pytest.raises(ParameterError, match="cycles"):
        timing.learn_from(ff, at, cycles=1)


def test_a_map_that_has_learnt_makes_the_next_step_at_once() -> None:
    timing = timings(-10.0, {"fuel_mg": [10.0, 20.0, 40.0]})
    ff = FeedForward(ExtremumSeeking(start=-10.0, bounds=(-30.0, 10.0)), timing)
    for fuel in (10.0, 20.0, 40.0):
        settle(ff, fuel, 500, seed=int(fuel))
        assert timing.learn_from(ff, {"fuel_mg": fuel})
    ff.recalibrated()
    settle(ff, 40.0, 20, seed=1)
    settle(ff, 15.0, 2, seed=2)
    assert ff.verdict == "confirmed"
    assert ff.estimate[0] == pytest.approx(-0.35 * 15.0, abs=1.0)
