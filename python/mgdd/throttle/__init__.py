"""The electronic throttle: parameters, simulation, and what follows from the parameters in closed form.

Angles are degrees from the mechanically closed position, opening positive; a positive duty opens. The model is a
reconstruction from public sources, not the code behind the dissertation: see the theory page.
"""

from __future__ import annotations

from mgdd._core.throttle import Throttle
from mgdd.throttle.characteristics import groups, holding_duty, linear_part
from mgdd.throttle.interop import initial_state, to_iosystem
from mgdd.throttle.pseudo_wiener import PseudoWiener
from mgdd.throttle.sensors import SensorFault, SensorPair, sense
from mgdd.throttle.simulation import simulate, simulate_many

__all__ = [
    "PseudoWiener",
    "SensorFault",
    "SensorPair",
    "Throttle",
    "groups",
    "holding_duty",
    "initial_state",
    "linear_part",
    "sense",
    "simulate",
    "simulate_many",
    "to_iosystem",
]
