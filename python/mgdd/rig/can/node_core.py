"""The other side of the bus, without a process: commands in, one sample of the plant, measurement frames out.

It trusts nobody: counter and CRC of every command are checked here, and what leaves for the plant passes the safety
gate of the node. After the gate took the drive away, the host has to arm the node again with safe frames. A node that
stood still longer than its limits allow trusts nothing that waited meanwhile. Another sender of a frame that only the
node sends is a fault of the bus: it lets go, and can be armed again. What the plant does not measure is never sent as a
number.
"""

from __future__ import annotations

import copy
import logging
import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from mgdd._core.rig import Frame
from mgdd.errors import ParameterError
from mgdd.loop import Plant, VirtualEngine, VirtualTestBed, VirtualThrottle
from mgdd.rig.can.link import Receiver, Sender
from mgdd.rig.can.mapped import MappedMessage, MappedSignal
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.safety import SafetyEnvelope, SafetyGate, facts_of

_LOG = logging.getLogger(__name__)
_ARMING_FRAMES = 3  # safe commands in a row that arm it
_OWN = ("command_timeout", "wrong_crc", "wrong_counter")  # values of the node, not of its plant
_COUNTER_ERRORS = ("repeated", "lost", "wrong_counter")


class Sampled(NamedTuple):
    """One sample of a plant behind a bus."""

    values: Mapping[str, float]
    applied: Mapping[str, float]


class NodePlant(Protocol):
    """A plant that can be driven or left alone."""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Inputs that commands may carry."""

    @property
    def sample_s(self) -> float | None:
        """Time in the plant per sample [s]; None: that of the map."""

    def value_names(self, inputs: Mapping[str, float]) -> tuple[str, ...] | None:
        """Give the names of what it measures at some inputs, and take no time; None where only a sample shows them."""

    def facts(self, envelope: SafetyEnvelope) -> dict[str, Any]:
        """Tell a gate what the sensors say, as `mgdd.rig.SafetyGate.observe` takes it; no time passes."""

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        """Run one sample; None: without drive."""


class _Throttle:
    """A throttle: without drive the bridge is open, and the springs move the plate to limp-home."""

    def __init__(self, plant: VirtualThrottle) -> None:
        self._plant = plant
        self._values: Mapping[str, float] | None = None
        self.input_names = tuple(name for name in plant.input_names if name != "bridge_open")
        self.sample_s: float | None = plant.sample_s

    def value_names(self, inputs: Mapping[str, float]) -> tuple[str, ...]:  # noqa: ARG002 - a throttle always measures
        return tuple(self._latest_values())

    def facts(self, envelope: SafetyEnvelope) -> dict[str, Any]:
        return facts_of(self._latest_values(), envelope.cycle_s)

    def _latest_values(self) -> Mapping[str, float]:
        if self._values is None:  # nothing was sampled yet: a look ahead, taken back
            before = self._plant.state
            self.sample(None)
            self._plant.state = before
        return self._values or {}

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        given = dict.fromkeys(self.input_names, 0.0) if inputs is None else dict(inputs)
        if inputs is None and "supply_v" in given:
            given["supply_v"] = self._plant.throttle.supply_v
        self._plant.apply({**given, "bridge_open": float(inputs is None)})
        self._values = self._plant.measure().values
        return Sampled(values=self._values, applied=given)


class _Cyclic:
    """An engine: only a driven one runs, cycle by cycle; one that stands has nothing to measure."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self.input_names = tuple(plant.input_names)
        self.sample_s: float | None = None

    def value_names(self, inputs: Mapping[str, float]) -> tuple[str, ...] | None:
        if not isinstance(self._plant, VirtualEngine | VirtualTestBed):
            return None  # to run a plant of somebody else may cost more than time
        ahead = _Cyclic(copy.deepcopy(self._plant))
        return tuple(ahead.sample(inputs).values)

    def facts(self, envelope: SafetyEnvelope) -> dict[str, Any]:
        # No plate to look at: given one in mid-travel, the same gate judges commands alone. An `ActuatorGuard` needs
        # bounds and limits, which the experiment of the host has and the node has not.
        half_v = 0.5 * envelope.sensor_sum_v
        middle_deg = 0.5 * (envelope.closed_deg + envelope.open_deg)
        return {"good_frames": 1, "age_s": 0.0, "sensor_v": (half_v, half_v), "angle_deg": middle_deg}

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        if inputs is None:
            return Sampled(values={}, applied={})
        self._plant.apply(inputs)
        measured = self._plant.measure()
        return Sampled(values={**measured.limits, **measured.values}, applied={**inputs, **measured.applied})


