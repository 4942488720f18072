"""A record with something of every kind, asymmetric in all of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mgdd.rig import Frame, Recorder

FRAMES = [
    Frame(id=0x120, data=bytes(range(8)), monotonic_ns=5_000_000_000, bus_ns=1_700_000_000_000_000_123),
    Frame(id=0x1ABCDEF0, extended=True, data=b"", received=True, channel=3, monotonic_ns=-7),
    Frame(id=0x7FF, fd=True, bit_rate_switch=True, data=bytes(range(200, 248)), received=True),
    Frame(id=0x40, error=True, data=bytes(8), received=True),
    Frame(id=0x121, remote=True, data=bytes(4)),
]


def write(path: Path) -> Recorder:
    with Recorder(path, config={"rig": "Prüfstand", "gain": np.float64(2.5)}) as record:
        for frame in FRAMES:
            record.frame(frame)
        record.sample("controller", {"angle_deg": 10.25, "duty": -0.5}, monotonic_ns=1_000)
        record.sample("controller", {"duty": np.nan, "angle_deg": 11.5}, monotonic_ns=2_000)
        record.sample("engine", {"speed_rpm": 1200}, monotonic_ns=1_500)
        record.event("state", "ARMED → RUN", monotonic_ns=3_000)
        record.sync()
    return record
