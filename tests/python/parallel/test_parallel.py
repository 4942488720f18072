"""The one mechanism of executors: order, lost workers, errors, Ctrl-C, and what cannot be pickled."""

import multiprocessing
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import parallel_work as work
from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.parallel import map_items
from mgdd.parallel.chunks import Plan, run_chunks

NUMBERS = [float(n) for n in range(40)]
SQUARES = [n * n for n in NUMBERS]


def processes(workers: int = 2) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with processes() as made:
        yield made


@pytest.mark.parametrize("executor", [None, ThreadPoolExecutor, work.LateReversed(), work.LateReversed])
@pytest.mark.parametrize("workers", [None, 1, 5])
def test_results_stand_in_the_order_of_the_items(executor: Any, workers: int | None) -> None:
    assert map_items(work.square, NUMBERS, executor=executor, workers=workers) == SQUARES


def test_processes_do_the_work(pool: ProcessPoolExecutor) -> None:
    assert map_items(work.square, NUMBERS, executor=pool) == SQUARES
    assert len(set(map_items(work.process, range(60), executor=pool)) - {multiprocessing.current_process().pid}) == 2
    assert map_items(work.square, [3.0], executor=pool) == [9.0]  # it was left open


def test_nothing_to_do() -> None:
    assert map_items(work.square, []) == []


def test_late_and_reversed_work_is_put_in_order() -> None:
    executor, seen = work.LateReversed(), list[tuple[int, int]]()
    assert map_items(work.square, NUMBERS, executor=executor, workers=4, progress=lambda *n: seen.append(n)) == SQUARES
    begun = [items[0] for items in executor.order]
    assert begun != sorted(begun)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert seen[-1] == (40, 40)


# --- lost workers -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("how", ["cancelled", "error"])
def test_a_lost_worker_keeps_what_is_done(how: str) -> None:
    for after in (0, 5):
        with pytest.raises(WorkerLostError, match=r"a worker was lost with items? .* of 40 \(.*: take fewer") as lost:
            map_items(work.square, NUMBERS, executor=work.Dropping(how, after), workers=1)
        done = lost.value.partial
        assert list(done) == list(range(len(done)))
        assert list(done.values()) == SQUARES[: len(done)]
        assert (len(done) > 0) == (after > 0)
        assert (f"{len(done)} of 40 are finished" if after else "nothing was finished") in str(lost.value)
    assert isinstance(lost.value, RuntimeError)


def test_a_killed_process_is_a_lost_worker() -> None:
    with pytest.raises(WorkerLostError, match=r"a worker was lost with items? .* of 40 \(BrokenProcessPool: ") as lost:
        map_items(work.deadly, NUMBERS, executor=lambda: processes(1))
    done = lost.value.partial
    assert done == {n: float(n * n) for n in done}
    assert 7 not in done


# --- errors -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", ["threads", "reversed", "processes"])
def test_the_error_of_the_lowest_item_comes_back_as_it_is(kind: str, pool: ProcessPoolExecutor) -> None:
    executor = {"threads": None, "reversed": work.LateReversed(), "processes": pool}[kind]
    items = [4.0] * 5 + [-1.0, 4.0, -2.0] + [-3.0] * 20
    with pytest.raises(ValueError, match=r"^-1\.0 is negative") as raised:
        map_items(work.root, items, executor=executor, workers=8)
    if kind == "processes":
        assert any("parallel_work.py" in note for note in raised.value.__notes__)
    assert map_items(work.root, [4.0], executor=executor) == [2.0]


def test_an_error_that_cannot_be_pickled_is_told_all_the_same(pool: ProcessPoolExecutor) -> None:
    with pytest.raises(RuntimeError, match=r"OddError: one, 1\.0"):
        map_items(work.odd_error, [1.0], executor=pool)
    with pytest.raises(work.OddError):
        map_items(work.odd_error, [1.0])


