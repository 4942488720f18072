"""Maps, guides and plants that seekers are judged on: inputs of unlike units, counted in fortieths of their bounds."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd_studies.several_maps import (
    CURVATURE,
    Setting,
    bent_by_half,
    of_no_use,
    off_by_a_fifth,
    several_maps,
    tuned_seeker,
)

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
UNIT = np.array([1.0, 0.01, 3.75])


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import a module below `benchmarks` as its scripts do."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module


def best_of(setting: Any, field: Any) -> np.ndarray:
    from scipy.optimize import minimize

    unit = UNIT[: field.lower.size]
    bounds = list(zip(field.lower / unit, field.upper / unit, strict=True))
    start, options = setting.start / unit, {"ftol": 1e-15, "gtol": 1e-9}
    found = minimize(lambda z: setting.lost(z * unit), start, method="L-BFGS-B", bounds=bounds, options=options)
    return found.x * unit


@pytest.mark.parametrize("name", ["coupled", "skewed", "ridge", "three"])
def test_every_map_has_its_best_input_off_the_middle_and_12_from_the_start(name: str) -> None:
    (field,) = [field for field in several_maps() if field.name == name]
    sides = set()
    for seed in range(8):
        setting = field.setting(seed, True)
        best = best_of(setting, field)
        unit = UNIT[: best.size]
        off = (best - (field.lower + field.upper) / 2) / unit
        assert setting.lost(best) == pytest.approx(0.0, abs=1e-6)
        assert np.all((np.abs(off) > 3.99) & (np.abs(off) < 5.01))
        assert np.linalg.norm((setting.start - best) / unit) == pytest.approx(12.0, abs=1e-2)
        assert np.all(setting.start - field.lower > 2.9 * unit)
        assert np.all(field.upper - setting.start > 2.9 * unit)
        assert setting.near(best)
        assert not setting.near(setting.start)
        sides.add(tuple(np.sign(off)))
    assert len(sides) == 2**field.lower.size


def test_near_means_a_loss_below_three_hundredths_per_input() -> None:
    coupled, three = (several_maps()[k] for k in (0, 3))
    for field, threshold in ((coupled, 0.06), (three, 0.09)):
        setting = field.setting(5, False)
        best = best_of(setting, field)
        step = np.zeros(best.size)
        step[1] = 0.01
        near, far = (best + step * np.sqrt(share * threshold / 0.03) for share in (0.98, 1.02))
        assert setting.lost(near) == pytest.approx(0.98 * threshold, rel=1e-3)
        assert setting.near(near)
        assert not setting.near(far)


def test_an_input_outside_of_its_bounds_is_an_error_of_the_contender() -> None:
    setting = several_maps()[0].setting(0, True)
    with pytest.raises(ValueError, match="outside"):
        setting.read(np.array([3.0, 0.41]))


@pytest.mark.parametrize("at", [1, 3])
def test_a_guide_is_the_map_bent_or_moved_and_one_of_no_use_knows_nothing_of_it(at: int) -> None:
    from scipy.optimize import minimize

    field = several_maps()[at]
    setting, unit = field.setting(6, False), UNIT[: field.lower.size]
    best = best_of(setting, field)
    x = best + np.array([3.0, -1.0, 2.0])[: unit.size] * unit
    assert bent_by_half(field, 6)(x) == pytest.approx(50.0 - 1.5 * setting.lost(x))
    moved = off_by_a_fifth(field, 6)
    peak = minimize(lambda z: -moved(z * unit), best / unit, method="L-BFGS-B", options={"ftol": 1e-15}).x
    np.testing.assert_allclose(np.abs(peak - best / unit), 8.0, atol=0.02)
    assert moved(peak * unit) == pytest.approx(50.0, abs=1e-5)
    assert of_no_use(field, 6)(x) == of_no_use(field, 7)(x) != of_no_use(field, 6)(best)


@pytest.mark.parametrize("method", ["spsa", "batch"])
def test_a_tuned_seeker_keeps_its_perturbation_inside_the_bounds(method: str) -> None:
    field = several_maps()[3]
    start = np.array([19.0, 0.2, 230.0])  # 1, 20 and 5.3 fortieths from a bound
    seeker = tuned_seeker(field, start, 1, method, CURVATURE / UNIT**2)
    sizes = np.broadcast_to(seeker.settings["perturbation" if method == "spsa" else "amplitude"], 3) / UNIT
    assert sizes[0] == pytest.approx(0.99)
    assert sizes[1] > 2.0 * sizes[0]


def test_a_scaled_contender_sees_bounds_alike_and_applies_the_input_they_stand_for(load: Any) -> None:
    peers = load("peers.peer_seekers")
    seen, applied = [], []

    class Plant:
        estimate = np.array([-20.0, 0.4, 100.0])

        def __call__(self, x: np.ndarray) -> float:
            applied.append(x)
            return 7.0

    def contender(plant: Any, start: np.ndarray, seed: int) -> None:
        seen.extend([start, plant.estimate, seed, plant(np.array([5.0, -10.0, 2.0]))])
        plant.estimate = np.array([-20.0, 20.0, 0.0])

    plant = Plant()
    lower, upper = np.array([-20.0, 0.0, 100.0]), np.array([20.0, 0.4, 250.0])
    peers.scaled(contender, lower, upper, 40.0)(plant, np.array([10.0, 0.3, 250.0]), 3)
    np.testing.assert_allclose(seen[0], [10.0, 10.0, 20.0])
    np.testing.assert_allclose(seen[1], [-20.0, 20.0, -20.0])
    assert seen[2:] == [3, 7.0]
    np.testing.assert_allclose(applied, [[5.0, 0.1, 182.5]])
    np.testing.assert_allclose(plant.estimate, [-20.0, 0.4, 175.0])


def test_the_plant_counts_what_was_lost_over_all_cycles_and_over_the_first_40(load: Any) -> None:
    maps, peers = load("support.seeking_maps"), load("peers.peer_seekers")
    setting = Setting(5.0, lambda x: abs(x) < 1.0, lambda x: -x, abs)
    plant = maps.CountedPlant(setting)

    def run(plant: Any, start: float, seed: int) -> None:  # noqa: ARG001
        for cycle in range(1000):
            plant.estimate = 5.0 if cycle < 50 else 0.5
            plant(start if cycle < 30 else -2.0)

    peers.run_to_end(run, plant, 5.0, 0)
    assert (plant.cycles, plant.arrived) == (300, 50)
    assert plant.lost_early == 30 * 5.0 + 10 * 2.0
    assert plant.lost == 30 * 5.0 + 270 * 2.0
    assert plant.lost_by_estimate() == 0.5
