"""Studies of the throttle: the habits of the plant, the first-principle fit of noisy logs, the controllers."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from mgdd.identify.throttle.free_run import quality_of
from mgdd_studies import run_study
from mgdd_studies.base import StudyResult
from mgdd_studies.throttle_cases import throttle_of
from mgdd_studies.throttle_faults import CASES as FAULTS
from mgdd_studies.throttle_tracking import (
    CASES,
    controllers_of,
    row_of,
    run_case,
    throttles_of,
    warm_rows,
)


@pytest.fixture(scope="module")
def habits(quick_study):
    return quick_study("throttle-characteristics")


def values(result, effect):
    return {row["condition"]: row["value"] for row in result.summary["rows"] if row["effect"] == effect}


def test_swing_shrinks_with_the_frequency(habits):
    spans = values(habits, "rate dependence")
    expected = {0.1: 82.3, 0.5: 62.0, 1.0: 33.0, 2.0: 16.2, 5.0: 5.8, 10.0: 2.4}
    for frequency, span in expected.items():
        assert spans[f"span at {frequency:g} Hz"] == pytest.approx(span, rel=0.03), frequency
    from_02 = list(spans.values())[1:]
    assert from_02 == sorted(from_02, reverse=True)


def test_slow_ramp_shows_twice_the_friction(habits):
    (row,) = [row for row in habits.summary["rows"] if row["effect"] == "hysteresis"]
    assert row["closed_form"] == pytest.approx(0.1854, abs=5e-5)
    assert row["value"] == pytest.approx(0.1975, abs=0.002)


def test_air_moves_the_plate_at_constant_duty(habits):
    air = values(habits, "air flow")
    assert air["-0.4 N m, at rest after opening"] == pytest.approx(0.0, abs=1e-6)
    assert air["0 N m, at rest after closing"] == pytest.approx(0.0, abs=1e-3)
    assert air["-0.1 N m, at rest after closing"] < -30.0
    assert air["-0.4 N m, at rest after unloaded"] < air["-0.3 N m, at rest after unloaded"] < -5.0


def test_groups_are_found_also_where_the_plant_does_more(quick_study):
    result = quick_study("throttle-first-principle")
    errors = {(row["case"], row["group"]): abs(row["error_percent"]) for row in result.summary["rows"]}
    bounds = {
        "tau_s": 8.0,
        "gain_deg_per_s2_per_duty": 5.0,
        "beta_above_duty": 1.0,
        "kappa_above_duty_per_deg": 8.0,
        "delta_duty": 4.0,
    }
    for group, bound in bounds.items():
        assert errors["P1 with inductance and Stribeck friction", group] <= bound, group
    for fit in result.summary["fits"]:
        assert fit["train_percent"] >= 98.0, fit["case"]


@pytest.mark.parametrize(
    "study", ["throttle-first-principle", pytest.param("throttle-pseudo-wiener", marks=pytest.mark.slow)]
)
def test_a_fit_in_percent_is_that_of_every_throttle_fit(quick_study, study):
    """The last record of a study is in its dataset: its stated fit leaves out the first 50 ms, like any other."""
    result = quick_study(study)
    if study == "throttle-first-principle":
        stated = {fit["case"]: fit["random_steps_percent"] for fit in result.summary["fits"]}
    else:
        rows = [row for row in result.summary["rows"] if row["lag_start"] == "rest"]
        stated = {f"{row['plant']} {row['model']}": row["fit_steps_percent"] for row in rows}
    for case, percent in stated.items():
        assert percent == quality_of([result.dataset.sel(case=case)]).nrmse_fit_percent, case


def test_the_torque_demand_study_says_what_each_part_is_worth():
    """All cases: they take two seconds."""
    result = run_study("torque-demand")
    assert result.summary["seeds"] == 0
    rows = {row["case"]: row for row in result.summary["rows"]}
    believed = rows["as believed"]
    assert abs(believed["hold_error_nm"]) < 1.0
    assert abs(believed["end_error_nm"]) < 1.0
    assert believed["tip_in_t90_s"] < 0.6 * rows["no filling fed forward"]["tip_in_t90_s"]
    # Near the ambient pressure an engine that breathes less shows only in the measured pressure.
    weak, blind = rows["breathes 10 % less"], rows["breathes 10 % less, no measured pressure"]
    assert abs(weak["end_error_nm"]) < 1.0
    assert blind["end_error_nm"] < -4.0
    # Air is metered at the throttle: 10 % more of it is 10 % more indicated torque.
    free = rows["throttle flows 10 % more"]
    wanted = result.dataset["wanted_torque_nm"].sel(case="as believed").to_numpy()[2999]
    assert free["hold_error_nm"] == pytest.approx(0.1 * (wanted + 21.0), abs=1.2)


def test_the_study_of_faults_says_so_in_a_table(quick_study: Callable[..., StudyResult]) -> None:
    result = quick_study("throttle-faults")
    rows = result.summary["rows"]
    assert {(row["fault"], row["controller"]) for row in rows} == {
        (name, kind) for name in FAULTS for kind in ("PID", "sliding mode")
    }
    for row in rows:
        case = FAULTS[row["fault"]]
        assert (row["mode"], row["reason"]) == (case.mode, case.reason)
        assert row["safe_ms"] <= 50.0
        assert row["kept"]
        assert row["recovered"]
        assert (row["return_ms"] is None) == (case.mode != "limp_home" or not case.returns)


@pytest.mark.slow
def test_a_study_ranks_the_kinds(quick_study: Callable[..., StudyResult]) -> None:
    result = quick_study("throttle-pseudo-wiener")
    rows = {(row["plant"], row["model"]): row for row in result.summary["rows"] if row["lag_start"] != "best"}
    better = {(row["plant"], row["model"]): row for row in result.summary["rows"] if row["lag_start"] == "best"}
    printed = {"P1": {"pw_r": 99.4, "pw_w": 79.3, "pw_p": 53.7}, "P2": {"pw_r": 99.4, "pw_w": 92.0, "pw_p": 82.4}}
    for plant, kinds in printed.items():
        for kind, train in kinds.items():
            row = rows[plant, kind]
            assert row["fit_train_percent"] >= train - 0.05
            assert row["ahead_20_ms_deg"] < rows[plant, "persistence"]["ahead_20_ms_deg"]
        assert rows[plant, "pw_r"]["ahead_20_ms_deg"] <= 0.06
    for case, row in better.items():
        assert row["fit_train_percent"] >= rows[case]["fit_train_percent"] - 0.3
    ahead = [rows["P1", kind]["ahead_20_ms_deg"] for kind in ("pw_r", "pw_w", "pw_p", "persistence")]
    assert ahead == sorted(ahead)
    assert 0.55 <= rows["P1", "pw_w"]["ahead_20_ms_deg"] <= 0.70
    assert rows["P1", "pw_r"]["fit_steps_percent"] >= 96.0
    assert rows["P1", "pw_w"]["fit_steps_percent"] <= 50.0
    assert rows["P1", "persistence"]["ahead_20_ms_deg"] == pytest.approx(1.548, abs=0.01)
    assert len(result.figures) == 4


@pytest.fixture(scope="module")
def few() -> dict[str, dict[str, float]]:
    runs = run_case("unknown", "P1", 12)
    return {str(kind): row_of("unknown", "P1", str(kind), runs) for kind in runs["controller"].to_numpy()}


def test_the_guided_controller_is_not_beaten_where_it_says_so(few: dict[str, dict[str, float]]) -> None:
    guided = few.pop("guided")
    assert guided["limit_cycles"] == 0
    assert guided["variation_rest"] < 0.01 < min(row["variation_rest"] for row in few.values())
    for name in ("large_p95_ms", "small_p95_ms", "up_p95_ms", "down_p95_ms", "sine_mse_deg2"):
        assert guided[name] <= 1.2 * min(row[name] for row in few.values()), name


def test_far_throttles_unsettle_the_baselines_only() -> None:
    runs = run_case("far", "P1", 16)
    rows = {kind: row_of("far", "P1", kind, runs) for kind in ("guided", "linear_mpc", "pid")}
    assert rows["guided"]["limit_cycles"] == 0
    assert rows["guided"]["small_p95_ms"] < min(rows["linear_mpc"]["small_p95_ms"], rows["pid"]["small_p95_ms"])


@pytest.mark.parametrize("name", CASES)
def test_a_case_does_what_it_says(name: str) -> None:
    case = CASES[name]
    throttles = throttles_of(case, "P1", 3)
    assert throttles == throttles_of(case, "P1", 3)
    assert len({throttle.coulomb_nm for throttle in throttles}) == 3
    assert all((throttle.friction == "lugre") == case.bristles for throttle in throttles)
    known = controllers_of(case, throttle_of("P1"))
    assert list(known) == list(case.controllers)


def test_what_was_learnt_is_worth_knowing_it() -> None:
    rows = {(row["wrong"], row["controller"]): row for row in warm_rows("P1", 5)}
    for wrong in ("friction 40 % higher", "preload 40 % higher"):
        for column in ("sine_mse_deg2", "crossing_mse_deg2"):
            assert rows[wrong, "after 2 s"][column] <= 1.25 * rows[wrong, "known"][column]


@pytest.fixture(scope="module")
def quick(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("throttle-tracking")


def test_the_study_runs_and_draws(quick: StudyResult) -> None:
    result = quick
    assert [row["controller"] for row in result.summary["rows"]] == list(CASES["unknown"].controllers)
    assert set(result.dataset["settling_ms"].dims) == {"preset", "throttle", "controller", "reference"}
    assert np.isfinite(result.dataset["mse_deg2"].to_numpy()).all()
    (figure,) = result.figures.values()
    assert len(figure.axes) == 4


def test_the_page_has_a_table_of_every_case(root: Path, study_tables: ModuleType, quick: StudyResult) -> None:
    """Cases, presets and controllers alone: the numbers there are of 100 throttles, by `tools/study_tables.py`."""
    text = (root / "docs" / "throttle_tracking.md").read_text(encoding="utf-8")
    page = text.splitlines()
    some = quick.summary["rows"][0]
    rows = [
        some | {"case": case.text, "preset": preset, "controller": controller}
        for case in CASES.values()
        for preset in case.presets
        for controller in case.controllers
    ]
    driven = {"controller": "cold", "sine_mse_deg2": 1e-3, "crossing_mse_deg2": 1e-3}
    warm = [
        driven | {"preset": preset, "wrong": f"{what} 40 % higher"}
        for preset in ("P1", "P2", "P3")
        for what in ("friction", "preload")
    ]
    warm += [warm[0] | {"controller": each} for each in ("after 2 s", "known")]
    tables = study_tables.tables("throttle-tracking", quick.summary | {"rows": rows, "warm": warm})
    assert list(tables) == [*(case.text for case in CASES.values()), "warm"]
    for name, lines in tables.items():
        at, labels = page.index(lines[0]), 1 if name == "warm" else 2
        for made, printed in zip(lines[2:], page[at + 2 :], strict=False):
            assert made.split(" | ")[:labels] == printed.split(" | ")[:labels]
    made = study_tables.put_into(text, "throttle-tracking", quick.summary)
    assert made != text
    assert study_tables.put_into(made, "throttle-tracking", quick.summary) == made
