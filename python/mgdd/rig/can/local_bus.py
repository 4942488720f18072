"""A node in the same process, as a bus: no threads and no clock, a command brings its answer."""

from __future__ import annotations

from collections import deque

from mgdd._core.rig import Frame
from mgdd.errors import RigError
from mgdd.loop import Plant
from mgdd.rig.can.frame import changed
from mgdd.rig.can.node_core import NodeCore
from mgdd.rig.can.node_plant import node_plant
from mgdd.rig.can.signal_map import SignalMap

__all__ = ["LocalBus"]


class LocalBus:
    """A plant behind a node in this process: every command frame brings one sample.

    The same checks, roundings and limits as over a real bus, faster than real time and always with the same bits.
    """

    def __init__(self, plant: Plant, signal_map: SignalMap) -> None:
        self.core = NodeCore(node_plant(plant), signal_map)
        self._answers: deque[Frame] = deque()
        self._now_ns = 1
        self._is_open = False

    @property
    def name(self) -> str:
        """What messages call it."""
        return "the node in this process"

    @property
    def shared(self) -> bool:
        """False: nobody else is here, and time is virtual."""
        return False

    def open(self) -> None:
        """Connect."""
        self._is_open = True

    def close(self) -> None:
        """Disconnect."""
        self._is_open = False
        self._answers.clear()

    def claim(self, keys: set[tuple[int, bool]]) -> None:
        """Nobody else sends here."""

    def send(self, frame: Frame, *, final: bool = False) -> None:  # noqa: ARG002 - there are no faults to pass
        """Give a frame to the node."""
        self._require_open()
        if self.core.take(changed(frame, monotonic_ns=self._now_ns, received=True)):
            self._now_ns += round(self.core.map.cycle_s * 1e9)
            self._answers += [
                changed(answer, monotonic_ns=self._now_ns, received=True) for answer in self.core.answer()
            ]

    def receive(self, timeout_s: float) -> Frame | None:  # noqa: ARG002 - time stands still
        """Give the next frame of the node; None where it has none."""
        self._require_open()
        return self._answers.popleft() if self._answers else None

    def _require_open(self) -> None:
        if not self._is_open:
            raise RigError(f"{self.name} is not open: use the rig in a with block")
