"""Identification: fitting models to measured records, and what such a fit can and cannot tell."""

from __future__ import annotations

from mgdd.identify.cylinder import fit_cylinder
from mgdd.identify.profile import WallHeatProfile, wall_heat_profile
from mgdd.identify.random_steps import random_step_records
from mgdd.identify.records import CylinderFit, LoadFit
from mgdd.identify.response_surface import Support
from mgdd.identify.sensor_lag import SensorLag
from mgdd.identify.surrogate import EngineSurrogate, SignalModel
from mgdd.identify.surrogate_engine import SurrogateEngine
from mgdd.identify.surrogate_fit import fit_surrogate
from mgdd.identify.surrogate_optimum import SurrogateOptimum
from mgdd.identify.throttle_fit import FittedParameters, ThrottleFit, ThrottleModel

__all__ = [
    "CylinderFit",
    "EngineSurrogate",
    "FittedParameters",
    "LoadFit",
    "SensorLag",
    "SignalModel",
    "Support",
    "SurrogateEngine",
    "SurrogateOptimum",
    "ThrottleFit",
    "ThrottleModel",
    "WallHeatProfile",
    "fit_cylinder",
    "fit_surrogate",
    "random_step_records",
    "wall_heat_profile",
]
