"""Models for a receding horizon: matrices, a pendulum, those of a throttle; limits that differ on all sides."""

from __future__ import annotations

from typing import Any

import numpy as np

from mgdd.control import DiscreteModel
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.throttle import PseudoWiener, Throttle

A = np.array([[0.95, 0.2, 0.0], [-0.3, 0.9, 0.15], [0.05, 0.0, 0.7]])
B, C = np.array([0.02, 0.1, 0.4]), np.array([1.0, -0.1, 0.3])
LINEAR = DiscreteModel.linear(A, B, C, sample_s=0.05)
LIMITS = {
    "output_weight": 3.0,
    "terminal_weight": 11.0,
    "input_weight": 2e-2,
    "change_weight": 5e-2,
    "lower": -0.45,
    "upper": 0.8,
    "largest_change": 0.17,
}


def swing(x: Any, u: Any) -> Any:
    """A pendulum by semi-implicit Euler steps; analytic."""
    speed = x[1] + 0.05 * (6.0 * u - 9.0 * np.sin(x[0]) - 0.8 * np.tanh(3.0 * x[1]))
    return np.array([x[0] + 0.05 * speed, speed])


def stretched(x: Any) -> Any:
    """An output that is not linear in the state."""
    return x[0] + 0.1 * x[0] ** 2


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
