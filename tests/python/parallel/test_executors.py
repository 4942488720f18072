"""Whatever takes an executor gives the same bits on threads, processes and Dask, in chunks of one or of many."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from typing import Any

import pytest
import xarray as xr

import parallel_work as work
from executor_calls import CALLS, SPACE, fixed_chunks, plain, same, tuning
from mgdd.control import Pid
from mgdd.errors import ParameterError
from mgdd.loop import Reference, VirtualEngine, monte_carlo, run_seeker, track_many
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.parallel import map_items
from mgdd.parallel.pool import cores, processes
from mgdd.throttle import Throttle


@pytest.fixture(scope="module")
def pool() -> Iterator[Executor]:
    with processes(2)() as made:
        yield made


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("size", [1, 4, 1000])
def test_chunks_on_threads_change_no_bit(name: str, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    fixed_chunks(monkeypatch, size)
    assert same(CALLS[name](executor=ThreadPoolExecutor, workers=3), plain(name))


@pytest.mark.parametrize("name", CALLS)
def test_processes_change_no_bit(name: str, pool: Executor) -> None:
    assert same(CALLS[name](executor=pool), plain(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_order_changes_no_bit(name: str) -> None:
    assert same(CALLS[name](executor=work.LateReversed(), workers=3), plain(name))


@pytest.mark.parametrize("name", CALLS)
def test_the_number_of_threads_changes_no_bit(name: str) -> None:
    assert same(CALLS[name](workers=1), plain(name))
    with pytest.raises(ParameterError, match="workers = 0: must be >= 1"):
        CALLS[name](workers=0)


@pytest.mark.slow
def test_dask_changes_no_bit() -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        for name in ("monte_carlo", "track_many"):
            assert same(CALLS[name](executor=client.get_executor()), plain(name))


@pytest.mark.parametrize(("name", "n"), [("monte_carlo", 42), ("track_many", 165)])
def test_progress_counts_runs_and_changes_no_bit(name: str, n: int) -> None:
    seen: list[tuple[int, int]] = []
    assert same(CALLS[name](progress=lambda *counts: seen.append(counts)), plain(name))
    assert seen[-1] == (n, n)
    assert [done for done, _ in seen] == sorted({done for done, _ in seen})


# --- one thread each ----------------------------------------------------------------------------------------
def test_a_worker_computes_on_one_thread(pool: Executor) -> None:
    assert cores() == len(os.sched_getaffinity(0))
    assert set(map_items(work.cores_inside, range(9))) == {1}
    assert set(map_items(work.cores_inside, range(9), executor=pool)) == {1}
    assert cores() == len(os.sched_getaffinity(0))


def test_a_pool_made_for_a_tuning_is_made_once() -> None:
    made: list[Executor] = []

    def make() -> Executor:
        made.append(ThreadPoolExecutor(2))
        return made[-1]

    tuning(executor=make)
    assert len(made) == 1
    with pytest.raises(RuntimeError, match="after shutdown"):
        made[0].submit(print)


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
    steps = [Reference.step(a, 2, hold_s=0.1) for a in (40, 1)]
    with pytest.raises(Exception, match="airflow_torque_nm"):
        track_many(
            {"pid": Pid()}, steps, [Throttle()] * 3, airflow_torque_nm={steps[1].name: [0.1]}, executor=work.NoWork()
        )


def test_reading_is_not_moving() -> None:
    """Benches and seekers stay where they are; what they did before does not travel."""
    bench, seeker = VirtualEngine(), ExtremumSeeking(**SPACE)
    run_seeker(bench, seeker, 20)
    monte_carlo(bench, seeker, range(3), cycles=10, executor=ThreadPoolExecutor)
    assert (bench.cycle, seeker.cycle, len(seeker.history["cycle"])) == (20, 20, 20)
