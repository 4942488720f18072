"""A virtual throttle behind a virtual bus of this process, and what its host sends."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from mgdd.rig import CanRig, SignalMap
from mgdd.rig.can.node import node_of, run_node
from mgdd.rig.can.node_core import NodeCore
from mgdd.rig.can.transport import CanTransport

pytest.importorskip("can", reason="the extra `can` is not installed")
pytest.importorskip("cantools", reason="the extra `can` is not installed")

ETB = SignalMap.load("etb")
LONG_S = 5.0  # nothing here waits so long, unless it fails


@contextmanager
def node(channel: str, *, step: bool = True, signal_map: SignalMap = ETB, seed: int = 1) -> Iterator[NodeCore]:
    """A node of this process behind a virtual bus."""
    core = NodeCore(node_of(signal_map, seed=seed), signal_map)
    stop = threading.Event()
    with CanTransport("virtual", channel) as bus:
        serving = threading.Thread(
            target=lambda: run_node(core, bus, step=step, keep_on=lambda: not stop.is_set()), daemon=True
        )
        serving.start()
        try:
            yield core
        finally:
            stop.set()
            serving.join()


def rig_on(channel: str, mode: str = "hil", signal_map: SignalMap = ETB, **settings: object) -> CanRig:
    return CanRig(signal_map, f"virtual:{channel}", mode=mode, timeout_s=LONG_S, **settings)  # type: ignore[arg-type]


def commands(spy: CanTransport) -> list[bytes]:
    """Frames of the host that the spy has seen."""
    out, until = [], time.monotonic() + 0.3  # a node with a clock never falls silent
    while time.monotonic() < until and (frame := spy.receive(0.05)) is not None:
        out += [frame.data] if frame.id == 0x120 else []
    return out


def is_safe(payload: bytes) -> bool:
    """Mode off, bridge open, duty 0: bits of the DBC by hand."""
    word = int.from_bytes(payload, "little")
    return (word >> 12) & 7 == 0 and (word >> 15) & 1 == 0 and (word >> 32) & 0xFFF == 0
