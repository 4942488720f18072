"""A node as a process: a virtual plant behind a bus, with its own clock or step by step, and a log of the truth."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from mgdd.errors import ParameterError
from mgdd.loop import EngineBench, ThrottleFault, VirtualThrottle
from mgdd.rig.can.fault_text import fault_of
from mgdd.rig.can.frame import Bus
from mgdd.rig.can.node_core import NodeCore
from mgdd.rig.can.node_plant import NodePlant, node_plant
from mgdd.rig.can.signal_map import SignalMap

__all__ = ["TruthLog", "node_of", "parent_watch", "run_node"]

_STEP_POLL_S = 0.1  # how often a waiting node looks for its parent
_MOST_BEHIND_S = 1.0
_FAULT_KEYS = {"from_s": float, "until_s": float, "size": float, "sensor": int}


class TruthLog:
    """What really happened, a line per sample: time, mode and reason of the gate, and all that the plant knows.

    Parameters
    ----------
    file : path-like
        CSV file, written line by line, so that a killed process loses none.
    """

    def __init__(self, file: str | os.PathLike[str]) -> None:
        self._file: IO[str] = Path(file).open("w", encoding="utf-8", newline="", buffering=1)  # noqa: SIM115 close()
        self._writer: Any = None
        self._names: list[str] = []

    def write(self, core: NodeCore, now_ns: int) -> None:
        """Write the last sample of a node.

        Parameters
        ----------
        core : NodeCore
            After its sample.
        now_ns : int
            Monotonic time [ns].
        """
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()


def node_of(
    signal_map: SignalMap,
    *,
    faults: Sequence[str] = (),
    seed: int = 0,
    sample_s: float | None = None,
) -> NodePlant:
    """Make the virtual plant that belongs to the inputs of a map.

    Parameters
    ----------
    signal_map : SignalMap
        With the input ``duty`` it is a throttle, with ``soc_cad`` an engine bench.
    faults : sequence of str
        Of a throttle, as ``KIND:KEY=VALUE,...`` with the kinds and keys of `mgdd.loop.ThrottleFault`.
    seed : int
        Of its noise.
    sample_s : float, optional
        Time between two samples of a throttle [s]; the cycle of the trigger message if left out.

    Returns
    -------
    NodePlant
        Throttle or engine.

    Raises
    ------
    mgdd.errors.ParameterError
        Inputs of no virtual plant, or a fault that is not known.
    """
    names = signal_map.input_names
    if "duty" in names:
        known = [_plant_fault(text) for text in faults]
        plant = VirtualThrottle(
            inputs=(*names, "bridge_open"),
            faults=known,
            sample_s=signal_map.cycle_s if sample_s is None else sample_s,
            seed=seed,
        )
        return node_plant(plant)
    if faults:
        raise ParameterError.of("fault", faults[0], "left out: only a throttle has faults of its own")
    if names == ("soc_cad",):
        wanted = [name for name in ("cov_imep_percent", *signal_map.limits) if name in signal_map.value_names]
        return node_plant(EngineBench(limits=wanted, seed=seed))
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
    """Serve a bus until `keep_on` says no.

    Parameters
    ----------
    core : NodeCore
        The node.
    bus : Bus
        Open.
    step : bool
        Every complete command brings one sample, and time stands still between; else the node has its own clock.
    period_s : float, optional
        Time between two samples [s]; the cycle of the trigger message if left out.
    log : TruthLog, optional
        Where every sample is written.
    keep_on : callable
        Asked once per sample, and every 0.1 s of waiting.

    Raises
    ------
    mgdd.errors.RigError
        A fault of the bus.
    """
    if step:
        _run_steps(core, bus, log, keep_on)
        return
    period_ns = round((core.map.cycle_s if period_s is None else period_s) * 1e9)
    if period_ns < 100_000:
        raise ParameterError.of("period_s", period_s, ">= 1e-4 s")
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


def _run_steps(core: NodeCore, bus: Bus, log: TruthLog | None, keep_on: Callable[[], bool]) -> None:
    while keep_on():
        frame = bus.receive(_STEP_POLL_S)
        if frame is None or not core.take(frame):
            continue
        was_driven = core.driven
        for answer in core.answer():
            bus.send(answer)
        if log is not None and (core.driven or was_driven):  # also why the drive was taken away
            log.write(core, frame.monotonic_ns)


def parent_watch() -> Callable[[], bool]:
    """Return a function that says whether the process that started this one still lives."""
    parent = os.getppid()
    return lambda: os.getppid() == parent


def _plant_fault(text: str) -> ThrottleFault:
    kind, given = fault_of(text, _FAULT_KEYS)
    return ThrottleFault(kind=kind, **given)
