"""Both ends of a protected exchange: a sender, a receiver, and the cycles and times of a host."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from mgdd._core.rig import E2eCheck, Frame, protect
from mgdd.errors import RigError
from mgdd.loop import Measurement
from mgdd.rig.can.mapped import MappedMessage
from mgdd.rig.can.signal_map import SignalMap

_JUMPS = 3  # so many show another sender
_REMEDY = "call arm() or enter the rig again"


class Taken(NamedTuple):
    """A frame that was checked."""

    message: MappedMessage
    status: str  # as `mgdd.rig.E2eCheck.push` says it; of an unprotected one ``ok`` or ``wrong_length``
    usable: bool  # whether its content may be used

    @property
    def is_new(self) -> bool:
        """Whether it is whole and not the last one again, usable or not."""
        return self.status in ("ok", "initial", "lost")


class Sender:
    """Stamps alive counter and CRC, each message with a counter of its own."""

    def __init__(self) -> None:
        self._counters: dict[str, int] = {}

    def frames(self, message: MappedMessage, payloads: Iterable[bytes]) -> list[Frame]:
        """Make frames of payloads, in the same order."""
        out = []
        for payload in payloads:
            whole = payload
            if message.e2e is not None:
                counter = self._counters.get(message.name, 0)
                whole = protect(message.e2e, counter, payload)
                self._counters[message.name] = message.e2e.next_counter(counter)
            where = message.message
            out.append(Frame(id=where.frame_id, data=whole, extended=where.extended, fd=len(whole) > 8))
        return out

    def go_on(self, message: MappedMessage, payload: bytes) -> None:
        """Go on from the alive counter of a frame that another sender sent."""
        if message.e2e is not None:
            byte, place = payload[message.e2e.counter_byte], message.e2e.counter_place
            counter = byte >> 4 if place == "high_nibble" else byte & 15 if place == "low_nibble" else byte
            if counter < message.e2e.counter_modulus:
                self._counters[message.name] = message.e2e.next_counter(counter)


class Receiver:
    """Checks the frames of some messages; what does not belong to them is counted as foreign."""

    def __init__(self, messages: Mapping[str, MappedMessage]) -> None:
        self._by_key = {message.key: message for message in messages.values()}
        self._checks = {name: E2eCheck(m.e2e) for name, m in messages.items() if m.e2e is not None}
        self._short: dict[str, int] = {}
        self.stamps_ns: dict[str, int] = {}  # of the last usable frame of each message
        self.seen: dict[int, int] = {}  # frames by identifier, foreign ones too

    def take(self, frame: Frame) -> Taken | None:
        """Check a frame; None for a foreign one."""
        self.seen[frame.id] = self.seen.get(frame.id, 0) + 1
        message = self._by_key.get((frame.id, frame.extended))
        if message is None:
            return None
        check = self._checks.get(message.name)
        if check is not None:
            status = check.push(frame.data)
            usable = status == "ok" and check.valid
        else:
            status = "ok" if len(frame.data) == message.message.size else "wrong_length"
            usable = status == "ok"
            self._short[message.name] = self._short.get(message.name, 0) + (not usable)
        if usable:
            self.stamps_ns[message.name] = frame.monotonic_ns
        return Taken(message, status, usable)

    def valid(self, name: str) -> bool:
        """Whether the frames of a message pass their check; True for an unprotected one."""
        check = self._checks.get(name)
        return check is None or check.valid

    def reset(self) -> None:
        """Forget what came; the counts stay."""
        self.stamps_ns.clear()
        for check in self._checks.values():
            check.reset()

    @property
    def counts(self) -> dict[str, dict[str, Any]]:
        """Frames by status, of each message that is checked or came too short."""
        protected = {name: dict(check.counts) for name, check in self._checks.items()}
        return {**{name: {"wrong_length": n} for name, n in self._short.items()}, **protected}


class Inbox:
    """Checked frames, gathered until the trigger message ends their cycle."""

    def __init__(self, signal_map: SignalMap) -> None:
        self.map = signal_map
        self.skipped = 0  # whole cycles that were not read before the next command
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
        """Whether there is an unread whole cycle."""
        return bool(self._whole)

    def read(self) -> tuple[int, Measurement]:
        """Give the oldest unread whole cycle, and when it arrived [ns]."""
        return self._whole.popleft()

    def skip(self) -> None:
        """Skip what came until now without reading it."""
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
        message = f"{trigger.name} ({trigger.frame_id:#x})"
        seen = self._receiver.seen
        if trigger.frame_id in seen and self._receiver.valid(trigger.name):
            return (
                f"no new frame {message} came; those before were valid: the node stopped or was late, or this computer "
                "is too busy; a longer time limit (timeout_ms of the bus) waits for it"
            )
        if trigger.frame_id in seen:
            checks = {status: n for status, n in self.counts.get(trigger.name, {}).items() if n}
            return (
                f"{seen[trigger.frame_id]} frames {message} came, too few of them valid ({checks}): another data "
                "identifier, or two senders of it"
            )
        others = ", ".join(f"{identifier:#x}" for identifier in sorted(seen)) or "none"
        return f"no frame {message} came; identifiers seen: {others}"

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
            last_values = self._values.get(name, {})
            age = self._cycles - 1 - self._cycle_of.get(name, -1)
            fresh = message.timeout_s is None or age <= math.ceil(message.timeout_s / self.map.cycle_s)
            values |= {key: last_values.get(key, math.nan) if fresh else math.nan for key in message.signals}
        return Measurement(
            components=tuple(weight * values[name] for name, weight in self.map.objective.items()),
            limits={name: values[name] for name in self.map.limits},
            misfire=values.get("misfire") == 1.0,
            values=values,
            applied={name: value for name, value in self._applied.items() if math.isfinite(value)},
        )


class Punctual:
    """Refuses commands and measurements that come too late: the node has let go, and has to be armed again."""

    def __init__(self, signal_map: SignalMap, bus: str, timeout_s: float) -> None:
        limits = [m.timeout_s for m in signal_map.commands.values() if m.timeout_s is not None]
        self._command_s = min(limits, default=math.inf)
        self._let_go_s = self._command_s + signal_map.cycle_s  # by then the node has looked at the time
        self._measured_s = max(timeout_s, self._command_s)
        self._bus = bus
        self._driven_ns: int | None = None
        self.is_timed = False  # a node without a clock steps, and waits for every command

    def commanded(self) -> None:
        """Note that a command of a driven node has left."""
        self._driven_ns = time.monotonic_ns()

    def armed_again(self) -> None:
        """Forget the commands before a handshake."""
        self._driven_ns = None

    def require_command(self) -> None:
        """Refuse a command after a time in which the node has let go."""
        if not self.is_timed or self._driven_ns is None:
            return
        late_s = (time.monotonic_ns() - self._driven_ns) * 1e-9
        if late_s > self._let_go_s:
            raise RigError(
                f"{self._bus}: {late_s * 1e3:.0f} ms since the last command, the time limit is "
                f"{self._command_s * 1e3:g} ms: the node has let go; {_REMEDY}"
            )

    def require_measurement(self, arrived_ns: int) -> None:
        """Refuse a measurement that waited for longer than it may take."""
        age_s = (time.monotonic_ns() - arrived_ns) * 1e-9
        if self.is_timed and age_s > self._measured_s:
            raise RigError(
                f"{self._bus}: the measurement is {age_s * 1e3:.0f} ms old, the limit is {self._measured_s * 1e3:g} "
                f"ms: this process or the bus stood still; {_REMEDY}"
            )
