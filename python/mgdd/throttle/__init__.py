"""The electronic throttle: parameters, simulation, closed forms, and the demand chain from the pedal to the plate.

Angles are degrees from the mechanically closed position, opening positive; a positive duty opens. The model is a
reconstruction from public sources, not the code behind the dissertation: see the theory page.
"""

from __future__ import annotations

from mgdd._core.throttle import PedalMap, Throttle
from mgdd._rooms import furnish as _furnish
from mgdd.throttle.characteristics import characteristics
from mgdd.throttle.demand import DemandChain
from mgdd.throttle.interop import to_iosystem
from mgdd.throttle.pseudo_wiener import PseudoWiener
from mgdd.throttle.sensors import SensorPair
from mgdd.throttle.simulation import simulate_throttle

__all__ = [
    "DemandChain",
    "PedalMap",
    "PseudoWiener",
    "SensorPair",
    "Throttle",
    "characteristics",
    "simulate_throttle",
    "to_iosystem",
]

_furnish(__name__)
