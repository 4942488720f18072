"""Test rigs: one protocol for the simulated plant and the real one.

`mgdd.loop.run_seeker` steers a rig as it steers any plant.
"""

from __future__ import annotations

from mgdd._core.rig import E2eCheck, E2eSettings, protect
from mgdd.rig.base import Rig
from mgdd.rig.simulated import SimulatedRig

__all__ = ["E2eCheck", "E2eSettings", "Rig", "SimulatedRig", "protect"]
