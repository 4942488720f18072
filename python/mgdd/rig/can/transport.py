"""What a rig needs of a bus, and a bus of any interface of python-can, with a receive thread and counters of ours."""

from __future__ import annotations

import contextlib
import errno
import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Protocol, Self
from urllib.parse import parse_qsl

from mgdd._core.rig import Frame, error_classes
from mgdd.errors import ParameterError, RigError
from mgdd.io.extras import import_extra
from mgdd.rig.can.python_can import THIS_HOST, Reception, connected, error_code, message_of


class FrameBus(Protocol):
    """What a bridge needs of a bus: a `mgdd.rig.CanTransport`, for example."""

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame that arrived, or None after the time; RigError for a fault of the bus."""

    def send(self, frame: Frame) -> None:
        """Hand a frame to the bus; RigError where it does not take it."""


class Bus(FrameBus, Protocol):
    """What every bus offers: a `CanTransport`, or a node in the same process."""

    @property
    def name(self) -> str:
        """What messages call it."""

    @property
    def shared(self) -> bool:
        """Whether others may be on it: real time, and real actuators."""

    def open(self) -> None:
        """Connect."""

    def close(self) -> None:
        """Disconnect; may be called twice."""

    def claim(self, keys: set[tuple[int, bool]]) -> None:
        """Say which identifiers only we send: one that arrives is a fault."""

    def send(self, frame: Frame, *, final: bool = False) -> None:
        """Hand a frame to the bus, with `final` even after a fault."""


def changed(frame: Frame, **fields: Any) -> Frame:
    """Return the frame with other fields: its stamp, its direction, its data."""
    return Frame(**{**frame.to_dict(), **fields})


_QUEUE = 4096  # unread frames
_FATAL = frozenset({"bus_off", "error_passive"})


class CanTransport:
    """A bus of python-can behind our own receive thread.

    The configuration files and environment variables of python-can are not read: what is not given here, is not used.
    The thread only stamps frames with their arrival and stores them; whatever ends it, and every fault of the bus, is
    raised by the next call. A frame that is malformed, and our own one that comes back, is left out and counted.
    `options` are further keywords of the interface; for `send_timeout_s` it waits for room in the queue of the driver.
    """

    shared = True  # others may be on the bus

    def __init__(
        self,
        interface: str,
        channel: str | int,
        *,
        options: Mapping[str, Any] = MappingProxyType({}),
        send_timeout_s: float = 0.005,
    ) -> None:
        if not isinstance(interface, str) or not interface:
            raise ParameterError.of("interface", interface, "the name of an interface of python-can, such as socketcan")
        if channel is None or channel == "":
            raise ParameterError.of("channel", channel, "given: a bus is never chosen by a configuration file")
        ParameterError.unless(0.0 < send_timeout_s < 10.0, "send_timeout_s", send_timeout_s, "in (0, 10) s")
        self.interface, self.channel = interface, channel
        self.options = dict(options)
        self.send_timeout_s = send_timeout_s
        self._bus: Any = None
        self._reception: Reception | None = None
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._arrived = threading.Condition()
        self._queue: deque[Frame] = deque()
        self._fault: RigError | None = None
        self._claimed: frozenset[tuple[int, bool]] = frozenset()
        self._counts: Counter[str] = Counter()

    @classmethod
    def parse(cls, text: str) -> Self:
        """Make a transport, not yet open, of ``INTERFACE:CHANNEL?OPTION=VALUE&...``, as ``socketcan:can0``."""
        place, _, query = text.partition("?")
        interface, _, channel = place.partition(":")
        if not interface or not channel:
            raise ParameterError.of("bus", text, "INTERFACE:CHANNEL?OPTION=VALUE&..., for example socketcan:can0")
        return cls(interface, channel, options={name: _plain(value) for name, value in parse_qsl(query)})

    @property
    def name(self) -> str:
        """Interface and channel."""
        where = "".join(f" {self.options[name]}" for name in ("host", "port") if name in self.options)
        return f"{self.interface}:{self.channel}{where}"

    @property
    def stays_here(self) -> bool:
        """Whether it does not leave this machine: ``virtual``, vcan, and a hub of this host."""
        if self.interface == "socketcan":
            return str(self.channel).startswith("vcan")
        hub = str(self.options.get("host", "")).lower()
        return self.interface == "virtual" or (self.interface == "socketcand" and hub in THIS_HOST)

    @property
    def counters(self) -> dict[str, int]:
        """Frames sent and received, retries, overflows, error frames by class; malformed and own ones left out."""
        with self._arrived:
            return dict(self._counts + (self._reception.counts if self._reception is not None else Counter()))

    def open(self) -> None:
        """Connect and start to receive; RigError, or ImportError without the extra ``can``, says why it cannot."""
        if self._bus is not None:
            raise RigError(f"{self.name} is open already: close it first")
        self._bus = connected(self.interface, self.channel, self.options, self.name)
        if self._reception is not None:
            self._counts += self._reception.counts
        self._reception = Reception(self._bus)
        self._stop.clear()
        self._queue.clear()
        self._fault = None
        self._thread = threading.Thread(target=self._receive_all, name=f"mgdd {self.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop the thread, then the bus; closing twice does nothing."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._bus is not None:
            bus, self._bus = self._bus, None
            bus.shutdown()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def claim(self, keys: set[tuple[int, bool]]) -> None:
        """Say which identifiers, with whether they have 29 bits, only we send: one that arrives is of another node."""
        with self._arrived:
            self._claimed = frozenset(keys)

    def send(self, frame: Frame, *, final: bool = False) -> None:
        """Hand a frame to the driver; while its queue is full, for `send_timeout_s` at most, try again.

        RigError where the driver does not take it, or the bus has a fault. With `final` it is tried even then, as the
        safe frames at the end are.
        """
        bus = self._open_bus(final=final)
        can, message = import_extra("can", "can", "a CAN bus"), message_of(frame)
        until, pause = time.monotonic() + self.send_timeout_s, 1e-4
        while True:
            try:
                bus.send(message)
            except (can.CanError, OSError) as error:
                full = error_code(error) in (errno.ENOBUFS, errno.EAGAIN) or "buffer" in str(error).lower()
                if not full or time.monotonic() + pause > until:
                    raise RigError(f"{self.name}: frame {frame.id:#x} was not sent: {error}") from error
                self._count("retries")
                time.sleep(pause)
                pause *= 2.0
            else:
                self._count("sent")
                return

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame that arrived, waiting for so long [s] at most; None where none came.

        RigError for a fault of bus or thread, or an identifier of ours that another node sends.
        """
        self._open_bus()
        with self._arrived:
            self._arrived.wait_for(lambda: self._queue or self._fault, timeout_s)
            if self._fault is not None:
                raise self._fault
            return self._queue.popleft() if self._queue else None

    def _open_bus(self, *, final: bool = False) -> Any:
        if self._fault is not None and not final:
            raise self._fault
        if self._bus is None:
            raise RigError(f"{self.name} is not open: use it in a with block, or call open()")
        return self._bus

    def _receive_all(self) -> None:
        try:
            while not self._stop.is_set() and self._reception is not None:
                frame = self._reception.receive()
                if frame is not None:
                    self._store(frame)
                elif self.interface == "socketcand":
                    self._require_connection()
        except RigError as error:
            self._trip(error)
        except Exception as error:  # noqa: BLE001 whatever ends the thread is raised by the next call
            self._trip(RigError(f"{self.name}: receiving ended: {error}"))

    def _store(self, frame: Frame) -> None:
        if frame.error:
            classes = error_classes(frame)
            for name in classes:
                self._count(name)
            if fatal := _FATAL & set(classes):
                raise RigError(
                    f"{self.name}: error frame {frame.id:#x}: {', '.join(sorted(fatal))}; the bus is not usable"
                )
            return
        if frame.remote:
            self._count("remote")
            return
        if (frame.id, frame.extended) in self._claimed:
            raise two_senders(self.name, frame.id)
        with self._arrived:
            if len(self._queue) == _QUEUE:
                self._queue.popleft()
                self._counts["overflows"] += 1
            self._queue.append(frame)
            self._counts["received"] += 1
            self._arrived.notify_all()

    def _require_connection(self) -> None:
        """python-can reads the end of a socketcand connection as silence, without sleeping: look at its socket."""
        stream = getattr(self._bus, "_SocketCanDaemonBus__socket", None)
        if stream is None:
            return
        with contextlib.suppress(BlockingIOError):
            if stream.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT) == b"":
                raise RigError(f"{self.name}: the hub has closed the connection")

    def _trip(self, fault: RigError) -> None:
        with self._arrived:
            self._fault = fault
            self._arrived.notify_all()

    def _count(self, name: str) -> None:
        with self._arrived:
            self._counts[name] += 1


def two_senders(bus: str, identifier: int) -> RigError:
    """Say that a frame came which only this host may send."""
    return RigError(
        f"{bus}: frame {identifier:#x} arrived, which this host sends: two nodes have one identifier; take the other "
        "one off the bus"
    )


def _plain(text: str) -> Any:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for number in (int, float):
        with contextlib.suppress(ValueError):
            return number(text)
    return text
