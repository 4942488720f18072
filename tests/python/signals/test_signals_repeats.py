"""Copies and samples that stand still, by bits alone."""

from __future__ import annotations

import numpy as np
import pytest

from mgdd.signals.repeats import copies, noise_of, still

RANDOM = np.random.default_rng(1)
SHAPE = 40.0 / (1.0 + np.linspace(-6.0, 6.0, 720) ** 2)
SIZE = 720


def rows(step: float) -> np.ndarray:
    drawn = SHAPE + RANDOM.normal(0.0, 0.03, (30, SIZE))
    return np.round(drawn / step) * step if step else drawn


@pytest.mark.parametrize("step", [0.0, 0.01, 0.05, 0.2])
def test_rounding_alone_is_neither_copy_nor_stuck(step: float) -> None:
    for _ in range(5):
        drawn = rows(step)
        assert copies(drawn) is None
        assert still(drawn, noise_of(drawn), 3) is None
        assert still(drawn[:1], noise_of(drawn[:1, :200]), 3) is None


@pytest.mark.parametrize("step", [0.0, 0.01, 0.05])
def test_a_buffer_written_again_is_found_where_it_stands(step: float) -> None:
    drawn = rows(step)
    drawn.ravel()[20 * SIZE + 500 : 22 * SIZE + 100] = drawn.ravel()[3 * SIZE + 77 : 3 * SIZE + 77 + SIZE + 320].copy()
    found = copies(drawn)
    assert found is not None
    assert set(found.cycles) <= {20, 21, 22}
    place = (found.again[0] - 20) * SIZE + found.again[1] - 500
    assert abs(place) <= 2
    assert (found.first[0] - 3) * SIZE + found.first[1] - 77 == place


def test_a_run_that_rounding_does_not_explain_is_named() -> None:
    drawn = rows(0.05)
    drawn[7, 300:321] = drawn[7, 300]
    found = still(drawn, noise_of(drawn), 3)
    assert found is not None
    assert (found.cycle, found.cycles) == (7, (7,))
    assert found.first in range(296, 301)
