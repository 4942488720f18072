"""The other side of the bus, without a process: commands in, one sample of the plant, measurement frames out.

It trusts nobody: counter and CRC of every command are checked here, and a command that stops to come, or comes
broken, takes the drive away. Then the host has to arm it again with safe frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from mgdd._core.rig import Frame
from mgdd.errors import ParameterError
from mgdd.loop import Plant, VirtualThrottle
from mgdd.rig.can.link import Receiver, Sender
from mgdd.rig.can.mapped import MappedMessage, MappedSignal
from mgdd.rig.can.signal_map import SignalMap

__all__ = ["NodeCore", "NodePlant", "Sampled", "node_plant"]

_ARMING_FRAMES = 3  # safe commands in a row that arm it


class Sampled(NamedTuple):
    """One sample of a plant behind a bus."""

    values: Mapping[str, float]
    applied: Mapping[str, float]


class NodePlant(Protocol):
    """A plant that can be driven or left alone."""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Inputs that commands may carry."""
        ...

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        """Run one sample; None: without drive."""
        ...


class _Throttle:
    """A throttle: without drive the bridge is open, and the springs move the plate to limp-home."""

    def __init__(self, plant: VirtualThrottle) -> None:
        self._plant = plant
        self.input_names = tuple(name for name in plant.input_names if name != "bridge_open")

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        given = dict.fromkeys(self.input_names, 0.0) if inputs is None else dict(inputs)
        if inputs is None and "supply_v" in given:
            given["supply_v"] = self._plant.throttle.supply_v
        self._plant.apply({**given, "bridge_open": float(inputs is None)})
        return Sampled(values=self._plant.measure().values, applied=given)


