"""Work for executors of several processes, which import it by name; and executors that misbehave."""

import os
import pickle
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from functools import partial
from typing import Any

from mgdd.parallel.pool import cores


def square(x: float) -> float:
    return x * x


def slow_square(x: float) -> float:
    time.sleep(0.02)
    return x * x


def root(x: float) -> float:
    if x < 0.0:
        raise ValueError(f"{x} is negative")
    return x**0.5


def process(_: object) -> int:
    time.sleep(0.01)
    return os.getpid()


def cores_inside(_: object) -> int:
    return cores()


def deadly(x: float) -> float:
    """Take down the worker that touches item 7."""
    if x == 7.0:
        os.kill(os.getpid(), signal.SIGKILL)
    return x * x


def unpicklable_result(x: float) -> Callable[[], float]:
    return lambda: x


class OddError(Exception):
    """An error that pickle cannot rebuild."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first}, {second}")


def odd_error(x: float) -> float:
    raise OddError("one", str(x))


class LateReversed(Executor):
    """Collects calls for a while and runs them last first."""

    def __init__(self) -> None:
        self.calls: list[Callable[[], None]] = []
        self.order: list[Any] = []
        self.lock = threading.Lock()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        with self.lock:
            self.calls.append(partial(self.run, future, partial(fn, *args, **kwargs)))
            if len(self.calls) == 1:
                threading.Timer(0.02, self.flush).start()
        return future

    def run(self, future: Future[Any], call: Callable[[], Any]) -> None:
        if future.set_running_or_notify_cancel():
            self.order.append(call.args[-1][-1])  # type: ignore[attr-defined]
            future.set_result(call())

    def flush(self) -> None:
        with self.lock:
            calls, self.calls = self.calls, []
        for call in reversed(calls):
            call()


class Pickling(Executor):
    """Runs a call at once, but sends it and its result through pickle, as to another process and back."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        call, given, named = pickle.loads(pickle.dumps((fn, args, kwargs)))
        future.set_result(pickle.loads(pickle.dumps(call(*given, **named))))
        return future


class Dropping(Executor):
    """Runs some calls at once, then loses all others, by a cancelled future or by an error of its own."""

    def __init__(self, how: str, after: int = 0) -> None:
        self.how, self.after, self.count = how, after, 0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.count += 1
        if self.count <= self.after:
            future.set_result(fn(*args, **kwargs))
        elif self.how == "cancelled":
            future.cancel()
            future.set_running_or_notify_cancel()
        else:
            future.set_exception(ConnectionError("the worker is gone"))
        return future


class NoWork(Executor):
    """An executor that nothing must reach: bad input is found before."""

    def submit(self, *_: Any, **__: Any) -> Any:
        raise AssertionError("work was handed out")
