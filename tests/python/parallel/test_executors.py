"""Whatever executor runs the parts: the same bits, and what is left when it is stopped."""

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import parallel_work as work
from mgdd.engine import OperatingPoint
from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.loop import LoopCriteria, VirtualEngine, monte_carlo, run_seeker, tune_controller
from mgdd.loop.tune import tracking_cost
from mgdd.optimize import ExtremumSeeking, GradientDescent, Limit, Spsa
from mgdd.parallel import map_items
from mgdd.parallel.chunks import Plan
from mgdd.parallel.pool import cores, processes
from mgdd.results.labels import check_labels
from mgdd.throttle import Throttle

SPACE = {"start": -12.0, "bounds": (-30.0, 10.0)}


def loops(**how: Any) -> xr.Dataset:
    """Two operating points, three kinds of seeker of which one has moved, 7 seeds: nothing is square."""
    caps = [Limit("p_max_bar", 95.0), Limit("dp_max_bar_per_cad", 6.0)]
    limits = [cap.name for cap in caps]
    benches = [VirtualEngine(limits=limits), VirtualEngine(point=OperatingPoint(fuel_mg=30.0), limits=limits)]
    benches[0].run(np.full(5, -6.0))
    moved = ExtremumSeeking(**SPACE, gain=0.7, limits=caps)
    for k in range(30):
        moved.ask()
        moved.tell(45.0 - 0.1 * k, limits=[80.0, 4.0])
    seekers = [moved, GradientDescent(**SPACE, limits=caps), Spsa(**SPACE, seed=3, limits=caps)]
    goals = [
        LoopCriteria(optimum=-5.6, exceed_above={"p_max_bar": 90.0}),
        LoopCriteria(optimum=-8.5, limits={"p_max_bar": 120.0}),
    ]
    return monte_carlo(benches, seekers, [3, 1, 4, 15, 9, 2**63, 6], cycles=260, criteria=goals, **how)


_KEPT: list[xr.Dataset] = []


def plain() -> xr.Dataset:
    """Return the result without an executor, computed once in this process."""
    if not _KEPT:
        _KEPT.append(loops())
    return _KEPT[0]


def fixed_chunks(monkeypatch: Any, size: int) -> None:
    """Let every chunk have so many items."""
    monkeypatch.setattr(Plan, "_size", lambda plan: min(size, plan._n - plan._next))


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


pytestmark = pytest.mark.slow


def test_a_lost_worker_hands_over_what_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    fixed_chunks(monkeypatch, 4)
    with pytest.raises(WorkerLostError) as lost:
        loops(executor=work.Dropping("cancelled", after=7), workers=2)
    part = lost.value.partial
    done = part["finished"].to_numpy()
    assert 0 < done.sum() < done.size
    assert f"{done.sum()} of {done.size} are finished" in str(lost.value)
    assert part.sizes == plain().sizes
    np.testing.assert_array_equal(part["mean_soc_cad"].to_numpy()[done], plain()["mean_soc_cad"].to_numpy()[done])
    assert np.isnan(part["mean_soc_cad"].to_numpy()[~done]).all()
    check_labels(part)


@pytest.mark.parametrize(
    ("name", "executor"),
    [
        ("monte_carlo", "None"),
        ("monte_carlo", "ThreadPoolExecutor"),
        ("monte_carlo", "processes(2)"),
        ("track_many", "None"),
    ],
)
def test_ctrl_c_carries_what_is_done(name: str, executor: str, root: Path) -> None:
    program = f"""
        import multiprocessing, os, signal, sys, threading
        from concurrent.futures import ThreadPoolExecutor
        import numpy as np
        from mgdd.control import Pid
        from mgdd.errors import Interrupted
        from mgdd.loop import VirtualEngine, monte_carlo, track_many
        from mgdd.optimize import ExtremumSeeking
        from mgdd.parallel.pool import processes
        from mgdd.throttle import Throttle

        def loops(**how):
            seeker = ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0))
            return monte_carlo(VirtualEngine(), seeker, range(20_000), cycles=1000, **how), "mean_soc_cad"

        def tracks(**how):
            return track_many({{"pid": Pid()}}, ["step:40:42", "step:4:20"], [Throttle()] * 20_000, **how), "mse_deg2"

        def stop(*counts):
            if not counts or counts[0] > 3:
                os.kill(os.getpid(), signal.SIGINT)

        if __name__ == "__main__":
            executor = {executor}
            how = {{"executor": executor, "progress": stop}} if executor else {{}}
            if not executor:
                threading.Timer(float(sys.argv[1]), stop).start()
            call, figure = {{"monte_carlo": (loops, "mean_soc_cad"), "track_many": (tracks, "mse_deg2")}}[{name!r}]
            try:
                call(**how)
            except Interrupted as stopped:
                table = stopped.partial
                done = table["finished"].to_numpy()
                if not executor and not done.any():
                    raise KeyboardInterrupt from None  # too early
                assert 0 < done.sum() < done.size, done.sum()
                assert (np.isfinite(table[figure].to_numpy()) == done).all()
                assert threading.active_count() == 1, threading.enumerate()
                assert not multiprocessing.active_children()
                print("kept")
    """
    for wait_s in (0.5, 1, 2, 4, 8, 16, 32):  # on any machine one of them falls between the first run and the last
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(program), str(wait_s)], capture_output=True, text=True, timeout=120,
            check=False, cwd=root,
        )  # fmt: skip
        if not done.stderr.endswith("\nKeyboardInterrupt\n"):
            break
    assert (done.stdout, done.stderr) == ("kept\n", "")


def test_ctrl_c_while_tuning_leaves_the_best_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    costs: list[float] = []

    def cost_and_stop(runs: Any) -> float:
        costs.append(tracking_cost(runs))
        if len(costs) == 6:
            os.kill(os.getpid(), signal.SIGINT)
        return costs[-1]

    monkeypatch.setattr("mgdd.loop.tune.tracking_cost", cost_and_stop)
    with pytest.raises(Interrupted, match=r"5 of 30 sets were run") as stop:
        tune_controller("pid", Throttle(), n_throttles=3, budget=30, seed=2)
    assert (stop.value.partial.evaluations, stop.value.partial.cost) == (5, min(costs[:5]))
