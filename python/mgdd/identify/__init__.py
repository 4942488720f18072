"""Identification: fitting models to measured records, and what such a fit can and cannot tell."""

from __future__ import annotations

from mgdd.identify.cylinder import fit_cylinder
from mgdd.identify.drive_axis import DriveFit, DriveModel, drive_free_run, drive_inverse_dynamics, fit_drive
from mgdd.identify.excitation import amplitude_random_steps, chirp, multisine, prbs, staircase, triangle
from mgdd.identify.excitation_check import ExcitationCheck, check_excitation
from mgdd.identify.excitation_design import design_excitation
from mgdd.identify.first_principle import fit_throttle, throttle_start
from mgdd.identify.first_principle_model import FirstPrincipleModel
from mgdd.identify.metrics import ResidualTests, fit_percent, mse, residual_tests, rmse, vaf_percent
from mgdd.identify.n_step import n_step_rms, split_log
from mgdd.identify.ode_fit import OdeFit, OdeModel, fit_ode
from mgdd.identify.online_update import OnlineUpdate
from mgdd.identify.physical_parameters import physical_parameters
from mgdd.identify.profile import WallHeatProfile, wall_heat_profile
from mgdd.identify.pseudo_wiener_fit import PseudoWienerFit, fit_pseudo_wiener
from mgdd.identify.random_steps import random_step_records
from mgdd.identify.record_content import RecordContent
from mgdd.identify.records import CylinderFit, LoadFit
from mgdd.identify.response_surface import Support
from mgdd.identify.sensor_lag import SensorLag
from mgdd.identify.smooth_throttle import (
    SmoothThrottleFit,
    SmoothThrottleModel,
    fit_smooth_throttle,
    simulate_smooth_throttle,
)
from mgdd.identify.surrogate import EngineSurrogate, SignalModel
from mgdd.identify.surrogate_engine import SurrogateEngine
from mgdd.identify.surrogate_fit import fit_surrogate
from mgdd.identify.surrogate_optimum import SurrogateOptimum
from mgdd.identify.throttle_fit import ThrottleFit, ThrottleModel
from mgdd.identify.throttle_fits import load_throttle_model
from mgdd.identify.throttle_front import identify_throttle
from mgdd.identify.throttle_validation import ThrottleValidation, correlation_dataset, validate_throttle
from mgdd.identify.two_tanks import TanksFit, TwoTanksModel, fit_two_tanks
from mgdd.identify.wiener_hammerstein import (
    LinearApproximation,
    WienerHammersteinFit,
    WienerHammersteinModel,
    fit_linear,
    fit_wiener_hammerstein,
)

__all__ = [
    "CylinderFit",
    "DriveFit",
    "DriveModel",
    "EngineSurrogate",
    "ExcitationCheck",
    "FirstPrincipleModel",
    "LinearApproximation",
    "LoadFit",
    "OdeFit",
    "OdeModel",
    "OnlineUpdate",
    "PseudoWienerFit",
    "RecordContent",
    "ResidualTests",
    "SensorLag",
    "SignalModel",
    "SmoothThrottleFit",
    "SmoothThrottleModel",
    "Support",
    "SurrogateEngine",
    "SurrogateOptimum",
    "TanksFit",
    "ThrottleFit",
    "ThrottleModel",
    "ThrottleValidation",
    "TwoTanksModel",
    "WallHeatProfile",
    "WienerHammersteinFit",
    "WienerHammersteinModel",
    "amplitude_random_steps",
    "check_excitation",
    "chirp",
    "correlation_dataset",
    "design_excitation",
    "drive_free_run",
    "drive_inverse_dynamics",
    "fit_cylinder",
    "fit_drive",
    "fit_linear",
    "fit_ode",
    "fit_percent",
    "fit_pseudo_wiener",
    "fit_smooth_throttle",
    "fit_surrogate",
    "fit_throttle",
    "fit_two_tanks",
    "fit_wiener_hammerstein",
    "identify_throttle",
    "load_throttle_model",
    "mse",
    "multisine",
    "n_step_rms",
    "physical_parameters",
    "prbs",
    "random_step_records",
    "residual_tests",
    "rmse",
    "simulate_smooth_throttle",
    "split_log",
    "staircase",
    "throttle_start",
    "triangle",
    "vaf_percent",
    "validate_throttle",
    "wall_heat_profile",
]
