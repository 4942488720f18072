"""The engine behind the study from design to map, the truth that maps are judged by, and each step on its own."""

from typing import Any

import numpy as np
import pytest

from mgdd.errors import ConvergenceError
from mgdd.loop import VirtualEngine
from mgdd_studies import design_to_map_steps
from mgdd_studies.design_to_map_engine import AXES, CELLS, ENGINES, LIMITS, OBJECTIVE, ROUGH, Truth, point_of
from mgdd_studies.design_to_map_steps import (
    SETTLING,
    SLOPES,
    check_map,
    design,
    design_of_cells,
    margins_of,
    measure,
    optimum_of,
    predict,
    responses,
    smooth,
)

OWN = ENGINES["as calibrated"]


@pytest.fixture(scope="module")
def truth() -> Truth:
    return Truth.of(OWN)


@pytest.fixture(scope="module")
def predicted() -> Any:
    return predict(responses(measure(OWN, design(48, 5), seed=5).points, "polynomial"))


# --- the truth ----------------------------------------------------------------------------------------------
def test_the_truth_is_what_the_bench_measures_without_noise() -> None:
    places = (np.array([1130.0, 2710.0]), np.array([27.5, 11.0]))
    own, timing = Truth.of(OWN, places), np.array([-7.3, -2.45])
    for k, place in enumerate(zip(*places, strict=True)):
        quiet = {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}
        bench = VirtualEngine(OWN, point_of(*place), limits=tuple(LIMITS), **quiet)
        cycle = bench.step(timing[k])
        assert own.at(timing)[k] == pytest.approx(cycle["j"], abs=2e-3)
        for name in LIMITS:
            assert own.at(timing, name)[k] == pytest.approx(cycle["limits"][name], rel=2e-3)


def test_nothing_is_better_than_the_best_and_nothing_is_won_beyond_a_limit(truth: Truth) -> None:
    assert truth.lost(truth.best_cad).max() < 0.01
    assert truth.excess(truth.best_cad).max() < 1e-3
    held = truth.free - truth.best > 0.05
    assert 3 <= held.sum() <= 12  # high load: a limit costs something there, and nowhere else
    assert set(CELLS[1][held]) <= {26.0, 32.0}
    beyond = truth.excess(truth.free_cad)
    assert (beyond[held] > 0.0).all()
    assert truth.at(truth.free_cad)[held].min() > 0.0
    np.testing.assert_array_equal(truth.lost(truth.free_cad)[held], 0.0)  # better than the best, and not counted
    for shift in (-3.0, 4.0):
        timing = truth.best_cad + shift
        kept = truth.excess(timing) <= 0.0
        assert (truth.at(timing)[kept] <= truth.best[kept] + 1e-3).all()


def test_places_are_read_one_by_one(truth: Truth) -> None:
    many = truth.lost(np.stack([truth.best_cad + 5.0, truth.best_cad - 1.0]))
    assert many.shape == (2, CELLS[0].size)
    np.testing.assert_array_equal(many[1], truth.lost(truth.best_cad - 1.0))


# --- the steps ----------------------------------------------------------------------------------------------
def test_a_design_stays_where_the_rough_model_allows_and_sees_the_limit_of_the_engine() -> None:
    plan = design(32, 4)
    places = (plan["speed_rpm"].to_numpy(), plan["fuel_mg"].to_numpy())
    timing = plan["soc_cad"].to_numpy()
    assert Truth.of(ROUGH, places).excess(timing).max() <= 0.101
    assert Truth.of(OWN, places).excess(timing).max() > 0.0  # the rough model is wrong on the dangerous side
    assert design(32, 4).equals(plan)
    assert not design(32, 6).equals(plan)


