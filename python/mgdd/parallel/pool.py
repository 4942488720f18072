"""The executor behind a call: given, made by a given function, or threads of its own that end with the call."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import Any, Self

from mgdd.errors import ParameterError

_single: ContextVar[bool] = ContextVar("single", default=False)


class Pool:
    """An executor with the number of its workers."""

    def __init__(self, executor: MakesExecutor | Any, workers: int | None) -> None:
        self._wanted = _checked(workers)
        self._make: Callable[[], Executor] | None = None
        if executor is None:
            self._make = self._threads
        elif isinstance(executor, type) or not hasattr(executor, "submit"):
            if not callable(executor):
                bound = "a concurrent.futures.Executor, or a function that makes one"
                raise ParameterError.of("executor", executor, bound)
            self._make = executor
        self._executor: Any = executor if self._make is None else self._make()
        if not hasattr(self._executor, "submit"):
            raise ParameterError.of("executor", executor, "a function that makes a concurrent.futures.Executor")
        self.workers: int = workers or _workers_of(self._executor) or cores()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Hand a call to the executor."""
        future: Future[Any] = self._executor.submit(function, *arguments)
        return future

    def close(self) -> None:
        """End an executor that was made here; nothing runs on behind it. A given one stays open."""
        if self._make is not None:
            self._executor.shutdown(wait=True)

    def _threads(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(self._wanted or cores(), thread_name_prefix="mgdd")


# What every ``executor=`` takes, beside None; a Pool serves several calls and is closed by whoever made it.
MakesExecutor = Executor | Callable[[], Executor] | Pool


def processes(workers: int) -> Callable[[], Executor]:
    """Give a function that makes a pool of fresh processes; Ctrl-C in the terminal ends them, and without a word."""
    context = multiprocessing.get_context("spawn")
    end = (signal.SIGINT, signal.SIG_DFL)
    return partial(ProcessPoolExecutor, _checked(workers), mp_context=context, initializer=signal.signal, initargs=end)


def threads_of(workers: int | None) -> int:
    """Give the number of threads of one call of the core: as many as wanted, or one per core."""
    return _checked(workers) or cores()


def cores() -> int:
    """Count the cores that a call may use: those of this process, one inside a worker."""
    return 1 if _single.get() else len(os.sched_getaffinity(0))


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let calls within take one core by default: the other workers have the others."""
    token = _single.set(True)
    try:
        yield
    finally:
        _single.reset(token)


def _checked(workers: int | None) -> int | None:
    ParameterError.unless(workers is None or workers >= 1, "workers", workers, ">= 1")
    return workers


def _workers_of(executor: Any) -> int | None:
    """Ask an executor for its workers: pools of Python and mpi4py, and the client behind one of Dask."""
    client: Any = getattr(executor, "_client", None)
    if hasattr(client, "nthreads"):
        return sum(client.nthreads().values()) or None
    for name in ("num_workers", "_max_workers"):
        count = getattr(executor, name, None)
        if isinstance(count, int) and count >= 1:
            return count
    return None
