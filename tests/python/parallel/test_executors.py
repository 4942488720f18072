"""Whatever takes an executor gives the same bits on threads, processes and Dask, in chunks of one or of many."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from typing import Any

import pytest
import xarray as xr

import parallel_work as work
from executor_calls import SPACE, fixed_chunks, loops, plain
from mgdd.errors import ParameterError
from mgdd.loop import VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.parallel import map_items
from mgdd.parallel.pool import cores, processes


@pytest.fixture(scope="module")
def pool() -> Iterator[Executor]:
    with processes(2)() as made:
        yield made


@pytest.mark.parametrize("size", [1, 4, 1000])
def test_chunks_on_threads_change_no_bit(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    fixed_chunks(monkeypatch, size)
    assert loops(executor=ThreadPoolExecutor, workers=3).identical(plain())


def test_processes_change_no_bit(pool: Executor) -> None:
    assert loops(executor=pool).identical(plain())


@pytest.mark.slow
def test_order_changes_no_bit() -> None:
    assert loops(executor=work.LateReversed(), workers=3).identical(plain())


def test_the_number_of_threads_changes_no_bit() -> None:
    assert loops(workers=1).identical(plain())
    with pytest.raises(ParameterError, match="workers = 0: must be >= 1"):
        loops(workers=0)


@pytest.mark.slow
def test_dask_changes_no_bit() -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert loops(executor=client.get_executor()).identical(plain())


def test_progress_counts_runs_and_changes_no_bit() -> None:
    seen: list[tuple[int, int]] = []
    assert loops(progress=lambda *counts: seen.append(counts)).identical(plain())
    assert seen[-1] == (42, 42)
    assert [done for done, _ in seen] == sorted({done for done, _ in seen})


# --- one thread each ----------------------------------------------------------------------------------------
def test_a_worker_computes_on_one_thread(pool: Executor) -> None:
    assert cores() == len(os.sched_getaffinity(0))
    assert set(map_items(work.cores_inside, range(9))) == {1}
    assert set(map_items(work.cores_inside, range(9), executor=pool)) == {1}
    assert cores() == len(os.sched_getaffinity(0))


# --- what is refused ----------------------------------------------------------------------------------------
def test_what_does_not_fit_is_refused_before_any_work() -> None:
    def loops_of(benches: Any, seekers: Any, seeds: Any = (1,), cycles: int = 5) -> xr.Dataset:
        return monte_carlo(benches, seekers, seeds, cycles=cycles, executor=work.NoWork())

    fits = ExtremumSeeking(**SPACE)
    capped = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", 90.0)])
    for call, message in (
        (lambda: loops_of(VirtualEngine(), [fits, 3.0]), "seeker = 3: must be a seeker, as"),
        (lambda: loops_of([VirtualEngine(limits=["p_max_bar"]), VirtualEngine()], [fits, capped]), "p_max_bar"),
        (lambda: loops_of(VirtualEngine(), fits, []), "seeds is empty"),
        (lambda: loops_of(VirtualEngine(), fits, cycles=0), "cycles = 0: must be >= 1"),
    ):
        with pytest.raises(ParameterError, match=message):
            call()


def test_reading_is_not_moving() -> None:
    """Benches and seekers stay where they are; what they did before does not travel."""
    bench, seeker = VirtualEngine(), ExtremumSeeking(**SPACE)
    run_seeker(bench, seeker, 20)
    monte_carlo(bench, seeker, range(3), cycles=10, executor=ThreadPoolExecutor)
    assert (bench.cycle, seeker.cycle, len(seeker.history["cycle"])) == (20, 20, 20)
