"""Both ends of a protected exchange: a sender with its alive counters, a receiver with its checks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from mgdd._core.rig import E2eCheck, Frame, protect
from mgdd.rig.can.mapped import MappedMessage

__all__ = ["Receiver", "Sender", "Taken"]


class Taken(NamedTuple):
    """A frame that was checked.

    Parameters
    ----------
    message : MappedMessage
        Whose frame it is.
    status : str
        As `E2eCheck.push` says it; of an unprotected one ``ok`` or ``wrong_length``.
    usable : bool
        Whether its content may be used.
    """

    message: MappedMessage
    status: str
    usable: bool

    @property
    def is_new(self) -> bool:
        """Whether it is whole and not the last one again, usable or not."""
        return self.status in ("ok", "initial", "lost")


class Sender:
    """Stamps alive counter and CRC, each message with a counter of its own."""

    def __init__(self) -> None:
        self._counters: dict[str, int] = {}

    def frames(self, message: MappedMessage, payloads: Iterable[bytes]) -> list[Frame]:
        """Make frames of payloads.

        Parameters
        ----------
        message : MappedMessage
            Whose identifier and protection they get.
        payloads : iterable of bytes
            Of the length of the message.

        Returns
        -------
        list of Frame
            In the same order.
        """
        out = []
        for payload in payloads:
            whole = payload
            if message.e2e is not None:
                counter = self._counters.get(message.name, 0)
                whole = protect(message.e2e, counter, payload)
                self._counters[message.name] = message.e2e.next_counter(counter)
            where = message.message
            out.append(Frame(id=where.frame_id, data=whole, extended=where.extended, fd=len(whole) > 8))
        return out


class Receiver:
    """Checks the frames of some messages; what does not belong to them is counted as foreign.

    Parameters
    ----------
    messages : mapping of str to MappedMessage
        What may come.

    Attributes
    ----------
    stamps_ns : dict of str to int
        Our stamp of the last usable frame of each message.
    seen : dict of int to int
        Frames by identifier, foreign ones too.
    """

    def __init__(self, messages: Mapping[str, MappedMessage]) -> None:
        self._by_key = {message.key: message for message in messages.values()}
        self._checks = {name: E2eCheck(m.e2e) for name, m in messages.items() if m.e2e is not None}
        self._short: dict[str, int] = {}
        self.stamps_ns: dict[str, int] = {}
        self.seen: dict[int, int] = {}

    def take(self, frame: Frame) -> Taken | None:
        """Check a frame.

        Parameters
        ----------
        frame : Frame
            As it arrived.

        Returns
        -------
        Taken or None
            Its message and what the check says; None for a foreign frame.
        """
        self.seen[frame.id] = self.seen.get(frame.id, 0) + 1
        message = self._by_key.get((frame.id, frame.extended))
        if message is None:
            return None
        check = self._checks.get(message.name)
        if check is not None:
            status = check.push(frame.data)
            usable = status == "ok" and check.valid
        else:
            status = "ok" if len(frame.data) == message.message.size else "wrong_length"
            usable = status == "ok"
            self._short[message.name] = self._short.get(message.name, 0) + (not usable)
        if usable:
            self.stamps_ns[message.name] = frame.monotonic_ns
        return Taken(message, status, usable)

    def valid(self, name: str) -> bool:
        """Whether the frames of a message pass their check; True for an unprotected one."""
        check = self._checks.get(name)
        return check is None or check.valid

    def reset(self) -> None:
        """Forget what came; the counts stay."""
        self.stamps_ns.clear()
        for check in self._checks.values():
            check.reset()

    @property
    def counts(self) -> dict[str, dict[str, Any]]:
        """Frames by status, of each message that is checked or came too short."""
        protected = {name: dict(check.counts) for name, check in self._checks.items()}
        return {**{name: {"wrong_length": n} for name, n in self._short.items()}, **protected}
