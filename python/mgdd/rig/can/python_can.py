"""What is ours of python-can: opening a bus, frames as its messages, receiving without malformed and own ones, logs."""

from __future__ import annotations

import errno
import logging
import socket
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mgdd._core.rig import Frame
from mgdd.errors import DataError, RigError, did_you_mean
from mgdd.io.extras import import_extra

if TYPE_CHECKING:
    import can

MOST_BYTES = 64  # of a CAN FD frame
_MOST_STAMP_S = 9e9  # since any epoch, as far as nanoseconds fit into 64 bits
_GREETING_S = 2.0
_GREETINGS = 5
POLL_S = 0.01  # longest wait for a frame
STILL_S = 0.03  # without a look at the bus: by then a receiver of commands every 5 ms has let go by itself
THIS_HOST = ("localhost", "127.0.0.1", "::1")
LOG_WRITERS = MappingProxyType({"blf": "BLFWriter", "asc": "ASCWriter", "log": "CanutilsLogWriter"})


def largest_identifier(*, extended: bool) -> int:
    """Return the largest identifier of 29 or of 11 bits."""
    return 0x1FFF_FFFF if extended else 0x7FF


def message_of(frame: Frame, *, timestamp_s: float = 0.0) -> can.Message:
    """Return a frame as python-can has it, with a stamp [s]; a remote frame keeps its length."""
    library: Any = import_extra("can", "can", "a CAN message")
    message: can.Message = library.Message(
        timestamp=timestamp_s,
        arbitration_id=frame.id,
        is_extended_id=frame.extended,
        is_error_frame=frame.error,
        is_remote_frame=frame.remote,
        is_fd=frame.fd,
        bitrate_switch=frame.bit_rate_switch,
        is_rx=frame.received,
        channel=frame.channel,
        dlc=len(frame.data),
        data=None if frame.remote else frame.data,
    )
    return message


def frame_of(message: can.Message, *, monotonic_ns: int, channel: int = 0, received: bool | None = None) -> Frame:
    """Return a message of python-can as a frame of the core, with our stamp; DataError where it is none."""
    largest = largest_identifier(extended=message.is_extended_id or message.is_error_frame)
    size = message.dlc if message.is_remote_frame else len(message.data)
    stamp_s = message.timestamp
    if not 0 <= message.arbitration_id <= largest or not 0 <= size <= MOST_BYTES or not abs(stamp_s) < _MOST_STAMP_S:
        raise DataError(
            f"not a frame: identifier {message.arbitration_id:#x} (at most {largest:#x}), {size} bytes (at most "
            f"{MOST_BYTES}), stamp {stamp_s:g} s"
        )
    return Frame(
        id=message.arbitration_id,
        data=bytes(size) if message.is_remote_frame else message.data,
        extended=message.is_extended_id,
        error=message.is_error_frame,
        received=message.is_rx if received is None else received,
        fd=message.is_fd,
        bit_rate_switch=message.bitrate_switch,
        remote=message.is_remote_frame,
        channel=channel,
        monotonic_ns=monotonic_ns,
        bus_ns=round(stamp_s * 1e9),
    )


_HINTS = {
    errno.EAFNOSUPPORT: "this kernel has no CAN: use socketcand and a hub (mgdd rig hub), or another machine",
    errno.ENODEV: "`ip -brief link` lists the CAN interfaces",
    errno.ENETDOWN: "`ip link set CHANNEL up type can bitrate 500000` starts it",
}


