"""The study of guided transients: the sequence, the plane, and what both must show with a seed or two."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mgdd_studies.base import StudyResult
from mgdd_studies.guide_cases import SpeedLoadPlane
from mgdd_studies.guided_transients import Plane, plane_row, run_plane


@pytest.fixture(scope="module")
def result(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("guided-transients")


def test_cells_are_compared_one_by_one() -> None:
    none = Plane(form="none", name="none", cycles=np.array([[50.0, 0.0]]), lost=np.array([[20.0, 2.0]]))
    own = Plane(form="curve", name="own", cycles=np.array([[10.0, 2.0]]), lost=np.array([[5.0, 2.5]]))
    row = plane_row(own, none)
    assert (row["cells"], row["cells_slower"], row["cells_costlier"]) == (2, 1, 1)
    assert row["worst_cost_over_unguided"] == 1.25
    lost = np.array([[20.1, 2.01]])  # half a percent more
    near = Plane(form="curve", name="near", cycles=np.array([[60.0, 0.0]]), lost=lost)
    assert (plane_row(near, none)["cells_slower"], plane_row(near, none)["cells_costlier"]) == (1, 0)
    assert (row["mean_cycles"], row["mean_cycles_saved"]) == (6.0, 19.0)
    assert row["lost_over_unguided"] == pytest.approx(7.5 / 22.0)


def test_a_guide_reaches_a_far_cell_at_once_and_the_plain_seeker_does_not() -> None:
    cell = SpeedLoadPlane([2700.0], [34.0])
    name = "wall heat -30 %"
    none, heat, curve = (
        run_plane(form, name, cell) for form, name in (("none", "none"), ("feed-forward", name), ("curve", name))
    )
    assert none.cycles[0, 0] > 60.0
    assert heat.cycles[0, 0] <= 3.0  # two cycles of the test of the guide
    assert heat.lost[0, 0] < 0.2 * none.lost[0, 0]
    assert curve.cycles[0, 0] <= 1.0  # the curve needs no test
    assert curve.lost[0, 0] < 0.5 * heat.lost[0, 0]


@pytest.mark.slow
def test_sequence_few_seeds(result: StudyResult) -> None:
    rows = {(row["form"], row["guide"]): row for row in result.summary["rows"]}
    assert len(rows) == 7
    assert rows["none", "none"]["lost_over_unguided"] == pytest.approx(1.0)
    for key, row in rows.items():
        if key[0] != "none":
            assert row["moving_over_unguided"] < 0.5, key
    data = result.dataset
    steps = np.flatnonzero(np.diff(data["speed_rpm"]) ** 2 + np.diff(data["fuel_mg"]) ** 2)
    assert [int(step) + 1 for step in steps] == list(range(250, 3000, 250))


@pytest.mark.slow
def test_loss_of_the_table_is_that_of_the_dataset(result: StudyResult) -> None:
    whole = result.dataset["lost_per_100"].mean("middle_cycle").to_numpy()
    assert whole == pytest.approx([row["lost_per_100"] for row in result.summary["rows"]], rel=1e-12)


@pytest.mark.slow
def test_plane_few_cells(result: StudyResult) -> None:
    rows = {(row["form"], row["guide"]): row for row in result.summary["plane"]}
    assert rows["none", "none"]["mean_cycles_saved"] == 0.0
    met = []
    for form in ("feed-forward", "curve"):
        assert rows[form, "wall heat +30 %"]["mean_cycles_saved"] > 30.0
        good = [rows[form, name] for name in ("wall heat -30 %", "wall heat +30 %", "duration -15 %")]
        met += [
            all(row["cells_slower"] == 0 for row in good),
            all(row["cells_costlier"] == 0 for row in good),
            rows[form, "adiabatic"]["worst_cost_over_unguided"] <= 1.2,
        ]
    assert [bar["met"] for bar in result.summary["bars"]] == met
