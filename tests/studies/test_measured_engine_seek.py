"""The study of seekers on the surrogate of a measured engine: laws on made records, facts on the measured ones."""

import json
from typing import Any

import numpy as np
import pytest

from mgdd import datasets
from mgdd.errors import DataError, Interrupted, ParameterError
from mgdd.results.labels import check_labels, to_jsonable
from mgdd_studies import measured_engine_cases, measured_engine_seek, run_study
from mgdd_studies.base import StudyResult
from mgdd_studies.measured_engine import EngineSurrogate, fit_surrogate, random_step_records
from mgdd_studies.measured_engine_map import MapJudge, guide_of, held_steps, sought
from mgdd_studies.measured_engine_seek import run_measured_engine_seek

needs_records = pytest.mark.skipif("h2df_502" not in datasets.names(), reason="MGDD_DATA_DIR holds no folder h2df_502")


@pytest.fixture(scope="module")
def made() -> EngineSurrogate:
    return fit_surrogate(random_step_records(3000))


@pytest.fixture
def on_made_records(made: EngineSurrogate, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured_engine_seek, "_surrogate", lambda: made)


def row(result: StudyResult, objective: str, seeker: str) -> dict[str, Any]:
    (one,) = [r for r in result.summary["rows"] if objective in r["objective"] and r["seeker"] == seeker]
    return one


def test_noise_is_read_at_the_period_of_the_dither() -> None:
    white = np.random.default_rng(1).normal(3.0, 0.25, 60_000)
    for period in (6, 13):
        assert measured_engine_cases.noise_at(white, period) == pytest.approx(0.25, rel=0.03)
    slow = np.sin(2.0 * np.pi * np.arange(6000) / 600.0)
    assert measured_engine_cases.noise_at(slow, 6) < 0.05 * np.std(slow)
    assert measured_engine_cases.noise_at(np.full(600, 7.0), 6) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.usefixtures("on_made_records")
def test_rows_and_dataset_on_made_records(made: EngineSurrogate) -> None:
    told: list[str] = []
    result = run_measured_engine_seek(n_seeds=2, quick=True, progress=told.append)
    check_labels(result.dataset)
    assert (result.name, result.summary["study"], result.summary["seeds"]) == (
        "measured-engine-seek",
        "measured-engine-seek",
        2,
    )
    assert dict(result.dataset.sizes) == {"case": 7, "seed": 2, "cycle": 600}
    assert len(told) == 8
    json.dumps(to_jsonable(result.summary), allow_nan=False)
    for at, one in enumerate(result.summary["rows"]):
        limited = "≤ 5" in one["objective"]
        weights = {"imep_bar": 1.0} if limited else {"imep_bar": 1.0, "nox_ppm": -0.001}
        limits = {"mprr": 5.0} if limited else {}
        assert one["optimum_soi_cad"] == made.find_optimum(weights, limits)["soi_cad"]
        final = result.dataset["final_soi_cad"][at]
        assert one["final_soi_cad"] == pytest.approx(float(final.mean()))
        assert one["error_cad"] == pytest.approx(one["final_soi_cad"] - one["optimum_soi_cad"])
        half = 12.7062 * float(final.std("seed", ddof=1)) / np.sqrt(2.0)  # t of one degree of freedom
        assert one["final_soi_cad_high"] - one["final_soi_cad"] == pytest.approx(half, rel=1e-4)
        assert 0.0 <= one["outside_share"] <= 1.0
    lag = made.signals["nox_ppm"].sensor
    assert lag is not None
    assert result.summary["nox_lag_cycles"] == lag.tau_cycles
    assert result.summary["nox_delay_cycles"] == lag.delay_cycles - made.signals["imep_bar"].lag_cycles
    assert len(result.figures) == 2
    trajectories, ends = result.figures.values()
    assert [len(ax.lines) >= 2 for ax in trajectories.axes] == [True] * 3
    assert len(ends.axes[0].get_yticklabels()) == 7


