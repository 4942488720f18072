"""The main job on the measured traces, and the page it writes."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

import pytest

from mgdd.report import write_report
from mgdd.results.labels import check_labels
from mgdd.studies import StudyResult, run_study


@pytest.fixture(scope="module")
def result() -> StudyResult:
    return run_study("measured-traces")


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
    check_labels(result.dataset)
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


def columns(page: str, heading: str) -> dict[str, list[str]]:
    """Return the first table below a heading of the page, column by column."""
    table = page.split(f"<h2>{heading}")[1].split("<table>")[1].split("</table>")[0]
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)]
    head = [html.unescape(cell) for cell in cells[0]]
    assert len(set(head)) == len(head)
    return {name: [row[i] for row in cells[1:]] for i, name in enumerate(head)}


def span(pair: list[float], digits: int) -> str:
    low, high = (f"{value:.{digits}f}" for value in pair)
    return low if low == high else f"{low} to {high}"


def test_every_column_of_the_page_holds_what_its_head_says(result: StudyResult, tmp_path: Path) -> None:
    page = write_report(result, tmp_path / "report").read_text(encoding="utf-8")
    summary: Any = result.summary
    best = summary["best_timing"]
    timing = columns(page, "Best timing")
    assert timing["trace"] == [row["file"] for row in best]
    for head, name, digits in (
        ("SOC as fitted [°CA aTDC]", "fitted_soc_cad", 1),
        ("best SOC, own p_max kept [°CA aTDC]", "soc_cad", 1),
        ("gain [%]", "gain_percent", 2),
        ("best SOC, no limit [°CA aTDC]", "free_soc_cad", 1),
        ("CA50, no limit [°CA aTDC]", "free_ca50_cad", 1),
        ("gain, no limit [%]", "free_gain_percent", 2),
    ):
        assert timing[head] == [span(row[name], digits) for row in best], head
    assert timing["p_max limit [bar]"] == [f"{row['p_max_limit_bar']:.1f}" for row in best]
    assert len(timing) == 8
    assert timing["gain [%]"] != timing["gain, no limit [%]"], "the limit costs something"

    laws, law = columns(page, "Every burn law"), summary["laws"]
    assert laws["law"][::4] == [row["law"] for row in law]
    assert laws["RMSE [% of p_max]"] == [f"{value:.2f}" for row in law for value in row["rmse_percent"]]
    for head, name, form in (
        ("closed IMEP error [%]", "imep_closed_error_percent", "+.1f"),
        ("SOC [°CA aTDC]", "soc_cad", ".1f"),
        ("SOC minus SOI [°CA]", "onset_against_soi_cad", "+.1f"),
        ("largest error [bar]", "largest_error_bar", "+.1f"),
        ("at [°CA aTDC]", "largest_error_cad", ".0f"),
    ):
        assert laws[head] == [format(value, form) for row in law for value in row[name]], head

    traces = summary["traces"]
    burn = columns(page, "Calibrated burn")
    for head, name, form in (
        ("SOC [°CA aTDC]", "soc_cad", ".2f"),
        ("duration [°CA]", "burn_duration_cad", ".1f"),
        ("fuel heat [J]", "fuel_heat_j", ".0f"),
        ("CA50 [°CA aTDC]", "ca50_cad", ".1f"),
        ("RMSE [bar]", "rmse_bar", ".2f"),
        ("wall heat over fuel heat [-]", "heat_loss_fraction", ".3f"),
    ):
        assert burn[head] == [format(row["calibrated"][name], form) for row in traces], head
    analysis = columns(page, "Analysis")
    for head, name, form in (
        ("p_max [bar]", "p_max_bar", ".1f"),
        ("at [°CA aTDC]", "p_max_cad", ".1f"),
        ("closed IMEP [bar]", "imep_closed_bar", ".2f"),
        ("CA10 [°CA aTDC]", "ca10_cad", ".1f"),
        ("CA50 [°CA aTDC]", "ca50_cad", ".1f"),
        ("CA90 [°CA aTDC]", "ca90_cad", ".1f"),
        ("net heat [J]", "heat_net_j", ".0f"),
        ("n_c [-]", "n_compression", ".3f"),
        ("n_e [-]", "n_expansion", ".3f"),
    ):
        assert analysis[head] == [format(row["analysis"][name], form) for row in traces], head
    wall = columns(page, "Wall heat")
    profiles = summary["common"]["wall_heat_scale"]
    assert wall["law"] == list(profiles)
    assert wall["scale [-]"] == [f"{p['value']:.2f}" for p in profiles.values()]
    assert wall["possible range [-]"] == [span((p["range_low"], p["range_high"]), 2) for p in profiles.values()]
