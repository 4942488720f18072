"""Test rigs: one protocol for the simulated plant and the real one.

`mgdd.loop.run_seeker` steers a rig as it steers any plant.
"""

from __future__ import annotations

from mgdd._core.rig import E2eCheck, E2eSettings, Frame
from mgdd.rig.base import Rig
from mgdd.rig.export import export_record
from mgdd.rig.protection import protect
from mgdd.rig.recorded import read_record, repair_record
from mgdd.rig.recorder import Recorder
from mgdd.rig.simulated import SimulatedRig

__all__ = [
    "E2eCheck",
    "E2eSettings",
    "Frame",
    "Recorder",
    "Rig",
    "SimulatedRig",
    "export_record",
    "protect",
    "read_record",
    "repair_record",
]
