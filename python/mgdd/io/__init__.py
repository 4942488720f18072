"""Files in, files out: whole test-cell files, measured pressure, throttle logs, operating conditions, parameters.

Angles are degrees of crank angle with firing TDC = 0 and compression negative (°CA aTDC); pressure is in bar.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.io.bench_file import read
from mgdd.io.chunks import pressure_chunks
from mgdd.io.encoder import Encoder
from mgdd.io.plain_csv import write_csv
from mgdd.io.pressure import pressure_trace, read_pressure
from mgdd.io.throttle_log import read_throttle_log, throttle_log

__all__ = [
    "Encoder",
    "pressure_chunks",
    "pressure_trace",
    "read",
    "read_pressure",
    "read_throttle_log",
    "throttle_log",
    "write_csv",
]

_furnish(__name__)
