"""A process of the self-test: it opens a throttle over a bus and dies in the way it is told, doomed.py WAY BUS LOOP.

It says ``ready`` when everything is imported, waits for a line, says ``open`` when the plate is open, and ``dying``
with the monotonic time [ns] where it dies by itself.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from mgdd.errors import RigError
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment.checked import check_experiment
from mgdd.rig.experiment.experiment import Experiment
from mgdd.rig.experiment.run import run_experiment
from mgdd.rig.experiment.stand import Cycle

_DUTY, _OPEN_DEG, _SAMPLES = 0.3, 40.0, 8
_PATIENCE_S = 2.0
_HANGS_S = 60.0
_HELD_DEG = 60.0
_EXPERIMENT = """
kind = "experiment"
format = 1
task = "track"
mode = "hil"
[track]
reference = "{reference}"
controller = "pid"
loop = "core"
[bus]
connection = "{connection}"
pace = "real_time"
"""


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


def track_and_die(way: str, connection: str) -> None:
    """Open the plate by an experiment on the real-time loop of the core, and die."""
    with TemporaryDirectory(prefix="mgdd-doomed-") as folder:
        file = Path(folder) / "held.csv"
        sample_s = SignalMap.load("etb").cycle_s
        rows = (f"{k * sample_s:.3f},{_HELD_DEG}" for k in range(round(_HANGS_S / sample_s)))
        file.write_text("\n".join(["time_s,reference_deg", *rows]), encoding="utf-8")
        text = _EXPERIMENT.format(reference=file, connection=connection)
        checked = check_experiment(Experiment.from_toml(text))
    _say("ready")
    sys.stdin.readline()
    ends = time.monotonic() + _HANGS_S
    while time.monotonic() < ends:
        try:
            run_experiment(checked, watch=_Doom(way))
        except RigError:
            continue  # a busy machine
        return  # Ctrl-C keeps what was done, and ends


class _Doom:
    """Says when the plate is open, and dies where the process is to die by itself."""

    def __init__(self, way: str) -> None:
        self._way, self._held = way, 0

    def __call__(self, cycle: Cycle) -> None:
        self._held = self._held + 1 if cycle.measured.values["sensed_angle_deg"] > _OPEN_DEG else 0
        if self._held != _SAMPLES:
            return
        _say("open")
        if self._way not in ("exception", "hang"):
            return
        _say(f"dying {time.monotonic_ns()}")
        if self._way == "exception":
            raise RuntimeError("a mistake in the experiment")
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
    {"python": drive_and_die, "core": track_and_die}[sys.argv[3]](*sys.argv[1:3])
