"""Seekers of several inputs with limits: they end where an independent solver ends, whatever their gains."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from mgdd.optimize import ExtremumSeeking, GradientDescent, Limit, Spsa

Point = NDArray[np.float64]

TWO: dict[str, Any] = {"period": 20, "harmonics": [3, 4]}
THREE: dict[str, Any] = {"period": 40, "harmonics": [4, 5, 7]}


def dithering(amplitude: list[float], space: dict[str, Any], window: dict[str, Any]) -> dict[str, Callable[[], Any]]:
    """Gains that give every input a time constant of its own, curvature 2 in all of them."""
    n = len(amplitude)
    rate = [0.02 * (i + 1) for i in range(n)]
    gain = [r / a for r, a in zip(rate, amplitude, strict=True)]
    common = {**space, **window, "amplitude": amplitude}
    return {
        "batch": lambda: ExtremumSeeking(**common, gain=gain),
        "moving_average": lambda: ExtremumSeeking(**common, gain=gain, rate=1.0, form="moving_average"),
        "washout": lambda: ExtremumSeeking(**common, gain=gain, rate=1.0, form="washout"),
    }


def direct(space: dict[str, Any]) -> dict[str, Callable[[], Any]]:
    steady: dict[str, Any] = {"schedule": "constant", "perturbation": 0.2}
    return {
        "spsa": lambda: Spsa(**space, **steady, gain=0.05),
        "spsa_second_order": lambda: Spsa(**space, **steady, form="second_order", gain=0.1, initial_hessian=-1.0),
        "gradient": lambda: GradientDescent(**space, step_size=0.1, difference=0.2, rate=0.3),
    }


def best_of(j: Callable[[Point], float], limits: Callable[[Point], Point], box: list[tuple[float, float]]) -> Point:
    found = minimize(
        lambda x: -j(x),
        np.full(len(box), -1.0),
        method="SLSQP",
        bounds=box,
        constraints={"type": "ineq", "fun": lambda x: -limits(x)},
        options={"ftol": 1e-12},
    )
    assert found.success
    return np.asarray(found.x)


def end_of(seeker: Any, j: Callable[[Point], float], limits: Callable[[Point], Point], cycles: int) -> Point:
    """Mean estimate of the last fifth."""
    history = seeker.run(lambda x: (j(x), limits(x)), cycles)
    return np.asarray(history["estimate"].to_numpy()[-cycles // 5 :].mean(axis=0))


def bowl(x: Point) -> float:
    return float(-((x - 3.0) ** 2).sum())


@pytest.mark.parametrize("amplitude", [[1.0, 1.0], [0.5, 2.0], [1.0, 0.5]])
@pytest.mark.parametrize("name", ["batch", "moving_average", "washout"])
def test_unequal_amplitudes_end_where_equal_ones_end(name: str, amplitude: list[float]) -> None:
    space = {"start": [-2.0, -1.0], "bounds": (-8.0, 8.0), "limits": [Limit("sum", 2.0, scale=1.0)]}
    small = [0.2 * a for a in amplitude]
    end = end_of(dithering(small, space, TWO)[name](), bowl, lambda x: np.array([x.sum()]), 8000)
    # What the dither keeps free of the limit, on the way to (1, 1) by symmetry of J and limit.
    assert end.sum() < 2.01
    assert abs(end[0] - end[1]) < 0.06, end
    assert bowl(end) > bowl(np.array([1.0, 1.0])) - 2.2 * sum(small), end


BOX = [(-8.0, 0.5), (-8.0, 8.0)]


@pytest.mark.parametrize("name", ["batch", "moving_average", "washout", "spsa", "spsa_second_order", "gradient"])
def test_a_bound_and_a_limit_at_once(name: str) -> None:
    """The best point lies where the bound of one input meets the limit of both."""
    amplitude = [0.05, 0.1]
    space = {
        "start": [-2.0, -1.0],
        "bounds": ([-8.0, -8.0], [0.5, 8.0]),
        "limits": [Limit("sum", 2.0, scale=1.0)],
    }
    if name in ("spsa", "spsa_second_order", "gradient"):
        reach = 0.4 if name == "spsa_second_order" else 0.2
        seeker = direct(space)[name]()
    else:
        reach = 0.1
        seeker = dithering(amplitude, space, TWO)[name]()
    end = end_of(seeker, bowl, lambda x: np.array([x.sum()]), 6000)
    best = best_of(bowl, lambda x: np.array([x.sum() - 2.0]), BOX)
    assert np.abs(best - [0.5, 1.5]).max() < 1e-6
    assert np.abs(end - best).max() < 3.1 * reach, end


MIXED = np.array([[2.0, 0.3, 0.2], [0.3, 3.0, -0.4], [0.2, -0.4, 2.5]])
TOP = np.array([3.0, 2.0, 4.0])
PLANES = np.array([[1.0, 1.0, 1.0], [2.0, -1.0, 0.5]])
UPPER = np.array([2.0, 1.0])


AMPLITUDE = [0.05, 0.2, 0.1]


def mixed(x: Point) -> float:
    return float(-0.5 * (x - TOP) @ MIXED @ (x - TOP))


@pytest.mark.parametrize("name", ["batch", "moving_average", "washout", "spsa", "spsa_second_order", "gradient"])
def test_three_inputs_and_two_limits_end_where_slsqp_ends(name: str) -> None:
    """The limits leave room for the reach of each dither, so the solver is asked with that room."""
    limits = [Limit("a", UPPER[0], scale=1.0), Limit("b", UPPER[1], scale=1.0)]
    space = {"start": [-2.0, -1.0, -3.0], "bounds": (-9.0, 9.0), "limits": limits}
    amplitude = AMPLITUDE
    seeker = {**dithering(amplitude, space, THREE), **direct(space)}[name]()
    end = end_of(seeker, mixed, lambda x: PLANES @ x, 12000)
    half = 0.5  # dithers and perturbations are halved while a limit holds
    reach = {"spsa": [0.2] * 3, "spsa_second_order": [0.4] * 3, "gradient": [0.4] * 3}
    kept = np.abs(PLANES) @ (half * np.array(reach.get(name, amplitude)))
    best = best_of(mixed, lambda x: PLANES @ x - UPPER + kept, [(-9.0, 9.0)] * 3)
    assert (PLANES @ end - UPPER).max() < 0.02
    # The loss against the solver: next to nothing for steps that use a mean, more for those of two.
    allowed = {"spsa": 0.3, "spsa_second_order": 0.3}.get(name, 0.02)
    assert mixed(best) - mixed(end) < allowed, (end, best)


@pytest.mark.parametrize("name", ["batch", "gradient"])
def test_j_never_falls_after_the_first_arrival(name: str) -> None:
    limits = [Limit("a", UPPER[0], scale=1.0), Limit("b", UPPER[1], scale=1.0)]
    space = {"start": [-2.0, -1.0, -3.0], "bounds": (-9.0, 9.0), "limits": limits}
    seeker = {**dithering(AMPLITUDE, space, THREE), **direct(space)}[name]()
    history = seeker.run(lambda x: (mixed(x), PLANES @ x), 12000)
    estimate = history["estimate"].to_numpy()
    rooms = UPPER - estimate @ PLANES.T
    arrival = int(np.argmax((rooms < 0.7).any(axis=1)))
    assert 0 < arrival < 6000
    j = np.array([mixed(x) for x in estimate[arrival:]])
    assert np.diff(j).min() > -1e-9  # rounding
    assert (np.maximum.accumulate(j) - j).max() < 5e-9
