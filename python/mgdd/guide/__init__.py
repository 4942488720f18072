"""What a model tells a seeker, and how the model learns while the engine runs."""

from __future__ import annotations

from mgdd.guide.online_calibration import OnlineCalibration, ParameterVerdict

__all__ = [
    "OnlineCalibration",
    "ParameterVerdict",
]
