"""How the real-time loop of an experiment reaches the bus of its rig: by a bridge in Python or a raw socket."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Self

from mgdd._core.rig import Frame, RingTransport, SocketCanTransport
from mgdd.errors import RigError
from mgdd.rig.can.bus_bridge import BusBridge
from mgdd.rig.can.frame import Bus, changed
from mgdd.rig.can.replay_bus import RecordedBus
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.signals import held_back
from mgdd.rig.can.transport import two_senders
from mgdd.rig.loop_message import LoopMessage

__all__ = ["BridgedBus", "SocketBus", "WatchedBus"]

_ALL_BITS = {False: 0x7FF, True: 0x1FFF_FFFF}
_FAILED_FRAMES = 3
_SWITCH_S = 5e-4
_LAST_S = 0.5  # for the last commands of the loop to be heard


class WatchedBus:
    """The bus of a rig, with an eye on the state that the node reports."""

    def __init__(self, bus: Bus, signal_map: SignalMap) -> None:
        self.bus, self._map = bus, signal_map
        known = signal_map.state
        self._key = None if known is None else signal_map.measurements[known.message].key
        self._in_a_row = 0
        self.state = ""

    @property
    def name(self) -> str:
        """What messages call it."""
        return self.bus.name

    @property
    def failed(self) -> bool:
        """Whether several frames in a row say so: they are not checked here."""
        return self._in_a_row >= _FAILED_FRAMES

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame."""
        frame = self.bus.receive(timeout_s)
        if frame is not None and self._map.state is not None and (frame.id, frame.extended) == self._key:
            self.state = self._map.state.name_of(frame.data)
            self._in_a_row = self._in_a_row + 1 if self.state in self._map.state.failed else 0
        return frame

    def send(self, frame: Frame) -> None:
        """Send a frame of the loop; the record says when it left Python, not when the loop did it."""
        self.bus.send(changed(frame, monotonic_ns=0))


class BridgedBus:
    """The loop has a ring, and two threads of Python carry its frames to and from the bus of the rig."""

    def __init__(self, bus: WatchedBus) -> None:
        self.transport = RingTransport()
        self._bus = bus
        self._bridge: BusBridge | None = None
        self._prompt = _prompt_threads()

    @property
    def error(self) -> BaseException | None:
        """What ended the bridge."""
        return None if self._bridge is None else self._bridge.error

    @property
    def counters(self) -> dict[str, int]:
        """None: the bus of the rig counts."""
        return {}

    def look(self, report: Callable[[], Mapping[str, Any]]) -> None:
        """Do nothing: the threads of the bridge do."""

    def __enter__(self) -> Self:
        self._prompt.__enter__()
        self._bridge = BusBridge(self._bus, self.transport)
        return self

    def __exit__(self, *_: object) -> None:
        if self._bridge is not None:
            self._bridge.close()
        self._prompt.__exit__(None, None, None)


class SocketBus:
    """The loop has a raw socket of its own, and the bus of the rig hears and records what passes between loop and node.

    Commands that the rig hears are those of the loop: its claim to them rests. Another sender shows itself at the
    socket of the loop: that one never hears its own frames, and lets nothing pass but commands and what the loop reads.
    """

    def __init__(
        self,
        bus: WatchedBus,
        channel: str,
        *,
        command: LoopMessage,
        measurements: Sequence[LoopMessage],
        transmits: bool,
    ) -> None:
        self._bus = bus
        self._ours = (command.can_id, command.extended) if transmits else None
        filters = [(one.can_id, _ALL_BITS[one.extended], one.extended) for one in (command, *measurements)]
        self.transport = SocketCanTransport(channel, filters=filters)
        self.error: BaseException | None = None
        self._heard = 0
        self._foreign: int | None = None

    @property
    def counters(self) -> dict[str, int]:
        """How many commands of the loop were heard, and so recorded."""
        return {"commands_heard": self._heard}

    def look(self, report: Callable[[], Mapping[str, Any]]) -> None:
        """Take and record all that came; from the second time on another sender of our commands is an error."""
        while self._hear(0.0):
            pass
        if self._ours is None:
            return
        said = report()
        # Counted in this order, an error frame is never taken for a stranger.
        foreign = said["frames"]["foreign"] - said["bus"]["error_frames"]
        if self._foreign is None:  # before, the last safe frames of the rig itself may have been among them
            self._foreign = foreign
        elif foreign > self._foreign and self.error is None:
            self.error = two_senders(self._bus.name, self._ours[0])

    def __enter__(self) -> Self:
        if self._ours is not None:
            self._bus.bus.claim(set())
            if isinstance(self._bus.bus, RecordedBus):
                self._bus.bus.sent_elsewhere = frozenset({self._ours})
        return self

    def __exit__(self, *_: object) -> None:
        until = time.monotonic() + _LAST_S
        with held_back():
            while self._heard < self.transport.counts["sent"] and (left_s := until - time.monotonic()) > 0.0:
                if not self._hear(left_s):
                    break

    def _hear(self, timeout_s: float) -> bool:
        """Take a frame; whether one came."""
        try:
            frame = self._bus.receive(timeout_s)
        except RigError as error:
            self.error = self.error or error
            return False
        if frame is not None and (frame.id, frame.extended) == self._ours:
            self._heard += 1
        return frame is not None


@contextmanager
def _prompt_threads() -> Iterator[None]:
    """Let threads of Python take turns ten times as often: two of them stand between the loop and its bus."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(min(before, _SWITCH_S))
    try:
        yield
    finally:
        sys.setswitchinterval(before)