def test_a_point_is_the_mean_of_its_settled_cycles() -> None:
    cells = design_of_cells(np.linspace(-9.0, 3.0, CELLS[0].size))
    timing = cells["soc_cad"].to_numpy()
    clean = measure(OWN, cells, seed=1, cycles=1, noise=False)
    own = Truth.of(OWN)
    np.testing.assert_allclose(clean.points[OBJECTIVE], own.at(timing), atol=5e-3)
    np.testing.assert_allclose(clean.points["p_max_bar"], own.at(timing, "p_max_bar"), rtol=2e-3)
    assert clean.cycles == CELLS[0].size * (SETTLING + 1)
    scatter = []
    for cycles in (5, 80):
        runs = [measure(OWN, cells, seed=seed, cycles=cycles).points[OBJECTIVE].to_numpy() for seed in range(8)]
        errors = np.concatenate([run - own.at(timing) for run in runs])
        scatter.append(errors.std())
        assert errors.std() == pytest.approx(0.25 / np.sqrt(cycles), rel=0.25)
    assert scatter[0] / scatter[1] == pytest.approx(4.0, rel=0.25)


def test_a_margin_is_kept_from_the_limit(predicted: Any) -> None:
    free, held = optimum_of(predicted), optimum_of(predicted, margins={"p_max_bar": 4.0, "dp_max_bar_per_cad": 0.0})
    at_limit = free.cells["active_limit"] == "p_max_bar"
    assert at_limit.any()
    assert (held.values[at_limit] > free.values[at_limit]).all()  # burns later
    assert (held.cells["objective"] <= free.cells["objective"] + 1e-9).all()


def test_smoothing_keeps_slopes_and_price_and_what_the_check_left(predicted: Any) -> None:
    table, price = smooth(predicted)
    best = optimum_of(predicted, price=price)
    assert price == 0.1
    assert ((table.values >= best.cells["low"]) & (table.values <= best.cells["high"])).all()
    floor = np.full(CELLS[0].size, -np.inf)
    floor[13] = table.values.ravel()[13] + 2.0
    later, _ = smooth(predicted, not_before=floor)
    assert later.values.ravel()[13] >= floor[13] - 1e-6
    for own in (table, later):
        for at, (name, entries) in enumerate(AXES.items()):
            slope = np.abs(np.diff(np.moveaxis(own.values, at, -1))) / np.diff(entries)
            assert slope.max() <= SLOPES[name] * (1.0 + 1e-6)


def test_slopes_that_no_price_allows_are_refused(predicted: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(design_to_map_steps, "SLOPES", {"speed_rpm": 1e-5, "fuel_mg": 1e-3})
    with pytest.raises(ConvergenceError, match=r"no price up to 1\.6 points"):
        smooth(predicted)


def test_a_check_finds_a_map_that_is_too_early_and_ends_within_the_limits(predicted: Any, truth: Truth) -> None:
    table, price = smooth(predicted)
    early = table.replaced(table.values - 2.5, cells={"low": -24.0, "high": 10.0})
    above = int((truth.excess(early.values.ravel()) > 0.005).sum())
    checked = check_map(OWN, early, price, predicted, {}, 7)
    assert checked.found >= above >= 3
    assert checked.cycles >= 2 * CELLS[0].size * (SETTLING + 50)  # it was driven again after the retard
    assert truth.excess(checked.table.values.ravel()).max() < 0.005
    clean = check_map(
        OWN, table.replaced(table.values + 3.0, cells={"low": -24.0, "high": 10.0}), price, predicted, {}, 7
    )
    assert (clean.found, clean.cycles) == (0, CELLS[0].size * (SETTLING + 50))


def test_a_margin_is_that_of_left_out_points() -> None:
    fits = responses(measure(OWN, design(40, 2), seed=2).points, "polynomial")
    said = margins_of(fits)
    left_out = fits["p_max_bar"].diagnostics
    error = (left_out["measured"] - left_out["left_out"]).to_numpy()
    assert said["p_max_bar"] == pytest.approx(1.64 * np.sqrt(np.mean(error**2)))
    assert list(said) == list(LIMITS)