def test_what_cannot_be_pickled_is_named(pool: ProcessPoolExecutor) -> None:
    for function, items, what in (
        (lambda x: x, NUMBERS, "lambda"),
        (work.process, [threading.Lock()], "lock"),
        (work.unpicklable_result, [1.0], "lambda"),
    ):
        with pytest.raises(ParameterError, match=rf"what it returns cannot be pickled.*{what}.*top level of a module"):
            map_items(function, items, executor=pool)
    assert map_items(work.square, NUMBERS, executor=pool) == SQUARES


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"workers": 0}, "workers = 0: must be >= 1"),
        ({"executor": 3}, r"executor = 3: must be a concurrent\.futures\.Executor, or a function that makes one"),
        ({"executor": lambda: 3}, "must be a function that makes"),
    ],
)
def test_bad_executors(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        map_items(work.square, NUMBERS, **options)


def test_an_error_of_progress_ends_the_work() -> None:
    def progress(done: int, _: int) -> None:
        raise LookupError(f"after {done}")

    before = threading.active_count()
    with pytest.raises(LookupError, match="after 1"):
        map_items(work.square, NUMBERS, progress=progress, workers=1)
    assert threading.active_count() == before


# --- chunks -------------------------------------------------------------------------------------------------
@given(
    n=st.integers(0, 400),
    workers=st.integers(1, 7),
    costs=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=10),
    largest=st.integers(1, 90),
)
def test_chunks_cover_everything_once_in_order(n: int, workers: int, costs: list[float], largest: int) -> None:
    plan, at = Plan(n, workers, largest=largest), 0
    while chunk := plan.next():
        assert chunk.start == at < chunk.stop <= n
        assert chunk.size <= largest
        plan.measured(chunk, costs[at % len(costs)])
        at = chunk.stop
    assert at == n


def test_chunks_follow_the_cost() -> None:
    cheap = Plan(10**6, 2)
    sizes = []
    for _ in range(8):
        chunk = cheap.next()
        assert chunk
        sizes.append(chunk.size)
        cheap.measured(chunk, 1e-6 * chunk.size)
    assert sizes == [1, 8, 64, 512, 4096, 32768, 240638, 180479]


def test_parts_are_kept_where_they_belong() -> None:
    kept: dict[int, int] = {}
    stop = run_chunks(
        lambda a, b: list(range(a, b)),
        lambda a, b: (a, b),
        lambda a, b, part: kept.update(zip(range(a, b), part, strict=True)),
        1000,
        workers=3,
        largest=17,
    )
    assert stop is None
    assert kept == {n: n for n in range(1000)}


# --- Ctrl-C -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("executor", ["None", "processes"])
def test_ctrl_c_keeps_what_is_done_and_leaves_nothing_running(executor: str, root: Path) -> None:
    program = f"""
        import multiprocessing, os, signal, threading
        from concurrent.futures import ProcessPoolExecutor
        import parallel_work as work
        from mgdd.errors import Interrupted
        from mgdd.parallel import map_items

        def processes():
            return ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))

        def progress(done, n):
            if done >= 10:
                os.kill(os.getpid(), signal.SIGINT)

        if __name__ == "__main__":
            try:
                map_items(work.slow_square, [float(x) for x in range(2000)], executor={executor}, progress=progress)
            except Interrupted as stop:
                assert 10 <= len(stop.partial) < 200, len(stop.partial)
                assert stop.partial == {{n: float(n * n) for n in stop.partial}}
                assert f"{{len(stop.partial)}} of 2000 are finished" in str(stop)
                assert threading.active_count() == 1, threading.enumerate()
                assert not multiprocessing.active_children()
                print("kept")
    """
    support = str(root / "tests" / "python" / "support")
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.append({support!r})\n{textwrap.dedent(program)}"],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.stdout == "kept\n", done.stderr
    assert "Traceback" not in done.stderr


def test_ctrl_c_in_this_process_is_handed_over() -> None:
    def work_on(x: float) -> float:
        if x == 6.0:
            raise KeyboardInterrupt
        return x

    class Direct(Executor):
        """Runs in the calling thread, as a worker whose own Ctrl-C comes back as its result."""

        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
            from concurrent.futures import Future

            future: Future[Any] = Future()
            try:
                future.set_result(fn(*args, **kwargs))
            except BaseException as error:  # noqa: BLE001
                future.set_exception(error)
            return future

    with pytest.raises(Interrupted) as stopped:
        map_items(work_on, NUMBERS, executor=Direct(), workers=1)
    assert 6 not in stopped.value.partial
    assert stopped.value.partial[0] == 0.0
