"""What loops, runs and tunings hand over after a lost worker or Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import parallel_work as work
from executor_calls import fixed_chunks, loops, plain
from mgdd.errors import Interrupted, WorkerLostError
from mgdd.loop import tune_controller
from mgdd.loop.tune import tracking_cost
from mgdd.results.labels import check_labels
from mgdd.throttle import Throttle

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
