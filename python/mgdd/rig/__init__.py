"""Test rigs: one protocol for the simulated plant and the real one, and what keeps the actuators safe.

`mgdd.loop.run_seeker` steers a rig as it steers any plant. Below every optimiser stands an `ActuatorGuard`, below every
throttle controller a `SafetyGate`.
"""

from __future__ import annotations

from mgdd.rig.actuator_guard import ActuatorGuard
from mgdd.rig.base import Rig
from mgdd.rig.gated import GatedThrottle
from mgdd.rig.safety import SafetyGate
from mgdd.rig.safety_envelope import SafetyEnvelope
from mgdd.rig.simulated import SimulatedRig

__all__ = [
    "ActuatorGuard",
    "GatedThrottle",
    "Rig",
    "SafetyEnvelope",
    "SafetyGate",
    "SimulatedRig",
]
