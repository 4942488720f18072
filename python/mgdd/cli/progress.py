"""What goes to the terminal: nothing that it would obey, and progress, so that no command is silent for long."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any, Self, TextIO, cast

from mgdd.errors import printable

__all__ = ["Progress", "Stopped"]  # what other packages take

_INTERVAL_S = 12.0


class Stopped(KeyboardInterrupt):
    """Ctrl-C after which something was kept; the message says what."""


class _Gate:
    """A stream of text to which nothing goes that a terminal would obey."""

    def __init__(self, stream: TextIO) -> None:
        self.trusted = stream

    def write(self, text: str) -> int:
        """Write a text with such letters written out."""
        return self.trusted.write(printable(text))

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts as `write` does."""
        for each in lines:
            self.write(each)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.trusted, name)


def trusted(stream: TextIO) -> TextIO:
    """Give the stream behind the gate, for colours and cursors of our own."""
    found: TextIO = getattr(stream, "trusted", stream)
    return found


@contextlib.contextmanager
def gated_streams() -> Iterator[None]:
    """Put a gate before stdout and stderr: results, errors, warnings, logs and usage have texts of files in them."""
    with (
        contextlib.redirect_stdout(cast("TextIO", _Gate(sys.stdout))),
        contextlib.redirect_stderr(cast("TextIO", _Gate(sys.stderr))),
    ):
        yield


def is_terminal() -> bool:
    """Whether a person reads stdout."""
    return sys.stdout.isatty()


class Progress:
    """Say what a command is doing, from its start to its end, whether it reports steps or not.

    A long step in the core shows too: a thread speaks, not the step. How many steps there will be is often known only
    at the end: `expect` says where the bar starts from. A stream that is not a terminal gets a line every `interval_s`
    seconds.
    """

    def __init__(self, *, quiet: bool, stream: TextIO | None = None, interval_s: float = _INTERVAL_S) -> None:
        self._quiet, self._stream, self._interval_s = quiet, stream, interval_s
        self._text, self._done, self._expected = "working", 0, 0
        self._begun = time.monotonic()
        self._ended = threading.Event()
        self._bar: Any = None
        self._task: Any = None
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        if self._quiet:
            return self
        out = sys.stderr if self._stream is None else self._stream
        if out.isatty():
            self._open_bar(out)
        else:
            self._thread = threading.Thread(target=self._speak, args=(out,), name="mgdd progress", daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __call__(self, text: str) -> None:
        """Begin a step."""
        self._text, self._done = text, self._done + 1
        if self._bar is not None:
            self._bar.update(self._task, description=text, completed=self._done - 1, total=self._total())

    def expect(self, steps: int) -> Self:
        """Say how many steps there may be; returns this object, to be called before each."""
        self._expected = steps
        return self

    def close(self) -> None:
        """Take the bar away, or end the lines; the result is printed next."""
        self._ended.set()
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _open_bar(self, out: TextIO) -> None:
        from rich import progress
        from rich.console import Console

        # Without redirection: what a command prints on stdout must not turn up on stderr.
        self._bar = progress.Progress(
            progress.SpinnerColumn(), progress.TextColumn("{task.description}"), progress.BarColumn(),
            progress.TimeElapsedColumn(), console=Console(file=trusted(out)), transient=True,
            redirect_stdout=False, redirect_stderr=True,
        )  # fmt: skip
        self._task = self._bar.add_task(self._text, total=None)
        self._bar.start()

    def _total(self) -> int | None:
        return max(self._expected, self._done) if self._expected else None

    def _speak(self, out: TextIO) -> None:
        while not self._ended.wait(self._interval_s):
            steps = f"step {self._done}" if self._done else ""
            steps += f" of about {self._total()}" if steps and self._expected else ""
            spent = f"{time.monotonic() - self._begun:.0f} s"
            print(f"mgdd: {self._text} ({', '.join(filter(None, (steps, spent)))})", file=out, flush=True)
