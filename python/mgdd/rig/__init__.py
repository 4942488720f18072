"""Test rigs: one protocol for the simulated bench and the real one."""

from __future__ import annotations

from mgdd.rig.base import AnnouncingRig, Measurement, Rig
from mgdd.rig.seek import run_on_rig
from mgdd.rig.simulated import SimulatedRig

__all__ = ["AnnouncingRig", "Measurement", "Rig", "SimulatedRig", "run_on_rig"]
