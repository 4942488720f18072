"""Many cycles in Numba, scalar code per cycle, on one core or by `prange`, for `sweep_speed.py`.

The forms:

- `literal`: four general powers in every step, as the equations are printed;
- `cut`: everything of the angle in tables, two square roots, one power and that only from SOC on, figures in the
  same loop;
- `shared`: `cut` for one operating point, whose compression is integrated once for all timings.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numba
import numpy as np
from peers.cycle_cases import FIGURES, Array, CutTables, Engine, charge_of, cut_tables
from peers.numba_cycle import burned_fraction

FORMS = ("literal", "cut", "shared")
_charge = numba.njit(charge_of)


@numba.njit(error_model="numpy")
def _write(e, p_ref, heat, p_end, closed, lost, a, b, c, top, slope, steep, out) -> None:
    """Figures from the sums and the three pressures about the highest."""
    bottom = e.clearance + e.swept
    gross = closed + p_ref * (e.volume[0] - bottom) + 0.5 * (p_end + p_ref) * (bottom - e.volume[-1])
    bend = a - 2.0 * b + c
    out[0], out[1], out[2] = closed / e.swept / 1e5, gross / e.swept / 1e5, gross / heat
    out[3], out[4] = (b - (a - c) * (a - c) / (8.0 * bend)) / 1e5, e.angle[top] + (a - c) / (2.0 * bend)
    out[5], out[6], out[7] = slope / 1e5, e.angle[steep] + 0.5, lost


@numba.njit(error_model="numpy")
def _literal_cycle(e, tables, case, p, out) -> None:  # noqa: ARG001 - one signature for both forms
    speed, soc = case[0], case[4]
    p_ref, gas, heat, duration = _charge(e, speed, case[1], case[2], case[3])
    v, n = e.volume, e.angle.size
    t_ref, piston, bore_power = p_ref * v[0] / gas, e.stroke * speed / 30.0, e.bore**-0.2
    p[0] = p_ref
    closed = lost = burned = 0.0
    for k in range(n - 1):
        temperature = p[k] * v[k] / gas
        rise = p[k] / p_ref - (v[0] / v[k]) ** e.gamma
        w = e.c2 * piston
        if e.angle[k] >= soc and rise > 0.0:
            w += e.cp * e.swept / v[0] * t_ref * rise
        film = e.wall_scale * bore_power * (p[k] / 1e5) ** 0.8 * temperature**-0.55 * w**0.8
        loss = film * e.area[k] * (temperature - e.wall_k) * (e.angle[k + 1] - e.angle[k]) / (6.0 * speed)
        after = burned_fraction((e.angle[k + 1] - soc) / duration)
        half, inner = 0.5 * (v[k + 1] - v[k]), e.gamma - 1.0
        p[k + 1] = (p[k] * (v[k] / inner - half) + heat * (after - burned) - loss) / (v[k + 1] / inner + half)
        closed += (p[k] + p[k + 1]) * half
        lost, burned = lost + loss, after
    top = steep = 0
    slope = -np.inf
    for k in range(n - 1):
        if p[k + 1] > p[top]:
            top = k + 1
        if p[k + 1] - p[k] > slope:
            slope, steep = p[k + 1] - p[k], k
    _write(e, p_ref, heat, p[-1], closed, lost, p[top - 1], p[top], p[top + 1], top, slope, steep, out)


@numba.njit(error_model="numpy")
def _wall(e, gas, speed):
    """Return scale of the loss, velocity without burn, velocity per Pa of rise, power 0.8 of that without burn."""
    still = e.c2 * e.stroke * speed / 30.0
    scale = e.wall_scale * 1e5**-0.8 * e.bore**-0.2 * gas**0.55 / (6.0 * speed)
    return scale, still, e.cp * e.swept / gas, math.exp(0.8 * math.log(still))


@numba.njit(error_model="numpy")
def _compress(e, tables, p_ref, gas, scale_still, last, p) -> tuple[float, float]:
    """Integrate to step `last` without heat release and power; the pressures go to `p`."""
    closed = lost = 0.0
    pressure, per_gas = p_ref, 1.0 / gas
    p[0] = p_ref
    for k in range(last):
        root = math.sqrt(math.sqrt(pressure))
        loss = scale_still * tables.wall[k] * (pressure * e.volume[k] * per_gas - e.wall_k) * root
        following = tables.keep[k] * pressure - tables.gain[k] * loss
        closed += (pressure + following) * (e.volume[k + 1] - e.volume[k])
        lost += loss
        pressure = p[k + 1] = following
    return 0.5 * closed, lost


@numba.njit(error_model="numpy")
def _burn(e, tables, case, charge, wall, start, closed, lost, top, steep, p, out) -> None:
    """From step `start`, the last that begins before SOC, to EVO; `p` holds the pressures up to there."""
    p_ref, gas, heat, duration = charge
    scale, still, per_pa, still_power = wall
    soc, per_gas, per_duration = case[4], 1.0 / gas, 1.0 / duration
    pressure, closed, slope, burned = p[start], 2.0 * closed, p[steep + 1] - p[steep], 0.0
    highest = p[top]
    for k in range(start, e.angle.size - 1):
        after = burned_fraction((e.angle[k + 1] - soc) * per_duration)
        lead = scale * tables.wall[k] * (pressure * e.volume[k] * per_gas - e.wall_k)
        root = math.sqrt(math.sqrt(pressure))
        rise = pressure - p_ref * tables.motored[k]
        power = math.exp(0.8 * math.log(still + per_pa * rise)) if k > start and rise > 0.0 else still_power
        loss = lead * root * power
        following = (
            tables.keep[k] * pressure + tables.gain[k] * heat * (after - burned) - tables.gain[k] * lead * root * power
        )
        closed += (pressure + following) * (e.volume[k + 1] - e.volume[k])
        lost, burned = lost + loss, after
        if following > highest:
            highest, top = following, k + 1
        if following - pressure > slope:
            slope, steep = following - pressure, k
        pressure = p[k + 1] = following
    _write(e, p_ref, heat, pressure, 0.5 * closed, lost, p[top - 1], p[top], p[top + 1], top, slope, steep, out)


@numba.njit(error_model="numpy")
def _peaks(p, last) -> tuple[int, int]:
    """Index of the highest pressure, and of the steepest step, of the first `last` steps."""
    top = steep = 0
    for k in range(last):
        if p[k + 1] > p[top]:
            top = k + 1
        if p[k + 1] - p[k] > p[steep + 1] - p[steep]:
            steep = k
    return top, steep


@numba.njit(error_model="numpy")
def _cut_cycle(e, tables, case, p, out) -> None:
    charge = _charge(e, case[0], case[1], case[2], case[3])
    wall = _wall(e, charge[1], case[0])
    start = np.searchsorted(e.angle, case[4]) - 1
    closed, lost = _compress(e, tables, charge[0], charge[1], wall[0] * wall[3], start, p)
    top, steep = _peaks(p, start)
    _burn(e, tables, case, charge, wall, start, closed, lost, top, steep, p, out)


@numba.njit(error_model="numpy")
def _shared(e, tables, cases) -> Array:
    """`cut` for one operating point: compression to the latest SOC once, with its sums and peaks at every angle."""
    n = e.angle.size
    first = cases[0]
    charge = _charge(e, first[0], first[1], first[2], first[3])
    wall = _wall(e, charge[1], first[0])
    last = np.searchsorted(e.angle, cases[:, 4].max()) - 1
    still = np.empty(n)
    closed, lost = np.zeros(n), np.zeros(n)
    top, steep = np.zeros(n, np.int64), np.zeros(n, np.int64)
    _compress(e, tables, charge[0], charge[1], wall[0] * wall[3], last, still)
    for k in range(last):
        temperature = still[k] * e.volume[k] / charge[1]
        root = math.sqrt(math.sqrt(still[k]))
        lost[k + 1] = lost[k] + wall[0] * wall[3] * tables.wall[k] * (temperature - e.wall_k) * root
        closed[k + 1] = closed[k] + 0.5 * (still[k] + still[k + 1]) * (e.volume[k + 1] - e.volume[k])
        top[k + 1] = k + 1 if still[k + 1] > still[top[k]] else top[k]
        steep[k + 1] = k if still[k + 1] - still[k] > still[steep[k] + 1] - still[steep[k]] else steep[k]
    out = np.empty((len(cases), len(FIGURES)))
    p = still.copy()
    for i in range(len(cases)):
        start = np.searchsorted(e.angle, cases[i, 4]) - 1
        a = max(min(top[start], start) - 1, 0)
        p[a : start + 1] = still[a : start + 1]
        p[steep[start] : steep[start] + 2] = still[steep[start] : steep[start] + 2]
        _burn(e, tables, cases[i], charge, wall, start, closed[start], lost[start], top[start], steep[start], p, out[i])
    return out


@cache
def _loop(form: str, parallel: bool) -> Callable[[Engine, CutTables, Array], Array]:
    """Compile the loop over the cases; each thread has a trace of its own."""
    cycle = _literal_cycle if form == "literal" else _cut_cycle
    rows, n_figures = numba.prange if parallel else range, len(FIGURES)

    @numba.njit(error_model="numpy", parallel=parallel)
    def run(e, tables, cases):
        out = np.empty((len(cases), n_figures))
        blocks = 64
        for block in rows(blocks):
            p = np.empty(e.angle.size)
            for i in range(block * len(cases) // blocks, (block + 1) * len(cases) // blocks):
                cycle(e, tables, cases[i], p, out[i])
        return out

    return run


def compile_sweep(form: str, e: Engine, *, parallel: bool = False) -> Callable[[Array], Array]:
    """Return one of `FORMS` as a function from cases to figures; its first call compiles."""
    tables = cut_tables(e)
    run = _shared if form == "shared" else _loop(form, parallel)
    return lambda cases: run(e, tables, cases)
