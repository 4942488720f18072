"""The main job on the measured traces, and the page it writes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from mgdd import results
from mgdd.report import write_report
from mgdd.studies import StudyResult, run_measured_traces


@pytest.fixture(scope="module")
def result() -> StudyResult:
    return run_measured_traces()


def test_every_bar_of_the_calibration(result: StudyResult) -> None:
    laws = {row["law"]: row for row in result.summary["laws"]}
    assert max(laws["wiebe, gamma linear"]["rmse_percent"]) <= 1.0
    assert max(map(abs, laws["wiebe, gamma linear"]["imep_closed_error_percent"])) <= 3.0
    assert max(laws["double_wiebe, gamma 1.37"]["rmse_percent"]) <= 0.4
    triangle = laws["triangle, gamma 1.37"]
    assert max(triangle["rmse_percent"]) <= 1.5
    assert all(-12.0 < error < -4.0 for error in triangle["imep_closed_error_percent"])
    assert all(onset < 0.0 for onset in triangle["onset_against_soi_cad"])


def test_the_report_says_what_to_distrust(result: StudyResult) -> None:
    text = "\n".join(result.summary["warnings"])
    assert re.search(r"triangle, gamma 1\.37: closed IMEP is 4\.9 to 11\.1 % low", text)
    assert re.search(r"triangle, gamma 1\.37: the fitted burn starts before the injection", text)
    for profile in result.summary["common"]["wall_heat_scale"].values():
        assert profile["identifiable"] is False
        assert profile["reasons"]
        assert abs(profile["correlation"]) > 0.7
    assert "wall_heat_scale" in result.summary["unidentifiable"]


def test_profile_of_the_double_wiebe_is_flat(result: StudyResult) -> None:
    profile = result.summary["common"]["wall_heat_scale"]["double_wiebe, gamma 1.37"]
    assert profile["range_low"] < 0.8 * profile["value"]
    assert profile["range_high"] > 1.2 * profile["value"]


def test_best_timing_is_a_range_within_the_pressure_limit(result: StudyResult) -> None:
    expected = {0: (-5.9, -3.7), 3: (-13.9, -11.2)}
    rows = result.summary["best_timing"]
    for index, span in expected.items():
        assert rows[index]["free_soc_cad"] == pytest.approx(span, abs=0.1)
    assert rows[3]["free_gain_percent"] == pytest.approx([1.2, 2.8], abs=0.1)
    for row in rows:
        for point in row["points"]:
            assert point["gain_percent"] >= -1e-9
            assert point["gain_percent"] <= point["free_gain_percent"] + 1e-9
            assert point["soc_cad"] >= point["free_soc_cad"] - 1e-6  # a pressure limit only delays


def test_dataset_is_labelled(result: StudyResult) -> None:
    results.check_labels(result.dataset)
    assert result.dataset.sizes == {"law": 5, "file": 4}


def test_page_is_self_contained(result: StudyResult, tmp_path: Path) -> None:
    page = write_report(result, tmp_path / "report")
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=[\"'](?!data:)", text)
    assert text.count("data:image/png;base64,") == len(result.figures) == 8
    assert "What to distrust" in text
    assert "not identifiable" in text
    summary = json.loads((tmp_path / "report" / "summary.json").read_text(encoding="utf-8"))
    assert summary == json.loads(json.dumps(result.summary))
    assert len(summary["traces"]) == 4