def node_plant(plant: Plant) -> NodePlant:
    """Put a plant of the loop behind a node; a throttle must have ``bridge_open`` among its inputs."""
    if not isinstance(plant, VirtualThrottle):
        return _Cyclic(plant)
    if "bridge_open" not in plant.input_names:
        raise ParameterError.of(
            "inputs of the throttle", list(plant.input_names), "with 'bridge_open': power off means an open bridge"
        )
    return _Throttle(plant)


class NodeCore:
    """What a node does: judge commands, ask its safety gate, sample the plant, report.

    Cycle and time limit of the gate come from plant and map; ParameterError where these do not fit each other.
    """

    def __init__(self, plant: NodePlant, signal_map: SignalMap, envelope: SafetyEnvelope | None = None) -> None:
        if set(plant.input_names) != set(signal_map.input_names):
            raise ParameterError.of(
                "inputs of the map",
                ", ".join(signal_map.input_names),
                f"those of the plant, {', '.join(plant.input_names)}",
            )
        self.plant, self.map = plant, signal_map
        self.samples = self.late = self.foreign = 0  # foreign: frames that only this node may send
        self.last: Sampled | None = None
        self._receiver = Receiver(signal_map.commands)
        self._sender = Sender()
        self._inputs: dict[str, float] = {}
        self._command_kinds: dict[str, str] = {}  # by message: rest, drive or other
        self._fresh: set[str] = set()
        self._good: Counter[str] = Counter()  # commands by message that the gate does not know of yet
        self._bad = 0
        self._bad_status = ""
        self._safe_frames = 0
        self._is_asked_to_arm = False
        self._troubles: set[str] = set()  # why the drive was taken away so far, as ETB_Diag names it
        self._timeouts_s = {name: m.timeout_s for name, m in signal_map.commands.items() if m.timeout_s is not None}
        self._own_keys = {message.key for message in signal_map.measurements.values()}
        self._second_sender = False
        middle = {name: 0.5 * (entry.lower + entry.upper) for name, entry in signal_map.inputs.items()}
        self._known_values = plant.value_names(middle)
        self._require_sayable()
        self._codes = {} if signal_map.state is None else signal_map.state.codes()
        trigger = signal_map.measurements[signal_map.trigger]
        last = [m for m in signal_map.measurements.values() if m is not trigger]
        self._order = [*last, trigger]
        cycle_s = signal_map.cycle_s if plant.sample_s is None else plant.sample_s
        self._limit_s = min(self._timeouts_s.values(), default=cycle_s)
        self.gate = SafetyGate(
            (SafetyEnvelope.load("etb_node") if envelope is None else envelope).replace(
                cycle_s=cycle_s, largest_age_cycles=max(self._limit_s / cycle_s, 1.0)
            )
        )
        self._deaf_until_ns = 0
        self._missed = 0  # samples, of a time in which the node stood still

    @property
    def driven(self) -> bool:
        """Whether the plant is driven."""
        return self.gate.mode == "run"

    @property
    def patience_s(self) -> float:
        """How long the node may stand still: the time limit of the commands, or as many samples as its gate allows."""
        envelope = self.gate.envelope
        return max(self._limit_s, envelope.missed_deadlines * envelope.cycle_s)

    def take(self, frame: Frame, now_ns: int | None = None) -> bool:
        """Take a frame; whether with it every cyclic command has come since the last sample, usable or not.

        That is the tick of a node that runs step by step. One with a clock gives the time: late frames are left out.
        """
        if (frame.id, frame.extended) in self._own_keys:
            self._second_sender = True
            self.foreign += 1
            return False
        if now_ns is not None and frame.monotonic_ns < max(self._deaf_until_ns, now_ns - round(self.patience_s * 1e9)):
            self.late += 1
            return False
        taken = self._receiver.take(frame)
        if taken is None:
            return False
        message = taken.message
        if taken.usable and not self._use(message, frame.data):
            self._bad += 1
            self._bad_status = "not_finite"
        elif not taken.usable and taken.status not in ("ok", "initial"):
            self._bad += 1
            self._bad_status = taken.status
        if taken.is_new:
            self._fresh.add(message.name)
        return taken.is_new and message.name in self._timeouts_s and self._fresh >= set(self._timeouts_s)

    def stood_still(self, since_ns: int, now_ns: int) -> None:
        """Note that the node did not run: a fault of the next sample, and what waited meanwhile is left out."""
        self._deaf_until_ns = now_ns
        self._missed = max(self._missed, int((now_ns - since_ns) * 1e-9 / self.gate.envelope.cycle_s))
        self._receiver.reset()
        for memory in (self._command_kinds, self._fresh, self._good):
            memory.clear()
        self._bad = self._safe_frames = 0
        self._is_asked_to_arm = False

    def sample(self, now_ns: int) -> list[Frame]:
        """Run one sample of a node with a clock; give the frames that report it, the trigger message last."""
        stamps = self._receiver.stamps_ns
        shares = [(now_ns - stamps.get(name, 0)) * 1e-9 / limit_s for name, limit_s in self._timeouts_s.items()]
        self.last = self.plant.sample(self._passed(max([0.0, *shares]) * self._limit_s))
        return self._report(self.last)

    def answer(self) -> list[Frame]:
        """Answer a tick of a node that runs step by step: a sample while driven, else time stands still.

        The clock of its gate counts ticks: commands that came are new, missing ones a cycle older.
        """
        self._fresh.clear()
        came = all(self._good[name] for name in self._timeouts_s)
        inputs = self._passed(0.0 if came else None)
        if inputs is not None:
            self.last = self.plant.sample(inputs)
        return self._report(self.last or Sampled(values={}, applied={}))

    def let_go(self) -> list[Frame]:
        """Open the bridge now; give the frames that report a sample without drive."""
        self.gate.abort()
        self.last = self.plant.sample(None)
        return self._report(self.last)

    def _use(self, message: MappedMessage, payload: bytes) -> bool:
        """Take the inputs; False where one is not finite. A duty that is not, the gate judges."""
        inputs = message.read(payload)
        if not all(math.isfinite(value) for name, value in inputs.items() if name != "duty"):
            return False
        self._inputs.update(inputs)
        if message.name not in self._timeouts_s:
            return True
        self._good[message.name] += 1
        rests, drives = message.rests(payload), message.drives(payload)
        self._command_kinds[message.name] = "rest" if rests else "drive" if drives else "other"
        self._safe_frames = self._safe_frames + 1 if self._all_say("rest") else 0
        if self._safe_frames >= _ARMING_FRAMES * len(self._timeouts_s):
            self._is_asked_to_arm = True
        return True

    def _all_say(self, word: str) -> bool:
        return all(self._command_kinds.get(name) == word for name in self._timeouts_s)

    def _passed(self, command_age_s: float | None) -> dict[str, float] | None:
        """Tell the gate of this cycle, and give the inputs that it lets pass; None: without drive."""
        was_driven = self.driven
        missed, self._missed = self._missed, 0
        rests = self._all_say("rest")  # a host whose commands are safe may stop sending
        age_s = 0.0 if rests or missed else command_age_s
        facts = self.plant.facts(self.gate.envelope)
        rounds = min((self._good[name] for name in self._timeouts_s), default=0)
        self._good = Counter({name: min(self._good[name] - rounds, 1) for name in self._timeouts_s})
        bad, self._bad = self._bad, 0
        self.gate.observe(
            **{
                **facts,
                "good_frames": rounds if facts["good_frames"] else 0,
                "bad_frames": bad,
                "age_s": None if age_s is None else max(age_s, facts["age_s"]),
                "missed_deadlines": missed,
                "bus": "off" if self._second_sender else "active",
                "request": self._request(),
            }
        )
        self._second_sender = False
        drive = self.gate.command(self._inputs.get("duty", 0.0))
        if was_driven and self.gate.mode == "limp":
            if self.gate.reason == "stale" and (age_s is None or age_s >= facts["age_s"]):
                self._troubles.add("command_timeout")
            elif self.gate.reason == "bad_frames":
                self._troubles.add("wrong_counter" if self._bad_status in _COUNTER_ERRORS else "wrong_crc")
        if drive.bridge_open:
            return None
        return self._inputs | ({"duty": drive.duty} if "duty" in self._inputs else {})

    def _request(self) -> str:
        """Give what the commands ask of the gate."""
        asked, self._is_asked_to_arm = self._is_asked_to_arm, False
        if asked and self.gate.mode in ("init", "limp", "fault"):
            return "arm" if self.gate.mode == "init" else "reset"
        drives = self._all_say("drive") and set(self._inputs) >= set(self.map.input_names)
        if self.gate.mode == "run":
            return "none" if drives else "stop"  # at rest, or in a mode that this node does not have
        return "run" if drives else "none"

    def _require_sayable(self) -> None:
        """Refuse a map with a value that the plant does not measure and its signal cannot say to be missing."""
        if self._known_values is None:
            return
        zeros = dict.fromkeys((*self._known_values, *_OWN), 0.0)
        for message in self.map.measurements.values():
            if lacking := _without_code(message.signals, zeros):
                raise ParameterError.of(
                    f"values of {message.name}", ", ".join(lacking),
                    f"measured by the plant ({', '.join(self._known_values)}), or give the signal a raw value "
                    '"not available" in its value table (VAL_), or take it out of the map',
                )  # fmt: skip
            if lacking := [name for name in message.signals if name not in zeros]:
                _LOG.warning("%s: the plant does not measure %s: sent as missing", message.name, ", ".join(lacking))

    def _report(self, sampled: Sampled) -> list[Frame]:
        own = {name: float(name in self._troubles) for name in _OWN}
        values = {**own, **sampled.values}
        stands = not sampled.values  # an engine: it measures nothing, and its state says so
        frames: list[Frame] = []
        for message in self._order:
            every = round((message.message.cycle_s or self.map.cycle_s) / self.map.cycle_s)
            if self.samples % max(1, every):
                continue
            if not stands and _without_code(message.signals, values):
                continue  # no number is better than a wrong one: its receiver sees it grow old
            raws: dict[str, Any] = {}
            state = self.map.state
            if state is not None and state.message == message.name:
                raws[state.signal.name] = self._codes[self.gate.mode]
            carried = _carried(message.signals, values)
            applied = _carried(message.applied, sampled.applied)
            frames += self._sender.frames(message, message.payloads(carried, raws, applied))
        self.samples += 1
        return frames


def _without_code(entries: Mapping[str, MappedSignal], values: Mapping[str, float]) -> list[str]:
    """Names of missing values whose signal has no code for "not available"."""
    return [
        name
        for name, entry in entries.items()
        if entry.signal.missing_raw is None and math.isnan(values.get(name, math.nan))
    ]


def _carried(entries: Mapping[str, MappedSignal], values: Mapping[str, float]) -> dict[str, float]:
    """Give what the signals can carry: what is missing is NaN; of an engine that stands flags and counters are 0."""
    given = {name: float(values.get(name, math.nan)) for name in entries}
    return {
        name: value
        for name, value in given.items()
        if not math.isnan(value) or entries[name].signal.missing_raw is not None
    }
