"""What loops, runs, fits and tunings hand over after a lost worker or Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

import parallel_work as work
from executor_calls import CALLS, fixed_chunks, plain, tuning
from mgdd.errors import Interrupted, WorkerLostError
from mgdd.results.labels import check_labels

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("name", "figure"), [("monte_carlo", "mean_soc_cad"), ("track_many", "mse_deg2")])
def test_a_lost_worker_hands_over_what_is_done(name: str, figure: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fixed_chunks(monkeypatch, 4)
    with pytest.raises(WorkerLostError) as lost:
        CALLS[name](executor=work.Dropping("cancelled", after=7), workers=2)
    part = lost.value.partial
    done = part["finished"].to_numpy()
    assert 0 < done.sum() < done.size
    assert f"{done.sum()} of {done.size} are finished" in str(lost.value)
    assert part.sizes == plain(name).sizes
    np.testing.assert_array_equal(part[figure].to_numpy()[done], plain(name)[figure].to_numpy()[done])
    assert np.isnan(part[figure].to_numpy()[~done]).all()
    check_labels(part)


def test_a_lost_worker_leaves_the_best_tuning_so_far() -> None:
    with pytest.raises(WorkerLostError) as lost:
        tuning(executor=work.Dropping("cancelled", after=60), workers=2)
    part = lost.value.partial
    assert 0 < part.evaluations < 30
    assert part.cost >= plain("tune_controller").cost
    with pytest.raises(WorkerLostError) as lost:
        tuning(executor=work.Dropping("cancelled"), workers=2)
    assert lost.value.partial is None


@pytest.mark.parametrize("executor", ["None", "ThreadPoolExecutor", "processes(2)"])
@pytest.mark.parametrize("name", ["monte_carlo", "track_many"])
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
            seeker = ExtremumSeeking(start=-12.0, lower=-30.0, upper=10.0)
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
                assert 0 < done.sum() < done.size, done.sum()
                assert (np.isfinite(table[figure].to_numpy()) == done).all()
                assert threading.active_count() == 1, threading.enumerate()
                assert not multiprocessing.active_children()
                print("kept")
    """
    for wait_s in ("1", "15"):  # under a sanitizer the first run may be over before it has begun
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(program), wait_s], capture_output=True, text=True, timeout=120,
            check=False, cwd=root,
        )  # fmt: skip
        if not done.stderr.endswith("\nKeyboardInterrupt\n"):
            break
    assert (done.stdout, done.stderr) == ("kept\n", "")


def test_ctrl_c_while_tuning_leaves_the_best_so_far() -> None:
    def progress(n: int, _: float) -> None:
        if n == 5:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(Interrupted, match=r"5 of 30 sets were run") as stop:
        tuning(progress=progress)
    assert stop.value.partial.evaluations == 5
    assert stop.value.partial.cost <= stop.value.partial.start_cost