@pytest.mark.slow
@pytest.mark.usefixtures("on_made_records")
def test_knowing_the_lag_is_what_finds_the_optimum() -> None:
    result = run_measured_engine_seek(n_seeds=2, figures=False)
    assert result.figures == {}
    known, ignored = row(result, "lag known", "batch"), row(result, "lag ignored", "batch")
    assert abs(known["error_cad"]) < 1.0
    assert abs(ignored["error_cad"]) > 2.0 * abs(known["error_cad"])
    assert ignored["period_cycles"] < known["period_cycles"]


@pytest.mark.slow
@pytest.mark.usefixtures("on_made_records")
def test_the_same_seeds_give_the_same_numbers() -> None:
    first = run_measured_engine_seek(n_seeds=1, quick=True, figures=False)
    second = run_measured_engine_seek(n_seeds=2, quick=True, figures=False)
    np.testing.assert_array_equal(first.dataset["final_soi_cad"][:, 0], second.dataset["final_soi_cad"][:, 0])
    assert (second.dataset["final_soi_cad"][:, 0] != second.dataset["final_soi_cad"][:, 1]).any()
    assert first.summary["rows"][0]["final_soi_cad_low"] is None
    json.dumps(first.summary, allow_nan=False)


def test_ctrl_c_keeps_the_finished_seekers(made: EngineSurrogate, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured_engine_seek, "_surrogate", lambda: made)

    def press(text: str) -> None:
        if text.endswith("spsa"):
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as stop:
        run_measured_engine_seek(n_seeds=1, quick=True, progress=press)
    result = stop.value.partial
    assert result.summary["interrupted"] is True
    assert [row["seeker"] for row in result.summary["rows"]] == ["batch"]
    assert len(result.figures) == 2


def test_errors_name_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ParameterError, match="seeds = 0: must be >= 1"):
        run_measured_engine_seek(n_seeds=0)
    monkeypatch.delenv("MGDD_DATA_DIR", raising=False)
    with pytest.raises(DataError, match="MGDD_DATA_DIR"):
        run_study("measured-engine-seek", quick=True)


@pytest.mark.slow
@needs_records
def test_on_the_measured_engine() -> None:
    result = run_measured_engine_seek(n_seeds=2, figures=False)
    assert "10.5281/zenodo.16902579" in result.summary["records"]["citation"]
    limited, known, ignored = (row(result, name, "batch") for name in ("≤ 5", "lag known", "lag ignored"))
    assert limited["optimum_soi_cad"] == pytest.approx(-2.16, abs=0.02)
    assert known["optimum_soi_cad"] == ignored["optimum_soi_cad"] == pytest.approx(1.49, abs=0.02)
    assert limited["mean_pressure_rise"] < 5.0
    assert abs(known["error_cad"]) < 1.0
    assert known["outside_share"] < 0.02
    assert ignored["error_cad"] < -6.0
    assert ignored["mean_nox_ppm"] > known["mean_nox_ppm"] + 300.0


@needs_records
def test_a_map_over_the_load_steps_of_the_measured_engine() -> None:
    records = datasets.read("h2df_502")
    surrogate = fit_surrogate(records)
    judge = MapJudge(surrogate)
    assert judge.best_cad.round(1).tolist() == [-3.7, -0.9, 2.3, -1.5, 1.3, 4.2, 0.3, 2.8, 5.5, 1.4, 3.6, 6.0]
    assert held_steps(records)["nox_ppm"].size == 600
    mean, worst, above = judge(np.full(12, judge.best_cad.max()))  # one safe timing for all loads
    assert (round(mean, 2), round(worst, 2), above.any()) == (0.21, 0.32, False)
    lost = {}
    for name, alone, margin in (("25 held steps", 11, 110.0), ("1500 cycles", 10, 70.0)):
        guide = guide_of(records, name)
        assert [judge.of_guide(guide, ppm)[2].sum() for ppm in (0.0, margin)] == [alone, 0]
        (found,) = sought(surrogate, guide, seed=0, stops=(16,), block_cycles=1)
        lost[name] = judge.of_search(found)[0]
    (found,) = sought(surrogate, {}, seed=0, stops=(16,), block_cycles=1)
    assert max(lost.values()) < 0.03 < judge.of_search(found)[0]
