"""Receding-horizon control: its plan against solvers of others, preview, soft bounds, what acted before."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import linalg, optimize

from mgdd.control import DiscreteModel, RecedingHorizon
from receding_cases import LIMITS, LINEAR, A, B, C, stretched, swing


def cost_of(
    model: DiscreteModel, x: NDArray[np.float64], u: NDArray[np.float64], r: float, s: dict[str, float], before: float
) -> float:
    total = 0.0
    for k, value in enumerate(u):
        x = model.step(x, value)
        y = model.output(x)
        total += s["terminal_weight" if k + 1 == len(u) else "output_weight"] * (y - r) ** 2
        total += s["input_weight"] * value**2 + s["change_weight"] * (value - before) ** 2
        excess = max(0.0, y - s.get("largest_output", 1e300), s.get("least_output", -1e300) - y)
        total += s.get("output_limit_weight", 0.0) * excess**2
        before = value
    return float(total)


def best_plan(
    model: DiscreteModel, x: NDArray[np.float64], r: float, s: dict[str, float], n: int, before: float
) -> NDArray[np.float64]:
    """The plan of sequential quadratic programming, which knows nothing of ours."""
    change = np.eye(n) - np.eye(n, k=-1)
    first = np.zeros(n)
    first[0] = before
    rows = {"type": "ineq", "fun": lambda u: s["largest_change"] - (change @ u - first), "jac": lambda _u: -change}
    back = {"type": "ineq", "fun": lambda u: s["largest_change"] + (change @ u - first), "jac": lambda _u: change}
    found = optimize.minimize(
        lambda u: cost_of(model, x, u, r, s, before),
        np.full(n, before),
        method="SLSQP",
        bounds=[(s["lower"], s["upper"])] * n,
        constraints=[rows, back],
        options={"ftol": 1e-13, "maxiter": 500},
    )
    return np.asarray(found.x, float)


def test_a_long_horizon_without_limits_is_the_linear_quadratic_regulator() -> None:
    weight = 3.0
    p = linalg.solve_discrete_are(A, B[:, None], weight * np.outer(C, C), np.array([[0.7]]))
    gain = (B @ p @ A) / (0.7 + B @ p @ B)
    controller = RecedingHorizon(
        LINEAR, horizon_samples=150, output_weight=weight, terminal_weight=weight, input_weight=0.7, change_weight=0.0,
        lower=-1e3, upper=1e3,
    )  # fmt: skip
    for x in ([0.7, -1.1, 0.4], [-0.2, 0.0, 3.0]):
        controller.start(x)
        # The controller's cost has no weight on the state of now: the same law.
        assert controller.step(0.0, x) == pytest.approx(-gain @ np.array(x), abs=1e-10)
        assert controller.status == "converged"


@pytest.mark.parametrize("x", [[0.4, -1.0, 0.3], [-0.3, 0.8, 1.1]])
@pytest.mark.parametrize("soft", [{}, {"largest_output": 0.5, "least_output": -0.2, "output_limit_weight": 30.0}])
def test_its_plan_is_that_of_sequential_quadratic_programming(x: list[float], soft: dict[str, float]) -> None:
    settings = LIMITS | soft
    for r in (0.9, -0.4):
        controller = RecedingHorizon(LINEAR, horizon_samples=12, max_sweeps=300, **settings)  # type: ignore[arg-type]
        controller.start(x, applied=0.3)
        u = controller.step(r, x)
        other = best_plan(LINEAR, np.array(x), r, settings, 12, 0.3)
        assert controller.planned_inputs == pytest.approx(other, abs=2e-4)
        mine = cost_of(LINEAR, np.array(x), controller.planned_inputs, r, settings, 0.3)
        assert mine <= cost_of(LINEAR, np.array(x), other, r, settings, 0.3) * (1.0 + 1e-9)
        assert u == controller.planned_inputs[0]
        ahead = np.array(x)
        for planned, said in zip(controller.planned_inputs, controller.predicted_outputs, strict=True):
            ahead = LINEAR.step(ahead, planned)
            assert said == pytest.approx(LINEAR.output(ahead), abs=1e-12)


def test_of_a_nonlinear_model_too_with_iterations() -> None:
    model = DiscreteModel(swing, output=stretched, n_states=2, sample_s=0.05)
    settings = LIMITS | {"input_weight": 0.05, "lower": -1.0}
    for x in ([-0.7, 1.5], [1.9, -0.4]):
        controller = RecedingHorizon(
            model, horizon_samples=14, max_iterations=80, tolerance=1e-8, **settings  # type: ignore[arg-type]
        )  # fmt: skip
        controller.start(x, applied=0.1)
        controller.step(1.2, x)
        assert controller.status == "converged"
        assert controller.iterations >= 2
        other = best_plan(model, np.array(x), 1.2, settings, 14, 0.1)
        mine = cost_of(model, np.array(x), controller.planned_inputs, 1.2, settings, 0.1)
        assert mine <= cost_of(model, np.array(x), other, 1.2, settings, 0.1) * (1.0 + 1e-7)


def test_preview_acts_before_the_reference_moves_and_limits_hold() -> None:
    errors = {}
    for preview in (False, True):
        controller = RecedingHorizon(LINEAR, horizon_samples=16, **LIMITS)  # type: ignore[arg-type]
        wanted = np.where(np.arange(300) % 60 < 30, 0.5, -0.3)
        x, before, total = np.zeros(3), 0.0, 0.0
        for k in range(250):
            u = controller.step(wanted[k + 1 : k + 17] if preview else wanted[k + 1], x)
            assert -0.45 <= u <= 0.8
            assert abs(u - before) <= 0.17 + 1e-15
            x, before = LINEAR.step(x, u), u
            total += (LINEAR.output(x) - wanted[k + 1]) ** 2
        errors[preview] = total
    assert errors[True] < 0.8 * errors[False]


def test_a_soft_bound_keeps_a_loop_below_it() -> None:
    highest = {}
    for weight in (0.0, 1e4):
        controller = RecedingHorizon(
            LINEAR, horizon_samples=20, change_weight=1e-3, largest_output=0.52, output_limit_weight=weight
        )
        x, seen = np.zeros(3), []
        for k in range(80):
            x = LINEAR.step(x, controller.step(0.5 if k < 60 else 0.7, x))
            seen.append(LINEAR.output(x))
        highest[weight] = max(seen)
    assert highest[0.0] > 0.65
    assert 0.5 < highest[1e4] < 0.53


def test_what_really_acted_is_counted_from() -> None:
    controller = RecedingHorizon(LINEAR, horizon_samples=9, **LIMITS)  # type: ignore[arg-type]
    controller.start([0.0, 0.0, 0.0], applied=0.3)
    controller.step(2.0, [0.0, 0.0, 0.0])
    controller.applied(-0.4)
    assert controller.step(2.0, [0.0, 0.0, 0.0]) <= -0.4 + 0.17 + 1e-15
    controller.reset()
    assert abs(controller.step(2.0, [0.0, 0.0, 0.0])) <= 0.17 + 1e-15
