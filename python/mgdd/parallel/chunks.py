"""The one mechanism: items of work in chunks on an executor, each result at its place, nothing left running."""

from __future__ import annotations

import math
import os
import pickle
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.parallel.finished import hand_over
from mgdd.parallel.pool import MakesExecutor, Pool, single_threaded


def pieces(start: int, stop: int, width: int) -> Iterator[tuple[int, int, int]]:
    """Cut a range of cells, counted row by row, where a row ends."""
    while start < stop:
        row, first = divmod(start, width)
        last = min(width, first + stop - start)
        yield row, first, last
        start += last - first


_WANTED_S = 0.25  # of a chunk: far above the cost of handing it over, short enough for progress and Ctrl-C
_GROWTH = 8  # a chunk may be that much larger than the largest one measured


@dataclass(frozen=True)
class Chunk:
    """Items ``start`` to ``stop`` (exclusive) of the work."""

    start: int
    stop: int

    @property
    def size(self) -> int:
        """Number of items."""
        return self.stop - self.start

    def __str__(self) -> str:
        return f"item {self.start}" if self.size == 1 else f"items {self.start} to {self.stop - 1}"


class Plan:
    """Cuts ``n_items`` into chunks, in order; the cost of an item is measured while the work goes on."""

    def __init__(self, n_items: int, workers: int, *, largest: int | None = None) -> None:
        self._n, self._workers = n_items, workers
        self._largest = n_items if largest is None else largest
        self._cost_s, self._measured, self._next = 0.0, 0, 0

    @property
    def n_at_once(self) -> int:
        """Chunks that may be out at a time: one more per worker, so that none waits for the next."""
        return 2 * self._workers if self._measured else self._workers

    def next(self) -> Chunk | None:
        """Return the next chunk, None when everything was handed out."""
        if self._next == self._n:
            return None
        start, self._next = self._next, self._next + self._size()
        return Chunk(start, self._next)

    def measured(self, chunk: Chunk, seconds: float) -> None:
        """Learn what the items of a finished chunk have cost."""
        now = seconds / chunk.size
        self._cost_s = 0.5 * (self._cost_s + now) if self._measured else now
        self._measured = max(self._measured, chunk.size)

    def _size(self) -> int:
        if not self._measured:
            return 1
        left = self._n - self._next
        by_time = math.floor(_WANTED_S / self._cost_s) if self._cost_s > 0.0 else left
        fair = math.ceil(left / (2 * self._workers))  # the last chunks get small: the workers end together
        return max(1, min(by_time, fair, self._largest, _GROWTH * self._measured))


Part = TypeVar("Part")


class _Answer(NamedTuple):
    """What came back of a chunk. An error of the work is a value here, so any other exception is the executor's."""

    seconds: float
    part: Any = None
    error: Exception | None = None


