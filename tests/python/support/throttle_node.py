"""A virtual throttle behind a ring transport, served by a thread of Python, and the messages that it speaks."""

import threading
from collections.abc import Callable
from typing import Any, Self

from mgdd._core.rig import E2eCheck, protect
from mgdd.loop import VirtualThrottle
from mgdd.rig import SafetyEnvelope
from mgdd.rig.realtime import E2eSettings, Frame, LoopMessage, RingTransport, SignalLayout

PERIOD_S = 0.002
ANGLE = SignalLayout(start=23, length=16, byte_order="big_endian", scale=0.01, offset=-5.0)
VOLTS = {
    "first_v": SignalLayout(start=0, length=12, scale=0.00125),
    "second_v": SignalLayout(start=12, length=12, scale=0.00125),
}
DUTY = SignalLayout(start=16, length=16, raw_type="signed", scale=5e-5)
ENABLE = SignalLayout(start=35, length=1)
MODE = SignalLayout(start=32, length=3)
COMMAND_E2E, STATUS_E2E = E2eSettings(data_id=0x120), E2eSettings(data_id=0x121)
COMMAND = LoopMessage(
    can_id=0x120, signals={"duty": DUTY, "enable": ENABLE}, fixed=[(MODE, 2.0)], protection=COMMAND_E2E
)
STATUS = LoopMessage(can_id=0x121, signals={"angle_deg": ANGLE}, protection=STATUS_E2E)
SENSORS = LoopMessage(can_id=0x18FF0122, extended=True, size=6, signals=VOLTS)
MEASUREMENTS = [STATUS, SENSORS]


def patient_envelope(**changes: Any) -> SafetyEnvelope:
    """Of a machine that may be busy: no limit of time."""
    patient = {
        "missed_deadlines": 1e6,
        "unsent_cycles": 1e6,
        "largest_age_cycles": 1e6,
        "good_frames": 5.0,
        "stall_s": 10.0,
    }
    return SafetyEnvelope(**{"cycle_s": PERIOD_S, "ramp_s": 0.0, "slew_per_s": 1e4, **patient, **changes})


class ThrottleNode:
    """Answers every command with status and sensors after one sample of the plant."""

    def __init__(self, take: Callable[[], Frame | None], feed: Callable[[Frame], Any]) -> None:
        self.plant = VirtualThrottle(inputs=("duty", "bridge_open"), sample_s=PERIOD_S, seed=3)
        self.commands: list[tuple[float, float]] = []
        self.angle_deg = float("nan")
        self.check = E2eCheck(COMMAND_E2E)
        self._take, self._feed = take, feed
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    @classmethod
    def on(cls, transport: RingTransport) -> Self:
        return cls(lambda: transport.take(0.02), transport.feed)

    def _serve(self) -> None:
        counter = 0
        while not self._stop.is_set():
            frame = self._take()
            if frame is None:
                continue
            self.check.push(frame.data)
            duty, enable = DUTY.unpack(frame.data), ENABLE.unpack(frame.data)
            self.plant.apply({"duty": duty, "bridge_open": 1.0 - enable})
            values = self.plant.measure().values
            self.angle_deg = values["angle_deg"]
            self.commands.append((duty, enable))
            counter = (counter + 1) % 16
            payload = bytes(6)
            for name, layout in VOLTS.items():
                payload = layout.pack(payload, values[name])
            self._feed(Frame(id=0x18FF0122, data=payload, extended=True))
            status = protect(STATUS_E2E, counter, ANGLE.pack(bytes(8), values["sensed_angle_deg"]))
            self._feed(Frame(id=0x121, data=status))

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
