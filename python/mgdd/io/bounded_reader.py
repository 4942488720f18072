"""Binary files, opened in a process with limits: what they do to its libraries is an error of one file here.

One process is kept for the files that follow; it ends with this one. Names and numbers come back, never objects.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, printable
from mgdd.io.array_table import Column, Columns, damaged
from mgdd.io.read_limits import ReadLimits

if TYPE_CHECKING:
    from numpy.typing import NDArray

_KEPT = 2  # processes that wait for a file, for callers with several threads
# Of waiting beside computing, as for a disk or other programs; all there is where computing cannot be limited.
_WAITING = 4.0
_TOO_LONG, _NO_MEMORY = -24, -9  # SIGXCPU, and SIGKILL as the system sends it that has no memory left
_START = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from mgdd.io.reading_process import serve; serve()"
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # each would take address space


class _LostError(Exception):
    """A process that ended instead of an answer."""


def _module_path() -> list[str]:
    """Give where modules are looked for, mgdd itself first; the folder that is current by chance is none of it."""
    return [str(Path(__file__).parents[2]), *(str(Path(each).absolute()) for each in sys.path if each)]


class _Process:
    """A process that reads, and its pipes."""

    def __init__(self) -> None:
        self.path = _module_path()
        self._late, self._lock = False, threading.Lock()
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START, json.dumps(self.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | _ONE_THREAD,
            start_new_session=True,  # Ctrl-C is for the caller, who ends it
        )
        try:
            began = self._answer()
        except BaseException:
            self.end()
            raise
        if not began.startswith(b"{"):
            code = self._process.wait()
            self.end()
            raise OSError(f"{sys.executable} ended with code {code}")

    def ask(self, request: dict[str, Any], seconds: float) -> tuple[dict[str, Any], NDArray[np.uint8]]:
        """Send a request and wait for what it says, and the bytes behind it."""
        with self._lock:
            watch = threading.Timer(seconds, self._give_up)
            watch.daemon = True
            watch.start()
            try:
                self._send(request)
                line = self._answer()
                said = json.loads(line) if line.endswith(b"\n") else None
                if said is None:
                    raise _LostError
                body = np.empty(said["bytes"], np.uint8)
                if self._process.stdout.readinto(body) < body.size:  # type: ignore[union-attr]
                    raise _LostError
            except OSError:
                raise _LostError from None
            finally:
                watch.cancel()
        return said, body

    def close_file(self) -> bool:
        """Leave the file that is open, and say whether another may follow."""
        try:
            self.ask({"do": "close"}, _WAITING)
        except _LostError:
            return False
        return True

    def alive(self) -> bool:
        """Whether it can be asked."""
        return self._process.poll() is None

    def code(self) -> int:
        """Wait for its end; below 0 for a signal."""
        return _TOO_LONG if self._late else self._process.wait()

    def end(self) -> None:
        """End it and what it started."""
        self._kill()
        self.forget()
        self._process.wait()

    def forget(self) -> None:
        """Close the pipes; a process whose parent is another one is left to that."""
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if stream is not None:
                    stream.close()

    def _send(self, request: dict[str, Any]) -> None:
        self._process.stdin.write(json.dumps(request).encode() + b"\n")  # type: ignore[union-attr]
        self._process.stdin.flush()  # type: ignore[union-attr]

    def _answer(self) -> bytes:
        return self._process.stdout.readline()  # type: ignore[union-attr]

    def _give_up(self) -> None:
        self._late = True
        self._kill()

    def _kill(self) -> None:
        if self._process.returncode is None:
            with contextlib.suppress(OSError):
                if hasattr(os, "killpg"):
                    os.killpg(self._process.pid, 9)
                else:
                    self._process.kill()


class _Kept:
    """Processes that wait for a file."""

    def __init__(self) -> None:
        self._idle: list[_Process] = []
        self._lock = threading.Lock()
        atexit.register(self.end)
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._forget)

    def take(self) -> _Process:
        """Give a process that sees the modules this one sees."""
        while True:
            with self._lock:
                found = self._idle.pop() if self._idle else None
            if found is None:
                return _Process()
            if found.path == _module_path() and found.alive():
                return found
            found.end()

    def give_back(self, process: _Process) -> None:
        """Keep a process for another file."""
        with self._lock:
            if len(self._idle) < _KEPT:
                self._idle.append(process)
                return
        process.end()

    def end(self) -> None:
        """End all that wait."""
        while self._idle:
            self._idle.pop().end()

    def _forget(self) -> None:
        self._lock = threading.Lock()
        for process in self._idle:
            process.forget()
        self._idle = []


_kept = _Kept()


class _File:
    """A file that a process has open."""

    def __init__(self, process: _Process, limits: ReadLimits) -> None:
        self._process, self._limits = process, limits

    def ask(self, **request: Any) -> tuple[dict[str, Any], NDArray[np.uint8]]:
        """Ask for something of the file, or raise what its reader raised."""
        try:
            said, body = self._process.ask(request, self._limits.seconds + _WAITING)
        except _LostError:
            raise _ended(self._process.code(), self._limits) from None
        if said.get("again") and said["ended"] != _TOO_LONG and request["do"] == "open":
            return self.ask(**request)  # what an earlier file left behind may have ended it: once more, in a new one
        if "ended" in said:
            raise _ended(said["ended"], self._limits)
        for note in said["warnings"]:
            warnings.warn(printable(note), UserWarning, stacklevel=2)
        match said.get("error"):
            case "memory":
                raise self._limits.too_much_memory()
            case "import":
                raise ImportError(said["text"], name=said["name"])
            case "data":
                raise DataError(said["text"])
            case "other":
                raise damaged(self._limits.file, said["text"])
        return said, body


def _ended(code: int, limits: ReadLimits) -> DataError:
    """Say why a process ended."""
    if code == _TOO_LONG:
        return limits.too_much_time()
    if code == _NO_MEMORY:
        return limits.too_much_memory()
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"code {code}"
    return DataError(f"{limits.file}: its reader ended with {name}: the file was cut off or damaged; write it again")


class _Array:
    """An array of a file that a process has open, read from it slice by slice."""

    def __init__(self, file: _File, number: int, shape: tuple[int, ...], dtype: str) -> None:
        self.shape, self.dtype = shape, np.dtype(dtype)
        self._file, self._number = file, number

    def __getitem__(self, index: tuple[Any, ...]) -> NDArray[Any]:
        wanted = [[one.start, one.stop] if isinstance(one, slice) else int(one) for one in index]
        said, body = self._file.ask(do="read", array=self._number, index=wanted)
        found: NDArray[Any] = body.view(np.dtype(said["type"])).reshape(said["shape"])
        return found


@contextlib.contextmanager
def open_bounded(file: Path, form: str, **how: Any) -> Iterator[Columns | tuple[str, str]]:
    """Open a binary file of a format in a process with limits: its columns, or what to call its text and the text.

    `how` are keywords of `mgdd.io.any_table.read_format`.
    """
    limits = ReadLimits.of(file, form)
    process = _kept.take()
    kept = False
    try:
        source = _File(process, limits)
        said, body = source.ask(
            do="open", file=str(file), folder=str(Path.cwd()), format=form, memory=limits.memory,
            seconds=limits.seconds, how=how,
        )  # fmt: skip
        if "source" in said:
            yield said["source"], body.tobytes().decode("utf-8", "surrogatepass")
        else:
            arrays = [_Array(source, k, tuple(shape), kind) for k, (shape, kind) in enumerate(said["arrays"])]
            for name, _, at, *_ in said["columns"]:
                limits.require(math.prod(arrays[at].shape) * arrays[at].dtype.itemsize, f"{name!r}")
            yield [(name, unit, Column(arrays[at], *place)) for name, unit, at, *place in said["columns"]]
        kept = process.close_file()
    except (DataError, ImportError):  # most of them told by a process that is well
        kept = process.close_file()
        raise
    finally:
        if kept:
            _kept.give_back(process)
        else:
            process.end()
