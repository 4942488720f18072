"""A bus without a kernel: a TCP server of the socketcand protocol (raw mode) that passes frames between processes.

Everything that one client sends, all the others get, in order. Real buses lose, change and delay frames: the hub does
so when asked.
"""

from __future__ import annotations

import asyncio
import errno
import math
import os
import random
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, cast

from mgdd.errors import ParameterError, RigError, argument, did_you_mean
from mgdd.rig.can.python_can import MOST_BYTES, STILL_S, largest_identifier

_MOST_TEXT = 1024  # bytes of a frame: of 64 bytes it has some 200
_TICK_S = 0.005  # of the clock by which the hub knows that it stood still
_READ = 1 << 18  # bytes that asyncio reads at once: behind a full read there are more
_JOIN_S = 0.02  # python-can does not expect a frame in one packet with the last "ok"
_MOST_WAITING = 1 << 20  # bytes that a client has not read: then it is put out


class _Client(asyncio.Protocol):
    """One connection; in raw mode its first frames wait until it has read the greeting."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._text = b""
        self._waiting: list[bytes] | None = []
        self._arrived_s: float | None = None  # of what a full read has left behind
        self.number = 0  # in the order of raw mode

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet it."""
        self._transport = cast("asyncio.Transport", transport)
        self._hub.connections.add(self)
        self._transport.write(b"< hi >")

    def data_received(self, data: bytes) -> None:
        """Take what it says, as old as it may be."""
        arrived_s = self._hub.arrival_s() if self._arrived_s is None else self._arrived_s
        self._arrived_s = arrived_s if len(data) >= _READ else None
        *whole, self._text = (self._text + data).split(b">")
        if len(self._text) > _MOST_TEXT:
            self._text = b""
            self._hub.malformed += 1
        for one in whole:
            words = one.strip().lstrip(b"<").split()
            if words[:1] == [b"open"]:
                self._transport.write(b"< ok >")
            elif words[:1] == [b"rawmode"] and not self.number:
                self._transport.write(b"< ok >")
                self.number = self._hub.joined(self)
                asyncio.get_running_loop().call_later(_JOIN_S, self._begin)
            elif words[:1] == [b"send"] and self.number:
                self._hub.pass_on(self, words[1:], arrived_s)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - a killed client is a normal event
        """Forget it."""
        self._hub.left(self)

    def write(self, text: bytes) -> None:
        """Give it a frame; one that does not read is put out."""
        if self._waiting is not None:
            self._waiting.append(text)
        elif self._transport.get_write_buffer_size() > _MOST_WAITING:
            self._transport.abort()
        else:
            self._transport.write(text)

    def close(self) -> None:
        """Put it out; one that reads gets what waits."""
        if self._transport.get_write_buffer_size():
            self._transport.abort()
        self._transport.close()

    def _begin(self) -> None:
        waiting, self._waiting = self._waiting or [], None
        self._transport.write(b"".join(waiting))


