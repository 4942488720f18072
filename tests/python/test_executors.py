"""Whatever takes an executor gives the same bits on threads, processes and Dask, in chunks of one or of many."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import parallel_work as work
from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode
from mgdd.engine import OperatingPoint
from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.identify import SmoothThrottle, fit_first_principle, fit_ode
from mgdd.loop import (
    EngineBench,
    LoopCriteria,
    Reference,
    monte_carlo,
    run_seeker,
    track_many,
    tune_controller,
    tuned_controller,
)
from mgdd.loop.tune import draw_throttles
from mgdd.optimize import ExtremumSeeking, FitOptions, Limit, NewtonSeeking, Spsa
from mgdd.parallel import map_items
from mgdd.parallel.plan import Plan
from mgdd.parallel.pool import cores, processes
from mgdd.results import Fit
from mgdd.results.labels import check_labels
from mgdd.throttle import Throttle

SPACE = {"start": -12.0, "lower": -30.0, "upper": 10.0}


def loops(**how: Any) -> xr.Dataset:
    """Two operating points, four kinds of seeker of which one has moved, 7 seeds: nothing is square."""
    caps = [Limit("p_max_bar", 95.0), Limit("dp_max_bar_per_cad", 6.0)]
    limits = [cap.name for cap in caps]
    benches = [EngineBench(limits=limits), EngineBench(point=OperatingPoint(fuel_mg=30.0), limits=limits)]
    benches[0].run(np.full(5, -6.0))
    moved = ExtremumSeeking(**SPACE, gain=0.7, limits=caps)
    for k in range(30):
        moved.ask()
        moved.tell(45.0 - 0.1 * k, limits=[80.0, 4.0])
    seekers = [moved, NewtonSeeking(**SPACE, limits=caps), Spsa(**SPACE, seed=3, limits=caps)]
    goals = [
        LoopCriteria(optimum=-5.6, exceed_above={"p_max_bar": 90.0}),
        LoopCriteria(optimum=-8.5, limits={"p_max_bar": 120.0}),
    ]
    return monte_carlo(benches, seekers, [3, 1, 4, 15, 9, 2**63, 6], cycles=260, criteria=goals, **how)


def tracks(**how: Any) -> xr.Dataset:
    """Eleven throttles are a full group of lanes and a broken one; one of the controllers is of another class each."""
    throttles = [*draw_throttles(Throttle(), 10, seed=5), Throttle(friction="stribeck", stiction_nm=0.3)]
    controllers = {
        "guided": GuidedPredictive(),
        "mgdd1": Mgdd1(),
        "pid": Pid(),
        "sliding": SlidingMode(),
        "nmpc": tuned_controller("nmpc"),
    }
    steps = [Reference.step(a, b, hold_s=0.1, after_s=0.3) for a, b in ((40, 42), (4, 20))]
    return track_many(
        controllers, [*steps, "sine:30:5:2"], throttles, first_seed=10, delay_samples=2,
        airflow_torque_nm={steps[1].name: -0.05}, **how,
    )  # fmt: skip


def tuning(**how: Any) -> Any:
    return tune_controller("pid", Throttle(), n_throttles=3, budget=30, seed=2, **how)


def records() -> tuple[xr.Dataset, np.ndarray]:
    levels = 0.7 * np.random.default_rng(1).random(40) - 0.35
    time, truth = 1e-3 * np.arange(1600), np.array(list(SmoothThrottle().parameters.values()))
    log = SmoothThrottle().simulate({"time_s": time, "duty": np.repeat(levels, 40)})
    log["angle_deg"] = log["angle_deg"] + np.random.default_rng(2).normal(0.0, 0.05, time.size)
    return log, truth


def smooth(**how: Any) -> Fit:
    log, truth = records()
    starts = truth * np.exp(np.random.default_rng(3).uniform(-0.3, 0.3, (11, 10)))
    return SmoothThrottle().fit(log, start_values=starts, lower=0.1 * truth, upper=10.0 * truth, **how)


def groups(**how: Any) -> Fit:
    return fit_first_principle(records()[0], options=FitOptions(n_starts=5, max_iterations=15), **how)


def ode(**how: Any) -> Fit:
    time = np.linspace(0.0, 10.0, 101)
    y = 2.0 * (1.0 - np.exp(-time / 0.5)) + 0.01 * np.random.default_rng(0).normal(size=101)
    record = {"time_s": time, "u": np.ones(101), "y": y}
    bounds = {"gain": (0.1, 9.0), "time_s": (0.1, 9.0)}
    return fit_ode(
        work.lag, record, parameters={"gain": 1.0, "time_s": 1.0}, initial_state=[0.0], bounds=bounds,
        options=FitOptions(n_starts=5), **how,
    )  # fmt: skip


CALLS: dict[str, Callable[..., Any]] = {
    "monte_carlo": loops,
    "track_many": tracks,
    "tune_controller": tuning,
    "SmoothThrottle.fit": smooth,
    "fit_first_principle": groups,
    "fit_ode": ode,
}


def same(one: Any, two: Any) -> bool:
    """Every bit of a Dataset, of a fit with its reports, of a tuning."""
    if isinstance(one, xr.Dataset):
        return one.identical(two)
    if isinstance(one, Fit):
        rows = [(f.parameters, f.start_rmse, f.n_best, f.unidentifiable, str(f.findings)) for f in (one, two)]
        arrays = [(f.report.values, f.report.stderr, f.report.residual) for f in (one, two)]
        alike = all(np.array_equal(a, b, equal_nan=True) for a, b in zip(*arrays, strict=True))
        return alike and rows[0] == rows[1] and one.run.identical(two.run)
    return bool(one == two)


@pytest.fixture(scope="module")
def plain() -> Callable[[str], Any]:
    """Return the results of the calls without an executor, each computed once."""
    kept: dict[str, Any] = {}
    return lambda name: kept[name] if name in kept else kept.setdefault(name, CALLS[name]())


@pytest.fixture(scope="module")
def pool() -> Iterator[Executor]:
    with processes(2)() as made:
        yield made


@pytest.fixture
def chunks_of(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Let every chunk have so many items."""
    return lambda size: monkeypatch.setattr(Plan, "_size", lambda plan: min(size, plan._n - plan._next))


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("size", [1, 4, 1000])
def test_chunks_on_threads_change_no_bit(
    name: str, size: int, plain: Callable[[str], Any], chunks_of: Callable[[int], None]
) -> None:
    chunks_of(size)
    assert same(CALLS[name](executor=ThreadPoolExecutor, workers=3), plain(name))


