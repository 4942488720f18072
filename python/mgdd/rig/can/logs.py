"""Logs of raw frames in the formats of other tools, by the writers of python-can."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import MappingProxyType

from mgdd._core.rig import Frame
from mgdd.io.extras import import_extra
from mgdd.rig.can.messages import message_of

__all__ = ["LOG_WRITERS", "write_log"]

LOG_WRITERS = MappingProxyType({"blf": "BLFWriter", "asc": "ASCWriter", "log": "CanutilsLogWriter"})


def write_log(kind: str, path: Path, frames: Iterable[tuple[float, Frame]]) -> None:
    """Write frames with their wall-clock stamps [s] as ``blf``, ``asc`` or ``log`` (candump)."""
    io = import_extra("can.io", "can", f"a {kind} file")
    writer = getattr(io, LOG_WRITERS[kind])(path)
    try:
        for timestamp_s, frame in frames:
            writer.on_message_received(message_of(frame, timestamp_s=timestamp_s))
    finally:
        writer.stop()  # it buffers: without this the end of the file is missing