class Hub:
    """A hub for processes of this machine.

    A frame is stamped with its arrival: what waited while the hub was stopped is as old as that.

    Parameters
    ----------
    host, port, faults, seed
        Address to listen at, 0 for a free port; what goes wrong on the bus, and the seed of its noise.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        faults: Sequence[BusFault] = (),
        seed: int = 0,
    ) -> None:
        ParameterError.unless(0 <= port < 65536, "port", port, "in [0, 65535]")
        self.host, self.port = host, port
        self.frames = self.malformed = 0
        self._injector = FaultInjector(faults, seed)
        self.connections: set[_Client] = set()
        self._clients: list[_Client] = []
        self._joined = 0
        self._start_s = 0.0
        self._ticked_s = self._looked_s = time.monotonic()

    async def run(self, on_ready: Callable[[Hub], None], stop: asyncio.Event) -> None:
        """Serve until `stop` is set; `on_ready` is called once, when the hub listens and knows its port."""
        self._start_s = self._ticked_s = self._looked_s = time.monotonic()
        loop = asyncio.get_running_loop()
        try:
            server = await loop.create_server(lambda: _Client(self), self.host, self.port)
        except OSError as error:
            why = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror or str(error)
            free = f"; {argument('port', '0')} takes a free one" if error.errno == errno.EADDRINUSE else ""
            raise RigError(f"{self.host}:{self.port}: the hub cannot listen there: {why}{free}") from error
        self.port = server.sockets[0].getsockname()[1]
        ticking = asyncio.create_task(self._tick())
        try:
            on_ready(self)
            await stop.wait()
        finally:
            ticking.cancel()
            server.close()
            await asyncio.sleep(0.0)  # whoever has just come in begins, and so is seen
            for client in list(self.connections):
                client.close()
            await server.wait_closed()  # last: since Python 3.12 it waits for the connections
            await asyncio.sleep(0.0)

    @property
    def counts(self) -> dict[str, int]:
        """Frames taken, malformed ones, and how often each fault struck."""
        return {"frames": self.frames, "malformed": self.malformed, **self._injector.counts}

    def arrival_s(self) -> float:
        """Return since when bytes that are read now may have waited; now, unless the hub stood still [s]."""
        now = time.monotonic()
        return now if now - self._looked_s <= STILL_S else self._looked_s

    def joined(self, client: _Client) -> int:
        """Take a client that is in raw mode, and give its number."""
        self._joined += 1
        self._clients.append(client)
        return self._joined

    def left(self, client: _Client) -> None:
        """Forget a client."""
        self.connections.discard(client)
        if client in self._clients:
            self._clients.remove(client)

    async def _tick(self) -> None:
        while True:  # after a stop the clock may ring before asyncio looks at its sockets: the tick before is safe
            self._looked_s, self._ticked_s = self._ticked_s, time.monotonic()
            await asyncio.sleep(_TICK_S)

    def pass_on(self, sender: _Client, words: list[bytes], arrived_s: float) -> None:
        """Give a frame to all other clients; one that is malformed is counted: socketcand says nothing either."""
        try:
            number, size = words[0], int(words[1], 16)
            data = bytes(int(word, 16) for word in words[2:])
            identifier = int(number, 16)
        except (IndexError, ValueError):
            self.malformed += 1
            return
        width = len(number)  # 3 digits say 11 bits, 8 say 29
        if not (0 <= identifier <= largest_identifier(extended=width > 3) and len(data) == size <= MOST_BYTES):
            self.malformed += 1
            return
        self.frames += 1
        now = time.monotonic() - self._start_s
        if self._injector.frozen(sender.number, now):
            return
        for delivery in self._injector.deliver(Delivery(sender, identifier, data, extended=width > 3), now):
            text = _text(delivery, arrived_s + delivery.late_s)
            but = None if delivery.error_class else delivery.sender
            if delivery.late_s > 0.0:
                asyncio.get_running_loop().call_later(delivery.late_s, self._write, but, text)
            else:
                self._write(but, text)

    def _write(self, but: _Client | None, text: bytes) -> None:
        now = time.monotonic() - self._start_s
        for client in list(self._clients):
            if client is but or self._injector.frozen(client.number, now):
                continue
            client.write(text)


def _text(delivery: Delivery, at_s: float) -> bytes:
    stamp = b"%.6f" % (time.time() - time.monotonic() + at_s)
    if delivery.error_class:
        return b"< error %08X %s >" % (delivery.error_class, stamp)
    number = (b"%08X" if delivery.extended else b"%03X") % delivery.identifier
    return b"< frame %s %s %s >" % (number, stamp, delivery.data.hex().upper().encode())


KINDS = ("drop", "duplicate", "delay", "reorder", "corrupt", "error", "freeze")
_KEYS = {"p": float, "id": int, "from_s": float, "until_s": float, "ms": float, "client": int, "class": int}
_NEEDS = {"delay": "ms", "error": "class", "freeze": "client"}


def fault_of(text: str, keys: Mapping[str, type]) -> tuple[str, dict[str, Any]]:
    """Read ``KIND:KEY=VALUE,...``, as ``drop:p=0.01,id=0x121``: kind, for the caller to check, and values by key."""
    kind, _, rest = text.partition(":")
    given: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        key, _, value = part.partition("=")
        if key not in keys:
            guess = did_you_mean(key, keys)
            raise ParameterError.of(
                "fault", text, f"KIND:KEY=VALUE,... with keys {', '.join(keys)}{'; ' + guess if guess else ''}"
            )
        try:
            given[key] = int(value, 0) if keys[key] is int else float(value)
        except ValueError:
            raise ParameterError.of(f"fault {kind}: {key}", value, "a number") from None
    return kind, given


@dataclass(frozen=True, kw_only=True)
class BusFault:
    """A fault of the bus, for each frame with a probability, and for a time after the start of the hub.

    A frame is lost, comes twice, comes late, comes after the next one of whatever sender, comes with one byte changed;
    every client, its sender too, gets an error frame instead of it; nothing goes to or comes from one client.
    """

    kind: str
    p: float = 1.0  # in [0, 1]
    id: int | None = None  # all if left out
    from_s: float = 0.0
    until_s: float = math.inf
    ms: float = 0.0  # of delay: how late
    client: int = 0  # of freeze: its number, from 1 in the order in which they came
    error_class: int = 0  # of error: bits of the error frame, for example 0x40 for bus-off

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        ParameterError.unless(self.kind in KINDS, "fault", self.kind, f"one of {', '.join(KINDS)}")
        ParameterError.unless(0.0 <= self.p <= 1.0, "p", self.p, "in [0, 1]")
        ParameterError.unless(0.0 <= self.ms <= 60_000.0, "ms", self.ms, "in [0, 60000] ms")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``KIND:KEY=VALUE,...``, as ``delay:ms=5,id=0x121`` or ``freeze:client=1,from_s=2,until_s=3``."""
        kind, given = fault_of(text, _KEYS)
        needed = _NEEDS.get(kind)
        if needed is not None and needed not in given:
            raise ParameterError.of("fault", text, f"given {needed}, for example {kind}:{needed}=1")
        if "class" in given:
            given["error_class"] = given.pop("class")
        return cls(kind=kind, **given)


