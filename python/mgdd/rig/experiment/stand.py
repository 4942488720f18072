"""The plant of an experiment in its mode, with its guard in front, and the observers of its cycles."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, NamedTuple, Self

from mgdd.errors import RigError
from mgdd.loop import Measurement, Plant
from mgdd.optimize import Limit
from mgdd.rig.base import ActuatorGuard, AroundPlant, SimulatedRig
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.processes import VirtualNode
from mgdd.rig.can.transport import Bus, CanTransport
from mgdd.rig.exchange import TABLE, RecordingRig, ReplayRig, RigRecord
from mgdd.rig.experiment.checked import CheckedExperiment, simulated_plant
from mgdd.rig.experiment.engine_tasks import MapPlan, SeekPlan
from mgdd.rig.experiment.tasks import compared
from mgdd.rig.recorder import RecordedBus, Recorder
from mgdd.rig.safety import GatedThrottle, SafetyGate, said_of


class RunRecord:
    """Takes what happens in a run: to a file, if there is one, and to a list of events."""

    def __init__(self, file: Path | None, checked: CheckedExperiment) -> None:
        self.events: list[str] = []
        self.began = False
        header = {"experiment": checked.experiment.to_toml(), **checked.to_dict()}
        self.recorder = None if file is None else Recorder(file, config=header)
        self._names: tuple[str, ...] = ()
        self._missed: set[str] = set()

    def row(self, row: Mapping[str, float]) -> None:
        """Append an exchange; the first one says the names, what a later one lacks is NaN."""
        if self.recorder is None:
            return
        if not self._names:
            # What a rig applied may be missing at first: it has its place from the start.
            late = [name.replace("input.", "applied.", 1) for name in row if name.startswith("input.")]
            self._names = tuple(dict.fromkeys((*row, *late)))
        new = sorted(set(row).difference(self._names, self._missed))
        if new:
            self._missed.update(new)
            self.say([f"record: {', '.join(new)} came after the first cycle and has no column"])
        self.recorder.sample(TABLE, {name: row.get(name, math.nan) for name in self._names})

    def say(self, events: Iterable[str]) -> None:
        """Append events."""
        for event in events:
            self.events.append(event)
            if self.recorder is not None:
                category, _, text = event.partition(": ")
                self.recorder.event(category, text)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        if self.recorder is not None:
            self.began = self.recorder.written > 0
            self.recorder.__exit__(kind, error, trace)


_STEP_TIMEOUT_S = 10.0  # a node that steps has no clock: only its end is waited for


class Cycle(NamedTuple):
    """One cycle of a plant."""

    number: int  # from 0 on
    asked: Mapping[str, float]
    measured: Measurement
    thinking_s: float  # from the measurement before to these inputs
    waiting_s: float  # from the inputs to this measurement


class Watched(AroundPlant):
    """A plant whose cycles are reported to a listener, with the time that they took."""

    def __init__(self, plant: Plant, listener: Callable[[Cycle], None]) -> None:
        super().__init__(plant)
        self._listener = listener
        self.cycles = 0
        self._asked: Mapping[str, float] = {}
        self._measured_s = self._applied_s = time.perf_counter()

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Pass the inputs on."""
        self._asked = dict(inputs)
        self._applied_s = time.perf_counter()
        self.plant.apply(inputs)

    def measure(self) -> Measurement:
        """Pass the measurement back, and report it to the listener."""
        measured = self.plant.measure()
        now = time.perf_counter()
        cycle = Cycle(self.cycles, self._asked, measured, self._applied_s - self._measured_s, now - self._applied_s)
        self.cycles += 1
        self._listener(cycle)
        self._measured_s = time.perf_counter()
        return measured


@contextmanager
def own_node(checked: CheckedExperiment, *, truth: str | os.PathLike[str] | None = None) -> Iterator[str]:
    """Start hub and node with the plant of the experiment, give what their bus is called, and end them."""
    if checked.signal_map is None:
        raise RigError("a node needs the map of a bus")
    with TemporaryDirectory(prefix="mgdd-node-") as folder:
        file = Path(folder) / "experiment.toml"
        file.write_text(checked.experiment.with_files(lambda path: str(path.resolve())).to_toml(), encoding="utf-8")
        with VirtualNode(
            checked.signal_map.file.resolve(),
            step=checked.experiment.bus.pace == "step",
            truth=truth,
            sample_ms=None if checked.sample_s is None else checked.sample_s * 1e3,
            experiment=file,
        ) as node:
            yield node.bus


