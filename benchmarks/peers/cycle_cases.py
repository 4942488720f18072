"""What all contenders of `sweep_speed.py` share: the cylinder in SI with its crank tables, the points, the charge.

One case is a row of `INPUTS`, in conventional units; the answer is a row of `FIGURES`. The crank grid has equal steps
of 1 °CA from IVC to EVO. `charge_of` is plain arithmetic: it serves floats, columns, Numba and JAX alike.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
INPUTS = ("speed_rpm", "fuel_mg", "intake_pressure_kpa", "intake_temperature_k", "soc_cad")
FIGURES = (
    *("imep_closed_bar", "imep_gross_bar", "efficiency_gross", "p_max_bar", "p_max_cad"),
    *("dp_max_bar_per_cad", "dp_max_cad", "heat_loss_j"),
)
EARLIEST_CAD, LATEST_CAD = -20.0, 11.0
LEAST_AIR_RATIO = 1.3
AIR_J_PER_KGK, AIR_PER_FUEL = 287.05, 14.5
WOSCHNI_BAR_M = 129.8


class Engine(NamedTuple):
    """One cylinder in SI, its volume and wall area over the crank grid, and its duration law."""

    angle: Array
    volume: Array
    area: Array
    swept: float
    clearance: float
    bore: float
    stroke: float
    gamma: float
    wall_scale: float
    c2: float
    cp: float
    wall_k: float
    volumetric_efficiency: float
    lower_heating_value: float
    duration_ref: float
    fuel_ref: float
    speed_ref: float
    fuel_exponent: float
    speed_exponent: float


class CutTables(NamedTuple):
    """Everything of a step that depends on the angle alone, one entry per step.

    p1 = keep p0 + gain (heat - loss); loss = scale `wall` (T - T_wall) p0^0.25 w^0.8; `motored` is (V_ref / V)^gamma.
    """

    keep: Array
    gain: Array
    wall: Array
    motored: Array


def crank_tables(cylinder: Any) -> tuple[Array, Array, Array, float, float]:
    """Angle [°CA aTDC], volume and wall area of each angle, swept and clearance volume (Tan 2018, eq. 2-1)."""
    bore, stroke = cylinder.bore_mm / 1e3, cylinder.stroke_mm / 1e3
    disc = math.pi / 4 * bore**2
    swept = disc * stroke
    clearance = swept / (cylinder.compression_ratio - 1)
    angle = np.arange(cylinder.ivc_cad, cylinder.evo_cad + 0.5)
    phi = np.deg2rad(angle)
    ratio = 2 * cylinder.connecting_rod_mm / cylinder.stroke_mm
    volume = clearance + swept / 2 * (1 + ratio - np.cos(phi) - np.sqrt(ratio**2 - np.sin(phi) ** 2))
    area = cylinder.bowl_area_factor * 2 * disc + volume / disc * bore * math.pi
    return angle, volume, area, swept, clearance


def engine_of(cylinder: Any) -> Engine:
    """Return the cylinder of the package in SI; ValueError for physics that the contenders do not share."""
    c = cylinder
    shared = {"burn_shape": "triangle", "gamma_model": "constant", "wall_heat_model": "woschni"}
    shared |= {"ivc_pressure_rise_kpa": 0.0}
    for name, value in shared.items():
        if getattr(c, name) != value:
            raise ValueError(f"{name} = {getattr(c, name)}: the contenders share {value} only")
    if (c.evo_cad - c.ivc_cad) % 1.0:
        raise ValueError(f"evo_cad - ivc_cad = {c.evo_cad - c.ivc_cad}: the contenders share whole steps of 1 °CA only")
    angle, volume, area, swept, clearance = crank_tables(c)
    return Engine(
        angle, volume, area, swept, clearance, c.bore_mm / 1e3, c.stroke_mm / 1e3, c.gamma,
        c.wall_heat_scale * WOSCHNI_BAR_M, c.woschni_c2, c.woschni_cp_m_per_sk, c.wall_temperature_k,
        c.volumetric_efficiency, c.lower_heating_value_mj_per_kg, c.burn_duration_ref_cad, c.burn_fuel_ref_mg,
        c.burn_speed_ref_rpm, c.burn_fuel_exponent, c.burn_speed_exponent,
    )  # fmt: skip


def cut_tables(e: Engine) -> CutTables:
    """Trapezoid with constant gamma, solved for the next pressure; T = p V/(N R) takes T^-0.55 to p^-0.55 V^-0.55."""
    v0, v1, inner = e.volume[:-1], e.volume[1:], e.gamma - 1
    half = inner * (v1 - v0) / 2
    wall = e.area[:-1] * v0**-0.55 * np.diff(e.angle)
    return CutTables((v0 - half) / (v1 + half), inner / (v1 + half), wall, (e.volume[0] / v0) ** e.gamma)


def charge_of(e, speed, fuel, pressure_kpa, temperature):  # floats, columns or tracers
    """Return p(IVC) [Pa], gas N R [J/K] (Tan 2018, eq. 2-3), heat of the fuel [J] and burn duration [°CA]."""
    pressure = pressure_kpa * 1e3
    gas = e.volumetric_efficiency * pressure * e.swept / temperature
    duration = e.duration_ref * (fuel / e.fuel_ref) ** e.fuel_exponent * (speed / e.speed_ref) ** e.speed_exponent
    return pressure, gas, fuel * e.lower_heating_value, duration


def timing_sweep(point: Any, n: int) -> Array:
    """Cases of one operating point at `n` ascending timings."""
    cases = np.empty((n, len(INPUTS)))
    cases[:, :4] = [getattr(point, name) for name in INPUTS[:4]]
    cases[:, 4] = np.linspace(EARLIEST_CAD, LATEST_CAD, n)
    return cases


def arbitrary_points(e: Engine, n: int, seed: int = 15) -> Array:
    """Cases in which all five inputs vary; the fuel is 15 % to all of what the air burns at `LEAST_AIR_RATIO`."""
    rng = np.random.default_rng(seed)
    low, high = [800.0, 0.15, 100.0, 290.0, EARLIEST_CAD], [4000.0, 1.0, 250.0, 340.0, LATEST_CAD]
    cases = rng.uniform(low, high, (n, len(INPUTS)))
    air_mg = e.volumetric_efficiency * cases[:, 2] * 1e3 * e.swept / (AIR_J_PER_KGK * cases[:, 3]) * 1e6
    cases[:, 1] *= air_mg / (AIR_PER_FUEL * LEAST_AIR_RATIO)
    return cases
