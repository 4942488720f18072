"""Processes of a virtual bench, and Ctrl-C and SIGTERM as exceptions, so that a rig is always left by its exit."""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

from mgdd.errors import RigError

_START_S = 60.0
_END_S = 5.0


class Child:
    """A module of Python in a process of its own, which says a line when it is ready; it ends with this process.

    RigError, with its error output, where it ends before that.
    """

    def __init__(self, module: str, *words: str) -> None:
        errors = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115 stop() closes it
        process = subprocess.Popen(
            [sys.executable, "-m", module, *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            start_new_session=True,  # a Ctrl-C in the terminal is for the run, which then ends them
        )
        self.process, self._errors = process, errors
        assert process.stdout is not None  # noqa: S101 - PIPE
        until = time.monotonic() + _START_S
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            line = process.stdout.readline() if selector.select(until - time.monotonic()) else ""
        if not line:
            process.kill()
            process.wait()
            errors.seek(0)
            text = errors.read().strip()
            self.stop()
            raise RigError(f"{' '.join((module, *words[:2]))} did not start: {text or 'no error output'}")
        self.line = line.strip()

    def stop(self) -> None:
        """End it; twice does nothing."""
        self.process.terminate()
        try:
            self.process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        self._errors.close()


class VirtualNode:
    """A virtual throttle or engine bench in a process of its own, behind a hub in another.

    In a ``with`` block; both processes end with it, and with this process.

    Parameters
    ----------
    signal_map : str or path-like
        A mapping file or the name of a shipped one.
    step : bool
        No clock: one sample per command.
    seed : int
        Of the plant.
    truth : path-like, optional
        CSV file with a line per sample: what really happened.
    faults : sequence of str
        Of the plant, as ``mgdd rig node --fault`` takes them.
    bus_faults : sequence of str
        Of the hub, as ``mgdd rig hub --fault`` takes them.
    sample_ms : float, optional
        Time in a throttle between two samples [ms]; the cycle of the map if left out.
    experiment : path-like, optional
        Experiment file whose plant and seed it has; a preset throttle or engine if left out.

    Examples
    --------
    >>> from mgdd.rig import CanRig, VirtualNode
    >>> with VirtualNode("etb", step=True) as node, CanRig("etb", node.bus, mode="hil", timeout_s=5.0) as rig:
    ...     for _ in range(40):
    ...         rig.apply({"duty": 0.3})
    ...         measured = rig.measure()
    >>> measured.values["sensed_angle_deg"] > 30.0
    True
    """

    def __init__(
        self,
        signal_map: str | os.PathLike[str],
        *,
        step: bool = False,
        seed: int = 0,
        truth: str | os.PathLike[str] | None = None,
        faults: Sequence[str] = (),
        bus_faults: Sequence[str] = (),
        sample_ms: float | None = None,
        experiment: str | os.PathLike[str] | None = None,
    ) -> None:
        self._hub_options = [word for fault in bus_faults for word in ("--fault", fault)]
        self._node_options = ["--map", str(signal_map), "--seed", str(seed)]
        self._node_options += ["--step"] if step else []
        self._node_options += [word for fault in faults for word in ("--fault", fault)]
        for name, value in (("--truth", truth), ("--sample-ms", sample_ms), ("--experiment", experiment)):
            self._node_options += [name, str(value)] if value is not None else []
        self._started: list[Child] = []
        self._bus = ""

    @property
    def bus(self) -> str:
        """Its bus, as `mgdd.rig.CanRig` takes it; RigError where it does not run."""
        if not self._bus:
            raise RigError("the virtual node does not run: use it in a with block")
        return self._bus

    def start(self) -> None:
        """Start both processes, and wait until they are ready; RigError, with its error output, where one ended."""
        try:
            bus = self._start("hub", ["--port", "0", *self._hub_options])
            self._start("node", ["--bus", bus, *self._node_options])
        except BaseException:
            self.stop()
            raise
        self._bus = bus

    def stop(self) -> None:
        """End both; twice does nothing."""
        self._bus = ""
        while self._started:
            self._started.pop().stop()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _start(self, command: str, options: Sequence[str]) -> str:
        """Start a command and give the line that it says when it is ready."""
        self._started.append(Child("mgdd", "rig", command, *options, "--quiet"))
        return self._started[-1].line


_CAUGHT = (signal.SIGINT, signal.SIGTERM)


class SignalsAsExceptions:
    """Handlers of SIGINT and SIGTERM for a while: a shell that starts a job in the background has it ignore the first.

    In a thread other than the main one nothing is installed: Python runs handlers in the main one only.
    """

    def __init__(self) -> None:
        self._before: dict[int, Any] = {}

    def install(self) -> None:
        """Raise KeyboardInterrupt at SIGINT and SystemExit at SIGTERM."""
        if threading.current_thread() is not threading.main_thread() or self._before:
            return
        self._before = _install({signal.SIGINT: signal.default_int_handler, signal.SIGTERM: _leave})

    def restore(self) -> None:
        """Put back what was there."""
        before, self._before = self._before, {}
        _restore(before)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold back both signals for some milliseconds: the last frames go out whole."""
    signal.pthread_sigmask(signal.SIG_BLOCK, _CAUGHT)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _CAUGHT)


@contextmanager
def noted_signals() -> Iterator[list[int]]:
    """Note both signals in a list, for a loop that looks whether it goes on."""
    noted: list[int] = []
    before = _install(dict.fromkeys(_CAUGHT, lambda got, _: noted.append(got)))
    try:
        yield noted
    finally:
        _restore(before)


@contextmanager
def held_back() -> Iterator[None]:
    """Hold both signals back until the block is over, also those that another thread of the process takes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with noted_signals() as noted:
        yield
    for number in noted:
        signal.raise_signal(number)


def _install(handlers: Mapping[signal.Signals, Any]) -> dict[int, Any]:
    """Install handlers and give those that were there."""
    before = {int(number): signal.getsignal(number) for number in handlers}
    for number, handler in handlers.items():
        signal.signal(number, handler)
    return before


def _restore(before: Mapping[int, Any]) -> None:
    for number, handler in before.items():
        if handler is not None:  # one that was not installed from Python cannot be put back
            signal.signal(number, handler)


def _leave(number: int, _: FrameType | None) -> None:
    raise SystemExit(128 + number)