@pytest.mark.parametrize("name", CALLS)
def test_processes_change_no_bit(name: str, pool: Executor, plain: Callable[[str], Any]) -> None:
    assert same(CALLS[name](executor=pool), plain(name))


@pytest.mark.parametrize("name", CALLS)
def test_order_and_losses_change_no_bit(name: str, plain: Callable[[str], Any]) -> None:
    for executor in (work.LateReversed(), work.Dropping("error")):
        assert same(CALLS[name](executor=executor, workers=3), plain(name))


@pytest.mark.parametrize("name", CALLS)
def test_the_number_of_threads_changes_no_bit(name: str, plain: Callable[[str], Any]) -> None:
    assert same(CALLS[name](workers=1), plain(name))
    with pytest.raises(ParameterError, match="workers = 0: must be >= 1"):
        CALLS[name](workers=0)


def test_dask_changes_no_bit(plain: Callable[[str], Any]) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        for name in ("monte_carlo", "track_many", "fit_first_principle"):
            assert same(CALLS[name](executor=client.get_executor()), plain(name))


@pytest.mark.parametrize(("name", "n"), [("monte_carlo", 42), ("track_many", 165)])
def test_progress_counts_runs_and_changes_no_bit(name: str, n: int, plain: Callable[[str], Any]) -> None:
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
class NoWork(Executor):
    """An executor that nothing must reach: bad input is found before."""

    def submit(self, *_: Any, **__: Any) -> Any:
        raise AssertionError("work was handed out")


def test_what_does_not_fit_is_refused_before_any_work() -> None:
    def loops_of(benches: Any, seekers: Any, seeds: Any = (1,), cycles: int = 5) -> xr.Dataset:
        return monte_carlo(benches, seekers, seeds, cycles=cycles, executor=NoWork())

    fits = ExtremumSeeking(**SPACE)
    capped = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", 90.0)])
    for call, message in (
        (lambda: loops_of(EngineBench(), [fits, 3.0]), "3.0 is not a seeker"),
        (lambda: loops_of([EngineBench(limits=["p_max_bar"]), EngineBench()], [fits, capped]), "p_max_bar"),
        (lambda: loops_of(EngineBench(), fits, []), "seeds is empty"),
        (lambda: loops_of(EngineBench(), fits, cycles=0), "cycles = 0: must be >= 1"),
    ):
        with pytest.raises(ParameterError, match=message):
            call()
    steps = [Reference.step(a, 2, hold_s=0.1) for a in (40, 1)]
    with pytest.raises(Exception, match="airflow_torque_nm"):
        track_many({"pid": Pid()}, steps, [Throttle()] * 3, airflow_torque_nm={steps[1].name: [0.1]}, executor=NoWork())


