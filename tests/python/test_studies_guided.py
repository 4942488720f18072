"""The study `guided`: a rough model saves cycles and J at the start, and its option of the measured engine."""

from __future__ import annotations

import json

import pytest

from mgdd import datasets
from mgdd.cli import main
from mgdd.errors import DataError, ParameterError
from mgdd.results.labels import check_labels, to_jsonable
from mgdd.studies import StudyResult, run_study

needs_records = pytest.mark.skipif(
    "h2df_502" not in datasets.available(), reason="MGDD_DATA_DIR holds no folder h2df_502"
)


@pytest.fixture(scope="module")
def bench() -> StudyResult:
    return run_study("guided", quick=True)


def rows(result: StudyResult) -> dict[str, dict[str, float]]:
    return {row["case"]: row for row in result.summary["rows"]}


def test_the_result_is_whole(bench: StudyResult) -> None:
    check_labels(bench.dataset)
    json.dumps(to_jsonable(bench.summary), allow_nan=False)
    assert (bench.summary["seeds"], bench.summary["plant"]) == (20, "virtual bench")
    assert list(rows(bench)) == ["unguided", "feed_forward", "curve", "parabola"]
    assert len(bench.figures) == 2


def test_a_guide_4_cad_wrong_saves_cycles_and_j(bench: StudyResult) -> None:
    assert bench.summary["guide_cad"] - bench.summary["optimum_cad"] == pytest.approx(4.1, abs=0.05)
    own = rows(bench)
    assert own["feed_forward"]["cycles_to_1_cad_high"] < 0.5 * own["unguided"]["cycles_to_1_cad_low"]
    for case in ("curve", "parabola"):
        assert own[case]["cycles_to_1_cad_high"] <= 8
        assert own[case]["cycles_stays_1_5_cad"] <= 8
        assert own[case]["lost_j_cycles_high"] < 0.5 * own["feed_forward"]["lost_j_cycles_low"]
        assert own[case]["late_loss_high"] < own["unguided"]["late_loss_low"]


def test_every_case_ends_at_the_same_place(bench: StudyResult) -> None:
    for row in bench.summary["rows"]:
        assert row["final_cad"] == pytest.approx(bench.summary["optimum_cad"], abs=0.5)


def test_losses_are_those_of_the_applied_timings(bench: StudyResult) -> None:
    lost = bench.dataset["lost_j_cycles"]
    assert (lost.diff("cycle") >= -1e-6).all()  # nothing beats the steady optimum
    assert lost.sel(case="unguided")[99] == pytest.approx(rows(bench)["unguided"]["lost_j_cycles"])


@needs_records
def test_a_rough_model_of_another_engine_and_fuel_guides_the_measured_one() -> None:
    result = run_study("guided", seeds=12, real=True)
    check_labels(result.dataset)
    assert result.summary["plant"] == "surrogate of the measured engine"
    assert abs(result.summary["guide_cad"] - result.summary["optimum_cad"]) > 3.0
    own = rows(result)
    assert own["curve"]["cycles_to_1_cad"] < 0.1 * own["unguided"]["cycles_to_1_cad"]
    assert own["curve"]["lost_j_cycles_high"] < 0.2 * own["unguided"]["lost_j_cycles_low"]


def test_records_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MGDD_DATA_DIR", raising=False)
    with pytest.raises(DataError, match="study guided needs the records"):
        run_study("guided", seeds=1, real=True)


def test_the_option_belongs_to_this_study(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "sensor-delay", "--real"]) == 2
    assert (
        "--real does not act here; it is an option of the study guided, not of sensor-delay" in capsys.readouterr().err
    )
    assert main(["study", "--list", "--real"]) == 2
    assert "--real" in capsys.readouterr().err
    with pytest.raises(ParameterError, match="real"):
        run_study("sensor-delay", real=True)
