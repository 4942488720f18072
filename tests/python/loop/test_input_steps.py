"""Inputs that can be set in whole steps alone: what is asked lies on them, the best is found, limits are kept."""

import math
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.errors import ParameterError
from mgdd.loop import seek
from mgdd.optimize import Input

LOW, HIGH, BEST, EDGE = -19.8, 20.2, 3.3, 1.4
WIDTHS = (0.25, 2.5, 5.0)


def made(width: float, **own: Any) -> dict[str, Any]:
    return stepped(start={"a": -8.1}, inputs=[Input("a", LOW, HIGH, step=width)], **own)


NAMES = list(made(1.0))


def run(seeker: Any, cycles: int, *, limited: bool = False) -> np.ndarray:
    """Return what was asked of a plant whose pressure passes its limit of 80 at EDGE."""
    rng, asked = np.random.default_rng(2), []
    for _ in range(cycles):
        (x,) = seeker.ask().values()
        j = 50.0 - 0.03 * (x - BEST) ** 2 + rng.normal(0.0, 0.1)
        seeker.tell(j, [80.0 + 2.0 * (x - EDGE) + rng.normal(0.0, 0.3)] if limited else None)
        asked.append(x)
    return np.array(asked)


def steps_above(values: np.ndarray, width: float) -> np.ndarray:
    return np.asarray((values - LOW) / width)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", NAMES)
def test_every_seeker_asks_for_steps_and_finds_the_best(name: str, width: float) -> None:
    seeker = made(width)[name]()
    count = steps_above(run(seeker, 400), width)
    np.testing.assert_allclose(count, np.round(count), rtol=0.0, atol=1e-9)
    best = LOW + round((BEST - LOW) / width) * width
    assert abs(float(seeker.settable[0]) - best) <= max(width, 1.0) + 1e-9
    settled = steps_above(seeker.settable, width)
    np.testing.assert_allclose(settled, np.round(settled), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", NAMES)
def test_the_step_beyond_a_limit_is_not_the_nearest(name: str, width: float) -> None:
    seeker = made(width, limits={"p": 80.0})[name]()
    asked = run(seeker, 400, limited=True)
    last = LOW + math.floor((EDGE - LOW) / width) * width
    assert np.mean(asked[40:] > last + 1e-9) < 0.05
    assert last - max(width, 2.0) - 1e-9 <= float(seeker.settable[0]) <= last + 1e-9


def test_two_inputs_of_which_one_has_steps() -> None:
    found = seek(
        lambda x: -0.03 * (x["a"] - BEST) ** 2 - 300.0 * (x["egr"] - 0.17) ** 2,
        {"a": (LOW, HIGH), "egr": (0.0, 0.4, 0.05)},
        cycles=80,
    )
    assert found.inputs["egr"] == pytest.approx(0.15)
    assert found.inputs["a"] == pytest.approx(BEST, abs=0.5)


def test_a_seeker_of_ones_own_is_told_the_step_that_was_set() -> None:
    class Thirds:
        estimate = 1.0 / 3.0

        def __init__(self) -> None:
            self.told: list[float] = []

        def ask(self) -> float:
            return self.estimate

        def tell(self, J: float, applied: np.ndarray) -> None:  # noqa: N803
            assert -(applied[0] ** 2) == J
            self.told.append(float(applied[0]))

    own = Thirds()
    found = seek(lambda x: -(x**2), {"x": (-1.0, 1.0, 0.5)}, seeker=own, cycles=3)
    assert (own.told, found.inputs) == ([0.5, 0.5, 0.5], {"x": 0.5})


@pytest.mark.parametrize(
    ("bounds", "value", "nearest"),
    [
        ((0.0, 10.0, 3.0), 10.0, 9.0),  # the bound is not on a step
        ((0.0, 0.3, 0.1), 0.3, 0.3),  # it is one, but for rounding
        ((-math.inf, 10.0, 4.0), -5.0, -4.0),  # multiples of the step, without a lower bound
        ((-3.0, math.inf, 2.0), 6.9, 7.0),
        ((0.0, 10.0, 0.0), 3.21, 3.21),
    ],
)
def test_the_nearest_value_that_can_be_set(bounds: tuple[float, float, float], value: float, nearest: float) -> None:
    lower, upper, step = bounds
    assert Input("a", lower, upper, step=step).nearest(value) == nearest


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"step": -1.0}, "step = -1"),
        ({"step": math.nan}, "step = nan"),
        ({"step": 50.0}, "at most upper - lower = 10"),
        ({"step": 2.0, "rate": 1.0}, "at most the rate = 1"),
    ],
)
def test_a_step_that_cannot_be_is_refused(settings: dict[str, float], said: str) -> None:
    with pytest.raises(ParameterError, match=said) as refused:
        Input("a", 0.0, 10.0, **settings)
    assert "step" in str(refused.value)
