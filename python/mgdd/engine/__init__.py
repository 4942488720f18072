"""The engine: one closed cycle, its best timing, NOx and performance, and the analysis of measured pressure.

Crank angles are °CA aTDC (firing TDC = 0, compression negative) throughout.
"""

from __future__ import annotations

from mgdd._core.engine import Cylinder, NoxModel, NoxProxy, OperatingPoint, Performance, PerformanceTerm, SoftSensor
from mgdd._rooms import furnish as _furnish
from mgdd.engine.cycle import sensitivities, simulate, timing_sweep
from mgdd.engine.ignition import ignition_delay
from mgdd.engine.indicating import Indicating
from mgdd.engine.nox import fit_nox_proxy, nox_at_reference_humidity, nox_g_per_kwh
from mgdd.engine.optimum import find_optimum
from mgdd.engine.pressure_check import PressureCheck, check_pressure
from mgdd.engine.thermal_no import ThermalNo
from mgdd.engine.trace import analyze

__all__ = [
    "Cylinder",
    "Indicating",
    "NoxModel",
    "NoxProxy",
    "OperatingPoint",
    "Performance",
    "PerformanceTerm",
    "PressureCheck",
    "SoftSensor",
    "ThermalNo",
    "analyze",
    "check_pressure",
    "find_optimum",
    "fit_nox_proxy",
    "ignition_delay",
    "nox_at_reference_humidity",
    "nox_g_per_kwh",
    "sensitivities",
    "simulate",
    "timing_sweep",
]

_furnish(__name__)
