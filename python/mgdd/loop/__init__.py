"""Closed loops: the virtual engine bench, a seeker on it, and thousands of such runs at once.

`EngineBench` is the plant with its chance and its sensors, `run_seeker` closes the loop in the core, `monte_carlo` does
so for seeds, gains and operating points on all cores, `find_steady_optimum` says where a seeker should end.
"""

from __future__ import annotations

from mgdd._core import SensorDynamics
from mgdd.loop.bench import EngineBench
from mgdd.loop.seek import LoopRun, monte_carlo, run_seeker
from mgdd.loop.steady import find_steady_optimum, steady_map
from mgdd.loop.summary import summarize_cycles

__all__ = [
    "EngineBench",
    "LoopRun",
    "SensorDynamics",
    "find_steady_optimum",
    "monte_carlo",
    "run_seeker",
    "steady_map",
    "summarize_cycles",
]
