"""Samples of a real-time loop: rows of a record, cycles of a task, columns of its result, and their replay."""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd.control.supervised import note_sent
from mgdd.errors import DataError
from mgdd.loop import Measurement
from mgdd.rig.can.signal_map import LOOP_NAMES
from mgdd.rig.exchange import Exchange, flat
from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.experiment.stand import Cycle, RunRecord
from mgdd.rig.experiment.tasks import Outcome, TrackPlan, compared
from mgdd.rig.recorded import RecordedRun
from mgdd.rig.recorder import Recorder
from mgdd.rig.safety import SafetyGate, said_of

LOOP_TABLE = "loop"  # of a record: a row per cycle of the loop
RUN = _core.rig.safety_states.index("run")
_MAP_NAMES = {own: name for name, own in LOOP_NAMES.items()}
_SENT = _core.rig.send_results.index("sent")
_NOTHING = math.nan
_KEPT = ("cycle", "asked_duty", "duty", "applied_duty", "sensed_angle_deg")  # what the result of a task needs


class LoopSamples:
    """Takes the samples of a loop: into a record, to a listener, and keeps what the result needs."""

    def __init__(
        self,
        recorder: Recorder | None,
        *,
        row: Callable[[Mapping[str, float]], None],
        listener: Callable[[Cycle], None],
        value_names: Sequence[str],
        samples: int,
        sample_s: float,
    ) -> None:
        self._recorder, self._row, self._listener = recorder, row, listener
        self._samples, self._sample_s = samples, sample_s
        self._missing = dict.fromkeys(value_names, math.nan)
        self._before: dict[str, float] | None = None
        self._reported, self._unreported = 0, deque[Cycle]()
        self._recorded = _columns()
        self._first: int | None = None
        self._running = False

    @property
    def done(self) -> int:
        """Grid points of the task that are over: their measurement has come."""
        if self._first is None or self._before is None:
            return 0
        return min(int(self._before["cycle"]) - self._first, self._samples)

    @property
    def stopped(self) -> bool:
        """Whether the gate has taken the drive away since the task began."""
        return self._first is not None and not self._running

    def take(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Take samples, as `mgdd.rig.RealtimeLoop.sample_columns` gives them."""
        names = [name for name in columns if name != "deadline_ns"]
        rows = zip(columns["deadline_ns"].tolist(), *(columns[name].tolist() for name in names), strict=True)
        for deadline_ns, *values in rows:
            row = dict(zip(names, map(float, values), strict=True))
            row["sensed_angle_deg"], row["mode"] = row.pop("angle_deg"), row.pop("state")  # as other tables name them
            self._take(deadline_ns, row)

    def tell(self) -> None:
        """Report to the listener the cycles that it has not received; what it raises ends the run."""
        while self._unreported:
            self._reported += 1
            self._listener(self._unreported.popleft())

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Give what the task came to, a row per grid point; see `task_columns`."""
        return task_columns(self._recorded, self._samples)

    def _take(self, deadline_ns: int, now: dict[str, float]) -> None:
        if self._recorder is not None:
            self._recorder.sample(LOOP_TABLE, now, monotonic_ns=deadline_ns)
        over = self.done == self._samples
        before, self._before = self._before, now
        self._running = now["mode"] == RUN
        began = self._first is not None
        if self._running and not began:
            self._first = int(now["cycle"])
        if self._first is not None and not over:
            _keep(self._recorded, now)
        if before is None:
            return
        values = {name: now[name] for name in _MAP_NAMES.values()}
        duty = now["applied_duty"]
        exchange = Exchange(
            {"duty": before["duty"]},
            Measurement(
                components=(),
                limits={},
                misfire=False,
                values={**self._missing, **{n: v for n, v in values.items() if n in self._missing}},
                applied={"duty": before["duty"] if math.isnan(duty) else duty},
            ),
        )
        self._row(flat(exchange))
        if began and not over:
            asked, thinking_s = {"duty": before["asked_duty"]}, before["compute_us"] * 1e-6
            period_s = (now["cycle"] - before["cycle"]) * self._sample_s
            cycle = Cycle(
                self._reported + len(self._unreported), asked, exchange.measurement, thinking_s, period_s - thinking_s
            )
            self._unreported.append(cycle)


def _columns() -> dict[str, array[float]]:
    return {name: array("d") for name in _KEPT}


def _keep(columns: Mapping[str, array[float]], row: Mapping[str, float]) -> None:
    """Append a row: 40 bytes, where its mapping takes 2 kB."""
    for name, column in columns.items():
        column.append(row[name])


def task_columns(kept: Mapping[str, Sequence[float]], samples: int) -> dict[str, NDArray[np.float64]]:
    """Give the duty that was asked, the one that the node reports and the angle that followed, a row per grid point.

    The rows begin with the first driven cycle; a grid point that the loop missed has the numbers of the one before.
    """
    columns = {name: np.array(values, dtype=np.float64) for name, values in kept.items()}
    cycle = columns["cycle"]
    done = 0 if len(cycle) == 0 else min(int(cycle[-1] - cycle[0]), samples)
    if done == 0:
        return {name: np.empty(0) for name in ("asked_duty", "duty", "sensed_angle_deg")}
    place = np.searchsorted(cycle, cycle[0] + np.arange(done + 1), side="right") - 1
    at, after = place[:-1], place[1:]
    applied = columns["applied_duty"][after]
    return {
        "asked_duty": columns["asked_duty"][at],
        "duty": np.where(np.isnan(applied), columns["duty"][at], applied),
        "sensed_angle_deg": columns["sensed_angle_deg"][after],
    }


def loop_rows(recorded: RecordedRun) -> list[dict[str, float]]:
    """Give the rows of the loop in a record; none for the record of another loop."""
    table = recorded.samples.get(LOOP_TABLE)
    if table is None:
        return []
    names = [str(name) for name in table.data_vars]
    values = np.column_stack([table[name].to_numpy() for name in names]).tolist()
    return [dict(zip(names, row, strict=True)) for row in values]


def replayed(
    checked: CheckedExperiment, plan: TrackPlan, rows: list[dict[str, float]], record: RunRecord
) -> tuple[Outcome, dict[str, Any]]:
    """Compute every duty of a recorded loop again, and compare it bit for bit."""
    controller, gate, sent = plan.controller(), SafetyGate(checked.envelope), True
    again = _columns()
    sizes: list[float] = []
    for row in rows:
        gate.observe(**_facts(row, sent=sent))
        sent = row["send_result"] == _SENT
        angle_deg = row["sensed_angle_deg"] if row["fresh"] else _NOTHING
        # The gate of another controller may have taken the drive away: it is stepped where it was, all the same.
        driven = gate.mode == "run" or not math.isnan(row["asked_duty"])
        asked = float(controller.step(row["reference_deg"], angle_deg)) if driven else _NOTHING
        drive = gate.command(asked if gate.mode == "run" else 0.0)
        if driven:
            note_sent(controller, drive.duty)
            pairs = ((asked, row["asked_duty"]), (drive.duty, row["duty"]))
            sizes.append(max(_distance(*pair) for pair in pairs))
        if driven or again["cycle"]:
            _keep(again, {**row, "asked_duty": asked, "duty": drive.duty})
        record.say(said_of(gate.drain()))
    if not again["cycle"]:
        raise DataError(f"{checked.record}: ends before the first cycle of the task")
    different = [(place, size) for place, size in enumerate(sizes) if size > 0.0]
    outcome = plan.outcome(task_columns(again, plan.samples), interrupted=False)
    return outcome, {"replay": compared(len(sizes), len(sizes), different), "gate": gate.counts}


def _facts(row: Mapping[str, float], *, sent: bool) -> dict[str, Any]:
    age_ns = None if math.isnan(row["age_us"]) else round(row["age_us"] * 1e3)
    return {
        "good_frames": int(row["good_frames"]),
        "bad_frames": int(row["bad_frames"]),
        "age_s": None if age_ns is None else age_ns * 1e-9,
        "sensor_v": (row["first_v"], row["second_v"]),
        "angle_deg": row["sensed_angle_deg"],
        "bus": _core.rig.bus_states[int(row["bus_state"])],
        "sent": sent,
        "missed_deadlines": int(row["missed"]),
        "request": _core.rig.safety_requests[int(row["request"])],
    }


def _distance(one: float, other: float) -> float:
    if one == other or (math.isnan(one) and math.isnan(other)):
        return 0.0
    return abs(one - other) if math.isfinite(one - other) else math.inf
