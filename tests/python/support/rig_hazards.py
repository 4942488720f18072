"""A throttle behind a safety gate, at 1 kHz or in a node, and the hazards of a rig with what must follow from each."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from mgdd.control import Pid
from mgdd.loop import ThrottleFault, VirtualThrottle
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.rig import SafetyEnvelope, SafetyGate, SignalMap
from mgdd.rig.can.link import Sender
from mgdd.rig.can.node_core import NodeCore, node_plant
from mgdd.rig.can.transport import changed
from mgdd.rig.realtime import Frame
from mgdd.rig.safety import facts_of

ONSET, OVER = 600, 1500  # samples: the hazard sets in, and ends
LIMP_HOME_DEG = 8.0
GONE = {"good_frames": 0, "age_s": None, "sensor_v": None, "angle_deg": None}
Facts = Mapping[str, Any]


def at(value: Any, k: int) -> Any:
    """Give what holds `k` samples after the onset."""
    return value(k) if callable(value) else value


@dataclass(frozen=True)
class Hazard:
    """What goes wrong from ONSET to OVER, and the gate's answer."""

    mode: str
    reason: str
    within: int  # samples from the onset to the open bridge; the gate sees a fault of the plate one later
    faults: tuple[ThrottleFault, ...] = ()
    facts: Facts | Callable[[int], Facts] = field(default_factory=dict)  # over those of the plant
    duty: float | Callable[[int], float] | None = None  # in place of the controller's
    reference_deg: float | Callable[[int], float] = 40.0
    changes: Mapping[str, float] = field(default_factory=dict)  # of the envelope
    returns: bool = True  # the plate to limp-home


def lasting(kind: str, size: float | None = None) -> tuple[ThrottleFault]:
    return (ThrottleFault(kind=kind, from_s=1e-3 * ONSET, until_s=1e-3 * OVER, size=size),)


def of_sensor(kind: str, sensor: int, size: float = 0.0) -> tuple[ThrottleFault]:
    return (ThrottleFault(kind=kind, sensor=sensor, from_s=1e-3 * ONSET, until_s=1e-3 * OVER, size=size),)


HAZARDS = {
    "lost measurement": Hazard("limp", "stale", 6, faults=lasting("missing_sample")),
    "late measurement": Hazard("limp", "stale", 6, faults=lasting("stale_sample")),
    "frozen sender": Hazard("limp", "stale", 5, facts=GONE),
    "corrupted frames": Hazard("limp", "bad_frames", 3, facts={**GONE, "bad_frames": 1}),
    "foreign frames between good ones": Hazard("limp", "bad_frames", 1, facts={"bad_frames": 3}),
    "sensors disagree": Hazard("fault", "sensor_disagreement", 6, faults=of_sensor("offset", 2, 0.3)),
    "sensor wire open": Hazard("fault", "sensor_range", 6, faults=of_sensor("open_wire", 1)),
    "sensor shorted to supply": Hazard("fault", "sensor_range", 7, faults=of_sensor("short_to_supply", 2)),
    "measurement not a number": Hazard("fault", "sensor_range", 5, faults=lasting("nan_sample")),
    "sensors jump": Hazard(
        "fault", "sensor_slope", 4, facts=lambda k: {"sensor_v": (4.5, 0.5) if k % 2 else (0.5, 4.5), "angle_deg": 40.0}
    ),
    "plate beyond its travel": Hazard("fault", "travel", 4, facts={"angle_deg": 97.0}),
    "controller gives NaN": Hazard("fault", "invalid_duty", 1, duty=math.nan),
    "controller gives infinity": Hazard("fault", "invalid_duty", 1, duty=-math.inf),
    "actuator overload, plate jammed": Hazard(
        "limp", "stall", 700, faults=lasting("jammed"), reference_deg=lambda k: 40.0 if k < 0 else 85.0, returns=False
    ),
    "actuator overload, duty too high for too long": Hazard(
        "limp",
        "heat",
        600,
        duty=lambda k: 0.75 if k // 30 % 2 else -0.75,
        changes={"heat_time_constant_s": 0.5, "slew_per_s": 1e4},
    ),
    "bus error passive": Hazard("limp", "bus_fault", 1, facts={"bus": "passive"}),
    "bus off": Hazard("limp", "bus_fault", 1, facts={**GONE, "bus": "off", "sent": False}),
    "commands do not leave": Hazard("limp", "not_sent", 3, facts={"sent": False}),
    "deadlines missed": Hazard("limp", "deadlines", 3, facts={"missed_deadlines": 1}),
    "host hung for a while": Hazard("limp", "deadlines", 1, facts={"missed_deadlines": 50}),
    "exception or signal in the host": Hazard("limp", "aborted", 1, facts={"request": "abort"}),
}


