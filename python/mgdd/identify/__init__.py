"""Identification: fitting models to measured records, and what such a fit can and cannot tell."""

from __future__ import annotations

from mgdd.identify.cylinder import fit_cylinder
from mgdd.identify.drive_axis import DriveFit, DriveModel, drive_free_run, drive_inverse_dynamics, fit_drive
from mgdd.identify.profile import WallHeatProfile, wall_heat_profile
from mgdd.identify.random_steps import random_step_records
from mgdd.identify.records import CylinderFit, LoadFit
from mgdd.identify.response_surface import Support
from mgdd.identify.sensor_lag import SensorLag
from mgdd.identify.surrogate import EngineSurrogate, SignalModel
from mgdd.identify.surrogate_engine import SurrogateEngine
from mgdd.identify.surrogate_fit import fit_surrogate
from mgdd.identify.surrogate_optimum import SurrogateOptimum
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
    "LinearApproximation",
    "LoadFit",
    "SensorLag",
    "SignalModel",
    "Support",
    "SurrogateEngine",
    "SurrogateOptimum",
    "TanksFit",
    "TwoTanksModel",
    "WallHeatProfile",
    "WienerHammersteinFit",
    "WienerHammersteinModel",
    "drive_free_run",
    "drive_inverse_dynamics",
    "fit_cylinder",
    "fit_drive",
    "fit_linear",
    "fit_surrogate",
    "fit_two_tanks",
    "fit_wiener_hammerstein",
    "random_step_records",
    "wall_heat_profile",
]
