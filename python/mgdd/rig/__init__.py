"""Test rigs: one protocol for the simulated plant and the real one, and what keeps the actuators safe.

`mgdd.loop.run_seeker` steers a rig as it steers any plant. Below every optimiser stands an `ActuatorGuard`, below every
throttle controller a `SafetyGate`. A `RealtimeLoop` runs such a controller over a bus in a thread of the core.
"""

from __future__ import annotations

from mgdd._core.rig import E2eCheck, E2eSettings, Frame, RingTransport, SignalLayout, SocketCanTransport, protect
from mgdd.rig.actuator_guard import ActuatorGuard, GuardedAsk
from mgdd.rig.base import Rig
from mgdd.rig.can.bus_bridge import BusBridge
from mgdd.rig.export import export_record
from mgdd.rig.gated import GatedThrottle
from mgdd.rig.loop_message import LoopMessage
from mgdd.rig.realtime import RealtimeLoop
from mgdd.rig.recorded import read_record, repair_record
from mgdd.rig.recorder import Recorder
from mgdd.rig.safety import Drive, SafetyChange, SafetyEnvelope, SafetyGate
from mgdd.rig.simulated import SimulatedRig

__all__ = [
    "ActuatorGuard",
    "BusBridge",
    "Drive",
    "E2eCheck",
    "E2eSettings",
    "Frame",
    "GatedThrottle",
    "GuardedAsk",
    "LoopMessage",
    "RealtimeLoop",
    "Recorder",
    "Rig",
    "RingTransport",
    "SafetyChange",
    "SafetyEnvelope",
    "SafetyGate",
    "SignalLayout",
    "SimulatedRig",
    "SocketCanTransport",
    "export_record",
    "protect",
    "read_record",
    "repair_record",
]
