"""A controller along a reference on the real-time loop of the core, and how that loop reaches the bus of its rig."""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Self

import numpy as np

from mgdd._core.rig import Frame, RingTransport, SocketCanTransport
from mgdd.errors import RigError
from mgdd.rig.can.bus_bridge import BusBridge
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.processes import held_back
from mgdd.rig.can.signal_map import SignalMap, loop_messages
from mgdd.rig.can.transport import Bus, changed, two_senders
from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.experiment.core_samples import LoopSamples
from mgdd.rig.experiment.stand import Cycle, RunRecord
from mgdd.rig.experiment.tasks import Outcome, TrackPlan
from mgdd.rig.loop_message import LoopMessage
from mgdd.rig.realtime import RealtimeLoop
from mgdd.rig.recorder import RecordedBus
from mgdd.rig.safety import drive_taken, said_of

_ALL_BITS = {False: 0x7FF, True: 0x1FFF_FFFF}
_FAILED_FRAMES = 3
_SWITCH_S = 5e-4
_LAST_S = 0.5  # for the last commands of the loop to be received
LEAD_S = 0.06  # of the references before their cycle: so long may Python stand still, and then the bridge opens
_LOOK_S = 0.005
_PATIENCE_S = 2.0  # at least, for the gate
_PHASE = 0.3  # of a cycle, from a measurement to the step of the controller: what the threads of a bridge need


class WatchedBus:
    """The bus of a rig, with an eye on the state that the node reports."""

    def __init__(self, bus: Bus, signal_map: SignalMap) -> None:
        self.bus, self._map, self.name = bus, signal_map, bus.name
        state = signal_map.state
        self._key = None if state is None else signal_map.measurements[state.message].key
        self._in_a_row = 0
        self.state = ""

    @property
    def failed(self) -> bool:
        """Whether several frames in a row say so: they are not checked here."""
        return self._in_a_row >= _FAILED_FRAMES

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame."""
        frame = self.bus.receive(timeout_s)
        if frame is not None and self._map.state is not None and (frame.id, frame.extended) == self._key:
            self.state = self._map.state.name_of(frame.data)
            self._in_a_row = self._in_a_row + 1 if self.state in self._map.state.failed else 0
        return frame

    def send(self, frame: Frame) -> None:
        """Send a frame of the loop; the record says when it left Python, not when the loop did it."""
        self.bus.send(changed(frame, monotonic_ns=0))


class BridgedBus:
    """The loop has a ring, and two threads of Python carry its frames to and from the bus of the rig."""

    def __init__(self, bus: WatchedBus) -> None:
        self.transport = RingTransport()
        self._bus = bus
        self._bridge: BusBridge | None = None
        self._prompt = _prompt_threads()

    @property
    def error(self) -> BaseException | None:
        """What ended the bridge."""
        return None if self._bridge is None else self._bridge.error

    @property
    def counters(self) -> dict[str, int]:
        """None: the bus of the rig counts."""
        return {}

    def look(self, report: Callable[[], Mapping[str, Any]]) -> None:
        """Do nothing: the threads of the bridge do."""

    def __enter__(self) -> Self:
        self._prompt.__enter__()
        self._bridge = BusBridge(self._bus, self.transport)
        return self

    def __exit__(self, *_: object) -> None:
        if self._bridge is not None:
            self._bridge.close()
        self._prompt.__exit__(None, None, None)


class SocketBus:
    """The loop has its own raw socket, and the bus of the rig receives and records what passes between loop and node.

    Commands that the rig receives are those of the loop: its claim to them rests. Another sender shows itself at the
    socket of the loop: it never receives its own frames, and lets nothing pass but commands and what the loop reads.
    """

    def __init__(
        self,
        bus: WatchedBus,
        channel: str,
        *,
        command: LoopMessage,
        measurements: Sequence[LoopMessage],
        transmits: bool,
    ) -> None:
        self._bus = bus
        self._ours = (command.can_id, command.extended) if transmits else None
        filters = [(one.can_id, _ALL_BITS[one.extended], one.extended) for one in (command, *measurements)]
        self.transport = SocketCanTransport(channel, filters=filters)
        self.error: BaseException | None = None
        self._received = 0
        self._foreign: int | None = None

    @property
    def counters(self) -> dict[str, int]:
        """How many commands of the loop were received, and so recorded."""
        return {"commands_heard": self._received}

    def look(self, report: Callable[[], Mapping[str, Any]]) -> None:
        """Take and record all that came; from the second time on another sender of our commands is an error."""
        while self._receive(0.0):
            pass
        if self._ours is None:
            return
        counts = report()
        # Counted in this order, an error frame is never taken for a frame of another sender.
        foreign = counts["frames"]["foreign"] - counts["bus"]["error_frames"]
        if self._foreign is None:  # before, the last safe frames of the rig itself may have been among them
            self._foreign = foreign
        elif foreign > self._foreign and self.error is None:
            self.error = two_senders(self._bus.name, self._ours[0])

    def __enter__(self) -> Self:
        if self._ours is not None:
            self._bus.bus.claim(set())
            if isinstance(self._bus.bus, RecordedBus):
                self._bus.bus.sent_elsewhere = frozenset({self._ours})
        return self

    def __exit__(self, *_: object) -> None:
        until = time.monotonic() + _LAST_S
        with held_back():
            while self._received < self.transport.counts["sent"] and (left_s := until - time.monotonic()) > 0.0:
                if not self._receive(left_s):
                    break

    def _receive(self, timeout_s: float) -> bool:
        """Take a frame; whether one came."""
        try:
            frame = self._bus.receive(timeout_s)
        except RigError as error:
            self.error = self.error or error
            return False
        if frame is not None and (frame.id, frame.extended) == self._ours:
            self._received += 1
        return frame is not None


@contextmanager
def _prompt_threads() -> Iterator[None]:
    """Let threads of Python take turns ten times as often: two of them stand between the loop and its bus."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(min(before, _SWITCH_S))
    try:
        yield
    finally:
        sys.setswitchinterval(before)


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
        self._references_deg, self._handed_over = wanted, 1
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
            # The grid of the loop shall lie soon behind the measurements: their age is dead time.
            behind_s = (time.monotonic_ns() - came_ns) * 1e-9 - _PHASE * self._sample_s
            time.sleep(-behind_s % self._sample_s)
            try:
                with self.loop:
                    try:
                        self.loop.arm(self._patience_s)
                        self._feed()
                        self.loop.drive(self._patience_s)
                    except RigError as error:
                        self._take()
                        raise self.bus.error or error from None
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

    def _follow(self) -> None:
        while self.samples.done < len(self._references_deg):
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
            places = np.minimum(np.arange(begin, begin + room), len(self._references_deg) - 1)
            self.loop.queue_references(self._references_deg[places])
            self._handed_over += room

    def _take(self) -> None:
        with held_back():  # Ctrl-C between two rows would tear a hole into the record
            self.bus.look(self.loop.report)
            events = self.loop.events()
            self.changes.update(change.reason for change in events)
            self._record.say(said_of(events))
            self.samples.take(self.loop.sample_columns())
