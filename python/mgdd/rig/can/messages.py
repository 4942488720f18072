"""Frames of the core as messages of python-can, and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mgdd._core.rig import Frame
from mgdd.io.extras import import_extra

if TYPE_CHECKING:
    import can

__all__ = ["frame_of", "message_of"]


def message_of(frame: Frame, *, timestamp_s: float = 0.0) -> can.Message:
    """Return a frame as python-can has it.

    Parameters
    ----------
    frame : mgdd.rig.Frame
        Any frame.
    timestamp_s : float
        Stamp of the message [s]; in files since 1970.

    Returns
    -------
    can.Message
        With the same content. A remote frame keeps its length.

    Examples
    --------
    >>> from mgdd.rig import Frame
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
    mgdd.rig.Frame
        With the stamp of the message as ``bus_ns``.

    Examples
    --------
    >>> import can
    >>> from mgdd.rig.can.messages import frame_of
    >>> frame_of(can.Message(arbitration_id=0x121, is_extended_id=False, data=[1, 2]), monotonic_ns=5).data.hex()
    '0102'
    """
    return Frame(
        id=message.arbitration_id,
        data=bytes(message.dlc) if message.is_remote_frame else message.data,
        extended=message.is_extended_id,
        error=message.is_error_frame,
        received=message.is_rx if received is None else received,
        fd=message.is_fd,
        bit_rate_switch=message.bitrate_switch,
        remote=message.is_remote_frame,
        channel=channel,
        monotonic_ns=monotonic_ns,
        bus_ns=round(message.timestamp * 1e9),
    )
