"""Identification: fitting models to measured records, and what such a fit can and cannot tell."""

from __future__ import annotations

from mgdd.identify.cylinder import fit_cylinder
from mgdd.identify.excitation import amplitude_random_steps, chirp, multisine, prbs, staircase, triangle
from mgdd.identify.excitation_check import ExcitationCheck, check_excitation
from mgdd.identify.excitation_design import design_excitation
from mgdd.identify.metrics import ResidualTests, fit_percent, mse, residual_tests, rmse, vaf_percent
from mgdd.identify.profile import WallHeatProfile, wall_heat_profile
from mgdd.identify.random_steps import random_step_records
from mgdd.identify.record_content import RecordContent
from mgdd.identify.records import CylinderFit, LoadFit
from mgdd.identify.response_surface import Support
from mgdd.identify.sensor_lag import SensorLag
from mgdd.identify.surrogate import EngineSurrogate, SignalModel
from mgdd.identify.surrogate_engine import SurrogateEngine
from mgdd.identify.surrogate_fit import fit_surrogate
from mgdd.identify.surrogate_optimum import SurrogateOptimum
from mgdd.identify.throttle_fit import FittedParameters, ThrottleFit, ThrottleModel
from mgdd.identify.throttle_front import identify_throttle
from mgdd.identify.throttle_validation import (
    ThrottleValidation,
    correlation_dataset,
    n_step_rms,
    split_log,
    validate_throttle,
)

__all__ = [
    "CylinderFit",
    "EngineSurrogate",
    "ExcitationCheck",
    "FittedParameters",
    "LoadFit",
    "RecordContent",
    "ResidualTests",
    "SensorLag",
    "SignalModel",
    "Support",
    "SurrogateEngine",
    "SurrogateOptimum",
    "ThrottleFit",
    "ThrottleModel",
    "ThrottleValidation",
    "WallHeatProfile",
    "amplitude_random_steps",
    "check_excitation",
    "chirp",
    "correlation_dataset",
    "design_excitation",
    "fit_cylinder",
    "fit_percent",
    "fit_surrogate",
    "identify_throttle",
    "mse",
    "multisine",
    "n_step_rms",
    "prbs",
    "random_step_records",
    "residual_tests",
    "rmse",
    "split_log",
    "staircase",
    "triangle",
    "vaf_percent",
    "validate_throttle",
    "wall_heat_profile",
]
