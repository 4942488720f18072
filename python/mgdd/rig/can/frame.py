"""What a rig or node needs of a bus, and what is done with its frames."""

from __future__ import annotations

from typing import Any, Protocol

from mgdd._core.rig import Frame


class FrameBus(Protocol):
    """What a bridge needs of a bus: a `mgdd.rig.CanTransport`, for example."""

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame that arrived, or None after the time; RigError for a fault of the bus."""
        ...

    def send(self, frame: Frame) -> None:
        """Hand a frame to the bus; RigError where it does not take it."""
        ...


class Bus(FrameBus, Protocol):
    """What every bus offers: a `CanTransport`, or a node in the same process."""

    @property
    def name(self) -> str:
        """What messages call it."""
        ...

    @property
    def shared(self) -> bool:
        """Whether others may be on it: real time, and real actuators."""
        ...

    def open(self) -> None:
        """Connect."""
        ...

    def close(self) -> None:
        """Disconnect; may be called twice."""
        ...

    def claim(self, keys: set[tuple[int, bool]]) -> None:
        """Say which identifiers only we send: one that arrives is a fault."""
        ...

    def send(self, frame: Frame, *, final: bool = False) -> None:
        """Hand a frame to the bus, with `final` even after a fault."""
        ...


def changed(frame: Frame, **fields: Any) -> Frame:
    """Return the frame with other fields: its stamp, its direction, its data."""
    return Frame(**{**frame.to_dict(), **fields})
