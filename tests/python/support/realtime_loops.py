"""A real-time loop of a throttle that waits for a busy machine, and how a test waits for it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from mgdd.control import Pid
from mgdd.rig.realtime import RealtimeLoop, RingTransport
from throttle_node import COMMAND, MEASUREMENTS, PERIOD_S, ThrottleNode, patient_envelope


def make_loop(transport: RingTransport, controller: Any = None, **changes: Any) -> RealtimeLoop:
    settings: dict[str, Any] = {
        "command": COMMAND,
        "measurements": MEASUREMENTS,
        "envelope": patient_envelope(),
        "realtime": False,
        "lock_memory": False,
    }
    return RealtimeLoop(controller or Pid(sample_s=PERIOD_S), transport, **{**settings, **changes})


def becomes(condition: Callable[[], bool], within_s: float = 20.0) -> bool:
    until = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.005)
    return True


def go(loop: RealtimeLoop) -> None:
    loop.arm(20.0)
    loop.drive(20.0)


@contextmanager
def driving(controller: Any = None, **changes: Any) -> Iterator[tuple[ThrottleNode, RealtimeLoop]]:
    """A throttle, and a loop that drives it."""
    transport = RingTransport()
    with ThrottleNode.on(transport) as node, make_loop(transport, controller, **changes) as loop:
        go(loop)
        yield node, loop
