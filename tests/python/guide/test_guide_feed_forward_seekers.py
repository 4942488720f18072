"""Feed-forward around every seeker: nothing without a guide, and on from state, pickle and copy bit for bit."""

from __future__ import annotations

import copy
import json
import math
import pickle
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.guide import FeedForward
from mgdd.optimize import Limit
from mgdd.optimize.optimum import Optimum

SPACE: dict[str, Any] = {"start": -20.0, "bounds": (-30.0, 10.0)}
LIMITS = [Limit(name="p_max_bar", upper=112.0)]
FREE, LIMITED = (
    {name: make for name, make in stepped(**SPACE, **own).items() if name != "CurveSeeking"}
    for own in ({}, {"limits": LIMITS})
)  # a curve is its own guide


def plant(x: float, optimum: float, noise: float = 0.0) -> float:
    return 56.0 - 0.0255 * (x - optimum) ** 2 + noise


def moved(fuel: float) -> Optimum:
    return Optimum(inputs={"soc_cad": -0.35 * fuel + 1.0}, objective="J", value=0.0, curvature=-0.051)


@pytest.mark.parametrize("name", FREE)
def test_without_a_guide_it_is_the_seeker_bit_for_bit(name: str) -> None:
    plain, guided = LIMITED[name](), LIMITED[name]()
    rng = np.random.default_rng(1)
    for one in (plain, guided):  # a seeker that has run already goes on with its state and history
        for k in range(15):
            x = float(one.ask()[0])
            one.tell(plant(x, -5.6, 0.1 * math.sin(k)), [110.0 - x])
    ff = FeedForward(guided)
    for k in range(300):
        point = {"fuel_mg": 20.0 if k < 150 else 30.0}
        x = plain.ask()
        assert ff.at(point) == "held"
        assert ff.ask().tobytes() == x.tobytes()
        told = plant(float(x[0]), -5.6, 0.2 * rng.standard_normal())
        for one in (plain, ff):
            one.tell(told, [110.0 - float(x[0])], misfire=k % 40 == 3)
        if k + 1 == 150:
            plain.restart()  # as a loop does at the new point that the next `at` says
    assert ff.seeker.state == plain.state
    assert ff.seeker.history.identical(plain.history)
    assert (ff.cycle + 15, ff.limit_names) == (plain.cycle, plain.limit_names)
    assert np.isnan(ff.feed_forward).all()
    assert np.isnan(ff.trim).all()


@pytest.mark.parametrize("cut", [1, 40, 61])
@pytest.mark.parametrize("name", FREE)
def test_goes_on_bit_for_bit_from_state_pickle_and_copy(name: str, cut: int) -> None:
    def play(ff: FeedForward, first: int, last: int) -> None:
        for k in range(first, last):
            fuel = 12.0 if k < 60 else 30.0
            ff.at(fuel)
            ff.tell(plant(float(ff.ask()[0]), -0.35 * fuel, 0.25 * math.sin(12.3 * k * k)))

    whole = FeedForward(FREE[name](), moved, noise_sd=0.25)
    play(whole, 0, cut)
    state = json.loads(json.dumps(whole.state))
    others = [FeedForward(FREE[name](), moved, noise_sd=0.25), pickle.loads(pickle.dumps(whole)), copy.copy(whole)]
    others[0].state = state
    play(whole, cut, 100)
    for other in others:
        play(other, cut, 100)
        assert other.state == whole.state
    assert others[1].history.identical(whole.history)
    assert others[1].seeker.history.identical(whole.seeker.history)
