"""Failure cases, tried out on this machine: a process drives a throttle over a bus and ends badly, six times."""

from __future__ import annotations

import csv
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mgdd.errors import ParameterError, RigError
from mgdd.results.describe import Row, rows_of
from mgdd.results.result import NumbersResult
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment.checked import check_experiment
from mgdd.rig.experiment.experiment import Experiment
from mgdd.rig.experiment.run import run_experiment
from mgdd.rig.experiment.stand import Cycle, own_node
from mgdd.rig.experiment.tasks import throttle_named

WAYS_TO_DIE = ("exception", "nan", "sigint", "sigterm", "sigkill", "hang")
WAYS_OF = {"python": WAYS_TO_DIE, "core": tuple(way for way in WAYS_TO_DIE if way != "nan")}
LIMIT_S = 0.4
_AWAY_DEG = 5.0  # from limp-home before the end, or the test says nothing
_BAND_DEG = 1.0
_WATCHED_S = 0.3  # beyond the limit
_READY_S = 60.0
_EXPERIMENT = """
kind = "experiment"
format = 1
task = "track"
mode = "hil"
[bus]
pace = "real_time"
"""
_DUTY, _OPEN_DEG, _SAMPLES = 0.3, 40.0, 8
_PATIENCE_S = 2.0
_HANGS_S = 60.0
_HELD_DEG = 60.0
_HELD = """
kind = "experiment"
format = 1
task = "track"
mode = "hil"
[track]
reference = "{reference}"
controller = "pid"
loop = "core"
[bus]
connection = "{connection}"
pace = "real_time"
"""
_DIES = f"import sys; from {__name__} import die; die(*sys.argv[1:])"
_SIGNALS = {"sigint": signal.SIGINT, "sigterm": signal.SIGTERM, "sigkill": signal.SIGKILL}


@dataclass(frozen=True, kw_only=True, repr=False)
class SelfTest(NumbersResult):
    """How long the plate took to limp-home after each failure."""

    ways_to_die: Mapping[str, float | None]  # seconds from the end of the process to limp-home; None: see notes
    limit_s: float
    notes: Mapping[str, str]  # why a way has no time
    loop: str = "python"  # what drove the plate

    def _rows(self) -> list[Row]:
        return rows_of({**self.ways_to_die, "limit_s": self.limit_s, "passed": self.passed})

    @property
    def passed(self) -> bool:
        """Whether every way has a time, and none is above the limit."""
        times = [self.ways_to_die.get(way) for way in WAYS_OF[self.loop]]
        return all(time is not None and time <= self.limit_s for time in times)

    def to_dict(self) -> dict[str, Any]:
        """Give all of it, as JSON holds it."""
        return {
            "passed": self.passed,
            "loop": self.loop,
            "limit_s": self.limit_s,
            "ways_to_die": dict(self.ways_to_die),
            "notes": dict(self.notes),
        }


def run_self_test(*, loop: str = "python", progress: Callable[[str], None] | None = None) -> SelfTest:
    """Let a process that drives a simulated throttle die in every way, and time the way home of the plate.

    Three parts on this machine, as on a bench: a hub, a node with the throttle, and the process that dies. The times
    are those of the truth in the node. With ``loop="python"`` Python drives the plate, command by command, with
    ``"core"`` an experiment on the real-time loop of the core, whose controllers give no ``nan``. `progress` is called
    with each way.
    """
    ParameterError.unless(loop in WAYS_OF, "loop", loop, f"one of {', '.join(WAYS_OF)}")
    ways = WAYS_OF[loop]
    experiment = Experiment.from_toml(_EXPERIMENT)
    checked, home_deg = check_experiment(experiment), throttle_named(experiment.plant.preset, Path()).limp_home_deg
    times: dict[str, float | None] = {}
    notes: dict[str, str] = {}
    with TemporaryDirectory(prefix="mgdd-selftest-") as folder:
        truth = Path(folder) / "truth.csv"
        with own_node(checked, truth=truth) as connection, ExitStack() as hosts:
            coming: list[_Host] = []
            for number, way in enumerate(ways):
                if progress is not None:
                    progress(way)
                for early in ways[len(coming) : number + 2]:  # the next one starts while this one dies
                    coming.append(_Host(early, connection, loop))
                    hosts.callback(coming[-1].end)
                try:
                    times[way] = _time_home(coming[number], truth, home_deg)
                except RigError as error:
                    times[way], notes[way] = None, str(error)
                coming[number].end()
    return SelfTest(ways_to_die=times, limit_s=LIMIT_S, notes=notes, loop=loop)


def _time_home(host: _Host, truth: Path, home_deg: float) -> float:
    """Let a host die, and give the time until the plate is home for good [s]."""
    died_ns = host.die()
    until_ns = died_ns + round((LIMIT_S + _WATCHED_S) * 1e9)
    waited = time.monotonic() + _READY_S
    rows = _rows(truth)
    while not rows or rows[-1][0] < until_ns:  # a busy machine: the log comes, but later
        if time.monotonic() > waited:
            raise RigError("the node reported nothing of that time")
        time.sleep(0.05)
        rows = _rows(truth)
    before = [angle for at_ns, angle in rows if at_ns <= died_ns]
    after = [(at_ns, angle) for at_ns, angle in rows if died_ns < at_ns <= until_ns]
    if not before or abs(before[-1] - home_deg) < _AWAY_DEG:
        raise RigError("the plate was at home already when the process ended")
    outside = [at_ns for at_ns, angle in after if not abs(angle - home_deg) < _BAND_DEG]
    if outside and outside[-1] == after[-1][0]:
        raise RigError(f"the plate stands at {after[-1][1]:.1f} deg, {LIMIT_S + _WATCHED_S:g} s after the end")
    return ((outside[-1] if outside else died_ns) - died_ns) * 1e-9


