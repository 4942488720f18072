"""A process of the self-test: it opens a throttle over a bus and dies in the way it is told, doomed.py WAY BUS.

It says ``ready`` when everything is imported, waits for a line, says ``open`` when the plate is open, and ``dying``
with the monotonic time [ns] where it dies by itself.
"""

from __future__ import annotations

import math
import sys
import time

from mgdd.errors import RigError
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.transport import CanTransport

__all__ = ["drive_and_die"]

_DUTY, _OPEN_DEG, _SAMPLES = 0.3, 40.0, 8
_PATIENCE_S = 2.0
_HANGS_S = 60.0


def drive_and_die(way: str, connection: str) -> None:
    """Open the plate over a bus and die."""
    transport = CanTransport.parse(connection)
    _say("ready")
    sys.stdin.readline()
    with CanRig("etb", transport, mode="hil", timeout_s=_PATIENCE_S) as rig:
        _hold_open(rig, _SAMPLES)
        _say("open")
        if way in ("sigint", "sigterm", "sigkill"):
            _hold_open(rig, None)
        _say(f"dying {time.monotonic_ns()}")
        if way == "exception":
            raise RuntimeError("a mistake in the experiment")
        if way == "nan":
            rig.apply({"duty": math.nan})
        time.sleep(_HANGS_S)


def _hold_open(rig: CanRig, samples: int | None) -> None:
    """Hold the plate open for so many samples in a row; where a busy machine let the node time out, arm it again."""
    held, ends = 0, time.monotonic() + _HANGS_S
    while time.monotonic() < ends and (samples is None or held < samples):
        try:
            rig.apply({"duty": _DUTY})
            angle = rig.measure().values["sensed_angle_deg"]
        except RigError:
            rig.arm()
            held = 0
        else:
            held = held + 1 if angle > _OPEN_DEG else 0


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    drive_and_die(*sys.argv[1:])
