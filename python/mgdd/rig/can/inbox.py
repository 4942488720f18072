"""What a host has received: frames become cycles, and the newest whole cycle a measurement."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

from mgdd._core.rig import Frame
from mgdd.loop import Measurement
from mgdd.rig.can.link import Receiver
from mgdd.rig.can.signal_map import SignalMap

__all__ = ["Inbox"]

_JUMPS = 3  # so many show another sender


class Inbox:
    """Checked frames, gathered until the trigger message ends their cycle."""

    def __init__(self, signal_map: SignalMap) -> None:
        self.map = signal_map
        self.skipped = 0  # whole cycles that nobody read before the next command
        self.state = ""  # that the node reported last
        self._receiver = Receiver(signal_map.measurements)
        self._cycles = 0
        self._whole: deque[tuple[int, Measurement]] = deque()  # with the arrival of its trigger [ns]
        self._values: dict[str, dict[str, float]] = {}
        self._applied: dict[str, float] = {}
        self._cycle_of: dict[str, int] = {}
        self._pending: dict[str, dict[str, float]] = {}
        self._pending_applied: dict[str, float] = {}

    @property
    def failed(self) -> bool:
        """Whether the node says that it does not follow its commands."""
        return self.map.state is not None and self.state in self.map.state.failed

    @property
    def unarmed(self) -> bool:
        """Whether the node says that it was never armed."""
        return self.map.state is not None and self.state == self.map.state.unarmed

    @property
    def answers(self) -> int:
        """How many trigger messages came, valid or not."""
        return self._receiver.seen.get(self.map.measurements[self.map.trigger].message.frame_id, 0)

    @property
    def counts(self) -> dict[str, dict[str, Any]]:
        """The checks by message."""
        return self._receiver.counts

    def take(self, frame: Frame) -> None:
        """Take a frame."""
        taken = self._receiver.take(frame)
        if taken is None or not taken.usable:
            return
        name = taken.message.name
        self._pending.setdefault(name, {}).update(taken.message.read(frame.data))
        self._pending_applied.update(taken.message.read_applied(frame.data))
        if self.map.state is not None and self.map.state.message == name:
            self.state = self.map.state.name_of(frame.data)
        if name == self.map.trigger:  # a cycle is whole: frames of the next one do not mix into it
            self._end_cycle(frame.monotonic_ns)

    @property
    def ready(self) -> bool:
        """Whether there is a whole cycle that nobody has read."""
        return bool(self._whole)

    def read(self) -> tuple[int, Measurement]:
        """Give the oldest whole cycle that nobody has read, and when it arrived [ns]."""
        return self._whole.popleft()

    def skip(self) -> None:
        """Note that nobody will read what came until now."""
        self.skipped += len(self._whole)
        self._whole.clear()

    def jumping(self) -> str:
        """Name a message whose alive counter does not count; empty where all do."""
        for name, checks in self.counts.items():
            jumps = checks.get("repeated", 0) + checks.get("lost", 0)
            if jumps >= _JUMPS and 2 * jumps > checks.get("ok", 0):
                return (
                    f"alive counter of {name} ({self.map.measurements[name].message.frame_id:#x}) jumps ({jumps} times)"
                )
        return ""

    def no_answer(self) -> str:
        """Say what came instead of a valid trigger message."""
        trigger = self.map.measurements[self.map.trigger].message
        wanted = f"{trigger.name} ({trigger.frame_id:#x})"
        seen = self._receiver.seen
        if trigger.frame_id in seen and self._receiver.valid(trigger.name):
            return (
                f"no new frame {wanted} came; those before were valid: the node stopped or was late, or this computer "
                "is too busy; a longer time limit (timeout_ms of the bus) waits for it"
            )
        if trigger.frame_id in seen:
            checks = {status: n for status, n in self.counts.get(trigger.name, {}).items() if n}
            return (
                f"{seen[trigger.frame_id]} frames {wanted} came, too few of them valid ({checks}): another data "
                "identifier, or two senders of it"
            )
        others = ", ".join(f"{identifier:#x}" for identifier in sorted(seen)) or "none"
        return f"no frame {wanted} came; identifiers seen: {others}"

    def _end_cycle(self, arrived_ns: int) -> None:
        for name, values in self._pending.items():
            self._values.setdefault(name, {}).update(values)
            self._cycle_of[name] = self._cycles
        self._applied.update(self._pending_applied)
        self._pending, self._pending_applied = {}, {}
        self._cycles += 1
        self._whole.append((arrived_ns, self._measurement()))

    def _measurement(self) -> Measurement:
        values: dict[str, float] = {}
        for name, message in self.map.measurements.items():
            known = self._values.get(name, {})
            age = self._cycles - 1 - self._cycle_of.get(name, -1)
            fresh = message.timeout_s is None or age <= math.ceil(message.timeout_s / self.map.cycle_s)
            values |= {key: known.get(key, math.nan) if fresh else math.nan for key in message.signals}
        return Measurement(
            components=tuple(weight * values[name] for name, weight in self.map.objective.items()),
            limits={name: values[name] for name in self.map.limits},
            misfire=values.get("misfire") == 1.0,
            values=values,
            applied={name: value for name, value in self._applied.items() if math.isfinite(value)},
        )
