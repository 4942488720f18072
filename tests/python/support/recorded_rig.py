"""A record with something of every kind, asymmetric in all of it, and a reader of its own."""

import json
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mgdd.rig import Recorder
from mgdd.rig.realtime import Frame

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


def independent(path: Path) -> Iterator[tuple[Any, ...]]:
    """Read a record with the standard library alone, as docs/rig_record.md says."""
    data = path.read_bytes()
    magic, version, length, run_id, wall_ns, monotonic_ns = struct.unpack_from("<8sII16sqq", data)
    assert (magic, version) == (b"\x89MREC\r\n\x1a", 1)
    at = 48 + length + 4
    assert zlib.crc32(data[: at - 4]) == struct.unpack_from("<I", data, at - 4)[0]
    yield "header", run_id, wall_ns, monotonic_ns, json.loads(data[48 : 48 + length])
    while at + 8 <= len(data):
        length, crc = struct.unpack_from("<II", data, at)
        body = data[at + 8 : at + 8 + length]
        if length < 16 or len(body) < length or zlib.crc32(body) != crc:
            break
        at += 8 + length
        kind, flags, small, word, stamp = struct.unpack_from("<BBHIq", body)
        if kind == 1:
            yield "frame", flags, small & 255, small >> 8, word, stamp, struct.unpack_from("<q", body, 16)[0], body[24:]
        elif kind == 2:
            names, place = [], 16
            for _ in range(word + 1):
                size = struct.unpack_from("<H", body, place)[0]
                names.append(body[place + 2 : place + 2 + size].decode())
                place += 2 + size
            yield "columns", small, stamp, names
        elif kind == 3:
            yield "sample", small, stamp, struct.unpack_from(f"<{word}d", body, 16)
        elif kind == 4:
            yield "event", stamp, body[16 : 16 + small].decode(), body[16 + small :].decode()
    yield "ignored", len(data) - at
