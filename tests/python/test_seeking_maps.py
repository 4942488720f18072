"""Maps and plants of the benchmarks of seeking: inputs of unlike units, counted in fortieths of their bounds."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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
def test_every_map_has_its_best_input_off_the_middle_and_12_from_the_start(load: Any, name: str) -> None:
    (field,) = [field for field in load("support.several_maps").several_maps() if field.name == name]
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


def test_near_means_a_loss_below_three_hundredths_per_input(load: Any) -> None:
    coupled, three = (load("support.several_maps").several_maps()[k] for k in (0, 3))
    for field, threshold in ((coupled, 0.06), (three, 0.09)):
        setting = field.setting(5, False)
        best = best_of(setting, field)
        step = np.zeros(best.size)
        step[1] = 0.01
        near, far = (best + step * np.sqrt(share * threshold / 0.03) for share in (0.98, 1.02))
        assert setting.lost(near) == pytest.approx(0.98 * threshold, rel=1e-3)
        assert setting.near(near)
        assert not setting.near(far)


def test_an_input_outside_of_its_bounds_is_an_error_of_the_contender(load: Any) -> None:
    setting = load("support.several_maps").several_maps()[0].setting(0, True)
    with pytest.raises(ValueError, match="outside"):
        setting.read(np.array([3.0, 0.41]))


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
    setting = maps.Setting(5.0, lambda x: abs(x) < 1.0, lambda x: -x, abs)
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
