"""Measured benchmarks of identification: a drive, two tanks and a circuit, fitted beside published figures."""

from __future__ import annotations

from mgdd.studies.benchmarks.drive_axis import DriveFit, DriveModel, drive_free_run, drive_inverse_dynamics, fit_drive
from mgdd.studies.benchmarks.two_tanks import TanksFit, TwoTanksModel, fit_two_tanks
from mgdd.studies.benchmarks.wiener_hammerstein import (
    LinearApproximation,
    WienerHammersteinFit,
    WienerHammersteinModel,
    fit_linear,
    fit_wiener_hammerstein,
)

__all__ = [
    "DriveFit",
    "DriveModel",
    "LinearApproximation",
    "TanksFit",
    "TwoTanksModel",
    "WienerHammersteinFit",
    "WienerHammersteinModel",
    "drive_free_run",
    "drive_inverse_dynamics",
    "fit_drive",
    "fit_linear",
    "fit_two_tanks",
    "fit_wiener_hammerstein",
]
