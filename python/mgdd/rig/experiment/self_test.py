"""The ways to die, tried out on this machine: a process drives a throttle over a bus and ends badly, six times."""

from __future__ import annotations

import csv
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mgdd.errors import RigError
from mgdd.results.describe import described
from mgdd.rig.experiment.checked import CheckedExperiment, check_experiment
from mgdd.rig.experiment.experiment import Experiment
from mgdd.rig.experiment.own_node import own_node

__all__ = ["WAYS_TO_DIE", "SelfTest", "run_self_test"]

WAYS_TO_DIE = ("exception", "nan", "sigint", "sigterm", "sigkill", "hang")
LIMIT_S = 0.4
_DUTY = 0.35
_AWAY_DEG = 5.0  # from limp-home before the end, or the test says nothing
_BAND_DEG = 1.0
_WATCHED_S = 1.0  # after the end
_READY_S = 60.0
_EXPERIMENT = """
kind = "experiment"
format = 1
task = "track"
mode = "hil"
[bus]
pace = "real_time"
"""
_SIGNALS = {"sigint": signal.SIGINT, "sigterm": signal.SIGTERM, "sigkill": signal.SIGKILL}


@dataclass(frozen=True, kw_only=True)
class SelfTest:
    """How long the plate took to limp-home after each way to die.

    Parameters
    ----------
    ways_to_die : mapping of str to float or None
        Seconds from the end of the process to limp-home, by way; None where the plate did not come home, or the way
        could not be tried.
    limit_s : float
        What is allowed [s].
    notes : mapping of str to str
        Why a way has no time.
    """

    ways_to_die: Mapping[str, float | None]
    limit_s: float
    notes: Mapping[str, str]

    @property
    def passed(self) -> bool:
        """Whether every way has a time, and none is above the limit."""
        times = [self.ways_to_die.get(way) for way in WAYS_TO_DIE]
        return all(time is not None and time <= self.limit_s for time in times)

    def to_dict(self) -> dict[str, Any]:
        """Give all of it.

        Returns
        -------
        dict
            As JSON holds it.
        """
        return {
            "passed": self.passed,
            "limit_s": self.limit_s,
            "ways_to_die": dict(self.ways_to_die),
            "notes": dict(self.notes),
        }


def run_self_test(*, progress: Callable[[str], None] | None = None) -> SelfTest:
    """Let a process that drives a simulated throttle die in every way, and time the way home of the plate.

    Three parts on this machine, as on a bench: a hub, a node with the throttle, and the process that dies. The times
    are those of the truth in the node.

    Parameters
    ----------
    progress : callable, optional
        Called with the name of each way.

    Returns
    -------
    SelfTest
        With ``exception``, ``nan``, ``sigint``, ``sigterm``, ``sigkill`` and ``hang``.

    Raises
    ------
    ImportError
        The extra ``can`` is not installed.
    mgdd.errors.RigError
        Hub and node did not start.
    """
    checked = check_experiment(Experiment.from_toml(_EXPERIMENT))
    times: dict[str, float | None] = {}
    notes: dict[str, str] = {}
    with TemporaryDirectory(prefix="mgdd-selftest-") as folder:
        truth = Path(folder) / "truth.csv"
        with own_node(checked, truth=truth) as connection:
            for way in WAYS_TO_DIE:
                if progress is not None:
                    progress(way)
                try:
                    times[way] = _time_home(checked, way, connection, truth)
                except RigError as error:
                    times[way], notes[way] = None, str(error)
    return SelfTest(ways_to_die=times, limit_s=LIMIT_S, notes=notes)


def _time_home(checked: CheckedExperiment, way: str, connection: str, truth: Path) -> float:
    died_ns = _die(way, connection)
    time.sleep(_WATCHED_S)
    home_deg = 8.0 if checked.signal_map is None else _limp_home_deg(checked)
    rows = _rows(truth)
    before = [angle for at_ns, angle in rows if at_ns <= died_ns]
    after = [(at_ns, angle) for at_ns, angle in rows if at_ns > died_ns]
    if not before or not after:
        raise RigError("the node says nothing of that time")
    if abs(before[-1] - home_deg) < _AWAY_DEG:
        raise RigError(f"the plate was at {before[-1]:.1f} deg already when the process ended")
    outside = [at_ns for at_ns, angle in after if not abs(angle - home_deg) < _BAND_DEG]
    if outside and outside[-1] == after[-1][0]:
        raise RigError(f"the plate stands at {after[-1][1]:.1f} deg, {_WATCHED_S:g} s after the end")
    return ((outside[-1] if outside else died_ns) - died_ns) * 1e-9


def _limp_home_deg(checked: CheckedExperiment) -> float:
    from mgdd.rig.experiment.throttle_tasks import throttle_named

    return throttle_named(checked.experiment.plant.preset, Path()).limp_home_deg


def _rows(truth: Path) -> list[tuple[int, float]]:
    with truth.open(encoding="utf-8", newline="") as lines:
        whole = [row for row in csv.DictReader(lines) if row["angle_deg"] not in (None, "")]
    rows = [(int(row["monotonic_ns"]), float(row["angle_deg"])) for row in whole]
    return [row for row in rows if math.isfinite(row[1])]


def _die(way: str, connection: str) -> int:
    """Start the process that dies, and give the time of its end [ns]."""
    process = subprocess.Popen(
        [sys.executable, "-m", "mgdd.rig.experiment.self_test", way, connection],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    if process.stdout is None:
        raise RigError("no pipe to the process")
    try:
        said = process.stdout.readline()
        if not said.startswith("driving"):
            _, complaint = process.communicate(timeout=_READY_S)
            raise RigError(f"the process did not come to drive: {complaint.strip()[-300:]}")
        if way in _SIGNALS:
            died_ns = time.monotonic_ns()
            os.kill(process.pid, _SIGNALS[way])
        else:
            died_ns = int(process.stdout.readline().split()[1])
        if way == "hang":
            time.sleep(_WATCHED_S)
    finally:
        if way == "hang" or process.poll() is None:
            with_time = time.monotonic() + _READY_S
            while way != "hang" and process.poll() is None and time.monotonic() < with_time:
                time.sleep(0.01)
            process.kill()
        process.communicate()
    return died_ns


def _drive_and_die(way: str, connection: str) -> None:
    from mgdd.rig.can.can_rig import CanRig

    with CanRig("etb", connection, mode="hil") as rig:
        duty, cycle, ends = _DUTY, 0, time.monotonic() + _READY_S
        while time.monotonic() < ends:
            rig.apply({"duty": duty})
            rig.measure()
            cycle += 1
            if cycle == 100:  # half a second: the plate stands open
                sys.stdout.write("driving\n")
                sys.stdout.flush()
            if cycle == 120 and way not in _SIGNALS:
                sys.stdout.write(f"died {time.monotonic_ns()}\n")
                sys.stdout.flush()
                if way == "exception":
                    raise RuntimeError("a mistake in the experiment")
                if way == "nan":
                    duty = math.nan
                while way == "hang":
                    pass


described(SelfTest, rows=lambda test: {**test.ways_to_die, "limit_s": test.limit_s, "passed": test.passed})

if __name__ == "__main__":
    _drive_and_die(*sys.argv[1:])
