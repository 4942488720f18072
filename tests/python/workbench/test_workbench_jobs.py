"""Work in a process of its own: what it answers, and every way in which it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import workbench_jobs as work
from mgdd.workbench.jobs import Job

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes are forked here"),
]


def run(function: Callable[..., Any], *given: Any, seconds: float = 120.0) -> tuple[Job, list[Any]]:
    job, told = Job(function, given, seconds=seconds), []
    while not job.over:
        told += job.look()
        time.sleep(0.01)
    return job, told


def alive(process: int) -> bool:
    try:
        status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    except (FileNotFoundError, ProcessLookupError):  # it may go while it is read
        return False
    return "State:\tZ" not in status


def becomes_dead(process: int) -> bool:
    until = time.monotonic() + 20.0
    while alive(process) and time.monotonic() < until:
        time.sleep(0.02)
    return not alive(process)


def test_it_reports_and_answers() -> None:
    job, told = run(work.answers, 3000)  # more than one look takes
    assert (job.result, job.error, job.interrupted) == (9_000_000, "", False)
    assert told == list(range(3000))


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (work.refuses, "a.csv: holds no numbers: give another file"),
        (work.fails, "KeyError: 'column 7'"),
        (work.eats, "needs more than 4096 MB of memory"),
        (work.dies, "was ended by SIGSEGV"),
        (work.gives_what_cannot_be_sent, "its process ended"),
    ],
)
def test_whatever_goes_wrong_is_a_sentence(function: Callable[..., Any], sentence: str) -> None:
    job, _ = run(function)
    assert sentence in job.error
    assert job.result is None


def test_what_takes_too_long_is_ended() -> None:
    Job(work.answers, (1,)).end()  # the process that forks is there now
    job, told = run(work.sleeps, 600.0, seconds=3.0)
    assert "took more than 3 s" in job.error
    assert becomes_dead(told[0])


def test_a_stop_keeps_what_is_finished() -> None:
    job, told = Job(work.goes_on, ()), list[Any]()
    while len(told) < 5:
        told += job.look()
    job.stop()
    while not job.over:
        job.look()
    assert (job.result, job.interrupted, job.error) == ("what was finished", True, "")


def test_what_is_cancelled_is_gone() -> None:
    job, told = Job(work.sleeps, (600.0,)), list[Any]()
    while not told:
        told += job.look()
    job.end()
    assert (job.over, job.error) == (True, "cancelled")
    assert becomes_dead(told[0])


PARENT = """
import sys, time
import workbench_jobs as work
from mgdd.workbench.jobs import Job
if __name__ == "__main__":
    job, told = Job(work.sleeps, (600.0,)), []
    while not told:
        told += job.look()
    print(told[0], flush=True)
    time.sleep(600.0)
"""


def test_work_ends_with_the_server(tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT, encoding="utf-8")
    folders = os.pathsep.join(filter(None, (str(Path(work.__file__).parent), os.environ.get("PYTHONPATH"))))
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": folders}
    ) as server:
        assert server.stdout is not None
        process = int(server.stdout.readline())
        assert alive(process)
        server.send_signal(signal.SIGKILL)
        server.wait()
    assert becomes_dead(process)
