"""Test rigs: one protocol for the simulated plant and the real one, in this process, over a CAN bus, or recorded.

`mgdd.loop.run_seeker` steers a rig as it steers any plant.
"""

from __future__ import annotations

from mgdd._core.rig import E2eCheck, E2eSettings, Frame
from mgdd.rig.base import Rig
from mgdd.rig.can.can_rig import CanRig
from mgdd.rig.can.processes import VirtualNode
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.exchange import RecordingRig, RigRecord
from mgdd.rig.export import export_record
from mgdd.rig.protection import protect
from mgdd.rig.recorded import read_record, repair_record
from mgdd.rig.recorder import Recorder
from mgdd.rig.replay import ReplayRig
from mgdd.rig.simulated import SimulatedRig

__all__ = [
    "CanRig",
    "CanTransport",
    "E2eCheck",
    "E2eSettings",
    "Frame",
    "Recorder",
    "RecordingRig",
    "ReplayRig",
    "Rig",
    "RigRecord",
    "SignalMap",
    "SimulatedRig",
    "VirtualNode",
    "export_record",
    "protect",
    "read_record",
    "repair_record",
]
