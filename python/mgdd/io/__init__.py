"""Files in, files out: measured pressure as CSV or plain columns, operating conditions as CSV.

Angles are degrees of crank angle with firing TDC = 0 and compression negative (°CA aTDC); pressure is in bar.
"""

from __future__ import annotations

from mgdd.io.angles import from_0_720, from_btdc
from mgdd.io.checks import check_trace
from mgdd.io.conditions import read_conditions
from mgdd.io.pressure import pressure_trace, read_pressure, write_pressure
from mgdd.io.traces import write_traces

__all__ = [
    "check_trace",
    "from_0_720",
    "from_btdc",
    "pressure_trace",
    "read_conditions",
    "read_pressure",
    "write_pressure",
    "write_traces",
]