def connected(interface: str, channel: str | int, options: Mapping[str, Any], name: str) -> Any:
    """Open a bus of python-can, which messages call `name`; RigError says what is wrong and what to do."""
    can: Any = import_extra("can", "can", "a CAN bus")
    options = dict(options)
    if interface == "socketcand":
        options.setdefault("tcp_tune", True)
        logging.getLogger("can.interfaces.socketcand.socketcand").setLevel(logging.CRITICAL)  # one per TCP segment
        missing = [key for key in ("host", "port") if key not in options]
        if missing:
            raise RigError(
                f"{name}: socketcand needs {' and '.join(missing)}, for example socketcand:can0?host=H&port=29536"
            )
        port = options["port"]
        if not (str(port).isdigit() and 0 < int(port) < 65536):
            raise RigError.of(f"{name}: port", port, "a whole number in [1, 65535], as the hub prints it")
        try:
            with socket.create_connection((options["host"], options["port"]), timeout=_GREETING_S) as stream:
                greeting = stream.recv(16)
        except OSError as error:
            raise RigError(f"{name}: no answer there: {error}; start the hub first: mgdd rig hub") from error
        if not greeting.startswith(b"< hi"):
            raise RigError(f"{name}: what answers there is not socketcand: it sent {greeting!r}")
    if interface not in can.VALID_INTERFACES:
        guess = did_you_mean(interface, can.VALID_INTERFACES)
        names = f"must be one of {', '.join(sorted(can.VALID_INTERFACES))}"
        raise RigError(f"interface {interface!r}: python-can has no such interface: {guess or names}")
    try:
        for _ in range(_GREETINGS):
            try:
                return can.Bus(interface=interface, channel=channel, ignore_config=True, **options)
            except can.CanError as error:
                if interface != "socketcand" or "Expected" not in str(error):
                    raise  # the one that is tried again: a frame in one packet with the greeting
        raise can.CanError("the greeting of the hub was never read alone")
    except (can.CanError, OSError, ImportError, ValueError, TypeError) as error:
        hint = _HINTS.get(error_code(error))
        raise RigError(
            f"{name}: channel {channel!r} of interface {interface} cannot be opened: {error}"
            + (f"; {hint}" if hint else "")
        ) from error


def error_code(error: Exception) -> int:
    """Return the errno of an error of python-can or of the system; 0 where it has none."""
    code = getattr(error, "error_code", None) or getattr(error, "errno", None)
    return code if isinstance(code, int) else 0


class Reception:
    """Receives from a bus of python-can.

    The age of a frame counts from its arrival, also where this process was stopped meanwhile: from the stamp where the
    bus has the clock of this machine, else from the last look that found the bus empty.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        module = str(bus.__class__.__module__)  # of python-can, or of another one
        self._interface = module.split(".")[2] if module.startswith("can.interfaces.") else ""
        self._has_our_clock = _has_our_clock(bus, self._interface)
        self._empty_ns = time.monotonic_ns()
        self.counts: Counter[str] = Counter()  # what was left out: ``malformed`` and ``own``

    def receive(self, timeout_s: float = POLL_S) -> Frame | None:
        """Give the next frame; None where none came, or what came is left out."""
        looked_ns = time.monotonic_ns()
        message = self._bus.recv(0.0)
        if message is None:
            self._empty_ns = looked_ns
            message = self._bus.recv(timeout_s)
        if message is None:
            return None
        # SocketCAN calls so what any process of this machine has sent, and gives nothing back to who sent it.
        if not message.is_rx and self._interface != "socketcan":
            self.counts["own"] += 1
            return None
        try:
            return frame_of(message, monotonic_ns=self._arrival_ns(message.timestamp), received=True)
        except DataError:
            self.counts["malformed"] += 1
            return None

    def _arrival_ns(self, stamp_s: float) -> int:
        now_ns = time.monotonic_ns()
        if self._has_our_clock and stamp_s > 0.0:
            waited_ns = (time.time() - stamp_s) * 1e9 - 1e3  # stamps are exact to 1 us
            return now_ns - round(max(0.0, min(waited_ns, float(now_ns))))
        return now_ns if now_ns - self._empty_ns <= STILL_S * 1e9 else self._empty_ns


def _has_our_clock(bus: Any, interface: str) -> bool:
    """Whether the bus stamps frames by the wall clock of this machine when they arrive."""
    if interface == "virtual":
        return not bus.preserve_timestamps
    if interface == "socketcand":
        return str(getattr(bus, "_SocketCanDaemonBus__host", "")).lower() in THIS_HOST
    return interface in ("socketcan", "udp_multicast")


def write_log(kind: str, path: Path, frames: Iterable[tuple[float, Frame]]) -> None:
    """Write frames with their wall-clock stamps [s] as ``blf``, ``asc`` or ``log`` (candump)."""
    io = import_extra("can.io", "can", f"a {kind} file")
    writer = getattr(io, LOG_WRITERS[kind])(path)
    try:
        for timestamp_s, frame in frames:
            writer.on_message_received(message_of(frame, timestamp_s=timestamp_s))
    finally:
        writer.stop()  # it buffers: without this the end of the file is missing
