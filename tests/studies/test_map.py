"""The study from design to map: one calibration and its parts, drives, and what few seeds already show."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from mgdd.errors import Interrupted
from mgdd_studies import design_to_map_engine as drives
from mgdd_studies import from_design_to_map, run_study
from mgdd_studies.base import StudyResult
from mgdd_studies.design_to_map_engine import CELLS, ENGINES, MIDDLES, Truth
from mgdd_studies.design_to_map_steps import PROCESS, SETTLING, STAGES, Case, Made, make_map
from mgdd_studies.from_design_to_map import Maps, effort_row, loss_parts, part_rows

OWN = ENGINES["as calibrated"]


@pytest.fixture(scope="module")
def study(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("from-design-to-map")


@pytest.fixture(scope="module")
def truth() -> Truth:
    return Truth.of(OWN)


@pytest.fixture(scope="module")
def made() -> Made:
    return make_map(PROCESS, 3, noise_free=True)


# --- one calibration and its parts --------------------------------------------------------------------------
def test_the_parts_sum_to_the_whole_loss(made: Made, truth: Truth) -> None:
    maps = Maps(case=PROCESS, made=[made])
    parts = loss_parts(maps, truth)
    assert tuple(parts) == STAGES
    np.testing.assert_allclose(sum(parts.values()), truth.lost(maps.timings("check")), atol=1e-12)
    rows = part_rows(maps, truth)
    whole = effort_row(maps, truth, Truth.of(OWN, MIDDLES))["lost_percent"]
    assert sum(row["lost_percent"] for row in rows[1:]) == pytest.approx(whole)
    assert rows[0]["lost_percent"] == pytest.approx(float((truth.free - truth.best).mean()))


def test_rows_by_hand(made: Made, truth: Truth) -> None:
    ideal = {**made.timings, "check": truth.best_cad}
    late = {**made.timings, "check": np.where(np.arange(CELLS[0].size) == 11, truth.best_cad + 4.0, truth.best_cad)}
    early = {**made.timings, "check": np.where(np.arange(CELLS[0].size) == 29, truth.free_cad, truth.best_cad)}
    middles = Truth.of(OWN, MIDDLES)
    maps = Maps(
        case=PROCESS, made=[replace(made, timings=own, between=middles.best_cad) for own in (ideal, late, early)]
    )
    row = effort_row(maps, truth, middles)
    lost = float(truth.lost(late["check"])[11])
    assert 0.2 < lost < 0.5  # 4 CAD late
    assert row["worst_lost_percent"] == pytest.approx(lost / 3.0, abs=5e-3)
    assert row["lost_percent"] == pytest.approx(lost / 3.0 / CELLS[0].size, abs=5e-3)
    assert row["within_02_percent"] == pytest.approx(200.0 / 3.0)
    assert row["within_05_percent"] == 100.0
    assert row["largest_excess_percent"] == pytest.approx(100.0 * float(truth.excess(early["check"])[29]))
    assert row["largest_excess_percent"] > 5.0
    assert row["between_lost_percent"] < 5e-3


def test_a_calibration_says_what_it_cost_and_repeats(made: Made) -> None:
    assert made.points == 64
    assert made.cycles == 64 * (SETTLING + 50)
    assert made.check_cycles % (CELLS[0].size * (SETTLING + 50)) == 0
    assert made.by_model <= made.price + 1e-9
    assert 0 < made.broken < 20
    again = make_map(PROCESS, 3)
    np.testing.assert_array_equal(again.timings["check"], made.timings["check"])
    assert "response model" not in again.timings
    other = make_map(Case(kind="polynomial", points=32, cycles=5), 3)
    assert other.cycles == 32 * (SETTLING + 5)


def test_between_the_cells_the_map_is_read_linearly(made: Made) -> None:
    values = made.table.values
    middle = 0.25 * (values[1:, 1:] + values[1:, :-1] + values[:-1, 1:] + values[:-1, :-1])
    np.testing.assert_allclose(made.between, middle.ravel(), atol=1e-9)


# --- drives -------------------------------------------------------------------------------------------------
def test_a_drive_by_the_true_map_alone_loses_only_between_its_cells(truth: Truth, made: Made) -> None:
    shape = made.table.values.shape
    exact = drives.timing_map(made.table.replaced(truth.best_cad.reshape(shape)))
    run = drives.drive_by_map(OWN, exact, 4)
    assert run.lost.shape == (drives.DWELL, drives.PLACES - 1)
    assert np.ptp(run.lost, axis=0).max() == 0.0
    assert run.lost.mean() < 0.02
    speed, fuel = drives.route(4)
    assert speed.min() >= 1000.0
    assert fuel.max() <= 32.0
    assert not np.array_equal(speed, drives.route(5)[0])


def test_a_map_learns_where_it_was_driven_and_nowhere_else(made: Made) -> None:
    learning, worn = drives.timing_map(made.table), ENGINES["worn"]
    run = drives.drive(worn, learning, 2, learns=True)
    assert 10 <= run.learnt <= drives.PLACES
    taught = learning.table
    seen = taught.cells["source"] == "learned"
    np.testing.assert_array_equal(taught.values[~seen], made.table.values[~seen])
    own = Truth.of(worn)
    before, after = (own.lost(table.values.ravel())[seen.ravel()].mean() for table in (made.table, taught))
    assert after < 0.6 * before
    assert (taught.values[seen] < made.table.values[seen]).mean() > 0.8  # the worn engine wants to burn earlier


# --- the study ----------------------------------------------------------------------------------------------


def test_few_seeds_show_what_the_page_says(study: StudyResult) -> None:
    rows = {row["way"]: row for row in study.summary["rows"]}
    assert rows["Gaussian process"]["cycles"] < 0.7 * rows["sweep in every cell"]["cycles"]
    assert all(row["worst_lost_percent"] < 0.3 for row in rows.values())
    parts = {(row["way"], row["part"]): row for row in study.summary["parts"]}
    for way in ("Gaussian process", "polynomial of degree 3"):
        caution = parts[way, "margin"]["lost_percent"] + parts[way, "smoothing"]["lost_percent"]
        ignorance = parts[way, "response model"]["lost_percent"] + parts[way, "noise"]["lost_percent"]
        assert caution > 2.0 * ignorance
        assert parts[way, "margin"]["cells_above"] < parts[way, "noise"]["cells_above"]
    engines = {row["engine"]: row for row in study.summary["other_engines"]}
    assert engines["worn"]["lost_percent"] > 5.0 * engines["as calibrated"]["lost_percent"]
    assert engines["burn 15 % shorter"]["largest_excess_percent"] > 10.0
    guides = {(row["engine"], row["guide"]): row for row in study.summary["guides"]}
    own = "as calibrated"
    assert guides[own, "map, no seeker"]["lost_percent"] < guides[own, "map that learns"]["late_lost_percent"]
    assert guides["worn", "map that learns"]["lost_percent"] < 0.5 * guides["worn", "map, no seeker"]["lost_percent"]
    assert all(guides[engine, "map that learns"]["saved_percent"] > 0.0 for engine in (own, "worn"))
    assert all(guides[engine, "plain seeker"]["saved_percent"] == 0.0 for engine in (own, "worn"))
    assert {row["engine"]: row["gone_percent"] for row in study.summary["learnt"]}["worn"] > 40.0


def test_slopes_prices_and_limits_hold_in_every_cell(study: StudyResult) -> None:
    said = {bar["bar"].partition(",")[0]: bar for bar in study.summary["bars"]}
    assert said["slope of the map over its limit [-]"]["met"]
    assert said["after the check"]["met"]


def test_ctrl_c_keeps_the_finished_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    real, count = from_design_to_map.make_map, iter(range(10))

    def interrupted(*args: Any, **how: Any) -> Made:
        if next(count) == 2:
            raise KeyboardInterrupt
        return real(*args, **how)

    monkeypatch.setattr(from_design_to_map, "make_map", interrupted)
    with pytest.raises(Interrupted) as stopped:
        run_study("from-design-to-map", n_seeds=1, quick=True)
    kept = stopped.value.partial.summary
    assert [row["way"] for row in kept["rows"]] == ["sweep in every cell", "polynomial of degree 3"]
    assert kept["other_engines"] == []
    assert kept["guides"] == []


def test_the_page_has_the_rows_of_the_study(root: Path, study_tables: ModuleType, study: StudyResult) -> None:
    """Labels alone: the numbers there are of 30 seeds, and `tools/study_tables.py` prints them."""
    page = (root / "docs" / "study_map.md").read_text(encoding="utf-8").splitlines()
    for part, lines in study_tables.tables(study.name, study.summary).items():
        at = page.index(lines[0])
        end = next(k for k, line in enumerate(page[at:], at) if not line.startswith("|"))
        printed = [row.strip("| ").split(" | ") for row in page[at + 2 : end]]
        words = 2 if part in ("parts", "guides") else 1
        made = [row.strip("| ").split(" | ") for row in lines[2:]]
        assert all(row[:words] in [own[:words] for own in printed] for row in made), part
        assert {len(row) for row in (*printed, *made)} == {len(lines[0].strip("| ").split(" | "))}
