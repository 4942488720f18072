"""A controller along a reference on the real-time loop of the core, behind the checks of a rig over a bus."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from mgdd.errors import RigError
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.loop_map import loop_messages
from mgdd.rig.can.signals import held_back
from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.experiment.core_samples import LoopSamples
from mgdd.rig.experiment.loop_bus import BridgedBus, SocketBus, WatchedBus
from mgdd.rig.experiment.run_folder import RunRecord
from mgdd.rig.experiment.tasks import Outcome, TrackPlan
from mgdd.rig.experiment.watched import Cycle
from mgdd.rig.gated import drive_taken
from mgdd.rig.realtime import RealtimeLoop
from mgdd.rig.safety import said_of

__all__ = ["LEAD_S", "track_on_core"]

LEAD_S = 0.06  # of the references before their cycle: so long may Python stand still, and then the bridge opens
_LOOK_S = 0.005
_PATIENCE_S = 2.0  # at least, for the gate
_PHASE = 0.3  # of a cycle, from a measurement to the step of the controller: what the threads of a bridge need


def track_on_core(
    checked: CheckedExperiment, plan: TrackPlan, rig: CanRig, record: RunRecord, listener: Callable[[Cycle], None]
) -> tuple[Outcome, dict[str, Any], dict[str, Any]]:
    """Run a controller along its reference.

    The rig has looked at its bus and armed the node; while the loop runs the bus is the loop's. Every reference is
    queued for its grid point; where Python stood still for `LEAD_S` the loop aborts rather than follow a late one.
    """
    import xarray  # noqa: F401 - before the phase of the loop is chosen

    run = _CoreRun(checked, plan, rig, record, listener)
    interrupted = run.to_the_end()
    report = run.loop.report()
    counters = dict(rig.counters)
    counters["commands"] += report["bus"]["sent"]
    counters |= {"loop": {**report["frames"], **run.bus.counters, "bus": report["bus"]}, "gate": dict(run.changes)}
    timing = {name: report[name] for name in _TIMING}
    return plan.outcome(run.samples.columns(), interrupted=interrupted), counters, timing


_TIMING = (
    "missed", "late", "longest_row", "lateness_us", "compute_us", "age_us", "send_us", "dropped_samples", "schedule",
)  # fmt: skip


class _CoreRun:
    """The loop, its way to the bus, and the thread of Python that feeds references and takes samples and frames."""

    def __init__(
        self,
        checked: CheckedExperiment,
        plan: TrackPlan,
        rig: CanRig,
        record: RunRecord,
        listener: Callable[[Cycle], None],
    ) -> None:
        command, measurements = loop_messages(checked.bus_map)
        sample_s, wanted = plan.sample_s, plan.reference.angle_deg
        self._sample_s = sample_s
        self._trigger = checked.bus_map.measurements[checked.bus_map.trigger].key
        self._shadow = checked.experiment.mode == "dry_run"
        self._watched = WatchedBus(rig.bus, checked.bus_map)
        channel = None if checked.loop is None else checked.loop.channel
        self.bus: BridgedBus | SocketBus = (
            BridgedBus(self._watched)
            if channel is None
            else SocketBus(
                self._watched, channel, command=command, measurements=measurements, transmits=not self._shadow
            )
        )
        self._record, self._lead = record, max(4, math.ceil(LEAD_S / sample_s))
        self._wanted, self._handed_over = wanted, 1
        self._patience_s = max(_PATIENCE_S, 20.0 * (checked.envelope.good_frames if checked.envelope else 0) * sample_s)
        self.changes: Counter[str] = Counter()
        self.samples = LoopSamples(
            record.recorder,
            row=record.row,
            listener=listener,
            value_names=checked.bus_map.value_names,
            samples=len(wanted),
            sample_s=sample_s,
        )
        self.loop = RealtimeLoop(
            plan.controller(),
            self.bus.transport,
            command=command,
            measurements=measurements,
            envelope=checked.envelope,
            reference_deg=float(wanted[0]),
            reference_timeout_s=0.5 * sample_s,  # the first grid point without its reference
            transmit=not self._shadow,
        )

    def to_the_end(self) -> bool:
        """Run; whether Ctrl-C cut it."""
        interrupted = False
        came_ns = self._trigger_ns()
        with self.bus:
            self._wait_for_phase(came_ns)
            try:
                with self.loop:
                    self._bring_into_service()
                    try:
                        self._follow()
                    except KeyboardInterrupt:
                        interrupted = True
            finally:
                self._take()
        return interrupted

    def _trigger_ns(self) -> int:
        """Wait for the next end of a measured cycle, and give its stamp; now where none comes."""
        while self._watched.receive(0.0) is not None:
            pass
        until = time.monotonic() + _PATIENCE_S
        while (left_s := until - time.monotonic()) > 0.0:
            frame = self._watched.receive(left_s)
            if frame is not None and (frame.id, frame.extended) == self._trigger:
                return frame.monotonic_ns
        return time.monotonic_ns()

    def _wait_for_phase(self, came_ns: int) -> None:
        """Sleep until the grid of the loop lies soon behind the measurements: their age is dead time."""
        behind_s = (time.monotonic_ns() - came_ns) * 1e-9 - _PHASE * self._sample_s
        time.sleep(-behind_s % self._sample_s)

    def _bring_into_service(self) -> None:
        try:
            self.loop.arm(self._patience_s)
            self._feed()
            self.loop.drive(self._patience_s)
        except RigError as error:
            self._take()
            raise self.bus.error or error from None

    def _follow(self) -> None:
        while self.samples.done < len(self._wanted):
            time.sleep(_LOOK_S)
            self._feed()
            self._take()
            self.samples.tell()
            if self.bus.error is not None or (self.samples.stopped and not self._shadow):
                raise self._why()
            if self._watched.failed and not self._shadow:
                raise RigError(
                    f"{self._watched.name}: the node is in state {self._watched.state!r} and does not drive; look for "
                    "the cause, then run the experiment again"
                )

    def _why(self) -> BaseException:
        if self.bus.error is not None:
            return self.bus.error
        if self.loop.report()["reference_timeouts"]:
            return RigError(
                f"Python stood still for {LEAD_S * 1e3:g} ms and handed over no reference: the loop has opened the "
                "bridge; keep the machine free, and what watches the run short"
            )
        return drive_taken(self.loop.mode, self.loop.reason)

    def _feed(self) -> None:
        """Fill the queue up to the lead; behind the last reference it holds."""
        room = self._lead - self.loop.queued_references
        if room > 0 and self.loop.mode in ("armed", "run"):
            begin = self._handed_over
            places = np.minimum(np.arange(begin, begin + room), len(self._wanted) - 1)
            self.loop.queue_references(self._wanted[places])
            self._handed_over += room

    def _take(self) -> None:
        with held_back():  # Ctrl-C between two rows would tear a hole into the record
            self.bus.look(self.loop.report)
            events = self.loop.events()
            self.changes.update(change.reason for change in events)
            self._record.say(said_of(events))
            self.samples.take(self.loop.sample_columns())
