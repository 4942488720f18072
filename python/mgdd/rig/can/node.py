"""A node as a bus of this process, or as a process: with its own clock or step by step, and a log of the truth."""

from __future__ import annotations

import contextlib
import csv
import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any, Self

from mgdd._core.rig import Frame
from mgdd.errors import ParameterError, RigError
from mgdd.loop import Plant, ThrottleFault, VirtualEngine, VirtualThrottle
from mgdd.rig.can.hub import fault_of
from mgdd.rig.can.node_core import NodeCore, NodePlant, node_plant
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import Bus, changed

_STEP_POLL_S = 0.1  # how often a waiting node looks for its parent
_MOST_BEHIND_S = 1.0
_FAULT_KEYS = {"from_s": float, "until_s": float, "size": float, "sensor": int}


class LocalBus:
    """A plant behind a node in this process: every command frame brings one sample.

    The same checks, roundings and limits as over a real bus, faster than real time and always with the same bits.
    """

    name = "the node in this process"
    shared = False  # no other node, and time is virtual

    def __init__(self, plant: Plant, signal_map: SignalMap) -> None:
        self.core = NodeCore(node_plant(plant), signal_map)
        self._answers: deque[Frame] = deque()
        self._now_ns = 1
        self._is_open = False

    def open(self) -> None:
        """Connect."""
        self._is_open = True

    def close(self) -> None:
        """Disconnect."""
        self._is_open = False
        self._answers.clear()

    def claim(self, keys: set[tuple[int, bool]]) -> None:
        """Nobody else sends here."""

    def send(self, frame: Frame, *, final: bool = False) -> None:  # noqa: ARG002 - there are no faults to pass
        """Give a frame to the node."""
        self._require_open()
        if self.core.take(changed(frame, monotonic_ns=self._now_ns, received=True)):
            self._now_ns += round(self.core.map.cycle_s * 1e9)
            self._answers += [
                changed(answer, monotonic_ns=self._now_ns, received=True) for answer in self.core.answer()
            ]

    def receive(self, timeout_s: float) -> Frame | None:  # noqa: ARG002 - time stands still
        """Give the next frame of the node; None where it has none."""
        self._require_open()
        return self._answers.popleft() if self._answers else None

    def _require_open(self) -> None:
        if not self._is_open:
            raise RigError(f"{self.name} is not open: use the rig in a with block")


class TruthLog:
    """What really happened: the gate and all that the plant knows, line by line, and a killed process loses none."""

    def __init__(self, file: str | os.PathLike[str]) -> None:
        self._file: IO[str] = Path(file).open("w", encoding="utf-8", newline="", buffering=1)  # noqa: SIM115 close()
        self._writer: Any = None
        self._names: list[str] = []

    def write(self, core: NodeCore, now_ns: int) -> None:
        """Write the last sample of a node."""
        if core.last is None:
            return
        values = dict(core.last.values)
        if self._writer is None:
            if not values:
                return  # an engine that does not run yet
            self._names = list(values)
            self._writer = csv.writer(self._file)
            heads = [f"applied_{name}" for name in core.plant.input_names]
            self._writer.writerow(["monotonic_ns", "mode", "driven", "reason", *heads, *self._names])
        applied = [core.last.applied.get(name, "") for name in core.plant.input_names]
        row = [values.get(name, "") for name in self._names]
        self._writer.writerow([now_ns, core.gate.mode, int(core.driven), core.gate.reason, *applied, *row])

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def node_of(
    signal_map: SignalMap,
    *,
    faults: Sequence[str] = (),
    seed: int = 0,
    sample_s: float | None = None,
) -> NodePlant:
    """Make the virtual plant of the inputs of a map, a throttle for ``duty``, an engine for ``soc_cad``."""
    names = signal_map.input_names
    if "duty" in names:
        parsed = [ThrottleFault(kind=kind, **given) for kind, given in (fault_of(text, _FAULT_KEYS) for text in faults)]
        plant = VirtualThrottle(
            inputs=(*names, "bridge_open"),
            faults=parsed,
            sample_s=signal_map.cycle_s if sample_s is None else sample_s,
            seed=seed,
        )
        return node_plant(plant)
    if faults:
        raise ParameterError.of("fault", faults[0], "left out: only a throttle has faults of its own")
    if names == ("soc_cad",):
        limits = [name for name in ("cov_imep_percent", *signal_map.limits) if name in signal_map.value_names]
        return node_plant(VirtualEngine(limits=limits, seed=seed))
    raise ParameterError.of(
        "inputs of the map", ", ".join(names), "those of a virtual throttle (duty) or engine bench (soc_cad)"
    )


