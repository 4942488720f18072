"""The study of the controllers: its rows, its cases, and what it claims, on few throttles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from mgdd_studies.base import StudyResult
from mgdd_studies.throttle_cases import throttle_of
from mgdd_studies.throttle_tracking import (
    CASES,
    controllers_of,
    row_of,
    run_case,
    throttles_of,
    warm_rows,
)


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
    tables = study_tables.tables("throttle-tracking", quick.summary | {"rows": rows})
    assert list(tables) == [*(case.text for case in CASES.values()), "warm"]
    for lines in tables.values():
        at = page.index(lines[0])
        for made, printed in zip(lines[2:], page[at + 2 :], strict=False):
            assert made.split(" | ")[:2] == printed.split(" | ")[:2]
    made = study_tables.put_into(text, "throttle-tracking", quick.summary)
    assert made != text
    assert study_tables.put_into(made, "throttle-tracking", quick.summary) == made
