"""Identification: fitting models to measured records, and what such a fit can and cannot tell.

Engine: `fit_cylinder`, `wall_heat_profile`. Throttle: `identify_throttle`, `validate_throttle` and the fits and
excitations below them. Any ODE: `fit_ode`.
"""

from __future__ import annotations

from mgdd.identify.engine.cylinder import fit_cylinder
from mgdd.identify.engine.profile import WallHeatProfile, wall_heat_profile
from mgdd.identify.engine.records import CylinderFit, LoadFit
from mgdd.identify.ode_fit import OdeFit, OdeModel, fit_ode
from mgdd.identify.throttle.excitation_check import ExcitationCheck, check_excitation
from mgdd.identify.throttle.excitation_design import design_excitation
from mgdd.identify.throttle.first_principle import fit_throttle, throttle_start
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.fit import FittedParameters, ThrottleFit, ThrottleModel
from mgdd.identify.throttle.fits import load_throttle_model
from mgdd.identify.throttle.identify import identify_throttle
from mgdd.identify.throttle.n_step import n_step_rms, split_log
from mgdd.identify.throttle.online_update import OnlineUpdate
from mgdd.identify.throttle.physical_parameters import physical_parameters
from mgdd.identify.throttle.pseudo_wiener_fit import PseudoWienerFit, fit_pseudo_wiener
from mgdd.identify.throttle.record_content import RecordContent
from mgdd.identify.throttle.smooth import SmoothThrottleFit, fit_smooth_throttle, simulate_smooth_throttle
from mgdd.identify.throttle.validation import ThrottleValidation, correlation_dataset, validate_throttle

__all__ = [
    "CylinderFit",
    "ExcitationCheck",
    "FirstPrincipleModel",
    "FittedParameters",
    "LoadFit",
    "OdeFit",
    "OdeModel",
    "OnlineUpdate",
    "PseudoWienerFit",
    "RecordContent",
    "SmoothThrottleFit",
    "ThrottleFit",
    "ThrottleModel",
    "ThrottleValidation",
    "WallHeatProfile",
    "check_excitation",
    "correlation_dataset",
    "design_excitation",
    "fit_cylinder",
    "fit_ode",
    "fit_pseudo_wiener",
    "fit_smooth_throttle",
    "fit_throttle",
    "identify_throttle",
    "load_throttle_model",
    "n_step_rms",
    "physical_parameters",
    "simulate_smooth_throttle",
    "split_log",
    "throttle_start",
    "validate_throttle",
    "wall_heat_profile",
]
