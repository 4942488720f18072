"""A process with a throttle that follows steps until Ctrl-C, on the real-time loop: simulated.py RECORD PERIOD_MS.

After Ctrl-C the bridge is open and the process goes on for a moment: its record shows the plate coming home.
"""

from __future__ import annotations

import sys
import threading
import time
from typing import Any

from mgdd import presets
from mgdd._core.rig import Frame, RingTransport, SignalLayout
from mgdd.loop import VirtualThrottle
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.rig.can.node import parent_watch
from mgdd.rig.can.processes import noted_signals
from mgdd.rig.loop_message import LoopMessage
from mgdd.rig.realtime import RealtimeLoop
from mgdd.rig.recorder import Recorder
from mgdd.rig.safety import SafetyEnvelope, bounded_by, said_of

_STEPS_DEG, _STEP_S = (20.0, 60.0, 35.0, 70.0, 15.0), 2.0
_LONGEST_S = 3600.0
_HOME_S, _PATIENCE_S = 1.0, 20.0
_TAKE_S = 0.02
_DUTY = SignalLayout(start=0, length=16, raw_type="signed", scale=5e-5)
_ENABLE = SignalLayout(start=16, length=1)
_ANGLE = SignalLayout(start=0, length=16, scale=0.01, offset=-10.0)
_VOLTS = {
    "first_v": SignalLayout(start=16, length=12, scale=0.00125),
    "second_v": SignalLayout(start=28, length=12, scale=0.00125),
}


def simulate(path: str, period_s: float) -> None:
    """Run until Ctrl-C, SIGTERM, the end of the parent, or for an hour."""
    # Of a busy desktop: what is late is counted, and does not end a demonstration.
    patient: dict[str, Any] = dict.fromkeys(("missed_deadlines", "unsent_cycles", "largest_age_cycles"), 1e6)
    ring, over = RingTransport(), threading.Event()
    controller, _ = tuned_with_doubts("guided", presets.load("P1").throttle, sample_s=period_s, delay_samples=1)
    envelope = SafetyEnvelope(cycle_s=period_s, **patient)
    loop = RealtimeLoop(
        bounded_by(controller, envelope),
        ring,
        command=LoopMessage(can_id=0x120, signals={"duty": _DUTY, "enable": _ENABLE}),
        measurements=[LoopMessage(can_id=0x121, signals={"angle_deg": _ANGLE, **_VOLTS})],
        envelope=envelope,
        reference_deg=_STEPS_DEG[0],
    )
    plant = threading.Thread(target=_serve, args=(ring, period_s, over))
    with noted_signals() as stopped, Recorder(path, config={"simulated": "P1"}) as record:
        plant.start()
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        try:
            with loop:
                loop.arm(_PATIENCE_S)
                loop.drive(_PATIENCE_S)
                alive, begun = parent_watch(), time.monotonic()
                while not stopped and alive() and (passed_s := time.monotonic() - begun) < _LONGEST_S:
                    loop.set_reference(_STEPS_DEG[int(passed_s / _STEP_S) % len(_STEPS_DEG)])
                    _keep(loop, record)
                loop.abort()
                until = time.monotonic() + _HOME_S
                while time.monotonic() < until:
                    _keep(loop, record)
        finally:
            over.set()
            plant.join()


def _serve(ring: RingTransport, sample_s: float, over: threading.Event) -> None:
    """Answer every command with the sensors after one sample of the throttle."""
    plant = VirtualThrottle(inputs=("duty", "bridge_open"), sample_s=sample_s, seed=1)
    while not over.is_set():
        frame = ring.take(0.05)
        if frame is None:
            continue
        plant.apply({"duty": _DUTY.unpack(frame.data), "bridge_open": 1.0 - _ENABLE.unpack(frame.data)})
        values = plant.measure().values
        payload = _ANGLE.pack(bytes(8), values["sensed_angle_deg"])
        for name, layout in _VOLTS.items():
            payload = layout.pack(payload, values[name])
        ring.feed(Frame(id=0x121, data=payload))


def _keep(loop: RealtimeLoop, record: Recorder) -> None:
    time.sleep(_TAKE_S)
    for event in said_of(loop.events()):
        record.event(*event.split(": ", 1))
    columns = loop.sample_columns()
    columns["sensed_angle_deg"], columns["mode"] = columns.pop("angle_deg"), columns.pop("state")
    stamps = columns.pop("deadline_ns").tolist()
    for stamp, *row in zip(stamps, *(column.tolist() for column in columns.values()), strict=True):
        record.sample("loop", dict(zip(columns, row, strict=True)), monotonic_ns=stamp)


if __name__ == "__main__":
    simulate(sys.argv[1], float(sys.argv[2]) * 1e-3)
