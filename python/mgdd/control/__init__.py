"""Controllers of a throttle plate, from model-guided prediction to PID, and a supervisor beside any of them.

A controller takes a reference and a measured angle and returns a duty, one sample at a time (``step``); it never
holds a plant, so simulation, replay and the real throttle are the same loop. It never reads a clock: ``sample_s`` is a
setting. ``state`` saves what a run needs to go on bit for bit. `SupervisedController` watches one of them and opens the
bridge where it must.
"""

from __future__ import annotations

from mgdd._core.control import GuidedPredictive, Pid, SlidingMode, ThrottleSupervisor
from mgdd._rooms import furnish as _furnish
from mgdd.control.mgdd1 import Mgdd1
from mgdd.control.supervised import SupervisedController

__all__ = [
    "GuidedPredictive",
    "Mgdd1",
    "Pid",
    "SlidingMode",
    "SupervisedController",
    "ThrottleSupervisor",
]

_furnish(__name__)
