"""What a model tells a seeker, and how the model learns while the engine runs."""

from __future__ import annotations

from mgdd.guide.online_calibration import OnlineCalibration
from mgdd.guide.parameter_verdict import ParameterVerdict

__all__ = [
    "OnlineCalibration",
    "ParameterVerdict",
]
