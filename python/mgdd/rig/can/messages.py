"""Frames of the core as messages of python-can, and back."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING, Any

from mgdd._core.rig import Frame
from mgdd.errors import DataError
from mgdd.io.extras import import_extra

if TYPE_CHECKING:
    import can

__all__ = ["MOST_BYTES", "Echoes", "frame_of", "largest_identifier", "message_of"]

MOST_BYTES = 64  # of a CAN FD frame
_MOST_STAMP_S = 9e9  # since any epoch, as far as nanoseconds fit into 64 bits
_ECHO_S = 1.0  # an echo that has not come by then was lost


def largest_identifier(*, extended: bool) -> int:
    """Return the largest identifier of 29 or of 11 bits."""
    return 0x1FFF_FFFF if extended else 0x7FF


def message_of(frame: Frame, *, timestamp_s: float = 0.0) -> can.Message:
    """Return a frame as python-can has it.

    Parameters
    ----------
    frame : mgdd.rig.realtime.Frame
        Any frame.
    timestamp_s : float
        Stamp of the message [s]; in files since 1970.

    Returns
    -------
    can.Message
        With the same content. A remote frame keeps its length.

    Examples
    --------
    >>> from mgdd.rig.realtime import Frame
    >>> from mgdd.rig.can.messages import message_of
    >>> message_of(Frame(id=0x120, data=bytes(2), received=True)).dlc
    2
    """
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
    """Return a message of python-can as a frame of the core.

    Parameters
    ----------
    message : can.Message
        As received, or as sent.
    monotonic_ns : int
        ``time.monotonic_ns()`` when it was received or handed to the bus [ns].
    channel : int
        Number of the bus, 0 to 255.
    received : bool, optional
        Whether it came from the bus; default what the message says.

    Returns
    -------
    mgdd.rig.realtime.Frame
        With the stamp of the message as ``bus_ns``.

    Raises
    ------
    mgdd.errors.DataError
        Not a frame: an identifier of too many bits, too many bytes, a stamp that is not a time.

    Examples
    --------
    >>> import can
    >>> from mgdd.rig.can.messages import frame_of
    >>> frame_of(can.Message(arbitration_id=0x121, is_extended_id=False, data=[1, 2]), monotonic_ns=5).data.hex()
    '0102'
    """
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


class Echoes:
    """Our own frames on a bus that hears itself and does not say so: each one that was sent comes back once at most.

    Examples
    --------
    >>> import can
    >>> from mgdd.rig.can.messages import Echoes
    >>> echoes, message = Echoes(), can.Message(arbitration_id=0x120, data=[1])
    >>> echoes.add(message)
    >>> echoes.take(message), echoes.take(message)
    (True, False)
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[float, tuple[Any, ...]]] = deque()  # appended and taken by one thread each

    def add(self, message: can.Message) -> None:
        """Note a message, before it is sent."""
        self._sent.append((time.monotonic(), _content(message)))

    def take(self, message: can.Message) -> bool:
        """Say whether a message that came is one of ours; what was sent before it will not come any more."""
        oldest_s, content = time.monotonic() - _ECHO_S, _content(message)
        while self._sent and self._sent[0][0] < oldest_s:
            self._sent.popleft()
        place = next((k for k, (_, sent) in enumerate(list(self._sent)) if sent == content), None)
        if place is None:
            return False
        for _ in range(place + 1):
            self._sent.popleft()
        return True


def _content(message: can.Message) -> tuple[Any, ...]:
    return message.arbitration_id, message.is_extended_id, message.is_remote_frame, message.dlc, bytes(message.data)
