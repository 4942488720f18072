"""Opening a bus of python-can, with errors that say what is wrong and what to do."""

from __future__ import annotations

import errno
import logging
import socket
from collections.abc import Mapping
from typing import Any

from mgdd.errors import RigError, did_you_mean
from mgdd.io.extras import import_extra

__all__ = ["connected", "error_code"]

_GREETING_S = 2.0
_GREETINGS = 5


def connected(interface: str, channel: str | int, options: Mapping[str, Any], name: str) -> Any:
    """Open a bus of python-can.

    Parameters
    ----------
    interface, channel : str or int
        As `CanTransport` takes them.
    options : mapping
        Further keywords of the interface.
    name : str
        What messages call it.

    Returns
    -------
    can.BusABC
        Open.

    Raises
    ------
    mgdd.errors.RigError
        No such interface or channel, nobody listens there, a kernel without CAN; the message says what to do.
    """
    can: Any = import_extra("can", "can", "a CAN bus")
    options = dict(options)
    if interface == "socketcand":
        options.setdefault("tcp_tune", True)
        logging.getLogger("can.interfaces.socketcand.socketcand").setLevel(logging.CRITICAL)  # one per TCP segment
        _require_hub(name, options)
    if interface not in can.VALID_INTERFACES:
        guess = did_you_mean(interface, can.VALID_INTERFACES)
        known = f"must be one of {', '.join(sorted(can.VALID_INTERFACES))}"
        raise RigError(f"interface {interface!r}: python-can has no such interface: {guess or known}")
    try:
        for _ in range(_GREETINGS):
            try:
                return can.Bus(interface=interface, channel=channel, ignore_config=True, **options)
            except can.CanError as error:
                if interface != "socketcand" or "Expected" not in str(error):
                    raise  # the one that is tried again: a frame in one packet with the greeting
        raise can.CanError("the greeting of the hub was never read alone")
    except (can.CanError, OSError, ImportError, ValueError, TypeError) as error:
        hint = _hint(error)
        raise RigError(
            f"{name}: channel {channel!r} of interface {interface} cannot be opened: {error}"
            + (f"; {hint}" if hint else "")
        ) from error


def error_code(error: Exception) -> int:
    """Return the errno of an error of python-can or of the system; 0 where it has none."""
    code = getattr(error, "error_code", None) or getattr(error, "errno", None)
    return code if isinstance(code, int) else 0


def _require_hub(name: str, options: Mapping[str, Any]) -> None:
    """Refuse a place where no socketcand answers: python-can would try for ten seconds, or wait for ever."""
    missing = [key for key in ("host", "port") if key not in options]
    if missing:
        raise RigError(
            f"{name}: socketcand needs {' and '.join(missing)}, for example socketcand:can0?host=H&port=29536"
        )
    port = options["port"]
    if not (str(port).isdigit() and 0 < int(port) < 65536):
        raise RigError.of(f"{name}: port", port, "a whole number in [1, 65535], as the hub says it")
    try:
        with socket.create_connection((options["host"], options["port"]), timeout=_GREETING_S) as stream:
            greeting = stream.recv(16)
    except OSError as error:
        raise RigError(f"{name}: nobody answers there: {error}; start the hub first: mgdd rig hub") from error
    if not greeting.startswith(b"< hi"):
        raise RigError(f"{name}: what answers there is not socketcand: it said {greeting!r}")


def _hint(error: Exception) -> str:
    return {
        errno.EAFNOSUPPORT: "this kernel has no CAN: use socketcand and a hub (mgdd rig hub), or another machine",
        errno.ENODEV: "`ip -brief link` lists the CAN interfaces",
        errno.ENETDOWN: "`ip link set CHANNEL up type can bitrate 500000` starts it",
    }.get(error_code(error), "")
