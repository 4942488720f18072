"""Calls that take an executor, each small and with nothing square, and what makes two of their results the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode
from mgdd.engine import OperatingPoint
from mgdd.loop import (
    LoopCriteria,
    Reference,
    VirtualEngine,
    monte_carlo,
    track_many,
    tune_controller,
    tuned_controller,
)
from mgdd.loop.tune import draw_throttles
from mgdd.optimize import ExtremumSeeking, GradientDescent, Limit, Spsa
from mgdd.parallel.chunks import Plan
from mgdd.throttle import Throttle

SPACE = {"start": -12.0, "lower": -30.0, "upper": 10.0}


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


def tracks(**how: Any) -> xr.Dataset:
    """Eleven throttles are a full group of lanes and a broken one; one of the controllers is of another class each."""
    throttles = [*draw_throttles(Throttle(), 10, seed=5), Throttle(friction="stribeck", stiction_nm=0.3)]
    controllers = {
        "guided": GuidedPredictive(),
        "mgdd1": Mgdd1(),
        "pid": Pid(),
        "sliding": SlidingMode(),
        "nmpc": tuned_controller("nmpc"),
    }
    steps = [Reference.step(a, b, hold_s=0.1, after_s=0.3) for a, b in ((40, 42), (4, 20))]
    return track_many(
        controllers, [*steps, "sine:30:5:2"], throttles, first_seed=10, delay_samples=2,
        airflow_torque_nm={steps[1].name: -0.05}, **how,
    )  # fmt: skip


def tuning(**how: Any) -> Any:
    return tune_controller("pid", Throttle(), n_throttles=3, budget=30, seed=2, **how)


CALLS: dict[str, Callable[..., Any]] = {
    "monte_carlo": loops,
    "track_many": tracks,
    "tune_controller": tuning,
}


def same(one: Any, two: Any) -> bool:
    """Every bit of a Dataset or of a tuning."""
    if isinstance(one, xr.Dataset):
        return one.identical(two)
    return bool(one == two)


_KEPT: dict[str, Any] = {}


def plain(name: str) -> Any:
    """Return the result of a call without an executor, computed once in this process."""
    if name not in _KEPT:
        _KEPT[name] = CALLS[name]()
    return _KEPT[name]


def fixed_chunks(monkeypatch: Any, size: int) -> None:
    """Let every chunk have so many items."""
    monkeypatch.setattr(Plan, "_size", lambda plan: min(size, plan._n - plan._next))
