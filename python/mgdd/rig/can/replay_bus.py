"""A bus whose frames go into a record."""

from __future__ import annotations

import time
from typing import Any

from mgdd._core.rig import Frame
from mgdd.rig.can.transport import Bus, changed
from mgdd.rig.recorder import Recorder


class RecordedBus:
    """Passes everything on to another bus, and appends every frame to a record."""

    def __init__(self, bus: Bus, recorder: Recorder) -> None:
        self.bus, self.recorder = bus, recorder
        self.name, self.shared, self.stays_here = bus.name, bus.shared, bool(getattr(bus, "stays_here", False))
        self.open, self.close, self.claim = bus.open, bus.close, bus.claim
        # Identifiers that another socket of this process sends: what is received of them is recorded as sent.
        self.sent_elsewhere: frozenset[tuple[int, bool]] = frozenset()

    @property
    def counters(self) -> dict[str, Any]:
        """What the bus counts."""
        return dict(getattr(self.bus, "counters", {}))

    def send(self, frame: Frame, *, final: bool = False) -> None:
        """Send a frame; what the bus did not take is not recorded."""
        self.bus.send(frame, final=final)
        self._append(frame, received=False)

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame."""
        frame = self.bus.receive(timeout_s)
        if frame is not None:
            self._append(frame, received=(frame.id, frame.extended) not in self.sent_elsewhere)
        return frame

    def _append(self, frame: Frame, *, received: bool) -> None:
        stamp_ns = frame.monotonic_ns or time.monotonic_ns()
        self.recorder.frame(changed(frame, monotonic_ns=stamp_ns, received=received))
