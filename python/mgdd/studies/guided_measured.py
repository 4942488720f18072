"""The guide of the measured engine: a cycle model of a diesel of its size, told what the records say on average."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import ConvergenceError
from mgdd.guide import Curve, ModelOptimum

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MeasuredGuide", "drawn_curve", "measured_guide"]

# 4.5 L of four cylinders; bore and stroke are those of engines of this size, the compression ratio is a usual one.
_CYLINDER = Cylinder(bore_mm=107.0, stroke_mm=124.0, connecting_rod_mm=192.0, compression_ratio=17.3)
_TEN_TO_NINETY = 1.0 - math.sqrt(0.2)  # of the duration of a symmetric triangle
_BOUNDS_CAD, _NODES = (-30.0, 15.0), 121


@dataclass(frozen=True, kw_only=True)
class MeasuredGuide:
    """What the model says over the injection [°CA aTDC].

    Parameters
    ----------
    curve : Curve
        IMEP [bar].
    pressure_rise : Curve
        Largest pressure rise [bar/°CA].
    bar_per_point : float
        IMEP of a point of efficiency [bar].
    """

    curve: Curve
    pressure_rise: Curve
    bar_per_point: float


def measured_guide(records: xr.Dataset) -> MeasuredGuide:
    """Draw IMEP and pressure rise over injection by the cycle model."""
    middle = {
        name: float(records[name].median())
        for name in ("speed_rpm", "soi_cad", "mfb10_cad", "mfb50_cad", "mfb90_cad", "diesel_energy_kj", "h2_energy_kj")
    }
    energy_kj = middle["diesel_energy_kj"] + middle["h2_energy_kj"]
    duration = (middle["mfb90_cad"] - middle["mfb10_cad"]) / _TEN_TO_NINETY
    point = OperatingPoint(
        speed_rpm=middle["speed_rpm"],
        fuel_mg=energy_kj * 1e3 / _CYLINDER.lower_heating_value_mj_per_kg,
        burn_duration_cad=duration,
    )
    from_soc_to_soi = middle["soi_cad"] - (middle["mfb50_cad"] - 0.5 * duration)
    model = ModelOptimum(_CYLINDER, bounds_cad=_BOUNDS_CAD)
    drawn, rises = drawn_curve(model, point), model.limit_curves(point, ["dp_max_bar_per_cad"])
    if rises is None:
        raise ConvergenceError(f"the guide has no pressure rise at {point}")
    displacement_m3 = 0.25 * math.pi * _CYLINDER.bore_mm**2 * _CYLINDER.stroke_mm * 1e-9
    bar_per_point = 0.01 * energy_kj * 1e3 / displacement_m3 * 1e-5
    soc = np.linspace(drawn.lower, drawn.upper, _NODES)
    return MeasuredGuide(
        curve=Curve(soc + from_soc_to_soi, bar_per_point * np.asarray(drawn(soc))),
        pressure_rise=Curve(soc + from_soc_to_soi, np.asarray(rises[0](soc))),
        bar_per_point=bar_per_point,
    )


def drawn_curve(model: ModelOptimum, point: OperatingPoint) -> Curve:
    """Draw J of a model over SOC; ConvergenceError where it has no cycle."""
    curve = model.curve(point)
    if curve is None:
        raise ConvergenceError(f"the guide has no cycle at {point}")
    return curve
