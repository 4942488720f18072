"""The literal cycle as one writes it first, loops over floats, for `sweep_speed.py`."""

from __future__ import annotations

import itertools

import numpy as np
from peers.cycle_cases import Array, Engine, charge_of


def python_cycles(e: Engine, cases: Array) -> Array:
    """Rows of `INPUTS` to rows of `FIGURES`, one cycle after another, floats and lists only."""
    angle, volume, area = e.angle.tolist(), e.volume.tolist(), e.area.tolist()
    return np.array([_one_cycle(e, angle, volume, area, *row) for row in cases.tolist()])


def _one_cycle(e, angle, volume, area, speed, fuel, pressure_kpa, temperature_in, soc):
    p_ref, gas, heat, duration = charge_of(e, speed, fuel, pressure_kpa, temperature_in)
    t_ref, piston = p_ref * volume[0] / gas, e.stroke * speed / 30
    p, lost, burned = [p_ref], 0.0, 0.0
    for k in range(len(angle) - 1):
        temperature = p[k] * volume[k] / gas
        w = e.c2 * piston
        rise = p[k] / p_ref - (volume[0] / volume[k]) ** e.gamma
        if angle[k] >= soc and rise > 0.0:
            w += e.cp * e.swept / volume[0] * t_ref * rise
        film = e.wall_scale * e.bore**-0.2 * (p[k] / 1e5) ** 0.8 * temperature**-0.55 * w**0.8
        loss = film * area[k] * (temperature - e.wall_k) * (angle[k + 1] - angle[k]) / (6 * speed)
        s = min(max((angle[k + 1] - soc) / duration, 0.0), 1.0)
        after = 2 * s * s if s <= 0.5 else 1 - 2 * (1 - s) ** 2
        half, inner = (volume[k + 1] - volume[k]) / 2, e.gamma - 1
        added = heat * (after - burned) - loss
        p.append((p[k] * (volume[k] / inner - half) + added) / (volume[k + 1] / inner + half))
        lost, burned = lost + loss, after
    closed = sum((p[k] + p[k + 1]) / 2 * (volume[k + 1] - volume[k]) for k in range(len(angle) - 1))
    bottom = e.clearance + e.swept
    gross = closed + p_ref * (volume[0] - bottom) + (p[-1] + p_ref) / 2 * (bottom - volume[-1])
    top = max(range(len(p)), key=p.__getitem__)
    a, b, c = p[top - 1], p[top], p[top + 1]
    bend = a - 2 * b + c
    slopes = [q1 - q0 for q0, q1 in itertools.pairwise(p)]
    steep = max(range(len(slopes)), key=slopes.__getitem__)
    p_max, at = b - (a - c) ** 2 / (8 * bend), angle[top] + (a - c) / (2 * bend)
    works = (closed / e.swept / 1e5, gross / e.swept / 1e5, gross / heat)
    return (*works, p_max / 1e5, at, slopes[steep] / 1e5, angle[steep] + 0.5, lost)
