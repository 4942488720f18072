"""Where the live page looks, and how its stop button opens the bridge there."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque
from pathlib import Path
from tempfile import TemporaryDirectory

from mgdd._core.rig import Frame
from mgdd.errors import DataError, RigError
from mgdd.rig.can.link import Sender
from mgdd.rig.can.processes import Child
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.live.live_data import LiveData
from mgdd.rig.live.record_tail import News, RecordTail

_RECORD = "run.rec"
_GROWS_S = _PATIENCE_S = 2.0
_ELSEWHERE = "written by another user or machine: stop it there"
_WRITES = os.O_WRONLY | os.O_RDWR
_SAFE_FRAMES, _SAFE_PAUSE_S = 5, 0.002


def writer_of(path: Path) -> int | None:
    """Give the process that has a file open for writing: what a record belongs to while it runs."""
    try:
        record_stat = path.stat()
    except OSError:
        return None
    for process in os.listdir("/proc") if os.path.isdir("/proc") else []:  # noqa: PTH112, PTH208 - ten thousand paths
        if process.isdigit() and _writes(process, record_stat):
            return int(process)
    return None


def _writes(process: str, record_stat: os.stat_result) -> bool:
    try:
        for number in os.listdir(f"/proc/{process}/fd"):  # noqa: PTH208
            try:
                open_stat = os.stat(f"/proc/{process}/fd/{number}")  # noqa: PTH116
            except OSError:
                continue
            if (open_stat.st_dev, open_stat.st_ino) == (record_stat.st_dev, record_stat.st_ino):
                text = Path(f"/proc/{process}/fdinfo/{number}").read_text(encoding="ascii")
                if int(text.partition("flags:")[2].split()[0], 8) & _WRITES:
                    return True
    except OSError:  # of another user, or it has ended
        pass
    return False


class RecordSource:
    """A record, of a run that goes on or is over. Stop is Ctrl-C to the process that writes it, as from its terminal.

    A second click is SIGTERM, for one that a shell made ignore the first.
    """

    def __init__(self, path: Path, signal_map: SignalMap | None = None, *, name: str = "") -> None:
        self.name = name or str(path)
        self.data = LiveData(signal_map)
        self.said = ""  # what became of the stop
        self._tail = RecordTail(path)
        self._looked_s = self._asked_s = self._grown_s = -9.0
        self._writer: int | None = None
        self._sent: dict[int, float] = {}  # by process, when it was asked first

    @property
    def trouble(self) -> str:
        """What stands against reading on."""
        return self._tail.trouble

    @property
    def state(self) -> str:
        """Whether it is still written, and by whom."""
        if time.monotonic() - self._asked_s > 1.0:
            self._asked_s, self._writer = time.monotonic(), writer_of(self._tail.path)
        behind = f"; {self._tail.behind / 1e6:.0f} MB are still to be read" if self._tail.behind else ""
        if self._writer is not None:
            return f"running, process {self._writer}{behind}"
        return (f"it grows: {_ELSEWHERE}" if self._grows else "over: no process writes it") + behind

    @property
    def _grows(self) -> bool:
        return time.monotonic() - self._grown_s < _GROWS_S

    def look(self) -> None:
        """Read on, at most ten times a second however many browsers ask."""
        if time.monotonic() - self._looked_s > 0.1:
            self._looked_s, size = time.monotonic(), self._tail.size
            self.data.take(self._tail.look(), self._tail.start_ns)
            if 0 < size < self._tail.size:
                self._grown_s = self._looked_s

    def stop(self) -> None:
        """Open the bridge."""
        self._writer = writer_of(self._tail.path)
        self._asked_s = time.monotonic()
        if self._writer is None:
            failed = f"STOP FAILED, it is {_ELSEWHERE}, or use the emergency stop"
            self.said = failed if self._grows else self.said or "nothing to stop: no process writes this record"
            return
        asked_s = self._sent.setdefault(self._writer, self._asked_s)
        if 0.0 < self._asked_s - asked_s < _PATIENCE_S:  # a double click: a run that ends keeps its results
            return
        number = signal.SIGINT if asked_s == self._asked_s else signal.SIGTERM
        try:
            descriptor = os.pidfd_open(self._writer)  # from here on the number cannot come to mean another process
            try:
                if writer_of(self._tail.path) == self._writer:
                    signal.pidfd_send_signal(descriptor, number)
            finally:
                os.close(descriptor)
        except OSError as error:
            self.said = f"STOP FAILED, process {self._writer}: {error.strerror}: use the emergency stop"
            return
        self.said = (
            f"{number.name} sent to process {self._writer} at {time.strftime('%H:%M:%S')}; if it stays running, "
            "click again, or use the emergency stop"
        )

    def close(self) -> None:
        """Leave it: a run goes on without its page."""


class BusSource:
    """A bus that is listened to. Stop sends safe frames there, which its host takes for a second sender and ends too.

    Nothing else is ever sent.
    """

    state, trouble = "listening", ""

    def __init__(self, bus: str, signal_map: SignalMap) -> None:
        self._map, self._bus = signal_map, CanTransport.parse(bus)
        self.name, self.said = self._bus.name, ""
        self.data = LiveData(signal_map)
        self._frames: deque[Frame] = deque(maxlen=100_000)  # of a page that is not open
        self._over, self._stop = threading.Event(), threading.Event()
        self._begun_ns = time.monotonic_ns()
        self._bus.open()
        self._thread = threading.Thread(target=self._listen, name="mgdd live page", daemon=True)
        self._thread.start()

    def look(self) -> None:
        """Take what came."""
        frames = [self._frames.popleft() for _ in range(len(self._frames))]
        self.data.take(News({}, [], frames), self._begun_ns)

    def stop(self) -> None:
        """Open the bridge."""
        if self._thread.is_alive():
            self._stop.set()
        else:
            self.said = "STOP FAILED: the bus is gone: use the emergency stop"

    def close(self) -> None:
        """Close the bus."""
        self._over.set()
        self._thread.join()
        self._bus.close()

    def _listen(self) -> None:
        try:
            while not self._over.is_set():
                frame = self._bus.receive(0.02)
                if frame is not None:
                    self._frames.append(frame)
                if self._stop.is_set():
                    self._stop.clear()
                    self._send_safe()
        except RigError as error:
            self.trouble, self.state = str(error), "the bus is gone"

    def _send_safe(self) -> None:
        """Go on from the counter that was received last: the node takes the frames, and refuses those of its host."""
        commands = [message for message in self._map.commands.values() if message.safe]
        sender, sent = Sender(), 0
        for message in commands:
            last = self.data.last_commands.get(message.name)
            if last is not None:
                sender.go_on(message, last)
        try:
            for _ in range(_SAFE_FRAMES):
                for message in commands:
                    for frame in sender.frames(message, message.payloads({}, message.safe)):
                        self._bus.send(frame, final=True)
                        sent += 1
                time.sleep(_SAFE_PAUSE_S)
        except RigError as error:
            self.said = f"STOP FAILED: {error}: use the emergency stop"
            return
        if not sent:
            self.said = "STOP FAILED: the map has no safe frame: use the emergency stop"
            return
        self.said = f"{sent} safe frames sent at {time.strftime('%H:%M:%S')}: check that the node opens its bridge"


class SimulatedSource(RecordSource):
    """A throttle that is simulated in a process of its own, on the real-time loop; it ends with the page."""

    def __init__(self, period_ms: float = 5.0) -> None:
        self._folder = TemporaryDirectory(prefix="mgdd-watch-")
        path = Path(self._folder.name) / _RECORD
        self._child = Child("mgdd.rig.live.simulated", str(path), str(period_ms))
        super().__init__(path, name=f"simulated throttle P1, guided control, {period_ms:g} ms")

    def close(self) -> None:
        """End the simulation."""
        self._child.stop()
        self._folder.cleanup()


Source = RecordSource | BusSource


def source_of(what: str | os.PathLike[str] | None, map_name: str | os.PathLike[str] | None = None) -> Source:
    """Open the folder of a run, a record, a bus, or with nothing a simulation; DataError where it is none of them."""
    text = "simulate" if what is None else os.fspath(what)
    path = Path(text)
    if path.is_dir() and not (path / _RECORD).is_file():
        raise DataError(f"{path}: holds no {_RECORD}: give the folder of a run of `mgdd rig run`")
    if path.exists():
        return RecordSource(
            path / _RECORD if path.is_dir() else path, None if map_name is None else SignalMap.load(map_name)
        )
    if text == "simulate":
        return SimulatedSource()
    if ":" in text:
        return BusSource(text, SignalMap.load("etb" if map_name is None else map_name))
    raise DataError(f"{text}: no such folder or record; a bus is INTERFACE:CHANNEL, and `simulate` needs nothing")