class Loop:
    """Controller, gate and throttle, sample by sample."""

    def __init__(self, hazard: Hazard) -> None:
        self.hazard = hazard
        self.gate = SafetyGate(SafetyEnvelope.load("etb").replace(cycle_s=1e-3, **hazard.changes))
        self.plant = VirtualThrottle(inputs=("duty", "bridge_open"), faults=hazard.faults, seed=5)
        self.controller = Pid()
        self.values: Mapping[str, float] | None = None
        self.k = 0

    def step(self) -> None:
        """Run one sample; the hazard acts on what the gate is told and on the duty."""
        after = self.k - ONSET
        acts = ONSET <= self.k < OVER
        facts = facts_of(self.values, 1e-3) | dict(at(self.hazard.facts, after) if acts else {})
        self.gate.observe(**facts)
        measured = math.nan if self.values is None else self.values["sensed_angle_deg"]
        asked = self.controller.step(at(self.hazard.reference_deg, after), measured)
        forced = acts and self.hazard.duty is not None
        drive = self.gate.command(at(self.hazard.duty, after) if forced else asked)
        assert drive.bridge_open == (self.gate.mode != "run")
        assert drive.duty == 0.0 or not drive.bridge_open
        self.plant.apply({"duty": drive.duty, "bridge_open": float(drive.bridge_open)})
        self.values = self.plant.measure().values
        self.k += 1

    def until(self, k: int) -> None:
        while self.k < k:
            self.step()

    def started(self) -> Self:
        """Give the loop with the plate at its reference, one sample before the onset."""
        self.until(60)
        self.gate.arm()
        self.gate.run()
        self.until(ONSET)
        self.gate.drain()
        return self

    @property
    def angle_deg(self) -> float:
        """Where the plate really is."""
        assert self.values is not None
        return self.values["angle_deg"]


SAMPLE_MS = 5.0
LAST = round(ONSET / SAMPLE_MS) - 1  # number of the last command before the onset
Frames = Callable[[Frame, list[Frame]], list[Frame]]  # of the command of a sample and those before it: what arrives


@dataclass(frozen=True)
class NodeHazard:
    """What goes wrong behind the bus from ONSET to OVER [ms], and the answer of the node."""

    mode: str
    reason: str
    within_ms: float  # from the onset to the open bridge
    faults: tuple[ThrottleFault, ...] = ()
    arrives: Frames = lambda frame, _: [frame]
    duty: Callable[[float], float] | None = None  # by the milliseconds since the onset
    reference_deg: float = 40.0  # from the onset on
    changes: Mapping[str, float] = field(default_factory=dict)  # of the envelope
    returns: bool = True  # the plate to limp-home, while the hazard lasts


def broken(frame: Frame, _: list[Frame]) -> list[Frame]:
    return [changed(frame, data=frame.data[:-1] + bytes([frame.data[-1] ^ 0x20]))]


def of_table(name: str, within_ms: float, **changes: Any) -> NodeHazard:
    """The same fault of the plate or its sensors as for the host."""
    known = HAZARDS[name]
    return NodeHazard(known.mode, known.reason, within_ms, known.faults, returns=known.returns, **changes)


NODE_HAZARDS = {
    "host dies": NodeHazard("limp", "stale", 30.0, arrives=lambda *_: []),
    "host hangs, its adapter repeats": NodeHazard(
        "limp", "bad_frames", 20.0, arrives=lambda _, before: before[LAST : LAST + 1]
    ),
    "commands come late": NodeHazard(
        "limp", "stale", 30.0, arrives=lambda frame, before: [frame] if len(before) % 8 == 0 else []
    ),
    "commands corrupted": NodeHazard("limp", "bad_frames", 20.0, arrives=broken),
    "lost measurement": of_table("lost measurement", 30.0),
    "late measurement": of_table("late measurement", 30.0),
    "sensors disagree": of_table("sensors disagree", 40.0),
    "sensor wire open": of_table("sensor wire open", 40.0),
    "sensor shorted to supply": of_table("sensor shorted to supply", 40.0),
    "actuator overload, plate jammed": of_table("actuator overload, plate jammed", 900.0, reference_deg=85.0),
    "actuator overload, duty too high for too long": NodeHazard(
        "limp",
        "heat",
        650.0,
        duty=lambda ms: 0.75 if int(ms) // 30 % 2 else -0.75,
        changes={"heat_time_constant_s": 0.5},
    ),
}


class NodeLoop:
    """Controller and node with frames and time by hand, a sample every 5 ms."""

    def __init__(self, hazard: NodeHazard) -> None:
        self.hazard, self.ms = hazard, 0.0
        self.map = SignalMap.load("etb")
        plant = VirtualThrottle(inputs=("duty", "bridge_open"), sample_s=5e-3, faults=hazard.faults, seed=5)
        envelope = SafetyEnvelope.load("etb_node").replace(**hazard.changes)
        self.core = NodeCore(node_plant(plant), self.map, envelope)
        self.controller, self.sender = tuned_with_doubts("pid", sample_s=5e-3)[0], Sender()
        self.sent: list[Frame] = []

    def step(self, *, safe: bool = False) -> None:
        """One command and one sample; the hazard acts on what arrives."""
        after, acts = self.ms - ONSET, ONSET <= self.ms < OVER
        measured = math.nan if self.core.last is None else self.core.last.values["sensed_angle_deg"]
        duty = self.controller.step(self.hazard.reference_deg if after >= 0 else 40.0, measured)
        if acts and self.hazard.duty is not None:
            duty = self.hazard.duty(after)
        command = self.map.commands["ETB_Cmd"]
        payloads = command.payloads({}, command.safe) if safe else command.payloads({"duty": duty}, command.driven)
        (frame,) = self.sender.frames(command, payloads)
        for arrived in self.hazard.arrives(frame, self.sent) if acts else [frame]:
            self.core.take(changed(arrived, monotonic_ns=self.now_ns))
        self.sent.append(frame)
        self.ms += SAMPLE_MS
        self.core.sample(self.now_ns)

    def until(self, ms: float, *, safe: bool = False) -> None:
        while self.ms < ms:
            self.step(safe=safe)

    @property
    def now_ns(self) -> int:
        """Monotonic time."""
        return 10**9 + round(self.ms * 1e6)

    @property
    def angle_deg(self) -> float:
        """Where the plate really is."""
        assert self.core.last is not None
        return self.core.last.values["angle_deg"]