def run_node(
    core: NodeCore,
    bus: Bus,
    *,
    step: bool = False,
    period_s: float | None = None,
    log: TruthLog | None = None,
    keep_on: Callable[[], bool] = lambda: True,
) -> None:
    """Serve an open bus until `keep_on`, asked once per sample and every 0.1 s of waiting, says no.

    However it ends, by an error too, the bridge of a driven plant is opened first, and that is reported and logged.

    Parameters
    ----------
    core, bus, log, keep_on
        The node, its bus, and where every sample is written.
    step : bool
        Every complete command brings one sample, and time stands still between; else the node has its own clock.
    period_s : float, optional
        Time between two samples [s]; the cycle of the trigger message if left out.
    """
    try:
        if step:
            while keep_on():
                frame = bus.receive(_STEP_POLL_S)
                if frame is None or not core.take(frame):
                    continue
                was_driven = core.driven
                for answer in core.answer():
                    bus.send(answer)
                if log is not None and (core.driven or was_driven):  # also why the drive was taken away
                    log.write(core, frame.monotonic_ns)
        else:
            _run_clock(core, bus, period_s, log, keep_on)
    finally:
        _let_go(core, bus, log)


def _let_go(core: NodeCore, bus: Bus, log: TruthLog | None) -> None:
    """Open the bridge of a driven plant; what hinders the report of it is not the news."""
    if not core.driven:
        return
    frames = core.let_go()
    with contextlib.suppress(OSError, ValueError):  # a full disk, a closed file
        if log is not None:
            log.write(core, time.monotonic_ns())
    with contextlib.suppress(RigError):
        for frame in frames:
            bus.send(frame, final=True)


def _run_clock(
    core: NodeCore, bus: Bus, period_s: float | None, log: TruthLog | None, keep_on: Callable[[], bool]
) -> None:
    period_ns = round((core.map.cycle_s if period_s is None else period_s) * 1e9)
    ParameterError.unless(period_ns >= 100000, "period_s", period_s, ">= 1e-4 s")
    next_ns = time.monotonic_ns() + period_ns
    known_ns = 0  # until when the node is known to have stood still
    while keep_on():
        while (left_ns := next_ns - time.monotonic_ns()) > 0:
            frame = bus.receive(left_ns * 1e-9)
            if frame is not None:
                core.take(frame, time.monotonic_ns())
        while time.monotonic_ns() < next_ns + period_ns and (frame := bus.receive(0.0)) is not None:
            core.take(frame, time.monotonic_ns())
        while True:  # a late node catches up in silence: the plate moves, whether somebody looks or not
            now_ns, since_ns = time.monotonic_ns(), max(next_ns, known_ns)
            if now_ns - since_ns > core.patience_s * 1e9:
                core.stood_still(since_ns, now_ns)
                known_ns = now_ns
                next_ns = max(next_ns, now_ns - round(_MOST_BEHIND_S * 1e9))
            frames = core.sample(next_ns)
            if log is not None:
                log.write(core, next_ns)
            next_ns += period_ns
            if next_ns > time.monotonic_ns():
                break
        for frame in frames:
            bus.send(frame)


def parent_watch() -> Callable[[], bool]:
    """Return a function that says whether the process that started this one still lives."""
    parent = os.getppid()
    return lambda: os.getppid() == parent
