"""What a bus of python-can brings: frames with the time of their arrival, without malformed ones and our own."""

from __future__ import annotations

import time
from collections import Counter
from typing import TYPE_CHECKING, Any

from mgdd._core.rig import Frame
from mgdd.errors import DataError
from mgdd.rig.can.messages import Echoes, frame_of

if TYPE_CHECKING:
    import can

__all__ = ["POLL_S", "STILL_S", "THIS_HOST", "Reception"]

POLL_S = 0.01  # longest wait for a frame
STILL_S = 0.03  # without a look at the bus: by then a receiver of commands every 5 ms has let go by itself
THIS_HOST = ("localhost", "127.0.0.1", "::1")
_OF_THE_WIRE = ("socketcand", "udp_multicast")  # interfaces that parse what a stranger may have written
_TEXT = "_SocketCanDaemonBus__receive_buffer"


class Reception:
    """Receives from a bus of python-can.

    The age of a frame counts from its arrival, also where this process was stopped meanwhile: from the stamp where the
    bus has the clock of this machine, else from the last look that found the bus empty.

    Parameters
    ----------
    bus : can.BusABC
        Open.

    Attributes
    ----------
    counts : Counter of str
        ``malformed`` and ``own``: what was left out.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._interface = _interface_of(bus)
        self._has_our_clock = _has_our_clock(bus, self._interface)
        self._echoes = Echoes() if self._interface == "udp_multicast" else None
        self._empty_ns = time.monotonic_ns()
        self.counts: Counter[str] = Counter()

    def sending(self, message: can.Message) -> None:
        """Note a message that will be sent: a bus that hears itself brings it back."""
        if self._echoes is not None:
            self._echoes.add(message)

    def receive(self, timeout_s: float = POLL_S) -> Frame | None:
        """Give the next frame; None where none came, or what came is left out.

        Parameters
        ----------
        timeout_s : float
            Longest time to wait [s].

        Returns
        -------
        mgdd.rig.realtime.Frame or None
            ``monotonic_ns`` is when it arrived.
        """
        looked_ns = time.monotonic_ns()
        message = self._next(0.0)
        if message is None:
            self._empty_ns = looked_ns
            message = self._next(timeout_s)
        if message is None:
            return None
        if self._is_own(message):
            self.counts["own"] += 1
            return None
        try:
            return frame_of(message, monotonic_ns=self._arrival_ns(message.timestamp), received=True)
        except DataError:
            self.counts["malformed"] += 1
            return None

    def _is_own(self, message: can.Message) -> bool:
        if self._echoes is not None and self._echoes.take(message):
            return True
        # SocketCAN calls so what any process of this machine has sent, and gives nothing back to who sent it.
        return not message.is_rx and self._interface != "socketcan"

    def _arrival_ns(self, stamp_s: float) -> int:
        now_ns = time.monotonic_ns()
        if self._has_our_clock and stamp_s > 0.0:
            waited_ns = (time.time() - stamp_s) * 1e9 - 1e3  # stamps are exact to 1 us
            return now_ns - round(max(0.0, min(waited_ns, float(now_ns))))
        return now_ns if now_ns - self._empty_ns <= STILL_S * 1e9 else self._empty_ns

    def _next(self, timeout_s: float) -> can.Message | None:
        try:
            return self._bus.recv(timeout_s)
        except Exception as error:
            if self._interface not in _OF_THE_WIRE or isinstance(error.__cause__, OSError | None):
                raise
            self.counts["malformed"] += 1
            if hasattr(self._bus, _TEXT):  # python-can would parse it again, for ever
                setattr(self._bus, _TEXT, "")
            return None


def _interface_of(bus: Any) -> str:
    """Name the interface of a bus by the module of python-can that it is from; empty for another one."""
    module = str(bus.__class__.__module__)
    return module.split(".")[2] if module.startswith("can.interfaces.") else ""


def _has_our_clock(bus: Any, interface: str) -> bool:
    """Whether the bus stamps frames by the wall clock of this machine when they arrive."""
    if interface == "virtual":
        return not bus.preserve_timestamps
    if interface == "socketcand":
        return str(getattr(bus, "_SocketCanDaemonBus__host", "")).lower() in THIS_HOST
    return interface in ("socketcan", "udp_multicast")
