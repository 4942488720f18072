"""Filters of signals, and signals that repeat."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

from mgdd.signals.excitation import _TAPS, maximum_length_sequence
from mgdd.signals.repeats import copies, noise_of, still


def shift_register(register: int) -> list[int]:
    state, out = [1] * register, []
    for _ in range(2**register - 1):
        out.append(state[-1])
        new = 0
        for tap in _TAPS[register]:
            new ^= state[tap - 1]
        state = [new, *state[:-1]]
    return out


@pytest.mark.parametrize("register", sorted(_TAPS))
def test_a_maximum_length_sequence_is_its_shift_register(register: int) -> None:
    bits = maximum_length_sequence(register)
    assert bits.tolist() == shift_register(register)
    assert int(bits.sum()) == 2 ** (register - 1)
    signs = 2.0 * bits - 1.0
    circular = np.fft.ifft(np.abs(np.fft.fft(signs)) ** 2).real
    np.testing.assert_allclose(circular[1:], -1.0, atol=1e-6 * bits.size)


@pytest.mark.parametrize(("half", "step_s"), [(3, 4e-3), (5, 2e-3), (10, 1e-3), (20, 5e-4)])
def test_smoothing_is_a_least_squares_cubic_of_each_window(half: int, step_s: float) -> None:
    angle = 30.0 + np.cumsum(np.random.default_rng(1).normal(0.0, 0.1, 300))
    grid = step_s * np.arange(-half, half + 1)
    windows = np.lib.stride_tricks.sliding_window_view(angle, 2 * half + 1)
    cubics = np.polynomial.polynomial.polyfit(grid, windows.T, 3)
    for order, factor in ((0, 1.0), (1, 1.0), (2, 2.0)):
        smooth = savgol_filter(angle, 2 * half + 1, 3, deriv=order, delta=step_s)[half:-half]
        expected = factor * cubics[order]
        np.testing.assert_allclose(smooth, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


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
