"""Settings of dithered seekers that follow from the curvature of J."""

from __future__ import annotations


def approach_gain(curvature: float, time_constant_cycles: float, *, amplitude: float = 1.0) -> float:
    """Give the gain by which extremum seeking nears an optimum of this curvature with this time constant [cycles]."""
    return 2.0 / (amplitude * abs(curvature) * time_constant_cycles)
