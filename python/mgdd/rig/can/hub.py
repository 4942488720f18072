"""A bus without a kernel: a TCP server of the socketcand protocol (raw mode) that passes frames between processes.

Everything that one client sends, all the others get, in order. Real buses lose, change and delay frames, and have a bit
rate: the hub does so when asked.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import time
from collections.abc import Callable, Sequence
from typing import cast

from mgdd.errors import ParameterError, RigError, argument
from mgdd.rig.can.hub_faults import BusFault, Delivery, FaultInjector

__all__ = ["Hub"]

_READ = 4096
_JOIN_S = 0.02  # python-can does not expect a frame in one packet with the last "ok"
_MOST_WAITING_S = 1.0  # of a frame before a bus with a bit rate: then it is lost
_MOST_WAITING = 1 << 20  # bytes that a client has not read: then it is put out
_OVERHEAD_BITS = 47  # of a standard frame; stuff bits come on top
_EXTENDED_BITS = 67
_STUFFING = 1.2


class _Client:
    """One connection in raw mode; its first frames wait until it has read the greeting."""

    def __init__(self, number: int, writer: asyncio.StreamWriter) -> None:
        self.number, self._writer = number, writer
        self._waiting: list[bytes] | None = []
        asyncio.get_running_loop().call_later(_JOIN_S, self._begin)

    def write(self, text: bytes) -> None:
        """Give it a frame; one that does not read is put out."""
        if self._waiting is not None:
            self._waiting.append(text)
        elif self._writer.transport.get_write_buffer_size() > _MOST_WAITING:
            self._writer.transport.abort()
        else:
            self._writer.write(text)

    def _begin(self) -> None:
        waiting, self._waiting = self._waiting or [], None
        self._writer.write(b"".join(waiting))


class Hub:
    """A hub for processes of this machine.

    Parameters
    ----------
    host : str
        Address to listen at.
    port : int
        Port; 0 takes a free one.
    faults : sequence of BusFault
        What goes wrong.
    bit_rate : float, optional
        Bits per second of the simulated bus; without limit if left out.
    seed : int
        Of the noise of the faults.

    Raises
    ------
    mgdd.errors.ParameterError
        A port or bit rate outside its domain.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        faults: Sequence[BusFault] = (),
        bit_rate: float | None = None,
        seed: int = 0,
    ) -> None:
        if not 0 <= port < 65536:
            raise ParameterError.of("port", port, "in [0, 65535]")
        if bit_rate is not None and not 1e3 <= bit_rate <= 1e8:
            raise ParameterError.of("bit_rate", bit_rate, "in [1e3, 1e8] bit/s")
        self.host, self.port = host, port
        self.frames = self._overload = 0
        self._rate = bit_rate
        self._injector = FaultInjector(faults, seed)
        self._clients: list[_Client] = []
        self._serving: set[asyncio.Task[None]] = set()
        self._joined = 0
        self._free_s = 0.0
        self._start_s = 0.0

    async def run(self, on_ready: Callable[[Hub], None], stop: asyncio.Event) -> None:
        """Serve until `stop` is set.

        Parameters
        ----------
        on_ready : callable
            Called once with the hub, when it listens and knows its port.
        stop : asyncio.Event
            Ends it.

        Raises
        ------
        mgdd.errors.RigError
            The port is taken.
        """
        self._start_s = time.monotonic()
        try:
            server = await asyncio.start_server(self._serve, self.host, self.port)
        except OSError as error:
            why = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror or str(error)
            free = f"; {argument('port', '0')} takes a free one" if error.errno == errno.EADDRINUSE else ""
            raise RigError(f"{self.host}:{self.port}: the hub cannot listen there: {why}{free}") from error
        self.port = server.sockets[0].getsockname()[1]
        try:
            on_ready(self)
            await stop.wait()
        finally:
            server.close()
            await asyncio.sleep(0.0)  # whoever has just come in begins, and so is seen
            serving = list(self._serving)
            for task in serving:
                task.cancel()
            await asyncio.gather(*serving, return_exceptions=True)
            await server.wait_closed()  # last: since Python 3.12 it waits for the connections

    @property
    def counts(self) -> dict[str, int]:
        """Frames taken, lost because the bus was too slow for them, and how often each fault struck."""
        return {"frames": self.frames, "overload": self._overload, **self._injector.counts}

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client: _Client | None = None
        task = cast("asyncio.Task[None]", asyncio.current_task())
        self._serving.add(task)
        writer.write(b"< hi >")
        buffer = b""
        try:
            while data := await reader.read(_READ):
                buffer += data
                while b">" in buffer:
                    one, _, buffer = buffer.partition(b">")
                    words = one.strip().lstrip(b"<").split()
                    if words[:1] == [b"open"]:
                        writer.write(b"< ok >")
                    elif words[:1] == [b"rawmode"] and client is None:
                        writer.write(b"< ok >")
                        await writer.drain()
                        self._joined += 1
                        client = _Client(self._joined, writer)
                        self._clients.append(client)
                    elif words[:1] == [b"send"] and client is not None:
                        self._pass_on(client, words)
        except (ConnectionError, asyncio.CancelledError):  # a killed client is a normal event on a test bus
            pass
        finally:
            self._serving.discard(task)
            if client is not None:
                self._clients.remove(client)
            writer.close()
            with contextlib.suppress(ConnectionError, asyncio.CancelledError):
                await writer.wait_closed()

    def _pass_on(self, sender: _Client, words: list[bytes]) -> None:
        try:
            size = int(words[2], 16)
            data = bytes(int(word, 16) for word in words[3 : 3 + size])
            identifier = int(words[1], 16)
        except (IndexError, ValueError):
            return  # not a frame: socketcand says nothing either
        if len(data) != size:
            return
        self.frames += 1
        now = time.monotonic() - self._start_s
        if self._injector.frozen(sender.number, now):
            return
        width = len(words[1])  # 3 digits say 11 bits, 8 say 29
        for other, delivery in self._injector.deliver(identifier, data, now):
            waiting_s = self._queueing_s(len(delivery.data), width, now)
            if waiting_s > _MOST_WAITING_S:
                self._overload += 1
                continue
            late = delivery.late_s + waiting_s
            text = _text(other, width, delivery)
            if late > 0.0:
                asyncio.get_running_loop().call_later(late, self._write, sender, text)
            else:
                self._write(sender, text)

    def _queueing_s(self, size: int, width: int, now: float) -> float:
        """Wait of a frame behind those before it, and its own time on the wire [s]."""
        if self._rate is None:
            return 0.0
        bits = ((_OVERHEAD_BITS if width <= 3 else _EXTENDED_BITS) + 8 * size) * _STUFFING
        free_s = max(self._free_s, now) + bits / self._rate
        if free_s - now <= _MOST_WAITING_S:
            self._free_s = free_s
        return free_s - now

    def _write(self, sender: _Client, text: bytes) -> None:
        now = time.monotonic() - self._start_s
        for client in list(self._clients):
            if client is sender or self._injector.frozen(client.number, now):
                continue
            client.write(text)


def _text(identifier: int, width: int, delivery: Delivery) -> bytes:
    stamp = b"%.6f" % time.time()
    if delivery.error_class:
        return b"< error %08X %s >" % (delivery.error_class, stamp)
    number = b"%08X" % identifier if width > 3 else b"%03X" % identifier
    return b"< frame %s %s %s >" % (number, stamp, delivery.data.hex().upper().encode())
