"""A bus of python-can on the far side of the two rings of a real-time loop."""

from __future__ import annotations

import logging
import threading
import time
import weakref
from typing import TYPE_CHECKING, Any, Self, cast

from mgdd._core.rig import Frame, RingTransport
from mgdd.errors import RigError
from mgdd.rig.can.python_can import POLL_S, Reception, message_of
from mgdd.rig.can.transport import FrameBus

if TYPE_CHECKING:
    import can

_log = logging.getLogger(__name__)
_LOOK_S = 0.05  # how often a waiting thread looks whether it shall end
_SEND_ERRORS = 3  # in a row, until the bus counts as gone


class BusBridge:
    """Two threads between a python-can bus and a `RingTransport`: one receives, one sends.

    The caller opens and closes the bus (any of python-can, or a `CanTransport`, which costs one more thread on the way
    in, and looks after its bus); nobody else may receive from it meanwhile. What goes wrong in a thread ends both and
    tells the loop that the bus is off, so that its gate opens the bridge; `error` says what it was. Python is in the
    way of every frame: while another thread computes, each may wait 5 ms and more. On Linux a `SocketCanTransport` has
    no such detour.
    """

    def __init__(self, bus: can.BusABC | FrameBus, transport: RingTransport) -> None:
        try:
            import can  # noqa: F401
        except ImportError:
            raise RigError('python-can is not installed: pip install "mgdd[can]"') from None
        self._bus = _PythonCan(cast("can.BusABC", bus)) if hasattr(bus, "recv") else bus
        self._transport = transport
        self._stop = threading.Event()
        self.error: BaseException | None = None
        self.send_errors = 0
        self._threads = [
            threading.Thread(target=self._guarded, args=(work,), name=f"mgdd bus bridge, {name}", daemon=True)
            for name, work in (("receive", self._receive), ("send", self._send))
        ]
        for thread in self._threads:
            thread.start()
        self._end = weakref.finalize(self, _end, transport, self._stop, self._threads)  # at the end of Python too

    def close(self) -> None:
        """Send what the loop has left, for 0.2 s at most, and end both threads; the bus stays open."""
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _guarded(self, work: Any) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 - whatever it is, the loop must learn of it
            self.error = error
            self._transport.fail()
            self._stop.set()
            _log.exception("the bus bridge ends: the loop sees its bus as off")

    def _receive(self) -> None:
        while not self._stop.is_set():
            frame = self._bus.receive(POLL_S)
            if frame is not None:
                self._transport.feed(frame)

    def _send(self) -> None:
        in_a_row = 0
        while not self._stop.is_set():
            frame = self._transport.take(_LOOK_S)
            if frame is None:
                continue
            try:
                self._bus.send(frame)
                in_a_row = 0
            except Exception:
                self.send_errors += 1
                in_a_row += 1
                if in_a_row == _SEND_ERRORS:
                    raise


class _PythonCan:
    """A bus of python-can with the two calls of ours."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus, self._reception = bus, Reception(bus)

    def receive(self, timeout_s: float) -> Frame | None:
        return self._reception.receive(timeout_s)

    def send(self, frame: Frame) -> None:
        self._bus.send(message_of(frame))


def _end(transport: RingTransport, stop: threading.Event, threads: list[threading.Thread]) -> None:
    until = time.monotonic() + 0.2
    while transport.waiting_to_send and not stop.is_set() and time.monotonic() < until:
        time.sleep(0.001)
    stop.set()
    for thread in threads:
        thread.join()
