"""The literal cycle with NumPy across the points, for `sweep_speed.py`; a test compares it with the package."""

from __future__ import annotations

import numpy as np
from peers.cycle_cases import FIGURES, Array, Engine, charge_of


def numpy_cycles(e: Engine, cases: Array, block: int) -> Array:
    """Rows of `INPUTS` to rows of `FIGURES`, `block` cases at a time: what is worked on should fit the cache."""
    return np.concatenate([_block(e, cases[i : i + block]) for i in range(0, len(cases), block)])


def _block(e: Engine, cases: Array) -> Array:
    """Loop over the angles, with a column for each quantity."""
    speed, fuel, pressure_kpa, temperature_in, soc = cases.T
    angle, volume, area = e.angle, e.volume, e.area
    p_ref, gas, heat, duration = charge_of(e, speed, fuel, pressure_kpa, temperature_in)
    t_ref, piston = p_ref * volume[0] / gas, e.stroke * speed / 30
    p = np.empty((angle.size, len(cases)))
    p[0], lost, burned = p_ref, np.zeros(len(cases)), np.zeros(len(cases))
    for k in range(angle.size - 1):
        temperature = p[k] * volume[k] / gas
        rise = np.where(angle[k] >= soc, np.maximum(p[k] / p_ref - (volume[0] / volume[k]) ** e.gamma, 0.0), 0.0)
        w = e.c2 * piston + e.cp * e.swept / volume[0] * t_ref * rise
        film = e.wall_scale * e.bore**-0.2 * (p[k] / 1e5) ** 0.8 * temperature**-0.55 * w**0.8
        loss = film * area[k] * (temperature - e.wall_k) * (angle[k + 1] - angle[k]) / (6 * speed)
        s = np.clip((angle[k + 1] - soc) / duration, 0.0, 1.0)
        after = np.where(s <= 0.5, 2 * s * s, 1 - 2 * (1 - s) ** 2)
        half, inner = (volume[k + 1] - volume[k]) / 2, e.gamma - 1
        added = heat * (after - burned) - loss
        p[k + 1] = (p[k] * (volume[k] / inner - half) + added) / (volume[k + 1] / inner + half)
        lost, burned = lost + loss, after
    closed = np.diff(volume) / 2 @ (p[:-1] + p[1:])
    bottom = e.clearance + e.swept
    gross = closed + p_ref * (volume[0] - bottom) + (p[-1] + p_ref) / 2 * (bottom - volume[-1])
    column = np.arange(len(cases))
    top = p.argmax(axis=0)
    a, b, c = (p[top + i, column] for i in (-1, 0, 1))
    bend = a - 2 * b + c
    slopes = np.diff(p, axis=0)
    steep = slopes.argmax(axis=0)
    figures = dict.fromkeys(FIGURES, lost)
    figures |= {"imep_closed_bar": closed / e.swept / 1e5, "imep_gross_bar": gross / e.swept / 1e5}
    figures |= {"efficiency_gross": gross / heat, "p_max_bar": (b - (a - c) ** 2 / (8 * bend)) / 1e5}
    figures |= {"p_max_cad": angle[top] + (a - c) / (2 * bend), "dp_max_cad": angle[steep] + 0.5}
    figures |= {"dp_max_bar_per_cad": slopes[steep, column] / 1e5}
    return np.column_stack(list(figures.values()))