def run_chunks(
    function: Callable[..., Part],
    cut: Callable[[int, int], tuple[Any, ...]],
    keep: Callable[[int, int, Part], None],
    n_items: int,
    *,
    executor: MakesExecutor | None = None,
    workers: int | None = None,
    largest: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Interrupted | WorkerLostError | None:
    """Run ``function(*cut(start, stop))`` for chunks that cover all items, and hand each result to `keep`.

    Chunks begin in order and end in any; what is kept must not depend on how the items were cut. `cut` and `keep`
    are called here, one at a time; only `function` and what `cut` returns go to the workers.
    """
    with nullcontext(executor) if isinstance(executor, Pool) else Pool(executor, workers) as pool:
        return _Run(function, cut, keep, n_items, pool, largest, progress).go()


class _Run:
    def __init__(
        self,
        function: Callable[..., Any],
        cut: Callable[[int, int], tuple[Any, ...]],
        keep: Callable[[int, int, Any], None],
        n_items: int,
        pool: Pool,
        largest: int | None,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        self._function, self._cut, self._keep, self._pool = function, cut, keep, pool
        self._n, self._done, self._progress = n_items, 0, progress
        self._plan = Plan(n_items, pool.workers, largest=largest)
        self._out: dict[Future[_Answer], Chunk] = {}
        self._failed: tuple[Chunk, Exception] | None = None

    def go(self) -> Interrupted | WorkerLostError | None:
        """Work to the end, to an error, to Ctrl-C, or to a lost worker."""
        try:
            while self._submit():
                done = wait(self._out, return_when=FIRST_COMPLETED).done
                for future in sorted(done, key=self._start_of):
                    self._take(future)
                if self._progress is not None:
                    self._progress(self._done, self._n)
        except KeyboardInterrupt:
            self._settle()
            return Interrupted(f"interrupted: {self._finished()}")
        except WorkerLostError as lost:
            self._settle()
            lost.args = (f"{lost}; {self._finished()}",)
            return lost
        except BaseException:
            self._settle(keep=False)
            raise
        if self._failed is not None:
            raise self._failed[1]
        return None

    def _submit(self) -> bool:
        """Hand out chunks; False when nothing is out and nothing is left."""
        while self._failed is None and len(self._out) < self._plan.n_at_once and (chunk := self._plan.next()):
            arguments = self._cut(chunk.start, chunk.stop)
            try:
                self._out[self._pool.submit(_answer, os.getpid(), self._function, arguments)] = chunk
            except BrokenExecutor as error:
                raise self._lost(chunk, error) from error
        return bool(self._out)

    def _start_of(self, future: Future[_Answer]) -> int:
        return self._out[future].start

    def _take(self, future: Future[_Answer]) -> None:
        chunk = self._out.pop(future, None)
        if chunk is None:  # cancelled behind one that failed
            return
        try:
            answer = future.result()
        except Exception as error:
            if isinstance(error, pickle.PicklingError | TypeError | AttributeError):
                raise ParameterError(
                    f"{chunk}: the work or what it returns cannot be pickled, so it cannot go from one process to "
                    f"another ({error}): define functions and classes at the top level of a module that the workers "
                    "can import, and return plain data; or use threads"
                ) from error
            raise self._lost(chunk, error) from error
        self._accept(chunk, answer)

    def _accept(self, chunk: Chunk, answer: _Answer) -> None:
        if answer.error is not None:
            if self._failed is None or chunk.start < self._failed[0].start:
                self._failed = chunk, answer.error
            for future, other in list(self._out.items()):  # lower ones may still fail, and then theirs is the error
                if other.start > self._failed[0].start and future.cancel():
                    del self._out[future]
            return
        self._keep(chunk.start, chunk.stop, answer.part)
        self._done += chunk.size
        self._plan.measured(chunk, answer.seconds)

    def _lost(self, chunk: Chunk, error: BaseException) -> WorkerLostError:
        cause = f"{type(error).__name__}: {error}".removesuffix(": ")
        return WorkerLostError(
            f"a worker was lost with {chunk} of {self._n} ({cause}): this work may kill its worker, for example by its "
            "memory: take fewer workers, and run the rest again"
        )

    def _finished(self) -> str:
        if not self._done:
            return "nothing was finished"
        return f"{self._done} of {self._n} are finished, they are in .partial"

    def _settle(self, *, keep: bool = True) -> None:
        """Cancel what has not begun, wait for what runs, and keep it."""
        running = {future: chunk for future, chunk in self._out.items() if not future.cancel()}
        self._out.clear()
        for future in wait(running).done:
            if keep and not future.cancelled() and future.exception() is None and future.result().error is None:
                self._accept(running[future], future.result())


def _answer(caller: int, function: Callable[..., Any], arguments: tuple[Any, ...]) -> _Answer:
    """Run in the worker, on one thread: the time it took, and the result or the error of the work."""
    begun = time.perf_counter()
    try:
        with single_threaded():
            part = function(*arguments)
    except Exception as error:  # noqa: BLE001 - it is raised where the call came from
        return _Answer(time.perf_counter() - begun, error=error if caller == os.getpid() else _portable(error))
    return _Answer(time.perf_counter() - begun, part)


def _portable(error: Exception) -> Exception:
    """Give an error a note of where in the worker it was raised, and a plain one where it cannot be pickled."""
    where = "".join(traceback.format_exception(error))
    try:
        error = pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - whatever its constructor makes of it
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(f"in a worker:\n{where}")
    return error


Item = TypeVar("Item")
Result = TypeVar("Result")


def map_items(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    *,
    executor: MakesExecutor | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Call a function with every item, on threads, processes or machines; the results stand in the order of the items.

    Items are handed out in chunks: small ones first, then as many as fit in a quarter of a second. What the function
    calls of mgdd takes one core, unless its own `workers` sets otherwise: the other workers have the rest.

    Parameters
    ----------
    function : callable
        Takes one item. For processes and machines function, items and results must be picklable.
    items : iterable
        What it is called with.
    executor : concurrent.futures.Executor or callable, optional
        Threads of this process if left out; or a pool of processes, ``client.get_executor()`` of Dask, which does the
        work of a lost worker again, ``mpi4py.futures.MPIPoolExecutor()``. What a function makes, such as
        ``lambda: ProcessPoolExecutor(4)``, is closed at the end, a given executor stays open.
    workers : int, optional
        Number of threads, or of the workers of an executor that does not state it; one per core if left out.
    progress : callable, optional
        Called with the number of finished items and that of all.

    Returns
    -------
    list
        One result per item, in order.

    Raises
    ------
    Exception
        Of the function: that of the first item that fails, with a note of where it happened in the worker.
    mgdd.errors.ParameterError
        A bad executor, or work that cannot be pickled.
    mgdd.errors.WorkerLostError
        A worker was lost, as one that is out of memory; ``partial`` has the finished results by number of item.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` has the finished results by number of item, and nothing is left running.

    Examples
    --------
    >>> from mgdd.engine import Cylinder, OperatingPoint, find_optimum
    >>> from mgdd.parallel import map_items
    >>> def best(speed_rpm):
    ...     return find_optimum(Cylinder(), OperatingPoint(speed_rpm=speed_rpm))["soc_cad"]
    >>> [round(soc, 1) for soc in map_items(best, [1000.0, 2000.0, 3000.0])]
    [-1.7, -8.4, -12.1]
    """
    given = list(items)
    results: dict[int, Result] = {}

    def keep(start: int, stop: int, part: list[Result]) -> None:
        results.update(zip(range(start, stop), part, strict=True))

    stop = run_chunks(
        _call_each,
        lambda start, stop: (function, given[start:stop]),
        keep,
        len(given),
        executor=executor,
        workers=workers,
        progress=progress,
    )
    if stop is not None:
        hand_over(results, stop)
    return [results[number] for number in range(len(given))]


def _call_each(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    return [function(item) for item in items]
