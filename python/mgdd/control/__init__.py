"""Controllers of a throttle plate: model-guided prediction, MGDD-1, and the baselines PID and sliding mode.

A controller is told a reference and a measured angle and answers with a duty, one sample at a time (``step``); it never
holds a plant, so simulation, replay and the real throttle are the same loop. It never reads a clock: ``sample_s`` is a
setting. ``state`` saves what a run needs to go on bit for bit.
"""

from __future__ import annotations

from mgdd._core.control import GuidedPredictive, Pid, SlidingMode
from mgdd.control.mgdd1 import Mgdd1

__all__ = ["GuidedPredictive", "Mgdd1", "Pid", "SlidingMode"]
