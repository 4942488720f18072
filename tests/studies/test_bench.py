"""The studies of seekers, sensors and tests on the virtual bench: laws of their tables, labels, figures."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from mgdd.loop import VirtualEngine
from mgdd_studies import run_study
from mgdd_studies.base import StudyResult


@pytest.fixture(scope="module")
def seekers(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("seeker-comparison")


@pytest.fixture(scope="module")
def sensors(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("nox-sensors")


@pytest.fixture(scope="module")
def four_tests(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("timing-tests")


def test_without_figures_and_with_seeds() -> None:
    result = run_study("nox-sensors", n_seeds=1, figures=False)
    assert result.figures == {}
    assert result.summary["seeds"] == 1
    assert result.summary["rows"][0]["steady_error_percent_low"] is None  # one seed says nothing of its spread


# --- seekers ------------------------------------------------------------------------------------------------
def test_every_form_of_every_seeker_competes_and_arrives(seekers: StudyResult) -> None:
    rows = {row["seeker"]: row for row in seekers.summary["rows"]}
    assert len(rows) == 10
    assert all(row["share_arrived"] == 1.0 for row in rows.values())
    best = VirtualEngine().find_optimum()["soc_cad"]
    assert seekers.summary["optimum_cad"] == pytest.approx(best)
    for row in rows.values():
        assert row["final_cad"] == pytest.approx(best, abs=1.0), row["seeker"]
        assert row["j_lost"] > 0.0, row["seeker"]


def test_tuning_is_faster_and_dearer(seekers: StudyResult) -> None:
    rows = {row["seeker"]: row for row in seekers.summary["rows"]}
    plain, tuned = rows["extremum seeking, batch"], rows["extremum seeking, batch, tuned"]
    assert tuned["cycles_to_1_cad_high"] < 0.5 * plain["cycles_to_1_cad_low"]
    assert tuned["rms_cad"] < plain["rms_cad"]
    assert tuned["j_lost_low"] > plain["j_lost_high"]
    # Loss by dither and error to second order: J''/2 (A^2/2 + rms^2), and the scatter of combustion.
    curvature = abs(seekers.summary["curvature_percent_per_cad2"])
    for row, amplitude in ((plain, 1.0), (tuned, 3.38)):
        predicted = 0.5 * curvature * (0.5 * amplitude**2 + row["rms_cad"] ** 2 + 0.3**2)
        assert row["j_lost"] == pytest.approx(predicted, abs=0.012), row["seeker"]
    assert rows["two-sided differences"]["rms_cad"] > 2.0  # fast, and at the mercy of the noise


def test_bands_hold_the_estimates(seekers: StudyResult) -> None:
    data = seekers.dataset
    assert (data["estimate_low_cad"] <= data["estimate_median_cad"]).all()
    assert (data["estimate_median_cad"] <= data["estimate_high_cad"]).all()
    np.testing.assert_array_equal(data["estimate_median_cad"][:, 0], -20.0)


def test_learning_removes_the_repeated_part(seekers: StudyResult) -> None:
    rows = {row["law"]: row for row in seekers.summary["iterative_learning"]}
    assert list(rows) == ["p", "q_filter", "norm_optimal"]
    for law in ("p", "norm_optimal"):
        assert rows[law]["sigma_max"] < 1.0
        assert rows[law]["last_rms_cad"] < 0.12 * rows[law]["first_rms_cad"]
        assert rows[law]["last_rms_cad"] > 0.29  # the scatter of combustion does not repeat
    assert rows["q_filter"]["last_rms_cad"] > rows["p"]["last_rms_cad"]  # the filter cannot follow the step
    assert len({row["first_rms_cad"] for row in rows.values()}) == 1


# --- sensors ------------------------------------------------------------------------------------------------
def test_times_to_90_percent_are_those_of_delay_and_lag(sensors: StudyResult) -> None:
    rows = {row["sensor"]: row for row in sensors.summary["rows"]}
    expected = 38 + math.ceil(25.0 * math.log(10.0)) - 1  # 3 s and 2 s at 80 ms per cycle
    assert rows["analyser"]["timing_step_t90_cycles"] == expected
    assert rows["analyser"]["timing_step_t90_s"] == pytest.approx(0.08 * expected)
    for sensor in ("soft sensor, wrong proxy", "soft sensor, fitted proxy"):
        assert rows[sensor]["timing_step_t90_cycles"] == rows[sensor]["load_step_t90_cycles"] == 0
    assert 0 < rows["fast sensor"]["timing_step_t90_cycles"] <= 3
    assert rows["soft sensor, wrong proxy held to the analyser"]["load_step_t90_cycles"] > expected


def test_steady_errors(sensors: StudyResult) -> None:
    rows = {row["sensor"]: row for row in sensors.summary["rows"]}
    assert rows["analyser"]["steady_error_percent"] < 0.3
    assert 20.0 < rows["soft sensor, wrong proxy"]["steady_error_percent"] < 32.0
    assert rows["soft sensor, wrong proxy held to the analyser"]["steady_error_percent"] < 0.3
    assert 0.5 < rows["soft sensor, fitted proxy"]["steady_error_percent"] < 3.0


def test_the_fit_finds_the_map_of_the_plant(sensors: StudyResult) -> None:
    fits = {row["map"]: row for row in sensors.summary["fits"]}
    arrhenius = fits["arrhenius"]
    assert arrhenius["activation_temperature_k"] == pytest.approx(16000.0, abs=60.0)
    assert arrhenius["reference_nox_ppm"] == pytest.approx(1200.0, abs=2.0)
    assert arrhenius["residual_percent"] < 0.3 * fits["affine_log"]["residual_percent"]
    nox = [row["nox_true_ppm"] for row in sensors.summary["sweep"]]
    assert all(early > late for early, late in itertools.pairwise(nox))  # advance makes NOx


def test_the_correction_takes_a_hundred_cycles_per_e_fold(sensors: StudyResult) -> None:
    (course,) = sensors.summary["correction"]
    start = -math.log1p(course["start_error_percent"] / 100.0)
    predicted = 100.0 * math.log(start / -math.log(0.98))
    assert course["cycles_to_2_percent"] == pytest.approx(predicted, rel=0.15)
    assert abs(course["final_error_percent"]) < 0.3


# --- tests --------------------------------------------------------------------------------------------------
def test_each_test_ends_at_the_optimum_of_its_own_performance(four_tests: StudyResult) -> None:
    rows = four_tests.summary["rows"]
    assert [row["test"][0] for row in rows] == list("1234")
    assert [row["start_cad"] for row in rows] == [-20.0, 5.0, -20.0, -20.0]
    optima = [-5.63, -5.63, -0.65, -0.67]
    assert [row["optimum_cad"] for row in rows] == pytest.approx(optima, abs=0.02)
    for row in rows:
        assert row["share_arrived"] == 1.0
        assert row["final_cad_low"] - 0.1 < row["optimum_cad"] < row["final_cad_high"] + 0.1
        assert row["gain_percent_points_low"] > 0.0


def test_before_and_after_belong_together(four_tests: StudyResult) -> None:
    for row in four_tests.summary["rows"]:
        weight = 0.004 if "NOx" in row["test"] else 0.0
        gain = row["efficiency_after_percent"] - row["efficiency_before_percent"]
        gain -= weight * (row["nox_after_ppm"] - row["nox_before_ppm"])
        assert row["gain_percent_points"] == pytest.approx(gain)


def test_nox_costs_efficiency_and_the_soft_sensor_saves_time(four_tests: StudyResult) -> None:
    efficiency, _, analyser, soft = four_tests.summary["rows"]
    for row in (analyser, soft):
        assert row["nox_after_ppm_high"] < 0.8 * efficiency["nox_after_ppm_low"]
        assert row["efficiency_after_percent_high"] < efficiency["efficiency_after_percent_low"]
    assert soft["cycles_to_1_cad_high"] < 0.6 * analyser["cycles_to_1_cad_low"]


def test_the_limited_run_keeps_its_limit(four_tests: StudyResult) -> None:
    (row,) = four_tests.summary["limited"]
    assert row["optimum_cad"] > four_tests.summary["rows"][0]["optimum_cad"] + 2.0
    assert row["final_cad"] > row["optimum_cad"]
    assert row["worst_p_max_bar"] > 150.0  # the early start
    assert (row["judged_from"], row["above_share"] > row["judged_above_share"] > 0.01) == (1000, True)
    assert row["exceed_above_bar"] > 97.0
    assert row["exceeded_share"] < 0.01
