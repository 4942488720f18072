"""Closed loops: plants behind one protocol, a seeker on any of them, and thousands of runs on the virtual bench.

`VirtualEngine`, `VirtualThrottle` and `FunctionPlant`, a function of your own, are plants: ``apply`` inputs by name,
``measure``. `run_seeker` closes the loop on any of them and on a test rig, `monte_carlo` does so for
seeds, gains and operating points of the bench, or on a compiled function, on all cores or an executor,
`VirtualEngine.find_optimum` says where a seeker should end. `track` and `track_many` run controllers of the throttle
along a `Reference`, `export_controller` writes one as C++, `simulate_drive` runs a throttle between the pedal and the
engine's torque.
"""

from __future__ import annotations

from mgdd._core.loop import SensorDynamics
from mgdd._rooms import furnish as _furnish
from mgdd.loop.closed_loop import run_seeker
from mgdd.loop.drive import simulate_drive
from mgdd.loop.engine_guide import EngineGuide
from mgdd.loop.export import export_controller
from mgdd.loop.function_plant import FunctionPlant
from mgdd.loop.many_loops import monte_carlo
from mgdd.loop.many_tracks import track_many
from mgdd.loop.plant import Measurement, Plant
from mgdd.loop.reference import Reference
from mgdd.loop.seek import seek
from mgdd.loop.seek_front import seek_front
from mgdd.loop.seek_map import seek_map
from mgdd.loop.summary import LoopCriteria
from mgdd.loop.track import track
from mgdd.loop.tune import tune_controller
from mgdd.loop.tuned import tuned_controller
from mgdd.loop.virtual_engine import VirtualEngine
from mgdd.loop.virtual_test_bed import VirtualTestBed
from mgdd.loop.virtual_throttle import VirtualThrottle
from mgdd.throttle.sensors import ThrottleFault

__all__ = [
    "EngineGuide",
    "FunctionPlant",
    "LoopCriteria",
    "Measurement",
    "Plant",
    "Reference",
    "SensorDynamics",
    "ThrottleFault",
    "VirtualEngine",
    "VirtualTestBed",
    "VirtualThrottle",
    "export_controller",
    "monte_carlo",
    "run_seeker",
    "seek",
    "seek_front",
    "seek_map",
    "simulate_drive",
    "track",
    "track_many",
    "tune_controller",
    "tuned_controller",
]  # fmt: skip

_furnish(__name__)
