"""Test rigs: one protocol for the simulated plant and the real one, in this process, over a CAN bus, or recorded.

`mgdd.loop.run_seeker` steers a rig as it steers any plant. Below every optimiser stands an `ActuatorGuard`, below every
throttle controller a `SafetyGate`. An `Experiment` from a file runs on all of them. The loop in a thread of the
core, with its frames, messages and transports, is in `mgdd.rig.realtime`.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.rig.base import ActuatorGuard, SimulatedRig
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.processes import VirtualNode
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.exchange import RecordingRig, ReplayRig
from mgdd.rig.experiment import Experiment, run_experiment
from mgdd.rig.export import export_record
from mgdd.rig.live.notebook import watch
from mgdd.rig.recorded import read_record, repair_record
from mgdd.rig.recorder import Recorder
from mgdd.rig.safety import GatedThrottle, SafetyEnvelope, SafetyGate

__all__ = [
    "ActuatorGuard",
    "CanRig",
    "Experiment",
    "GatedThrottle",
    "Recorder",
    "RecordingRig",
    "ReplayRig",
    "SafetyEnvelope",
    "SafetyGate",
    "SignalMap",
    "SimulatedRig",
    "VirtualNode",
    "export_record",
    "read_record",
    "repair_record",
    "run_experiment",
    "watch",
]

_furnish(__name__)
