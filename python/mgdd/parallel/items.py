"""A function over a list of items on any executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from mgdd.parallel.chunks import run_chunks
from mgdd.parallel.finished import hand_over
from mgdd.parallel.pool import MakesExecutor

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
