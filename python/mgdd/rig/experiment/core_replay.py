"""A run of the real-time loop again: controller and safety gate get what they got then, cycle by cycle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from mgdd import _core
from mgdd.errors import DataError
from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.experiment.core_samples import LOOP_TABLE, task_columns
from mgdd.rig.experiment.outcome import Outcome
from mgdd.rig.experiment.run_record import RunRecord
from mgdd.rig.experiment.throttle_tasks import TrackPlan
from mgdd.rig.recorded import RecordedRun
from mgdd.rig.safety import SafetyGate

__all__ = ["loop_rows", "replayed"]

_SENT = _core.rig.send_results.index("sent")
_NOTHING = math.nan


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
    again: list[dict[str, float]] = []
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
            pairs = ((asked, row["asked_duty"]), (drive.duty, row["duty"]))
            sizes.append(max(0.0 if _same(*pair) else _distance(*pair) for pair in pairs))
        if driven or again:
            again.append({**row, "asked_duty": asked, "duty": drive.duty})
        record.say(f"safety gate: {c.before} -> {c.after}: {c.reason}" for c in gate.drain())
    if not again:
        raise DataError(f"{checked.record}: ends before the first cycle of the task")
    different = [place for place, size in enumerate(sizes) if size > 0.0]
    compared = {
        "samples": len(sizes),
        "recorded": len(sizes),
        "different": len(different),
        "first_different": different[0] if different else None,
        "largest_difference": max(sizes),
    }
    outcome = plan.outcome(task_columns(again, plan.samples), interrupted=False)
    return outcome, {"replay": compared, "gate": gate.counts}


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


def _same(one: float, other: float) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))


def _distance(one: float, other: float) -> float:
    return abs(one - other) if math.isfinite(one - other) else math.inf
