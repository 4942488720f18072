"""Loops: the virtual engine bench that seekers and rigs run against.

Crank angles are °CA aTDC (firing TDC = 0, compression negative) throughout.
"""

from __future__ import annotations

from mgdd._core import SensorDynamics
from mgdd.loop.bench import EngineBench

__all__ = ["EngineBench", "SensorDynamics"]
