"""Receding-horizon control where something is wrong: errors of a model, numbers that are not finite, arguments."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mgdd.control import DiscreteModel, RecedingHorizon
from mgdd.errors import ParameterError, ShapeError
from mgdd.throttle import Throttle
from receding_cases import LINEAR, A, B, C, swing, throttle_models


class Trap:
    """A model that breaks on demand."""

    def __init__(self) -> None:
        self.calls, self.broken_from = 0, math.inf
        self.answer: Any = None

    def __call__(self, x: Any, u: Any) -> Any:
        self.calls += 1
        if self.calls >= self.broken_from:
            if self.answer is None:
                raise ZeroDivisionError("no such plant")
            return self.answer
        return swing(x, u)


@pytest.mark.parametrize(
    ("answer", "error"),
    [(None, ZeroDivisionError), ([1.0], ShapeError), ("nonsense", ValueError), ([1.0, 2.0, 3.0], ShapeError)],
)
@pytest.mark.parametrize("late", [1, 2, 30, 70])  # of the 71 calls of a step
def test_an_error_of_a_function_comes_out_and_changes_nothing(answer: Any, error: type[Exception], late: int) -> None:
    trap = Trap()
    make = {"output": [1.0, 0.0], "n_states": 2, "sample_s": 0.05}
    broken = RecedingHorizon(DiscreteModel(trap, **make), horizon_samples=10)  # type: ignore[arg-type]
    sound = RecedingHorizon(DiscreteModel(swing, **make), horizon_samples=10)  # type: ignore[arg-type]
    x = np.array([0.1, 0.0])
    for k in range(20):
        if k % 5 == 3:
            before, trap.broken_from, trap.answer = broken.state, trap.calls + late, answer
            planned = broken.planned_inputs
            with pytest.raises(error):
                broken.step(0.5, x)
            assert broken.state == before
            assert np.array_equal(broken.planned_inputs, planned)
            trap.broken_from = math.inf
        u = broken.step(0.5, x)
        assert u == sound.step(0.5, x)
        x = swing(x, u)


def test_a_prediction_that_is_not_finite_repeats_the_input_and_says_so() -> None:
    sick = [False]
    model = DiscreteModel(
        lambda x, u: [math.nan, 0.0] if sick[0] else swing(x, u), output=[1.0, 0.0], n_states=2, sample_s=0.05
    )
    controller = RecedingHorizon(model, horizon_samples=8)
    u = controller.step(0.5, [0.1, 0.0])
    sick[0] = True
    assert controller.step(0.5, [0.1, 0.0]) == u
    assert controller.status == "not_finite"
    sick[0] = False
    assert controller.step(0.5, [math.nan, 0.0]) == u
    assert controller.status == "not_finite"
    assert controller.step(math.nan, [0.1, 0.0]) == u
    assert controller.status == "not_finite"
    controller.step(0.5, [0.1, 0.0])
    assert controller.status == "converged"


def test_wrong_arguments_name_themselves_and_change_nothing() -> None:
    for name, value in {
        "output_weight": -1.0, "upper": -2.0, "largest_change": 0.0, "horizon_samples": 0, "max_sweeps": 0,
        "largest_output": -1e300, "output_limit_weight": math.nan,
    }.items():  # fmt: skip
        with pytest.raises(ParameterError, match=name):
            RecedingHorizon(LINEAR, **{name: value})  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="model"):
        RecedingHorizon(Throttle())
    with pytest.raises(ShapeError, match="observer_gain"):
        RecedingHorizon(LINEAR, observer_gain=[1.0])
    with pytest.raises(ParameterError, match="observer_gain"):
        RecedingHorizon(throttle_models()["pw_r"], observer_gain=[1.0])
    for bad in (
        lambda: DiscreteModel.linear(np.ones((2, 3)), B, C, sample_s=1.0),
        lambda: DiscreteModel.linear(A, B[:2], C, sample_s=1.0),
        lambda: DiscreteModel.linear(A, B, C, sample_s=0.0),
        lambda: DiscreteModel.linear(A * np.nan, B, C, sample_s=1.0),
        lambda: DiscreteModel(swing, output=[1.0], n_states=2, sample_s=1.0),
        lambda: DiscreteModel(swing, output=[1.0, 0.0], n_states=33, sample_s=1.0),
        lambda: DiscreteModel(swing, output=[1.0, 0.0], n_states=2, sample_s=1.0, slopes="exact"),
    ):
        with pytest.raises((ParameterError, ShapeError)):
            bad()
    controller = RecedingHorizon(LINEAR)
    controller.step(0.3, [0.1, 0.2, 0.3])
    before = controller.state
    for wrong in (
        lambda: controller.step(0.3, 0.1),
        lambda: controller.step([], [0.1, 0.2, 0.3]),
        lambda: controller.step([[0.3]], [0.1, 0.2, 0.3]),
        lambda: controller.start([0.1]),
        lambda: controller.start([0.1, math.nan, 0.0]),
    ):
        with pytest.raises((ParameterError, ShapeError)):
            wrong()
    with pytest.raises(ParameterError, match="applied"):
        controller.state = before | {"applied": [3.0]}
    assert controller.state == before
    assert set(RecedingHorizon.fields()) < set(controller.settings)
    assert RecedingHorizon(LINEAR, **controller.settings).settings == controller.settings
