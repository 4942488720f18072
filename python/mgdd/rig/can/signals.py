"""Ctrl-C and SIGTERM as exceptions, so that a rig is always left through its exit."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any

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