class Delivery(NamedTuple):
    """A frame on its way: all get it but who sent it; how late [s]; as error frame, which all get."""

    sender: Any
    identifier: int
    data: bytes
    extended: bool = False
    late_s: float = 0.0
    error_class: int = 0


class FaultInjector:
    """Applies rules in their order, with noise of its own."""

    def __init__(self, faults: Sequence[BusFault], seed: int = 0) -> None:
        self._faults = tuple(faults)
        self._random = random.Random(seed)
        self._held: list[Delivery] = []
        self.counts = dict.fromkeys(KINDS, 0)

    def frozen(self, client: int, now_s: float) -> bool:
        """Whether a frame does not go to, or come from, a client now."""
        frozen = any(
            fault.kind == "freeze" and fault.client == client and fault.from_s <= now_s < fault.until_s
            for fault in self._faults
        )
        self.counts["freeze"] += frozen
        return frozen

    def deliver(self, frame: Delivery, now_s: float) -> list[Delivery]:
        """Say what leaves now for a frame: nothing where it was lost or is held back until the next one."""
        out = [frame]
        hold = False
        for fault in self._faults:
            if not self._strikes(fault, frame.identifier, now_s) or not out:
                continue
            if fault.kind == "corrupt" and not frame.data:
                continue
            self.counts[fault.kind] += 1
            if fault.kind == "drop":
                out = []
            elif fault.kind == "duplicate":
                out = out * 2
            elif fault.kind == "delay":
                out = [one._replace(late_s=one.late_s + fault.ms * 1e-3) for one in out]
            elif fault.kind == "corrupt":
                out = [one._replace(data=self._changed(one.data)) for one in out]
            elif fault.kind == "error":
                out = [frame._replace(error_class=fault.error_class)]
            elif fault.kind == "reorder":
                hold = True
        if hold and not self._held:
            self._held = out
            return []
        held, self._held = self._held, []
        return out + held

    def _strikes(self, fault: BusFault, identifier: int, now_s: float) -> bool:
        if fault.kind == "freeze" or not fault.from_s <= now_s < fault.until_s:
            return False
        return fault.id in (None, identifier) and self._random.random() < fault.p

    def _changed(self, data: bytes) -> bytes:
        place = self._random.randrange(len(data))
        flipped = data[place] ^ self._random.randrange(1, 256)
        return data[:place] + bytes([flipped]) + data[place + 1 :]
