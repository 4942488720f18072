"""Test rigs: one protocol for the simulated bench and the real one."""

from __future__ import annotations

from mgdd.rig.base import Measurement, Rig
from mgdd.rig.simulated import SimulatedRig

__all__ = ["Measurement", "Rig", "SimulatedRig"]
