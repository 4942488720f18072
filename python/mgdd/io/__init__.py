"""Files in, files out: measured pressure, throttle logs (also from MATLAB), operating conditions, parameters.

Angles are degrees of crank angle with firing TDC = 0 and compression negative (°CA aTDC); pressure is in bar.
"""

from __future__ import annotations

from mgdd.io.point_table import read_conditions
from mgdd.io.pressure import pressure_trace, read_pressure, write_pressure
from mgdd.io.throttle_log import read_throttle_log, throttle_log, write_throttle_log

__all__ = [
    "pressure_trace",
    "read_conditions",
    "read_pressure",
    "read_throttle_log",
    "throttle_log",
    "write_pressure",
    "write_throttle_log",
]


def __dir__() -> list[str]:
    return __all__
