"""The main job on the measured traces, the page that it writes, and the table of the tour."""

import html
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mgdd import datasets, presets
from mgdd.errors import Interrupted
from mgdd.identify import best_timing
from mgdd.identify.engine import family
from mgdd.report import write_report
from mgdd_studies import run_study
from mgdd_studies.base import StudyResult
from study_cache import quick_study, sources

HD = presets.load("hd_diesel_128x144").cylinder


@pytest.fixture(scope="module")
def result() -> StudyResult:
    return quick_study("measured-traces")


def test_the_report_names_its_limitations(result: StudyResult) -> None:
    text = "\n".join(result.summary["warnings"])
    assert (
        "held at the injection or spark and would start before (SOC minus SOI in °CA: pressure_a100_bar +0.0)" in text
    )
    for profile in result.summary["common"]["wall_heat_scale"].values():
        assert profile["identifiable"] is False
        assert profile["reasons"]
        assert abs(profile["correlation"]) > 0.7
    assert "wall_heat_scale" in result.summary["unidentifiable"]


def test_gamma_and_wall_heat_stand_in_for_each_other(result: StudyResult) -> None:
    profiles = result.summary["common"]["wall_heat_scale"]
    held = profiles["double_wiebe, linear gamma held at 1.396"]
    free = profiles["double_wiebe, linear gamma refitted"]
    assert held["range_low"] < 0.8 * held["value"]
    assert held["range_high"] > 1.2 * held["value"]
    assert free["range_high"] - free["range_low"] > 2.0 * (held["range_high"] - held["range_low"])
    assert held["moved"]["gamma"] == [0.0, 2.5]  # 0.03 of gamma moves the estimate over the whole search
    assert "gamma" not in free["moved"]


def test_the_headline_is_plausible_and_the_range_holds_every_plausible_answer(result: StudyResult) -> None:
    rows = result.summary["best_timing"]
    assert len(rows) == 4
    for row in rows:
        best, members = row["best"], row["members"]
        kept = [member for member in members if member["plausible"]]
        assert len(kept) >= 2
        assert best in kept
        assert best["efficiency_gross"] <= 0.53
        assert best["soc_minus_soi_cad"] >= 0.0
        assert abs(best["wall_heat_scale"] - 1.0) <= 0.25
        for name in ("soc_cad", "ca50_cad", "gain_percent", "free_soc_cad", "free_ca50_cad", "free_shift_cad"):
            values = [member[name] for member in kept]
            wider = 1.0 if name.endswith("_cad") else 0.0  # what all members lack
            ends = [min(values) - wider, max(values) + wider]
            if name == "gain_percent" and row["shift_cad"][0] <= 0.0 <= row["shift_cad"][1]:
                ends[0] = min(0.0, ends[0])
            assert row[name] == pytest.approx(ends, abs=1e-12), name
        for member in members:
            assert bool(member["why_not"]) != member["plausible"]
            assert member["gain_percent"] >= -1e-9
            assert member["shift_cad"] == pytest.approx(member["soc_cad"] - member["fitted_soc_cad"], abs=1e-12)
            assert member["gain_percent"] <= member["free_gain_percent"] + 1e-9
            assert member["soc_cad"] >= member["free_soc_cad"] - 1e-6  # a pressure limit only delays


def test_the_wall_heat_law_moves_the_best_timing_as_much_as_its_scale(result: StudyResult) -> None:
    for row in result.summary["best_timing"]:
        kept = [m for m in row["members"] if m["plausible"] and m["gamma_model"] == "polynomial"]
        by = {(m["wall_heat_model"], m["wall_heat_scale"]): m["free_ca50_cad"] for m in kept}
        assert by["woschni", 1.5] - by["woschni", 1.0] > 2.0
        assert by["woschni", 1.0] - by["hohenberg", 1.0] > 2.0
        assert by["woschni", 1.0] - by["eichelberg", 1.0] > 2.0


def test_a_kept_study_depends_on_every_module() -> None:
    files = {"/".join(file.parts[-2:]) for file in sources()}
    assert {"mgdd_studies/base.py", "engine/cycle.py", "presets/P1.toml"} <= files


