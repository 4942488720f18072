"""Receding-horizon control: against solvers of others, on matrices, functions and throttle models; errors and state."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import linalg, optimize

from mgdd.control import DiscreteModel, RecedingHorizon
from mgdd.errors import ParameterError, ShapeError
from mgdd.identify import FirstPrincipleModel
from mgdd.loop import track
from mgdd.throttle import PseudoWiener, Throttle

A = np.array([[0.95, 0.2, 0.0], [-0.3, 0.9, 0.15], [0.05, 0.0, 0.7]])
B, C = np.array([0.02, 0.1, 0.4]), np.array([1.0, -0.1, 0.3])
LINEAR = DiscreteModel.linear(A, B, C, sample_s=0.05)


def swing(x: Any, u: Any) -> Any:
    """A pendulum by semi-implicit Euler steps; analytic."""
    speed = x[1] + 0.05 * (6.0 * u - 9.0 * np.sin(x[0]) - 0.8 * np.tanh(3.0 * x[1]))
    return np.array([x[0] + 0.05 * speed, speed])


def stretched(x: Any) -> Any:
    """An output that is not linear in the state."""
    return x[0] + 0.1 * x[0] ** 2


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


LIMITS = {
    "output_weight": 3.0,
    "terminal_weight": 11.0,
    "input_weight": 2e-2,
    "change_weight": 5e-2,
    "lower": -0.45,
    "upper": 0.8,
    "largest_change": 0.17,
}


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


def throttle_models() -> dict[str, Any]:
    groups = {**PseudoWiener.of_throttle(Throttle()).parameters, "delay_samples": 1.0, "ramp_deg": 0.5}
    return {
        "pw_r": PseudoWiener("pw_r", groups, friction="tanh"),
        "pw_w": PseudoWiener("pw_w", {"delay_samples": 1.0}),
        "pw_p": PseudoWiener("pw_p", {"delay_samples": 1.0}),
        "first_principle": FirstPrincipleModel(
            parameters={
                "tau_s": groups.get("above_tau_s", 0.0197),
                "gain_deg_per_s2_per_duty": 83597.0,
                "beta_above_duty": 0.1292,
                "kappa_above_duty_per_deg": 4.96e-4,
                "delta_duty": 0.0927,
                "beta_below_duty": 0.1292,
                "kappa_below_duty_per_deg": 4.96e-4,
                "limp_home_deg": 8.0,
                "electrical_s": 0.001,
                "delay_samples": 1.0,
            }
        ),
    }


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
@pytest.mark.parametrize("late", [1, 2, 30, 101])
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
            if trap.calls + late <= trap.calls + 60:
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


def test_what_really_acted_is_counted_from() -> None:
    controller = RecedingHorizon(LINEAR, horizon_samples=9, **LIMITS)  # type: ignore[arg-type]
    controller.start([0.0, 0.0, 0.0], applied=0.3)
    controller.step(2.0, [0.0, 0.0, 0.0])
    controller.applied(-0.4)
    assert controller.step(2.0, [0.0, 0.0, 0.0]) <= -0.4 + 0.17 + 1e-15
    controller.reset()
    assert abs(controller.step(2.0, [0.0, 0.0, 0.0])) <= 0.17 + 1e-15


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