@dataclass(frozen=True, kw_only=True)
class Stand:
    """A plant that is open and guarded."""

    plant: Plant
    counters: Callable[[], dict[str, Any]]
    events: Callable[[], list[str]]  # once each, what guard or gate had to say
    start: Callable[[], float]  # brings the guard into service; gives the angle or timing there
    left: Callable[[], int | None]  # how many cycles there can be at most; None without an end


@contextmanager
def opened_rig(
    checked: CheckedExperiment, recorder: Recorder | None, *, arm: bool, key_file: str | os.PathLike[str] | None
) -> Iterator[Any]:
    """Open the rig of an experiment in its mode, where need be with a node of our own; every frame goes to the record.

    It is left safe, in whatever way the block ends.
    """
    experiment, mode = checked.experiment, checked.experiment.mode
    with ExitStack() as stack:
        if mode == "simulate":
            rig: Any = SimulatedRig(simulated_plant(experiment, sample_s=checked.sample_s, inputs=("duty",)))
        elif checked.recorded is not None:
            rig = ReplayRig(RigRecord.of_run(checked.recorded, f"{checked.record}"), strict=False)
        else:
            bus: Bus = CanTransport.parse(experiment.bus.connection or stack.enter_context(own_node(checked)))
            if recorder is not None:
                bus = RecordedBus(bus, recorder)
            given_ms = experiment.bus.timeout_ms
            timeout_s = given_ms * 1e-3 if given_ms else _STEP_TIMEOUT_S if experiment.bus.pace == "step" else None
            rig = CanRig(
                checked.bus_map, bus, mode=mode, timeout_s=timeout_s, arm=arm, key_file=key_file,
                limits=experiment.limit_names or None,
            )  # fmt: skip
        yield stack.enter_context(rig)


def guarded(checked: CheckedExperiment, rig: Any, record: RunRecord) -> Stand:
    """Put the guard of an experiment before its rig; every exchange below it goes into the record."""
    recorded = RecordingRig(rig, record.row, keep=False)

    def counters() -> dict[str, Any]:
        counts: dict[str, Any] = dict(getattr(rig, "counters", {}))
        if isinstance(rig, ReplayRig):
            sizes = [(difference.sample, abs(difference.asked - difference.recorded)) for difference in rig.differences]
            counts["replay"] = compared(rig.sample, len(rig.record), sizes)
        return counts

    def left() -> int | None:
        return len(rig.record) - rig.sample if isinstance(rig, ReplayRig) else None

    if checked.envelope is not None:
        gate = SafetyGate(checked.envelope)
        safe = GatedThrottle(recorded, gate, shadow=checked.experiment.mode in ("dry_run", "replay"))
        return Stand(
            plant=safe,
            counters=lambda: {**counters(), "gate": gate.counts},
            events=lambda: said_of(gate.drain()),
            start=safe.start,
            left=left,
        )
    plan, safety = checked.plan, checked.experiment.safety
    if not isinstance(plan, SeekPlan | MapPlan):
        raise TypeError(f"{type(plan).__name__} without an envelope")
    guard = ActuatorGuard(
        recorded,
        start=plan.start,
        bounds=plan.bounds,
        rates={"soc_cad": safety.rate_cad, **safety.rates} if "soc_cad" in plan.start else safety.rates,
        limits=[Limit(name, upper) for name, upper in safety.limits.items()],
    )
    reported = 0

    def new_events() -> list[str]:
        nonlocal reported
        log, reported_before = guard.log, reported
        reported = len(log)
        return [
            f"guard: cycle {e.cycle}: {e.reason} {e.name}: {dict(e.asked)} -> {dict(e.applied)}"
            for e in log[reported_before:]
        ]

    return Stand(
        plant=guard,
        counters=lambda: {**counters(), "guard": guard.counts},
        events=new_events,
        start=lambda: next(iter(plan.start.values())),
        left=left,
    )
