"""Receding-horizon control of every kind of model: functions as matrices, slopes, an observer, throttle models."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from scipy import linalg

from mgdd.control import DiscreteModel, RecedingHorizon
from mgdd.loop import track
from receding_cases import LIMITS, LINEAR, A, B, C, stretched, swing, throttle_models


def loop(controller: RecedingHorizon, model: DiscreteModel, n: int = 120) -> list[float]:
    x, sent = np.zeros(model.n_states), []
    for k in range(n):
        sent.append(controller.step(0.5 if k % 60 < 30 else -0.3, x))
        x = model.step(x, sent[-1]) + 0.003 * math.cos(0.7 * k)
    return sent


@pytest.mark.parametrize("slopes", ["differences", "complex_step", lambda _x, _u: (A.tolist(), B)])
def test_a_function_that_is_linear_gives_what_matrices_give(slopes: Any) -> None:
    model = DiscreteModel(lambda x, u: A @ x + B * u, output=C, n_states=3, sample_s=0.05, slopes=slopes)
    expected = loop(RecedingHorizon(LINEAR, horizon_samples=9, **LIMITS), LINEAR)  # type: ignore[arg-type]
    got = loop(RecedingHorizon(model, horizon_samples=9, **LIMITS), LINEAR)  # type: ignore[arg-type]
    assert got == pytest.approx(expected, abs=1e-6 if slopes == "differences" else 1e-12)
    assert len({round(u, 9) for u in expected}) > 20


def test_slopes_by_differences_and_complex_steps_are_those_of_the_function() -> None:
    x, u = np.array([0.7, -0.2]), 0.3
    angle_slope = -9.0 * math.cos(0.7)
    speed_slope = -0.8 * 3.0 / math.cosh(0.6) ** 2
    row = np.array([0.05 * angle_slope, 1.0 + 0.05 * speed_slope])
    exact = np.array([[1.0 + 0.05 * row[0], 0.05 * row[1]], row])
    for way, tolerance in (("differences", 1e-8), ("complex_step", 1e-14)):
        model = DiscreteModel(swing, output=stretched, n_states=2, sample_s=0.05, slopes=way)
        a, b = model.slopes(x, u)
        assert a == pytest.approx(exact, abs=tolerance)
        assert b == pytest.approx([0.05 * 0.3, 0.3], abs=tolerance)
        assert model.output_slope(x) == pytest.approx([1.14, 0.0], abs=tolerance)


def test_an_observer_takes_the_output_and_a_disturbance_state_leaves_no_offset() -> None:
    a = np.block([[A, B[:, None]], [np.zeros(3), np.ones(1)]])  # an input nobody told of is a fourth state
    model = DiscreteModel.linear(a, np.append(B, 0.0), np.append(C, 0.0), sample_s=0.05)
    p = linalg.solve_discrete_are(a.T, np.append(C, 0.0)[:, None], np.diag([1e-3, 1e-3, 1e-3, 1e-2]), [[1e-3]])
    full = np.append(C, 0.0)
    gain = p @ full / (full @ p @ full + 1e-3)
    errors = {}
    for name, chosen in (("with", gain), ("without", gain * [1, 1, 1, 0])):
        controller = RecedingHorizon(model, horizon_samples=20, observer_gain=chosen, change_weight=0.05)
        x = np.zeros(3)
        for k in range(300):
            measured = math.nan if k in (0, 1, 7, 150) else LINEAR.output(x)
            u = controller.step(0.4, measured)
            assert math.isfinite(u)
            x = LINEAR.step(x, u - 0.2)
        errors[name] = abs(LINEAR.output(x) - 0.4)
    assert errors["with"] < 1e-6 < 1e-2 < errors["without"]


@pytest.mark.parametrize("kind", ["pw_r", "first_principle"])
def test_it_follows_on_the_virtual_throttle(kind: str) -> None:
    controller = RecedingHorizon(throttle_models()[kind], horizon_samples=30, change_weight=100.0)
    run = track(controller, "step:20:60", seed=1)
    assert float(run["static_error_deg"]) < 0.5
    assert controller.status == "converged"
    again = track(
        RecedingHorizon(throttle_models()[kind], horizon_samples=30, change_weight=100.0), "step:20:60", seed=1
    )
    assert np.array_equal(run["duty"], again["duty"])


@pytest.mark.parametrize("kind", ["pw_r", "pw_w", "pw_p", "first_principle"])
def test_every_throttle_model_plans_and_goes_on_bit_for_bit(kind: str) -> None:
    model = throttle_models()[kind]
    first = RecedingHorizon(model, horizon_samples=12, change_weight=10.0)
    second = RecedingHorizon(model, horizon_samples=12, change_weight=10.0)
    for k in range(60):
        measured = 20.0 + 0.3 * k + math.sin(k)
        if k % 9 == 4:
            second.state = first.state
        u = first.step(40.0, measured)
        assert -1.0 <= u <= 1.0
        assert np.isfinite(first.predicted_outputs).all()
        if k >= 4:
            assert second.step(40.0, measured) == u
    thawed = pickle.loads(pickle.dumps(first))
    assert thawed.step(33.0, 38.0) == copy.deepcopy(first).step(33.0, 38.0) == first.step(33.0, 38.0)
