"""The cycle of `puma_single` in Numba: the literal equations and the algebra of the C++ core, for `cycle_speed.py`.

Trapezoid step, triangular burn, constant gamma, Woschni; every indicator of the core. The forms:

- `literal`: p^0.8, T^-0.55, w^0.8 and (V_ref / V)^gamma in every step, as the equations are printed;
- `cut`: the algebra of the core, with w^0.8 as exp(0.8 log w);
- `cut_table`: the same with the core's own table-driven w^0.8, which is not what a Numba user would write.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
from peers.cycle_cases import WOSCHNI_BAR_M, Array, crank_tables

FORMS = ("literal", "cut", "cut_table")
INDICATORS = (
    *("imep_closed_bar", "imep_gross_bar", "efficiency_gross", "p_max_bar", "p_max_cad", "dp_max_bar_per_cad"),
    *("dp_max_cad", "t_max_k", "t_max_cad", "ca10_cad", "ca50_cad", "ca90_cad", "heat_loss_j", "heat_loss_fraction"),
    *("work_closed_j", "work_gross_j", "ringing_intensity_mw_per_m2"),
)
_MANTISSA = np.int64(0xFFFFFFFFFFFFF)
_ONE = np.int64(0x3FF0000000000000)
_CENTRES = 256
_OCTAVES = 64
_INVERSE = 1.0 / (1.0 + (np.arange(_CENTRES) + 0.5) / _CENTRES)
_POWER = (1.0 / _INVERSE) ** 0.8
_OCTAVE = 2.0 ** (0.8 * (np.arange(_OCTAVES) - _OCTAVES // 2))
_C5, _H = 0.011264, 0.5 / _CENTRES
_C1, _C2, _C3, _C4 = 0.8 - _C5 * _H**4 / 8, -0.08, 0.032 + _C5 * _H**2, -0.0176


@dataclass(frozen=True)
class Engine:
    """Parameters of the preset and its nominal point in SI, and the tables over the crank grid.

    `constants`: swept and clearance volume, bore, gamma, wall-heat constant, C2, Cp, wall temperature, speed, fuel
    heat, burn duration, intake pressure, N R, mean piston speed.
    """

    angle: Array
    volume: Array
    area: Array
    constants: Array


def engine(cylinder: object, point: object, burn_duration_cad: float) -> Engine:
    """Crank tables, charge (Tan 2018, eq. 2-3) and the other constants of one cylinder at one point."""
    c, o = cylinder, point
    bore, stroke = c.bore_mm / 1e3, c.stroke_mm / 1e3
    angle, volume, area, swept, clearance = crank_tables(c)
    intake_pa = o.intake_pressure_kpa * 1e3
    gas = c.volumetric_efficiency * intake_pa * swept / o.intake_temperature_k
    heat = o.fuel_mg * c.lower_heating_value_mj_per_kg
    scale = c.wall_heat_scale * WOSCHNI_BAR_M
    constants = np.array(
        [swept, clearance, bore, c.gamma, scale, c.woschni_c2, c.woschni_cp_m_per_sk, c.wall_temperature_k, o.speed_rpm,
         heat, burn_duration_cad, intake_pa, gas, stroke * o.speed_rpm / 30]
    )  # fmt: skip
    return Engine(angle, volume, area, constants)


@numba.njit(error_model="numpy")
def burned_fraction(s: float) -> float:
    if s <= 0.0:
        return 0.0
    if s <= 0.5:
        return 2.0 * s * s
    return 1.0 - 2.0 * (1.0 - s) * (1.0 - s) if s < 1.0 else 1.0


@numba.njit(error_model="numpy")
def _table_power(x: float) -> float:
    """x^0.8 by the tables of `mgdd/common/fast_power.hpp`."""
    bits = np.float64(x).view(np.int64)
    octave = (bits >> 52) - (1023 - _OCTAVES // 2)
    if octave < 0 or octave >= _OCTAVES:
        return x**0.8
    i = (bits & _MANTISSA) >> 44
    z = np.int64((bits & _MANTISSA) | _ONE).view(np.float64) * _INVERSE[i] - 1.0
    lead = _OCTAVE[octave] * _POWER[i]
    return lead + (lead * z) * ((_C1 + _C2 * z) + (z * z) * (_C3 + _C4 * z))


@numba.njit(error_model="numpy")
def _peak(angle: Array, k: int, before: float, at: float, after: float) -> tuple[float, float]:
    if k == 0 or k + 1 >= angle.size:
        return angle[k], at
    left, right = angle[k] - angle[k - 1], angle[k + 1] - angle[k]
    rise, fall = (at - before) / left, (after - at) / right
    bend = (fall - rise) / (left + right)
    if not bend < 0.0:
        return angle[k], at
    offset = rise / bend * -0.5 + 0.5 * left
    return angle[k - 1] + offset, before + rise * offset + bend * offset * (offset - left)


@numba.njit(error_model="numpy")
def _indicators(angle: Array, v: Array, c: Array, soc: float, p: Array, loss: Array, out: Array) -> None:
    swept, clearance, gamma, speed, heat, duration, intake, gas = c[0], c[1], c[3], c[8], c[9], c[10], c[11], c[12]
    n = angle.size
    closed = lost = 0.0
    p_at = t_at = slope_at = 0
    p_best, t_best, slope_best = p[0], p[0] * v[0], -np.inf
    for k in range(n - 1):
        closed += (p[k] + p[k + 1]) * (v[k + 1] - v[k])
        lost += loss[k]
        if p[k + 1] > p_best:
            p_best, p_at = p[k + 1], k + 1
        energy = p[k + 1] * v[k + 1]
        if energy > t_best:
            t_best, t_at = energy, k + 1
        slope = (p[k + 1] - p[k]) / (angle[k + 1] - angle[k])
        if slope > slope_best:
            slope_best, slope_at = slope, k
    closed *= 0.5
    p_cad, p_max = _peak(angle, p_at, p[max(p_at - 1, 0)], p[p_at], p[min(p_at + 1, n - 1)])
    a, b = max(t_at - 1, 0), min(t_at + 1, n - 1)
    t_cad, t_max = _peak(angle, t_at, p[a] * v[a] / gas, p[t_at] * v[t_at] / gas, p[b] * v[b] / gas)
    bottom = clearance + swept
    gross = closed + intake * (v[0] - bottom) + 0.5 * (p[n - 1] + intake) * (bottom - v[n - 1])
    pulse = slope_best * 6.0 * speed * 0.05e-3
    out[0], out[1], out[2] = closed / swept / 1e5, gross / swept / 1e5, gross / heat
    out[3], out[4] = p_max / 1e5, p_cad
    out[5], out[6] = slope_best / 1e5, 0.5 * (angle[slope_at] + angle[slope_at + 1])
    out[7], out[8] = t_max, t_cad
    out[9], out[10] = soc + duration * math.sqrt(0.05), soc + duration * 0.5
    out[11] = soc + duration * (1.0 - math.sqrt(0.05))
    out[12], out[13], out[14], out[15] = lost, lost / heat, closed, gross
    out[16] = pulse * pulse / (2.0 * gamma * p_max) * math.sqrt(gamma * 287.05 * t_max) * 1e-6


def compile_form(form: str, model: Engine) -> Callable[[Array], Array]:
    """Compile one of `FORMS`; the result maps start angles [°CA aTDC] to indicators, one row each."""
    literal, table = form == "literal", form == "cut_table"
    angle, v, area, c = model.angle, model.volume, model.area, model.constants
    gamma, step = c[3], np.diff(angle)
    half, inner = np.diff(v) / 2, gamma - 1
    keep = np.append((v[:-1] - inner * half) / (v[1:] + inner * half), 0.0)
    gain = np.append(inner / (v[1:] + inner * half), 0.0)
    wall = np.append(area[:-1] * v[:-1] ** -0.55 * step, 0.0)
    tables = np.column_stack([keep, gain, wall, (v[0] / v) ** gamma])

    @numba.njit(error_model="numpy")
    def release(angle: Array, c: Array, soc: float, heat_j: Array) -> None:
        """Heat per step; zero outside the burn without evaluating the law there, as in the core."""
        heat_j[:] = 0.0
        duration = c[10]
        first = np.searchsorted(angle, soc, side="right")
        burned = 0.0
        for k in range(max(first, 1), angle.size):
            after = burned_fraction((angle[k] - soc) / duration)
            heat_j[k - 1] = c[9] * (after - burned)
            burned = after
            if angle[k] >= soc + duration:
                break

    @numba.njit(error_model="numpy")
    def run_literal(angle: Array, v: Array, area: Array, c: Array, soc: float, p: Array, loss: Array, q: Array) -> None:
        swept, bore, gamma, scale, c2, cp, wall_k = c[0], c[2], c[3], c[4], c[5], c[6], c[7]
        speed, p_ref, gas, piston = c[8], c[11], c[12], c[13]
        bore_power, t_ref = bore**-0.2, p_ref * v[0] / gas
        p[0] = p_ref
        for k in range(angle.size - 1):
            temperature = p[k] * v[k] / gas
            rise = p[k] / p_ref - (v[0] / v[k]) ** gamma
            w = c2 * piston
            if angle[k] >= soc and rise > 0.0:
                w += cp * swept / v[0] * t_ref * rise
            film = scale * bore_power * (p[k] / 1e5) ** 0.8 * temperature**-0.55 * w**0.8
            loss[k] = film * area[k] * (temperature - wall_k) * (angle[k + 1] - angle[k]) / (6.0 * speed)
            half, inner = 0.5 * (v[k + 1] - v[k]), gamma - 1.0
            p[k + 1] = (p[k] * (v[k] / inner - half) + q[k] - loss[k]) / (v[k + 1] / inner + half)

    @numba.njit(error_model="numpy")
    def power(w: float) -> float:
        return _table_power(w) if table else math.exp(0.8 * math.log(w))

    @numba.njit(error_model="numpy")
    def run_cut(angle: Array, v: Array, tables: Array, c: Array, soc: float, p: Array, loss: Array, q: Array) -> None:
        swept, bore, cp, wall_k, speed, p_ref, gas = c[0], c[2], c[6], c[7], c[8], c[11], c[12]
        still, per_pa, per_gas = c[5] * c[13], cp * swept / gas, 1.0 / gas
        burning, still_power = per_pa * p_ref, power(still)
        scale = c[4] * 1e5**-0.8 * bore**-0.2 * gas**0.55 / (6.0 * speed)
        first = np.searchsorted(angle, soc)
        pressure = p[0] = p_ref
        for k in range(angle.size - 1):
            keep, gain, wall, motored = tables[k]
            lead = scale * wall * (pressure * v[k] * per_gas - wall_k)
            root, velocity_power = math.sqrt(math.sqrt(pressure)), still_power
            if k >= first:
                w = (still - burning * motored) + per_pa * pressure
                if w > still:
                    velocity_power = power(w)
            loss[k] = lead * root * velocity_power
            pressure = (keep * pressure + gain * q[k]) - gain * lead * root * velocity_power
            p[k + 1] = pressure

    @numba.njit(error_model="numpy")
    def sweep(timings: Array, angle: Array, v: Array, area: Array, tables: Array, c: Array) -> Array:
        p, loss, q = np.zeros(angle.size), np.zeros(angle.size), np.zeros(angle.size)
        out = np.empty((timings.size, 17))
        for i in range(timings.size):
            release(angle, c, timings[i], q)
            if literal:
                run_literal(angle, v, area, c, timings[i], p, loss, q)
            else:
                run_cut(angle, v, tables, c, timings[i], p, loss, q)
            _indicators(angle, v, c, timings[i], p, loss, out[i])
        return out

    return lambda timings: sweep(timings, angle, v, area, tables, c)