class _Cyclic:
    """An engine: without drive there is no cycle, and nothing is measured."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self.input_names = tuple(plant.input_names)

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        if inputs is None:
            return Sampled(values={}, applied={})
        self._plant.apply(inputs)
        measured = self._plant.measure()
        return Sampled(values={**measured.limits, **measured.values}, applied={**inputs, **measured.applied})


def node_plant(plant: Plant) -> NodePlant:
    """Put a plant of the loop behind a node.

    Parameters
    ----------
    plant : mgdd.loop.Plant
        A throttle must have ``bridge_open`` among its inputs.

    Returns
    -------
    NodePlant
        What a node drives.

    Raises
    ------
    mgdd.errors.ParameterError
        A throttle whose bridge cannot be opened.
    """
    if not isinstance(plant, VirtualThrottle):
        return _Cyclic(plant)
    if "bridge_open" not in plant.input_names:
        raise ParameterError.of(
            "inputs of the throttle", list(plant.input_names), "with 'bridge_open': power off means an open bridge"
        )
    return _Throttle(plant)


class NodeCore:
    """State machine of a node: init, armed, run, limp.

    Parameters
    ----------
    plant : NodePlant
        What it drives.
    signal_map : SignalMap
        Its messages.

    Raises
    ------
    mgdd.errors.ParameterError
        Inputs of the plant that no command carries, or the other way round.
    """

    def __init__(self, plant: NodePlant, signal_map: SignalMap) -> None:
        if set(plant.input_names) != set(signal_map.input_names):
            raise ParameterError.of(
                "inputs of the map",
                ", ".join(signal_map.input_names),
                f"those of the plant, {', '.join(plant.input_names)}",
            )
        self.plant, self.map = plant, signal_map
        self.state = "init"
        self.samples = 0
        self.last: Sampled | None = None
        self.reasons: dict[str, int] = {}
        self._receiver = Receiver(signal_map.commands)
        self._sender = Sender()
        self._inputs: dict[str, float] = {}
        self._said: dict[str, str] = {}  # by message: rest, drive or other
        self._fresh: set[str] = set()
        self._safe_frames = 0
        self._cyclic = {name: m for name, m in signal_map.commands.items() if m.timeout_s is not None}
        self._codes = {} if signal_map.state is None else dict(signal_map.state.signal.choices)
        trigger = signal_map.measurements[signal_map.trigger]
        last = [m for m in signal_map.measurements.values() if m is not trigger]
        self._order = [*last, trigger]

    @property
    def driven(self) -> bool:
        """Whether the plant is driven."""
        return self.state == "run"

    def take(self, frame: Frame) -> bool:
        """Take a frame of the bus.

        Parameters
        ----------
        frame : Frame
            With our stamp.

        Returns
        -------
        bool
            Whether with it every cyclic command has come since the last sample, usable or not: the tick of a node that
            runs step by step.
        """
        taken = self._receiver.take(frame)
        if taken is None:
            return False
        message = taken.message
        if taken.usable:
            self._use(message, frame.data)
        elif self.driven and not self._receiver.valid(message.name):
            self._limp("wrong_counter" if taken.status in ("repeated", "lost", "wrong_counter") else "wrong_crc")
        if taken.is_new:
            self._fresh.add(message.name)
        return taken.is_new and message.name in self._cyclic and self._fresh >= set(self._cyclic)

    def watch(self, now_ns: int) -> None:
        """Take the drive away where a command is late.

        Parameters
        ----------
        now_ns : int
            Monotonic time [ns].
        """
        for name, message in self._cyclic.items():
            age_s = (now_ns - self._receiver.stamps_ns.get(name, 0)) * 1e-9
            if self.driven and message.timeout_s is not None and age_s > message.timeout_s:
                self._limp("command_timeout")

    def sample(self) -> list[Frame]:
        """Run one sample and give the frames that report it, the trigger message last."""
        self.last = self.plant.sample(dict(self._inputs) if self.driven else None)
        return self._report(self.last)

    def answer(self) -> list[Frame]:
        """Answer a tick of a node that runs step by step: a sample while driven, else time stands still."""
        self._fresh.clear()
        if self.driven:
            return self.sample()
        return self._report(self.last or Sampled(values={}, applied={}))

    def _use(self, message: MappedMessage, payload: bytes) -> None:
        self._inputs.update(message.read(payload))
        if message.name not in self._cyclic:
            return
        rests, drives = message.rests(payload), message.drives(payload)
        self._said[message.name] = "rest" if rests else "drive" if drives else "other"
        said = [self._said.get(name) for name in self._cyclic]
        if all(word == "rest" for word in said):
            self._safe_frames += 1
            armed = self._safe_frames >= _ARMING_FRAMES * len(self._cyclic)
            if self.state == "run" or (self.state in ("init", "limp") and armed):
                self.state = "armed"
            return
        self._safe_frames = 0
        if self.state == "run" and "other" in said:  # a mode that this node does not have
            self.state = "armed"
        complete = set(self._inputs) >= set(self.map.input_names)
        if self.state == "armed" and complete and all(word == "drive" for word in said):
            self.state = "run"

    def _limp(self, reason: str) -> None:
        self.state = "limp"
        self._safe_frames = 0
        self.reasons[reason] = self.reasons.get(reason, 0) + 1

    def _report(self, sampled: Sampled) -> list[Frame]:
        own = {name: float(name in self.reasons) for name in ("command_timeout", "wrong_crc", "wrong_counter")}
        values = {**own, **sampled.values}
        frames: list[Frame] = []
        for message in self._order:
            if self.samples % self._every(message):
                continue
            raws: dict[str, Any] = {}
            state = self.map.state
            if state is not None and state.message == message.name:
                raws[state.signal.name] = self._codes.get(self.state, 0)
            known = _carried(message.signals, values)
            applied = _carried(message.applied, sampled.applied)
            frames += self._sender.frames(message, message.payloads(known, raws, applied))
        self.samples += 1
        return frames

    def _every(self, message: MappedMessage) -> int:
        """Return the number of samples between two frames of a message."""
        return max(1, round((message.message.cycle_s or self.map.cycle_s) / self.map.cycle_s))


def _carried(entries: Mapping[str, MappedSignal], values: Mapping[str, float]) -> dict[str, float]:
    """Give what the signals can carry: what is missing is NaN, or left at 0 where a signal has no NaN."""
    given = {name: float(values.get(name, math.nan)) for name in entries}
    return {
        name: value
        for name, value in given.items()
        if not math.isnan(value) or entries[name].signal.missing_raw is not None
    }
