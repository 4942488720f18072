"""Acceptance facts of the seekers, through the Python face: cycle counts, errors, scale and dimension."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mgdd.optimize import ExtremumSeeking, GradientDescent, Spsa

BEND = -0.051
GAIN = 2.0 / (0.051 * 40.0)


def path_of(seeker: Any, cycles: int, fun: Callable[[float], float] = lambda x: 0.5 * BEND * x * x) -> np.ndarray:
    """Estimates before each cycle of a search in one input, and after the last."""
    out = [float(seeker.estimate[0])]
    for _ in range(cycles):
        seeker.tell(fun(float(seeker.ask()[0])))
        out.append(float(seeker.estimate[0]))
    return np.array(out)


def plain(start: float, **settings: Any) -> ExtremumSeeking:
    """Make a seeker as the facts define it: moving average, period 10, amplitude 1, no clip."""
    return ExtremumSeeking(**({"start": start, "form": "moving_average", "gain": GAIN, "rate": np.inf} | settings))


@pytest.mark.parametrize("start", [12.0, -12.0])
def test_cycles_from_twelve_to_one(start: float) -> None:
    path = path_of(plain(start), 300)
    assert np.argmax(np.abs(path) <= 1.0) == pytest.approx(109, abs=12)
    assert (path[:10] == start).all()
    clipped = path_of(plain(start, rate=None), 300)
    assert np.argmax(np.abs(clipped) <= 1.0) == pytest.approx(128, abs=5)


def test_noise_gives_the_error_of_the_closed_form() -> None:
    squares = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        path = path_of(plain(0.0), 2400, lambda x, rng=rng: 0.5 * BEND * x * x + rng.normal(0.0, 0.25))
        squares.append(np.mean(path[400:] ** 2))
    assert np.sqrt(np.mean(squares)) == pytest.approx(0.25 / (0.051 * np.sqrt(40.0)), rel=0.15)


def test_a_constant_added_to_j_and_the_gain_do_not_move_the_end() -> None:
    ends = [
        path_of(plain(6.0, gain=gain, form=form), 3000, lambda x, c=c: c + 0.5 * BEND * x * x)[2000:].mean()
        for gain in (GAIN, 0.5 * GAIN)
        for form in ("moving_average", "batch")
        for c in (0.0, 1e6)
    ]
    assert np.ptp(ends) < 0.05
    assert np.abs(ends).max() < 0.05


@pytest.mark.parametrize("inputs", [1, 2, 5])
def test_spsa_gradient_has_no_bias_and_takes_two_evaluations(inputs: int) -> None:
    start = np.linspace(5.0, -4.0, inputs) if inputs > 1 else np.array([5.0])
    hessian = -0.05 * np.eye(inputs) + 0.01 * (np.eye(inputs, k=1) + np.eye(inputs, k=-1))
    seeker = Spsa(start=start, schedule="constant", gain=1e-300, perturbation=3.0, seed=inputs)
    gradients = []
    for _ in range(10_000):
        for _ in range(2):
            x = seeker.ask()
            seeker.tell(0.5 * float(x @ hessian @ x))
        gradients.append(seeker.gradient)
    assert seeker.iteration == 10_000
    assert seeker.cycle == 20_000
    error = np.std(gradients, axis=0) / 100.0
    assert (np.abs(np.mean(gradients, axis=0) - hessian @ start) <= 3.0 * error + 1e-12).all()


def test_gradient_steps_converge_below_twice_the_inverse_curvature() -> None:
    fast = GradientDescent(start=-9.0, step_size=18.0)
    path_of(fast, 120)
    assert fast.converged_at == 4
    wild = GradientDescent(start=-9.0, step_size=45.0, lower=-20.0, upper=20.0)
    path_of(wild, 120)
    assert wild.converged_at is None
    assert abs(wild.estimate[0]) > 5.0
