"""Work that answers, fails, hangs, eats memory or dies, for the processes of the workbench."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

from mgdd.errors import DataError, Interrupted

Watch = Callable[[object], object]


def answers(watch: Watch, value: int) -> int:
    for step in range(value):
        watch(step)
    return value * value


def refuses(_: Watch) -> None:
    raise DataError("a.csv: holds no numbers: give another file")


def fails(_: Watch) -> None:
    raise KeyError("column 7")


def sleeps(watch: Watch, seconds: float) -> None:
    watch(os.getpid())
    time.sleep(seconds)


def goes_on(watch: Watch) -> None:
    try:
        for step in range(10_000):
            watch(step)
            time.sleep(0.01)
    except KeyboardInterrupt:
        raise Interrupted("stopped", "what was finished") from None


def eats(_: Watch) -> int:
    return len(bytearray(6 << 30))


def dies(_: Watch) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def gives_what_cannot_be_sent(_: Watch) -> object:
    return lambda: None