def test_reading_is_not_moving() -> None:
    """Benches and seekers stay where they are; what they did before does not travel."""
    bench, seeker = EngineBench(), ExtremumSeeking(**SPACE)
    run_seeker(bench, seeker, 20)
    monte_carlo(bench, seeker, range(3), cycles=10, executor=ThreadPoolExecutor)
    assert (bench.cycle, seeker.cycle, len(seeker.history["cycle"])) == (20, 20, 20)


# --- what is left after a loss or Ctrl-C --------------------------------------------------------------------
class Dies(work.Dropping):
    """Works for a while, then loses everything."""

    def __init__(self, last: int) -> None:
        super().__init__("cancelled")
        self.last = last

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        self.always = self.count > self.last
        return super().submit(fn, *args, **kwargs)


@pytest.mark.parametrize(("name", "figure"), [("monte_carlo", "mean_cad"), ("track_many", "mse_deg2")])
def test_a_lost_worker_hands_over_what_is_done(
    name: str, figure: str, plain: Callable[[str], Any], chunks_of: Callable[[int], None]
) -> None:
    chunks_of(4)
    with pytest.raises(WorkerLostError) as lost:
        CALLS[name](executor=Dies(7), workers=2)
    part = lost.value.partial
    done = part["finished"].to_numpy()
    assert 0 < done.sum() < done.size
    assert f"{done.sum()} are finished" in str(lost.value)
    assert part.sizes == plain(name).sizes
    np.testing.assert_array_equal(part[figure].to_numpy()[done], plain(name)[figure].to_numpy()[done])
    assert np.isnan(part[figure].to_numpy()[~done]).all()
    check_labels(part)


def test_a_lost_worker_leaves_the_best_tuning_so_far(plain: Callable[[str], Any]) -> None:
    with pytest.raises(WorkerLostError) as lost:
        tuning(executor=Dies(60), workers=2)
    part = lost.value.partial
    assert 0 < part.evaluations < 30
    assert part.cost >= plain("tune_controller").cost
    with pytest.raises(WorkerLostError) as lost:
        tuning(executor=Dies(0), workers=2)
    assert lost.value.partial is None


def test_a_lost_worker_leaves_the_best_of_the_finished_starts(chunks_of: Callable[[int], None]) -> None:
    chunks_of(1)
    with pytest.raises(WorkerLostError) as lost:
        groups(executor=Dies(3), workers=1)
    part = lost.value.partial
    assert 0 < len(part.start_rmse) < 5
    assert part.report.rmse == min(part.start_rmse)


@pytest.mark.parametrize("executor", ["None", "ThreadPoolExecutor", "processes(2)"])
@pytest.mark.parametrize("name", ["monte_carlo", "track_many"])
def test_ctrl_c_carries_what_is_done(name: str, executor: str, root: Path) -> None:
    program = f"""
        import multiprocessing, os, signal, threading
        from concurrent.futures import ThreadPoolExecutor
        import numpy as np
        from mgdd.control import Pid
        from mgdd.errors import Interrupted
        from mgdd.loop import EngineBench, monte_carlo, track_many
        from mgdd.optimize import ExtremumSeeking
        from mgdd.parallel.pool import processes
        from mgdd.throttle import Throttle

        def loops(**how):
            seeker = ExtremumSeeking(start=-12.0, lower=-30.0, upper=10.0)
            return monte_carlo(EngineBench(), seeker, range(20_000), cycles=1000, **how), "mean_cad"

        def tracks(**how):
            return track_many({{"pid": Pid()}}, ["step:40:42", "step:4:20"], [Throttle()] * 20_000, **how), "mse_deg2"

        def stop(*counts):
            if not counts or counts[0] > 3:
                os.kill(os.getpid(), signal.SIGINT)

        if __name__ == "__main__":
            executor = {executor}
            how = {{"executor": executor, "progress": stop}} if executor else {{}}
            if not executor:
                threading.Timer(1.0, stop).start()
            call, figure = {{"monte_carlo": (loops, "mean_cad"), "track_many": (tracks, "mse_deg2")}}[{name!r}]
            try:
                call(**how)
            except Interrupted as stopped:
                table = stopped.partial
                done = table["finished"].to_numpy()
                assert 0 < done.sum() < done.size, done.sum()
                assert (np.isfinite(table[figure].to_numpy()) == done).all()
                assert threading.active_count() == 1, threading.enumerate()
                assert not multiprocessing.active_children()
                print("kept")
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=120, check=False,
        cwd=root,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("kept\n", "")


def test_ctrl_c_while_tuning_leaves_the_best_so_far() -> None:
    def progress(n: int, _: float) -> None:
        if n == 5:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(Interrupted, match=r"5 of 30 sets were run") as stop:
        tuning(progress=progress)
    assert stop.value.partial.evaluations == 5
    assert stop.value.partial.cost <= stop.value.partial.start_cost
