"""The study of the map that seeks: judgement by hand, trouble, guides, and what few seeds already show."""

import importlib.util
import json
from collections.abc import Callable
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest

from mgdd.loop import VirtualTestBed, seek_map
from mgdd.results.labels import check_labels
from mgdd_studies.base import StudyResult
from mgdd_studies.design_to_map_engine import AXES, CELLS, ENGINES, LIMITS, point_of
from mgdd_studies.map_that_seeks import Walked, unvisited_row, visit_row
from mgdd_studies.map_that_seeks_cases import (
    GUIDES,
    NO_GUIDE,
    OLD_MAP,
    TROUBLES,
    WRONG_WAY,
    Path,
    Search,
    TroubledBed,
    guide_of,
    truth_of,
)
from mgdd_studies.map_that_seeks_drives import CURVE, MAP, drive

OWN = "as calibrated"


@pytest.fixture(scope="module")
def study(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("map-that-seeks")


def test_rows_by_hand() -> None:
    truth, cells = truth_of(OWN), np.arange(CELLS[0].size)
    late = np.where(cells == 11, truth.best_cad + 4.0, truth.best_cad)
    early = np.where(cells == 29, truth.free_cad, truth.best_cad)  # held back by a limit there
    asked = np.array([truth.best_cad[3], truth.free_cad[29]])

    def path(timing: Any, failing: int = -1, named: int = -1) -> Path:
        return Path(
            timings=timing[None],
            named=cells[None] == named,
            places=np.array([3, 29]),
            asked=asked,
            runs=cells != failing,
        )

    search = Search(stops=(2,))
    row = visit_row(Walked(search=search, paths=[path(truth.best_cad), path(late)]), 0)
    own = float(truth.lost(late)[11])
    assert row["engine_cycles"] == 140
    assert row["lost_percent"] == pytest.approx(0.5 * own / 30.0, abs=1e-4)
    assert row["worst_lost_percent"] == pytest.approx(0.5 * own, abs=1e-4)
    assert row["within_01_percent"] == 50.0
    assert row["cells_above"] == 0.0
    assert row["visits_above"] == 1.0
    assert row["largest_visit_excess_percent"] == pytest.approx(100.0 * float(truth.excess(truth.free_cad)[29]))
    for named, left in ((3, 1.0), (29, 0.0)):
        row = visit_row(Walked(search=search, paths=[path(early, named=named)]), 0)
        assert (row["cells_above"], row["unnamed_above"]) == (1.0, left)
    # Where the engine does not run nothing is judged.
    spared = Walked(search=search, paths=[path(late, failing=11), path(early, failing=29)])
    assert visit_row(spared, 0)["worst_lost_percent"] < 1e-4
    assert visit_row(spared, 0)["cells_above"] == 0.0
    assert unvisited_row(Search(guide=OLD_MAP))["worst_lost_percent"] < 1e-3
    assert unvisited_row(Search(engine="worn", guide=OLD_MAP))["lost_percent"] > 0.4


def test_trouble_is_what_its_name_says() -> None:
    """As a search meets it, of visits of three cycles without noise."""

    def troubled(trouble: str) -> tuple[VirtualTestBed, TroubledBed]:
        bed = VirtualTestBed(ENGINES[OWN], point=point_of, limits=tuple(LIMITS), seed=1, soc_scatter_cad=0.0,
                             efficiency_noise_percent=0.0)  # fmt: skip
        return bed, TroubledBed(bed, trouble, 3)

    def off(trouble: str) -> Any:
        bed, plant = troubled(trouble)
        visits = seek_map(plant, {"soc_cad": (-3.0, -1.0)}, AXES, visits=40, averaged=2, settling=1).visits
        places = {name: [{**one.at, **one.inputs}[name] for one in visits] for name in bed.input_names}
        return np.array([one.j for one in visits]) - bed.steady(places)["j"]

    for trouble, slope in (("slow drift", 0.042), ("fast drift", 0.3)):
        np.testing.assert_allclose(off(trouble), slope * np.arange(40) / 20.0, atol=1e-9)
    lies = np.abs(off("outliers").reshape(2, 20))
    assert ((lies > 0.5).sum(axis=1) == 1).all()
    assert np.unique(lies.round(9)).tolist() == [0.0, 1.0]

    def fails(place: int) -> bool:
        plant = troubled(TROUBLES[-1])[1]
        at = {name: float(column[place]) for name, column in zip(AXES, CELLS, strict=True)}
        plant.apply({**at, "soc_cad": -2.0})
        return plant.measure().misfire

    assert sum(map(fails, range(30))) == 1


def test_guides_are_wrong_as_their_names_say() -> None:
    def best(name: str) -> Any:
        table = guide_of(name)["guide"]
        return table["soc_cad"].to_numpy()[table.to_numpy().reshape(30, -1).argmax(axis=1)]

    rough, wrong = best("twice the wall heat"), best(WRONG_WAY)
    np.testing.assert_allclose(rough + wrong, -16.0, atol=1e-9)  # about the middle of -24 to 8
    assert np.corrcoef(rough, truth_of(OWN).free_cad)[0, 1] > 0.9
    assert (best("adiabatic") < best(OLD_MAP)).all()  # without wall heat it pays to burn early
    np.testing.assert_allclose(best(OLD_MAP), truth_of(OWN).free_cad, atol=0.45)  # half a node of the guide
    assert "guide" not in guide_of(NO_GUIDE)
    assert set(GUIDES) == {"twice the wall heat", "wall heat +30 %", "adiabatic", WRONG_WAY, OLD_MAP, NO_GUIDE}


def test_summary_dataset_and_figures(study: StudyResult) -> None:
    check_labels(study.dataset)
    assert json.loads(json.dumps(study.summary, allow_nan=False)) == study.summary
    for part in ("rows", "unvisited", "others", "drives"):
        rows = study.summary[part]
        assert rows
        assert all(list(row) == list(rows[0]) for row in rows), part
    assert len(study.figures) == 4


def test_one_seed_shows_what_the_page_says(study: StudyResult) -> None:
    rows = {(row["engine"], row["guide"], row["visits"]): row for row in study.summary["rows"]}
    guided, bare = rows[OWN, "twice the wall heat", 24], rows[OWN, NO_GUIDE, 24]
    assert guided["worst_lost_percent"] < 0.1
    assert guided["visits_above"] == guided["cells_above"] == 0.0
    assert bare["lost_percent"] > 10.0 * guided["lost_percent"]
    design = study.summary["others"][0]
    assert guided["lost_percent"] < 0.3 * design["lost_percent"]
    assert guided["engine_cycles"] < design["engine_cycles"]
    old = next(row for row in study.summary["unvisited"] if row["engine"] == "worn")
    assert rows["worn", OLD_MAP, 10]["lost_percent"] < 0.15 * old["lost_percent"]
    drives = {(row["way"], row["guide"]): row["lost_percent"] for row in study.summary["drives"]}
    assert drives[MAP, "twice the wall heat"] < 0.5 * drives[CURVE, "twice the wall heat"]
    assert all(bar["met"] for bar in study.summary["bars"])


def test_a_drive_repeats_and_learns() -> None:
    one, again = (drive(MAP, "twice the wall heat", 3) for _ in range(2))
    np.testing.assert_array_equal(one.lost, again.lost)
    assert one.lost.shape == (2, 12, 40)
    assert one.lost.min() >= -1e-9
    turns = sum(own.lost.mean(axis=(1, 2)) for own in (one, *(drive(MAP, "twice the wall heat", k) for k in (1, 2))))
    assert turns[1] < 0.7 * turns[0]  # 0.55 over 30 seeds
    assert drive(CURVE, WRONG_WAY, 3).lost[:, :, :2].mean() > 1.0


def test_the_page_has_the_rows_of_the_study(root: File, study: StudyResult) -> None:
    """Labels alone: the numbers there are of 30 seeds, and `tools/study_tables.py` prints them."""
    spec = importlib.util.spec_from_file_location("study_tables", root / "tools" / "study_tables.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    page = (root / "docs" / "study_map_that_seeks.md").read_text(encoding="utf-8")
    for part, lines in tool.tables(study.name, study.summary).items():
        if part in ("visits", "changed", "two_inputs"):  # other visits than the quick ones
            continue
        assert lines[0] in page, part
        for line in lines[2:]:
            first = " | ".join(line.strip("| ").split(" | ")[: 2 if part in ("rows", "drives") else 1])
            assert f"| {first} |" in page, part
