"""A bus whose frames go into a record, and recorded frames as a bus: the same checks see them again, in their order."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterable
from typing import Any, Self

from mgdd._core.rig import Frame
from mgdd.errors import RigError
from mgdd.io.files import existing_file
from mgdd.rig.can.mapped import MappedMessage
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import Bus, changed
from mgdd.rig.recorded import stamped_frames
from mgdd.rig.recorder import Recorder


class ReplayBus:
    """Frames of a run, sent and received, as `CanRig` saw them with ``on_frame``.

    A command moves to the next recorded command that drives; what the node sent after it arrives then. A command whose
    inputs are not the recorded ones is an error if `strict`, else an entry of `differences`: the number of the command,
    from 0, its inputs and the recorded ones.
    """

    name = "the record"
    shared = False  # nobody is there

    def __init__(self, frames: Iterable[Frame], signal_map: SignalMap, *, strict: bool = True) -> None:
        self._map, self._strict = signal_map, strict
        self._frames = list(frames)
        self._by_key = {message.key: message for message in signal_map.commands.values()}
        self.differences: list[tuple[int, dict[str, float], dict[str, float]]] = []
        self._rewind()

    @classmethod
    def read(cls, path: str | os.PathLike[str], signal_map: SignalMap, *, strict: bool = True) -> Self:
        """Read the frames of a `mgdd.rig.Recorder` that was given every one, for a `CanRig` in the mode ``replay``."""
        frames = [frame for _, frame in stamped_frames(existing_file(path))]
        return cls(frames, signal_map, strict=strict)

    def open(self) -> None:
        """Begin at the first frame."""
        self._rewind()

    def close(self) -> None:
        """Leave the record."""

    def claim(self, keys: set[tuple[int, bool]]) -> None:
        """Nobody sends here."""

    def send(self, frame: Frame, *, final: bool = False) -> None:  # noqa: ARG002 - nothing is sent
        """Move to the next recorded command of this message, and compare its inputs; RigError behind the last one."""
        message = self._by_key[frame.id, frame.extended]
        while self._left:
            recorded = self._left.popleft()
            if recorded.received:
                self._arrived.append(recorded)
            elif (recorded.id, recorded.extended) == message.key and message.drives(recorded.data):
                self._compare(message, frame, recorded)
                return
        raise RigError(f"the record ends after {self._commands} commands: ask for fewer")

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame that came before the next command; without waiting only those of the past."""
        if self._arrived:
            return self._arrived.popleft()
        if timeout_s > 0.0 and self._left and self._left[0].received:
            return self._left.popleft()
        return None

    def _compare(self, message: MappedMessage, frame: Frame, recorded: Frame) -> None:
        asked, known = message.read(frame.data), message.read(recorded.data)
        if asked != known:
            if self._strict:
                raise RigError(f"command {self._commands}: {asked} was asked for, {known} is recorded")
            self.differences.append((self._commands, asked, known))
        self._commands += 1

    def _rewind(self) -> None:
        self._left: deque[Frame] = deque(self._frames)
        self._arrived: deque[Frame] = deque()
        self._commands = 0
        self.differences.clear()


class RecordedBus:
    """Passes everything on to another bus, and appends every frame to a record."""

    def __init__(self, bus: Bus, recorder: Recorder) -> None:
        self.bus, self.recorder = bus, recorder
        self.name, self.shared, self.stays_here = bus.name, bus.shared, bool(getattr(bus, "stays_here", False))
        self.open, self.close, self.claim = bus.open, bus.close, bus.claim
        # Identifiers that another socket of this process sends: what is heard of them is recorded as sent.
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