def columns(page: str, heading: str) -> dict[str, list[str]]:
    """Return the first table below a heading of the page, column by column."""
    table = page.split(f"<h2>{heading}")[1].split("<table>")[1].split("</table>")[0]
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)]
    head = [html.unescape(cell) for cell in cells[0]]
    assert len(set(head)) == len(head)
    return {name: [row[i] for row in cells[1:]] for i, name in enumerate(head)}


def span(pair: list[float], digits: int) -> str:
    low, high = (f"{value:z.{digits}f}" for value in pair)
    return low if low == high else f"{low} to {high}"


def test_every_column_of_the_page_holds_what_its_head_says(result: StudyResult, tmp_path: Path) -> None:
    page = write_report(result, tmp_path / "report").read_text(encoding="utf-8")
    summary: Any = result.summary
    best = summary["best_timing"]
    timing = columns(page, "Best timing")
    assert timing["trace"] == [row["file"] for row in best]
    for head, name, digits in (
        ("best SOC, own p_max kept [°CA aTDC]", "soc_cad", 1),
        ("best CA50, own p_max kept [°CA aTDC]", "ca50_cad", 1),
        ("move by, own p_max kept [°CA]", "shift_cad", 1),
        ("gain [%]", "gain_percent", 2),
        ("move by, no limit [°CA]", "free_shift_cad", 1),
        ("best SOC, no limit [°CA aTDC]", "free_soc_cad", 1),
        ("best CA50, no limit [°CA aTDC]", "free_ca50_cad", 1),
        ("gain, no limit [%]", "free_gain_percent", 2),
    ):
        cells = []
        for row in best:
            low, high = row["free_shift_cad" if name.startswith("free_") else "shift_cad"]
            is_open = low <= 0.0 <= high and name.endswith(("shift_cad", "gain_percent"))
            first = "open" if is_open else f"{row['best'][name]:z.{digits}f}"
            cells.append(f"{first} ({span(row[name], digits)})")
        assert timing[head] == cells, head
    assert len(timing) == 9
    assert timing["gain [%]"] != timing["gain, no limit [%]"], "the limit costs something"

    family = columns(page, "Every member")
    assert len(family["model"]) == 4 * len(best[0]["members"])
    assert family["model"][::4] == [html.escape(member["name"]) for member in best[0]["members"]]
    for head, name, form in (
        ("RMSE [% of p_max]", "rmse_percent", ".2f"),
        ("closed IMEP error [%]", "imep_closed_error_percent", "+.1f"),
        ("SOC minus SOI [°CA]", "soc_minus_soi_cad", "+.1f"),
        ("gross efficiency [-]", "efficiency_gross", ".3f"),
        ("best CA50, own p_max kept [°CA aTDC]", "ca50_cad", ".1f"),
        ("best CA50, no limit [°CA aTDC]", "free_ca50_cad", ".1f"),
    ):
        for at, row in enumerate(best):
            assert family[head][at::4] == [format(member[name], form) for member in row["members"]], head
    assert family["plausible"][::4] == [html.escape(member["why_not"]) or "yes" for member in best[0]["members"]]

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
    for head, name in (("as good within 10 % [-]", "range"), ("possible in all [-]", "possible")):
        assert wall[head] == [span((p[f"{name}_low"], p[f"{name}_high"]), 2) for p in profiles.values()]


def press_at(models: int) -> Callable[[str], None]:
    """Press Ctrl-C when that many models are calibrated."""
    done: list[str] = []

    def progress(text: str) -> None:
        done.extend([text] if text.startswith("calibrated ") else [])
        if len(done) == models:
            raise KeyboardInterrupt

    return progress


def test_ctrl_c_keeps_the_finished_models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(Interrupted, match="2 finished models") as stop:
        run_study("measured-traces", figures=False, progress=press_at(2))
    part = stop.value.partial
    assert [len(row["members"]) for row in part.summary["best_timing"]] == [2, 2, 2, 2]
    assert part.summary["warnings"][0].startswith("interrupted: ranges over 2 finished model(s)")
    assert "interrupted: ranges over 2" in write_report(part, tmp_path).read_text(encoding="utf-8")

    def press(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(family, "fit_request", press)
    with pytest.raises(Interrupted, match="no model was finished") as stop:
        best_timing(datasets.read("hd_diesel_128x144")[:1], HD)
    assert stop.value.partial is None
