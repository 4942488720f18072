"""Test rigs: one protocol for the simulated plant and the real one, in this process, over a CAN bus, or recorded.

`mgdd.loop.run_seeker` steers a rig as it steers any plant. Below every optimiser stands an `ActuatorGuard`, below every
throttle controller a `SafetyGate`. An `Experiment` from a file runs on all of them.
"""

from __future__ import annotations

from mgdd._core.rig import E2eCheck, E2eSettings, Frame, RingTransport, SignalLayout, SocketCanTransport
from mgdd.rig.actuator_guard import ActuatorGuard
from mgdd.rig.base import Rig, SimulatedRig
from mgdd.rig.can.bus_bridge import BusBridge
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.processes import VirtualNode
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.exchange import RecordingRig, ReplayRig, RigRecord
from mgdd.rig.experiment import Experiment, check_experiment, run_experiment
from mgdd.rig.export import export_record
from mgdd.rig.gated import GatedThrottle
from mgdd.rig.loop_message import LoopMessage, protect
from mgdd.rig.realtime import RealtimeLoop
from mgdd.rig.recorded import read_record, repair_record
from mgdd.rig.recorder import Recorder
from mgdd.rig.safety import SafetyEnvelope, SafetyGate

__all__ = [
    "ActuatorGuard",
    "BusBridge",
    "CanRig",
    "CanTransport",
    "E2eCheck",
    "E2eSettings",
    "Experiment",
    "Frame",
    "GatedThrottle",
    "LoopMessage",
    "RealtimeLoop",
    "Recorder",
    "RecordingRig",
    "ReplayRig",
    "Rig",
    "RigRecord",
    "RingTransport",
    "SafetyEnvelope",
    "SafetyGate",
    "SignalLayout",
    "SignalMap",
    "SimulatedRig",
    "SocketCanTransport",
    "VirtualNode",
    "check_experiment",
    "export_record",
    "protect",
    "read_record",
    "repair_record",
    "run_experiment",
]


def __dir__() -> list[str]:
    return __all__
