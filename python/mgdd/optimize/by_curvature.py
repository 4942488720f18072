"""Settings of dithered seekers that follow from the curvature of J."""

from __future__ import annotations

from typing import Any

__all__ = ["approach_gain", "newton_settings"]

# Rates of the filters of Newton seeking at a period of ten cycles; a slower dither slows them alike.
_PERIOD, _HESSIAN_RATE, _RICCATI_RATE = 10.0, 0.03, 0.02


def approach_gain(curvature: float, time_constant_cycles: float, *, amplitude: float = 1.0) -> float:
    """Give the gain by which extremum seeking nears an optimum of this curvature with this time constant [cycles]."""
    return 2.0 / (amplitude * abs(curvature) * time_constant_cycles)


def newton_settings(curvature: float, period: int, *, reach: float) -> dict[str, Any]:
    """Give period, rates and first Hessian of Newton seeking; its inverse may grow to `reach` times the first."""
    slow, bend = period / _PERIOD, abs(curvature)
    return {
        "period": period,
        "hessian_rate": _HESSIAN_RATE / slow,
        "riccati_rate": _RICCATI_RATE / slow,
        "initial_hessian": -bend,
        "initial_inverse": -1.0 / bend,
        "largest_inverse": reach / bend,
    }
