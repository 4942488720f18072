"""Models that guide a seeker: the model proposes a starting point, measured cycles correct it.

A guide is any function of the operating point that says where the optimum should be: `ModelOptimum` asks the cycle
model, `TimingMap` a table, and a function of your own will do. `FeedForward` puts it in front of a seeker of
`mgdd.optimize`, which learns only what is left; ``guide=None`` is the plain seeker. `CurveSeeking` takes the whole
curve of a model, held by a `Curve`, which may stand in the wrong place, and finds from a few measurements where it
stands. `OnlineCalibration` adapts the model itself to the measured pressure, and `GuidedEngine` is
the whole loop of seeker, model and calibration.

Examples
--------
>>> from mgdd.engine import Cylinder, OperatingPoint
>>> from mgdd.guide import CurveSeeking, ModelOptimum
>>> from mgdd.loop import VirtualEngine
>>> rough = ModelOptimum(Cylinder(wall_heat_scale=1.0))  # twice the wall heat of the bench
>>> curve = rough.curve(OperatingPoint())
>>> seeker = CurveSeeking(start=curve.best, bounds=(-30.0, 10.0), curve=curve)
>>> bench = VirtualEngine(seed=3)
>>> for _ in range(40):
...     seeker.tell(bench.step(seeker.ask()[0])["j"])
>>> round(curve.best, 1), abs(seeker.estimate[0] - bench.find_optimum()["soc_cad"]) < 1.5
(-1.5, np.True_)
"""

from __future__ import annotations

from mgdd._core.guide import Curve
from mgdd._rooms import furnish as _furnish
from mgdd.guide.curve_seeking import CurveSeeking
from mgdd.guide.feed_forward import FeedForward
from mgdd.guide.guided_engine import GuidedEngine
from mgdd.guide.model_optimum import ModelOptimum
from mgdd.guide.online_calibration import OnlineCalibration
from mgdd.guide.timing_map import TimingMap

__all__ = ["Curve", "CurveSeeking", "FeedForward", "GuidedEngine", "ModelOptimum", "OnlineCalibration", "TimingMap"]

_furnish(__name__)
