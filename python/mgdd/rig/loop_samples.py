"""What a real-time loop has done, as a labelled Dataset and in a few lines of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.results.labels import VARIABLES, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["samples_dataset", "summary"]

_LABELS: Mapping[str, tuple[str, str]] = {
    "cycle": ("-", "number of the grid point"),
    "lateness_us": ("us", "beginning after the deadline"),
    "compute_us": ("us", "time from waking until the command had left"),
    "age_us": ("us", "age of the measurement"),
    "missed": ("-", "deadlines missed since the cycle before"),
    "first_v": ("V", "first position sensor"),
    "second_v": ("V", "second position sensor"),
    "applied_duty": ("-", "duty that the node reports"),
    "asked_duty": ("-", "duty of the controller"),
    "bridge_open": ("-", "open bridge"),
    "fresh": ("-", "a new angle arrived"),
    "mode": ("-", "mode of the safety gate"),
    "cause": ("-", "what is wrong"),
    "send_result": ("-", "what became of the command"),
    "good_frames": ("-", "frames with a new angle"),
    "bad_frames": ("-", "frames that were refused"),
    "bus_state": ("-", "state of the bus"),
    "request": ("-", "request to the safety gate"),
}
_MODES = tuple(_core.rig.safety_states)
_REASONS = tuple(_core.rig.safety_reasons)
_RESULTS = tuple(_core.rig.send_results)
_BUS_STATES = tuple(_core.rig.bus_states)
_REQUESTS = tuple(_core.rig.safety_requests)
_TIMES = {"lateness_us": "lateness", "compute_us": "compute", "age_us": "age", "send_us": "send"}


def samples_dataset(columns: Mapping[str, Any], origin_ns: int) -> xr.Dataset:
    """Label the columns of the core along the time of the deadlines from an origin on the monotonic clock [ns]."""
    values = dict(columns)
    time_s = (values.pop("deadline_ns") - origin_ns) * 1e-9
    values["sensed_angle_deg"] = values.pop("angle_deg")
    values["mode"] = np.array(_MODES)[values.pop("state")]
    values["cause"] = np.array(_REASONS)[values["cause"]]
    values["send_result"] = np.array(_RESULTS)[values["send_result"]]
    values["bus_state"] = np.array(_BUS_STATES)[values["bus_state"]]
    values["request"] = np.array(_REQUESTS)[values["request"]]
    variables: dict[str, Any] = {"time_s": ("time_s", time_s)}
    for name, column in values.items():
        variables[name] = ("time_s", column, *(_LABELS.get(name) or VARIABLES[name]))
    return labelled_dataset(variables, attrs={"origin_monotonic_ns": str(origin_ns)})


def summary(report: Mapping[str, Any], period_s: float) -> str:
    """Say in a few lines how punctual the loop of a report was."""
    frames, bus, granted = report["frames"], report["bus"], report["schedule"]
    cycles = f"{report['cycles']} cycles of {period_s * 1e3:g} ms, {report['missed']} deadlines missed"
    lines = [f"{cycles} ({report['late']} of them too long, longest row {report['longest_row']})"]
    lines.append(f"{'':14}{'p50':>10}{'p99':>10}{'p99.9':>10}{'max':>12}")
    for name, what in _TIMES.items():
        times = report[name]
        quantiles = "".join(f"{times[q]:10.1f}" for q in ("p50", "p99", "p99_9"))
        lines.append(f"{what + ' [us]':14}{quantiles}{times['max']:12.1f}")
    received = f"frames: {frames['good']} good, {frames['bad']} bad, {bus['lost']} lost"
    lines.append(
        f"{received}, {bus['sent']} sent, {bus['full'] + bus['failed']} not sent; samples dropped:"
        f" {report['dropped_samples']}"
    )
    yes = {True: "yes", False: "no"}
    lines.append(f"SCHED_FIFO: {yes[granted['realtime']]}, memory locked: {yes[granted['memory_locked']]}")
    return "\n".join(lines)
