"""The study `guided`: a rough model saves cycles and J at the start, and its option of the measured engine."""

from collections.abc import Callable

import numpy as np
import pytest

from mgdd import datasets
from mgdd.cli import main
from mgdd.errors import DataError, ParameterError
from mgdd.results.labels import check_labels
from mgdd_studies import run_study
from mgdd_studies.base import StudyResult
from mgdd_studies.guided import LimitedRuns, limited_parts
from mgdd_studies.measured_engine import fit_surrogate
from mgdd_studies.measured_engine_cases import measured_guide

needs_records = pytest.mark.skipif("h2df_502" not in datasets.names(), reason="MGDD_DATA_DIR holds no folder h2df_502")


@pytest.fixture(scope="module")
def bench(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("guided")


def rows(result: StudyResult) -> dict[str, dict[str, float]]:
    return {row["case"]: row for row in result.summary["rows"]}


def test_the_result_is_whole(bench: StudyResult) -> None:
    assert (bench.summary["seeds"], bench.summary["plant"]) == (20, "virtual bench")
    assert list(rows(bench)) == ["unguided", "feed_forward", "curve", "parabola"]


def test_a_guide_4_cad_wrong_saves_cycles_and_j(bench: StudyResult) -> None:
    assert bench.summary["guide_cad"] - bench.summary["optimum_cad"] == pytest.approx(4.1, abs=0.05)
    own = rows(bench)
    assert own["feed_forward"]["cycles_to_1_cad_high"] < 0.5 * own["unguided"]["cycles_to_1_cad_low"]
    for case in ("curve", "parabola"):
        assert own[case]["cycles_to_1_cad_high"] <= 8
        assert own[case]["cycles_stays_1_5_cad"] <= 25
        assert own[case]["lost_j_cycles_high"] < 0.5 * own["feed_forward"]["lost_j_cycles_low"]
        assert own[case]["late_loss_high"] < own["unguided"]["late_loss_low"]


def test_every_case_ends_at_the_same_place(bench: StudyResult) -> None:
    for row in bench.summary["rows"]:
        assert row["final_cad"] == pytest.approx(bench.summary["optimum_cad"], abs=0.5)


def test_losses_are_those_of_the_applied_timings(bench: StudyResult) -> None:
    lost = bench.dataset["lost_j_cycles"]
    assert (lost.diff("cycle") >= -1e-6).all()  # nothing beats the steady optimum
    assert lost.sel(case="unguided")[99] == pytest.approx(rows(bench)["unguided"]["lost_j_cycles"])


@pytest.fixture(scope="module")
def real() -> StudyResult:
    return run_study("guided", n_seeds=12, real=True)


@pytest.mark.slow
@needs_records
def test_a_rough_model_of_another_engine_and_fuel_guides_the_measured_one(real: StudyResult) -> None:
    result = real
    check_labels(result.dataset)
    assert result.summary["plant"] == "surrogate of the measured engine"
    assert abs(result.summary["guide_cad"] - result.summary["optimum_cad"]) > 3.0
    own = rows(result)
    assert own["curve"]["cycles_to_1_cad"] < 0.1 * own["unguided"]["cycles_to_1_cad"]
    assert own["curve"]["lost_j_cycles_high"] < 0.2 * own["unguided"]["lost_j_cycles_low"]


@pytest.mark.slow
@needs_records
def test_under_a_limit_the_curve_arrives_first_and_stays_below_as_often(real: StudyResult) -> None:
    own = rows(real)
    assert own["unguided"].get("above_share") is None
    best = fit_surrogate(datasets.read("h2df_502")).find_optimum({"imep_bar": 1.0}, {"mprr": 5.0})
    none, curve = own["unguided, margin 0 sd"], own["curve, margin 0 sd"]
    for row in (none, curve):
        assert row["limited_optimum_cad"] == pytest.approx(best["soi_cad"])
        assert row["start_cad"] == own["unguided"]["start_cad"]
        assert row["final_cad"] == pytest.approx(best["soi_cad"], abs=2.0)
    assert curve["cycles_to_1_cad"] < 0.1 * none["cycles_to_1_cad"]
    assert curve["lost_j_cycles_high"] < 0.3 * none["lost_j_cycles_low"]
    assert curve["above_share"] < none["above_share_high"]
    for form in ("unguided", "curve", "curve, slope of the limit learnt"):
        safe, bold = own[f"{form}, margin 1 sd"], own[f"{form}, margin 0 sd"]
        assert safe["above_share"] < 0.02
        assert safe["late_loss"] > bold["late_loss"]  # what the margin costs
    assert len(real.figures) == 3


@needs_records
def test_the_guide_knows_where_the_pressure_rises_not_how_much() -> None:
    guide = measured_guide(datasets.read("h2df_502"))
    surface = fit_surrogate(datasets.read("h2df_502")).predict([-6.0, -2.0, 2.0])
    measured, said = surface["mprr"].to_numpy(), [float(guide.pressure_rise(soi)) for soi in (-6.0, -2.0, 2.0)]
    assert (np.diff(measured) < 0.0).all()
    assert (np.diff(said) < 0.0).all()
    assert abs(said[1] - measured[1]) > 0.3
    assert guide.curve.best == pytest.approx(-1.2, abs=0.05)


@needs_records
def test_what_is_above_the_limit_is_no_gain() -> None:
    parts = dict(limited_parts(datasets.read("h2df_502"), 2, 150))
    run = parts["limited: curve, slope of the limit learnt, margin 0 sd"]()
    assert run.above.any()
    assert run.lost[run.above].max() < 1e-3
    assert run.lost.min() == 0.0


def test_a_row_under_a_limit_by_hand() -> None:
    estimate = np.array([[8.0, -1.0, -1.0, -2.0], [8.0, 4.0, -1.5, 6.0]])
    rise = np.array([[2.0, 5.1, 5.0, 4.9], [2.0, 3.0, 5.2, 5.3]])
    lost = np.array([[0.4, 0.0, 0.1, 0.0], [0.4, 0.2, 0.0, 0.3]])
    run = LimitedRuns(case="own", start_cad=8.0, best_cad=-2.0, limit=5.0, estimate=estimate, lost=lost, rise=rise)
    row = run.row(2)
    assert row["cycles_to_1_cad"] == 1.5  # cycles 1 and 2
    assert row["cycles_stays_1_5_cad"] is None  # cycle 1, and never
    assert (row["above_share"], row["late_above_share"]) == (3.0 / 8.0, 0.5)
    assert (row["lost_j_cycles"], row["late_loss"]) == pytest.approx((0.5, 0.1))
    assert (row["final_cad"], row["worst_pressure_rise"]) == pytest.approx((0.375, 5.3))


def test_records_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MGDD_DATA_DIR", raising=False)
    with pytest.raises(DataError, match="study guided needs the records"):
        run_study("guided", n_seeds=1, real=True)


def test_the_option_belongs_to_this_study(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "sensor-delay", "--real"]) == 2
    assert (
        "--real does not act here; it is an option of the study guided, not of sensor-delay" in capsys.readouterr().err
    )
    assert main(["study", "--list", "--real"]) == 2
    assert "--real" in capsys.readouterr().err
    with pytest.raises(ParameterError, match="real"):
        run_study("sensor-delay", real=True)
