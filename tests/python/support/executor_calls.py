"""Loops that take an executor, few and with nothing square."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from mgdd.engine import OperatingPoint
from mgdd.loop import LoopCriteria, VirtualEngine, monte_carlo
from mgdd.optimize import ExtremumSeeking, GradientDescent, Limit, Spsa
from mgdd.parallel.chunks import Plan

SPACE = {"start": -12.0, "bounds": (-30.0, 10.0)}


def loops(**how: Any) -> xr.Dataset:
    """Two operating points, three kinds of seeker of which one has moved, 7 seeds: nothing is square."""
    caps = [Limit("p_max_bar", 95.0), Limit("dp_max_bar_per_cad", 6.0)]
    limits = [cap.name for cap in caps]
    benches = [VirtualEngine(limits=limits), VirtualEngine(point=OperatingPoint(fuel_mg=30.0), limits=limits)]
    benches[0].run(np.full(5, -6.0))
    moved = ExtremumSeeking(**SPACE, gain=0.7, limits=caps)
    for k in range(30):
        moved.ask()
        moved.tell(45.0 - 0.1 * k, limits=[80.0, 4.0])
    seekers = [moved, GradientDescent(**SPACE, limits=caps), Spsa(**SPACE, seed=3, limits=caps)]
    goals = [
        LoopCriteria(optimum=-5.6, exceed_above={"p_max_bar": 90.0}),
        LoopCriteria(optimum=-8.5, limits={"p_max_bar": 120.0}),
    ]
    return monte_carlo(benches, seekers, [3, 1, 4, 15, 9, 2**63, 6], cycles=260, criteria=goals, **how)


_KEPT: list[xr.Dataset] = []


def plain() -> xr.Dataset:
    """Return the result without an executor, computed once in this process."""
    if not _KEPT:
        _KEPT.append(loops())
    return _KEPT[0]


def fixed_chunks(monkeypatch: Any, size: int) -> None:
    """Let every chunk have so many items."""
    monkeypatch.setattr(Plan, "_size", lambda plan: min(size, plan._n - plan._next))
