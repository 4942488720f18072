"""What a rig or node needs of a bus, and what is done with its frames."""

from __future__ import annotations

from typing import Any, Protocol

from mgdd._core.rig import Frame

__all__ = ["Bus", "changed", "error_classes"]

# Class bits of an error frame, as Linux defines them (linux/can/error.h).
_CLASSES = {
    0x001: "transmit_timeout",
    0x002: "lost_arbitration",
    0x004: "controller",
    0x008: "protocol",
    0x010: "transceiver",
    0x020: "no_acknowledgement",
    0x040: "bus_off",
    0x080: "bus_error",
    0x100: "restarted",
}
_PASSIVE = 0x30  # of byte 1 of a controller error: receiver or transmitter is error-passive


class Bus(Protocol):
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
        """Hand a frame to the bus, with `final` even after a fault; RigError where it does not take it."""
        ...

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame that arrived, or None after the time; RigError for a fault of the bus."""
        ...


def error_classes(frame: Frame) -> list[str]:
    """Name what an error frame reports; ``error_passive`` beside ``controller`` where its data say so."""
    out = [name for bit, name in _CLASSES.items() if frame.id & bit]
    if frame.id & 0x004 and len(frame.data) > 1 and frame.data[1] & _PASSIVE:
        out.append("error_passive")
    return out or ["unknown"]


def changed(frame: Frame, **fields: Any) -> Frame:
    """Return the frame with other fields: its stamp, its direction, its data."""
    return Frame(**{**frame.to_dict(), **fields})
