"""A host that opens a throttle over a bus and then dies in the way it is told: python doomed_host.py WAY BUS.

It says `ready` when everything is imported, waits for a line, says `open` when the plate is open, and `dying NS` with
the monotonic time of its death, where it dies by itself.
"""

from __future__ import annotations

import math
import sys
import time

from mgdd.errors import RigError
from mgdd.rig import CanRig
from mgdd.rig.can.transport import CanTransport

OPEN_DEG, SAMPLES = 40.0, 8


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def drive(rig: CanRig, samples: int) -> None:
    """Hold the plate open for so many samples in a row; a machine that stalls is armed again."""
    held = 0
    while held < samples:
        try:
            rig.apply({"duty": 0.3})
            angle = rig.measure().values["sensed_angle_deg"]
        except RigError:
            rig.arm()
            held = 0
        else:
            held = held + 1 if angle > OPEN_DEG else 0


def main(way: str, bus: str) -> None:
    transport = CanTransport.parse(bus)
    say("ready")
    sys.stdin.readline()
    with CanRig("etb", transport, mode="hil", timeout_s=2.0) as rig:
        drive(rig, SAMPLES)
        say("open")
        if way in ("sigint", "sigterm", "sigkill"):
            drive(rig, 1_000_000)
        say(f"dying {time.monotonic_ns()}")
        if way == "exception":
            raise ZeroDivisionError
        if way == "nan":
            rig.apply({"duty": math.nan})
        time.sleep(60.0)  # hangs


main(*sys.argv[1:])