def _rows(truth: Path) -> list[tuple[int, float]]:
    with truth.open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    if rows and None in rows[-1].values():
        del rows[-1]  # a line that is being written
    return [(int(row["monotonic_ns"]), float(row["angle_deg"])) for row in rows]


class _Host:
    """The process that dies; it is started early, and drives when the command to die comes."""

    def __init__(self, way: str, connection: str, loop: str) -> None:
        self.way = way
        self._process = subprocess.Popen(
            [sys.executable, "-c", _DIES, way, connection, loop],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip

    def die(self) -> int:
        """Let it open the plate and die; give the time of its end [ns]."""
        process = self._process
        watchdog = threading.Timer(_READY_S, process.kill)
        watchdog.start()
        try:
            self._expect("ready")
            if process.stdin is not None:
                process.stdin.write("go\n")
                process.stdin.flush()
            self._expect("open")
            if self.way not in _SIGNALS:
                return int(self._expect("dying").split()[1])
            died_ns = time.monotonic_ns()
            process.send_signal(_SIGNALS[self.way])
            return died_ns
        finally:
            watchdog.cancel()

    def end(self) -> None:
        """End it, if it has not; the one that hangs has not."""
        self._process.kill()
        self._process.communicate()

    def _expect(self, word: str) -> str:
        line = self._process.stdout.readline() if self._process.stdout is not None else ""
        if not line.startswith(word):
            self._process.kill()
            _, complaint = self._process.communicate()
            raise RigError(f"the process did not come to {word!r}: {complaint.strip()[-300:] or 'no error output'}")
        return line


def _drive_and_die(way: str, connection: str) -> None:
    """Open the plate over a bus and die."""
    transport = CanTransport.parse(connection)
    _say("ready")
    sys.stdin.readline()
    with CanRig("etb", transport, mode="hil", timeout_s=_PATIENCE_S) as rig:
        _hold_open(rig, _SAMPLES)
        _say("open")
        if way in ("sigint", "sigterm", "sigkill"):
            _hold_open(rig, None)
        _say(f"dying {time.monotonic_ns()}")
        if way == "exception":
            raise RuntimeError("a mistake in the experiment")
        if way == "nan":
            rig.apply({"duty": math.nan})
        time.sleep(_HANGS_S)


def _track_and_die(way: str, connection: str) -> None:
    """Open the plate by an experiment on the real-time loop of the core, and die."""
    with TemporaryDirectory(prefix="mgdd-doomed-") as folder:
        file = Path(folder) / "held.csv"
        sample_s = SignalMap.load("etb").cycle_s
        rows = (f"{k * sample_s:.3f},{_HELD_DEG}" for k in range(round(_HANGS_S / sample_s)))
        file.write_text("\n".join(["time_s,reference_deg", *rows]), encoding="utf-8")
        text = _HELD.format(reference=file, connection=connection)
        checked = check_experiment(Experiment.from_toml(text))
    _say("ready")
    sys.stdin.readline()
    ends = time.monotonic() + _HANGS_S
    while time.monotonic() < ends:
        try:
            run_experiment(checked, watch=_Doom(way))
        except RigError:
            continue  # a busy machine
        return  # Ctrl-C keeps what was done, and ends


class _Doom:
    """Says when the plate is open, and dies where the process is to die by itself."""

    def __init__(self, way: str) -> None:
        self._way, self._held = way, 0

    def __call__(self, cycle: Cycle) -> None:
        self._held = self._held + 1 if cycle.measured.values["sensed_angle_deg"] > _OPEN_DEG else 0
        if self._held != _SAMPLES:
            return
        _say("open")
        if self._way not in ("exception", "hang"):
            return
        _say(f"dying {time.monotonic_ns()}")
        if self._way == "exception":
            raise RuntimeError("a mistake in the experiment")
        time.sleep(_HANGS_S)


def _hold_open(rig: CanRig, samples: int | None) -> None:
    """Hold the plate open for so many samples in a row; where a busy machine let the node time out, arm it again."""
    held, ends = 0, time.monotonic() + _HANGS_S
    while time.monotonic() < ends and (samples is None or held < samples):
        try:
            rig.apply({"duty": _DUTY})
            angle = rig.measure().values["sensed_angle_deg"]
        except RigError:
            rig.arm()
            held = 0
        else:
            held = held + 1 if angle > _OPEN_DEG else 0


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def die(way: str, connection: str, loop: str) -> None:
    """Open a throttle over a bus and die, in the process that does.

    It says ``ready``, waits for a line, says ``open`` when the plate is open, and ``dying`` with the monotonic time
    [ns] where it dies by itself.
    """
    {"python": _drive_and_die, "core": _track_and_die}[loop](way, connection)
