"""Studies of guides: what each case is, counted by hand, the transients, and what few seeds already show."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from mgdd.engine import OperatingPoint
from mgdd.loop import VirtualEngine
from mgdd_studies.base import StudyResult
from mgdd_studies.guide_accuracy import HARD, HardCase, run_hard
from mgdd_studies.guide_cases import (
    GUIDES,
    HIGH,
    LOW,
    PLANT,
    Guide,
    SpeedLoadPlane,
    SteadyMap,
    curve_seeker,
    drive,
    trimmed,
    verdict_on,
)
from mgdd_studies.guided_transients import Plane, plane_row, run_plane
from mgdd_studies.statistics import first_within, median_interval, stays_within, with_median_interval

GUIDE = {guide.name: guide for guide in GUIDES}


@pytest.fixture(scope="module")
def start_up(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("guided-start-up")


@pytest.fixture(scope="module")
def accuracy(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("guide-accuracy")


def test_median_interval_by_hand() -> None:
    values = [7.0, 1.0, 5.0, 3.0, 9.0, 11.0]  # 1 - 2/2^6 = 0.969 between the smallest and the largest of six
    assert median_interval(values) == (6.0, 1.0, 11.0)
    assert median_interval([3.0, 1.0, 2.0])[0] == 2.0
    assert np.isnan(median_interval([3.0, 1.0, 2.0])[1:]).all()
    assert median_interval([1.0, math.inf, math.inf])[0] == math.inf  # one that never arrives counts
    assert with_median_interval("x", [1.0, math.inf, math.inf])["x"] is None


@pytest.mark.parametrize("size", [6, 20, 200])
def test_median_interval_covers_whatever_the_distribution(size: int) -> None:
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(2000):
        _, low, high = median_interval(rng.exponential(size=size))
        inside += low <= math.log(2.0) <= high
    assert 0.94 <= inside / 2000 <= 0.985


def test_counts_of_cycles_by_hand() -> None:
    estimate = np.array([5.0, 1.5, 4.0, 1.9, 2.2])
    assert first_within(estimate, 2.0, 0.5) == 1.0
    assert stays_within(estimate, 2.0, 0.5) == 3.0
    assert stays_within(estimate[:3], 2.0, 0.5) == math.inf
    assert stays_within(estimate, 2.0, 9.0) == 0.0
    assert first_within(estimate, -2.0, 0.5) == math.inf


def test_a_bar_is_met_by_all_or_not() -> None:
    said = verdict_on("loss", [0.1, 0.4, 0.2], "at most 0.3", high=0.3)
    assert (said["worst"], said["cases"], said["cases_met"], said["met"]) == (0.4, 3, 2, False)
    both = verdict_on("held", [91.0, 98.0], "90 to 99", low=90.0, high=99.0)
    assert (both["cases_met"], both["met"]) == (2, True)
    assert verdict_on("held", [math.nan], "at most 1", high=1.0)["met"] is False  # what is missing is not met


def test_a_guide_is_wrong_in_what_its_name_says() -> None:
    law = OperatingPoint(fuel_mg=14.0, speed_rpm=2100.0)
    told = law.replace(burn_duration_cad=0.85 * 30.0 * (14.0 / 20.0) ** 0.6 * 1.4**0.3)
    exact, short = GUIDE["exact"], GUIDE["duration -15 %"]
    assert short(law)["soc_cad"] == pytest.approx(exact(told)["soc_cad"], abs=0.05)
    assert short(HIGH)["soc_cad"] == pytest.approx(exact(HIGH.replace(burn_duration_cad=37.4))["soc_cad"], abs=1e-9)
    assert short.curve(HIGH).best == pytest.approx(short(HIGH)["soc_cad"], abs=0.05)
    wrong = GUIDE["wrong sign"]
    moved = [guide(HIGH)["soc_cad"] - guide(LOW)["soc_cad"] for guide in (exact, wrong)]
    assert moved[0] < -5.0
    assert moved[1] == pytest.approx(-moved[0], abs=1e-9)
    assert wrong.curve(HIGH).best == pytest.approx(wrong(HIGH)["soc_cad"], abs=0.05)
    assert wrong.curve(LOW) == exact.curve(LOW)


def test_a_motored_point_has_no_guide() -> None:
    with pytest.raises(ArithmeticError, match="exact"):
        Guide("exact", PLANT)(OperatingPoint(fuel_mg=0.0))


def test_loss_is_that_of_the_steady_map() -> None:
    steady = SteadyMap.of(VirtualEngine(point=HIGH))
    bench = VirtualEngine(point=HIGH, soc_scatter_cad=0.0, efficiency_noise_percent=0.0)
    j = [bench.step(soc)["j"] for soc in (steady.best_cad, -17.3)]
    assert steady.best_cad == pytest.approx(-10.7, abs=0.1)
    assert steady.lost(np.array([-17.3]))[0] == pytest.approx(j[0] - j[1], abs=2e-4)


def test_what_comes_late_is_seen_by_the_plant_alone() -> None:
    quiet = {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}
    seeker = curve_seeker(GUIDE["exact"].curve(OperatingPoint()))
    run = drive(VirtualEngine(**quiet), seeker, 120, late_by_cad=lambda _: 4.0)
    best = SteadyMap.of(VirtualEngine()).best_cad
    assert run.estimate[-1] == pytest.approx(best - 4.0, abs=0.5)
    assert run.applied[-40:].mean() == pytest.approx(best, abs=0.5)


def test_a_feed_forward_without_a_guide_starts_far_and_with_one_near() -> None:
    for guide, start in ((None, -20.0), (GUIDE["adiabatic"], GUIDE["adiabatic"](LOW)["soc_cad"])):
        run = drive(VirtualEngine(point=LOW, soc_scatter_cad=0.0), trimmed(guide), 3)
        assert run.estimate[0] == pytest.approx(start, abs=1e-9)


def test_a_jump_moves_the_target_and_not_the_height() -> None:
    case = HardCase(name="jump", jump_cad=6.0)
    assert [case.late_by_cad(k) for k in (0, 199, 200, 400)] == [0.0, 0.0, 6.0, 6.0]
    hard = run_hard(case, 10)
    assert np.median(hard.error[:, 200]) > 4.0  # the estimate stands where it was, the target lies six earlier
    assert abs(np.median(hard.error[:, -50:])) < 1.0
    assert hard.row["median_back"] <= 10.0


def test_start_up_few_seeds(start_up: StudyResult) -> None:
    rows = {row["guide"]: row for row in start_up.summary["rows"]}
    assert list(rows)[:2] == ["none", "exact"]
    assert "wrong sign" not in rows
    assert rows["exact"]["cycles_to_1_cad"] == 0.0
    assert rows["none"]["cycles_to_1_cad"] == pytest.approx(125.0, abs=30.0)
    assert rows["wall heat +30 %"]["times_fewer"] > 2.5
    assert rows["adiabatic"]["guide_error_cad"] == pytest.approx(-7.8, abs=0.1)


def test_every_curve_arrives_from_both_starts(start_up: StudyResult) -> None:
    rows = start_up.summary["curve"]
    assert len({row["case"] for row in rows}) == 12
    assert [sum(row["case"] == name for row in rows) for name in {row["case"] for row in rows}] == [2] * 12
    assert max(row["first_95_percent"] for row in rows) <= 40.0
    assert max(row["late_loss_percent"] for row in rows) <= 0.03
    far = {row["start_cad"] for row in rows if row["case"].startswith("plant Wiebe 60")}
    assert 0.0 in far


@pytest.mark.slow
def test_accuracy_few_seeds(accuracy: StudyResult) -> None:
    rows = {(row["form"], row["guide"]): row for row in accuracy.summary["rows"]}
    assert len(rows) == 1 + 2 * len(GUIDES)
    none = rows["feed-forward", "none"]
    assert none["excess_percent_of_unguided"] == pytest.approx(100.0, abs=1e-9)
    assert none["final_shift_cad"] == 0.0
    assert rows["feed-forward", "wrong sign"]["found_wrong_percent"] == 100.0
    assert rows["feed-forward", "exact"]["found_wrong_percent"] == 0.0
    for form in ("feed-forward", "curve"):
        for name in ("wall heat -30 %", "wall heat +30 %", "duration -15 %"):
            assert rows[form, name]["lost"] < 0.4 * none["lost"]


@pytest.mark.slow
def test_trouble_few_seeds(accuracy: StudyResult) -> None:
    rows = {row["trouble"]: row for row in accuracy.summary["trouble"]}
    assert list(rows) == [case.name for case in HARD]
    for name in (
        "efficiency late, delay known",
        "efficiency late, delay given 4 short",
        "efficiency late, delay given 4 long",
    ):
        assert rows[name]["median_first"] <= 45.0
    assert all((row["median_back"] is not None) == name.startswith("jump") for name, row in rows.items())


@pytest.fixture(scope="module")
def result(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("guided-transients")


def test_cells_are_compared_one_by_one() -> None:
    none = Plane(form="none", name="none", cycles=np.array([[50.0, 0.0]]), lost=np.array([[20.0, 2.0]]))
    own = Plane(form="curve", name="own", cycles=np.array([[10.0, 2.0]]), lost=np.array([[5.0, 2.5]]))
    row = plane_row(own, none)
    assert (row["cells"], row["cells_slower"], row["cells_costlier"]) == (2, 1, 1)
    assert row["worst_cost_over_unguided"] == 1.25
    lost = np.array([[20.1, 2.01]])  # half a percent more
    near = Plane(form="curve", name="near", cycles=np.array([[60.0, 0.0]]), lost=lost)
    assert (plane_row(near, none)["cells_slower"], plane_row(near, none)["cells_costlier"]) == (1, 0)
    assert (row["mean_cycles"], row["mean_cycles_saved"]) == (6.0, 19.0)
    assert row["lost_over_unguided"] == pytest.approx(7.5 / 22.0)


def test_a_guide_reaches_a_far_cell_at_once_and_the_plain_seeker_does_not() -> None:
    cell = SpeedLoadPlane([2700.0], [34.0])
    name = "wall heat -30 %"
    none, heat, curve = (
        run_plane(form, name, cell) for form, name in (("none", "none"), ("feed-forward", name), ("curve", name))
    )
    assert none.cycles[0, 0] > 60.0
    assert heat.cycles[0, 0] <= 3.0  # two cycles of the test of the guide
    assert heat.lost[0, 0] < 0.2 * none.lost[0, 0]
    assert curve.cycles[0, 0] <= 1.0  # the curve needs no test
    assert curve.lost[0, 0] < 0.5 * heat.lost[0, 0]


@pytest.mark.slow
def test_sequence_few_seeds(result: StudyResult) -> None:
    rows = {(row["form"], row["guide"]): row for row in result.summary["rows"]}
    assert len(rows) == 7
    assert rows["none", "none"]["lost_over_unguided"] == pytest.approx(1.0)
    for key, row in rows.items():
        if key[0] != "none":
            assert row["moving_over_unguided"] < 0.5, key
    data = result.dataset
    steps = np.flatnonzero(np.diff(data["speed_rpm"]) ** 2 + np.diff(data["fuel_mg"]) ** 2)
    assert [int(step) + 1 for step in steps] == list(range(250, 3000, 250))


@pytest.mark.slow
def test_loss_of_the_table_is_that_of_the_dataset(result: StudyResult) -> None:
    whole = result.dataset["lost_per_100"].mean("middle_cycle").to_numpy()
    assert whole == pytest.approx([row["lost_per_100"] for row in result.summary["rows"]], rel=1e-12)


@pytest.mark.slow
def test_plane_few_cells(result: StudyResult) -> None:
    rows = {(row["form"], row["guide"]): row for row in result.summary["plane"]}
    assert rows["none", "none"]["mean_cycles_saved"] == 0.0
    met = []
    for form in ("feed-forward", "curve"):
        assert rows[form, "wall heat +30 %"]["mean_cycles_saved"] > 30.0
        good = [rows[form, name] for name in ("wall heat -30 %", "wall heat +30 %", "duration -15 %")]
        met += [
            all(row["cells_slower"] == 0 for row in good),
            all(row["cells_costlier"] == 0 for row in good),
            rows[form, "adiabatic"]["worst_cost_over_unguided"] <= 1.2,
        ]
    assert [bar["met"] for bar in result.summary["bars"]] == met
