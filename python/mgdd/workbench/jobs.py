"""Work in a process of its own: bounded in memory and time, watched, stopped with what is finished, or ended."""

from __future__ import annotations

import _thread
import contextlib
import multiprocessing
import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from typing import Any

from mgdd.errors import Error, Interrupted

MOST_MB = 4096  # of one piece of work, beside what is shared with the others
READ_S = 60.0  # that reading a file may take
_NICE = 5  # the page comes first
_MOST_TOLD = 1000  # reports that are taken in one look
_STOP = "stop"
_OUR_ERRORS = (Error, OSError, ImportError, ValueError, TypeError, ArithmeticError, LookupError)


def prepare() -> None:
    """Start the process from which all work is forked: it imports what work needs once."""
    multiprocessing.set_forkserver_preload(["mgdd.workbench.warm"])
    forkserver.ensure_running()


class Job:
    """A script that runs in a process of its own; it ends with this process.

    Parameters
    ----------
    function : callable
        Of a module: takes `watch`, which it may call with anything that can be pickled, then `given`.
    given : tuple
        What it is called with.
    seconds : float
        It is ended after so long.
    """

    def __init__(self, function: Callable[..., Any], given: tuple[Any, ...], *, seconds: float = float("inf")) -> None:
        context = multiprocessing.get_context("forkserver")
        self._here, there = context.Pipe()
        self._process = context.Process(target=_work, args=(there, function, given), daemon=True)
        self._process.start()
        there.close()
        self._until, self._seconds = time.monotonic() + seconds, seconds
        self.result: Any = None
        self.interrupted = False
        self.error = ""
        self.over = False

    def look(self) -> list[Any]:
        """Give what it has reported since the last look; with its end `over`, and `result` or `error`."""
        told: list[Any] = []
        while not self.over and len(told) < _MOST_TOLD and self._here.poll():
            try:
                kind, value = self._here.recv()
            except (EOFError, OSError):
                self._end(self._death())
            else:
                if kind == "told":
                    told.append(value)
                else:
                    self.result, self.interrupted = (None, False) if kind == "error" else value
                    self._end(value if kind == "error" else "")
        if not self.over and time.monotonic() > self._until:
            self._end(f"it took more than {self._seconds:g} s and was ended: cut the file, or use the command line")
        return told

    def stop(self) -> None:
        """Ask it to end with what is finished."""
        with contextlib.suppress(OSError):
            self._here.send(_STOP)

    def end(self, why: str = "cancelled") -> None:
        """End it at once, and with it what it has not reported."""
        if not self.over:
            self._end(why)

    def _end(self, error: str) -> None:
        self.error, self.over = error, True
        self._here.close()
        if error:
            self._process.kill()

    def _death(self) -> str:
        self._process.join(1.0)
        code = self._process.exitcode
        how = f"ended with code {code}" if code is None or code >= 0 else f"was ended by {signal.Signals(-code).name}"
        return f"its process {how}: the file is damaged, or needs more than {MOST_MB} MB of memory"


def _work(there: Connection, function: Callable[..., Any], given: tuple[Any, ...]) -> None:
    """Run in the child: what is sent is an answer, an error as a sentence, or what the work reports."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.nice(_NICE)
    most = MOST_MB << 20
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    threading.Thread(target=_listen, args=(there,), daemon=True).start()
    answer: tuple[str, Any]
    try:
        answer = "result", (function(lambda value: there.send(("told", value)), *given), False)
    except Interrupted as stop:
        part = stop.partial
        answer = ("error", "stopped before anything was finished") if part is None else ("result", (part, True))
    except KeyboardInterrupt:
        answer = "error", "stopped before anything was finished"
    except MemoryError:
        answer = "error", f"needs more than {MOST_MB} MB of memory: cut the file, or use the command line"
    except _OUR_ERRORS as error:
        kind = "" if isinstance(error, Error | ImportError) else f"{type(error).__name__}: "
        answer = "error", f"{kind}{error}"
    with contextlib.suppress(OSError):  # nobody is there any more
        there.send(answer)
    os._exit(0)


def _listen(there: Connection) -> None:
    """Stop as Ctrl-C does; end where the page has ended."""
    try:
        while there.recv() == _STOP:
            _thread.interrupt_main()
    except (EOFError, OSError):
        os._exit(1)
