"""Calls that take an executor, each small and with nothing square, and what makes two of their results the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

import parallel_work as work
from mgdd.engine import OperatingPoint
from mgdd.identify import fit_ode
from mgdd.identify.throttle.first_principle import fit_first_principle
from mgdd.identify.throttle.smooth import SmoothThrottle
from mgdd.loop import LoopCriteria, VirtualEngine, monte_carlo
from mgdd.optimize import ExtremumSeeking, FitOptions, GradientDescent, Limit, Spsa
from mgdd.parallel.chunks import Plan
from mgdd.results import Fit

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


def records() -> tuple[xr.Dataset, np.ndarray]:
    levels = 0.7 * np.random.default_rng(1).random(40) - 0.35
    time, truth = 1e-3 * np.arange(1600), np.array(list(SmoothThrottle().parameters.values()))
    log = SmoothThrottle().simulate({"time_s": time, "duty": np.repeat(levels, 40)})
    log["angle_deg"] = log["angle_deg"] + np.random.default_rng(2).normal(0.0, 0.05, time.size)
    return log, truth


def smooth(**how: Any) -> Fit:
    log, truth = records()
    starts = truth * np.exp(np.random.default_rng(3).uniform(-0.3, 0.3, (11, 10)))
    return SmoothThrottle().fit(log, start_values=starts, lower=0.1 * truth, upper=10.0 * truth, **how)


def groups(**how: Any) -> Fit:
    return fit_first_principle(records()[0], options=FitOptions(n_starts=5, max_iterations=15), **how)


def ode(**how: Any) -> Fit:
    time = np.linspace(0.0, 10.0, 101)
    y = 2.0 * (1.0 - np.exp(-time / 0.5)) + 0.01 * np.random.default_rng(0).normal(size=101)
    record = {"time_s": time, "u": np.ones(101), "y": y}
    bounds = {"gain": (0.1, 9.0), "time_s": (0.1, 9.0)}
    return fit_ode(
        work.lag, record, parameters={"gain": 1.0, "time_s": 1.0}, initial_state=[0.0], bounds=bounds,
        options=FitOptions(n_starts=5), **how,
    )  # fmt: skip


CALLS: dict[str, Callable[..., Any]] = {
    "monte_carlo": loops,
    "SmoothThrottle.fit": smooth,
    "fit_first_principle": groups,
    "fit_ode": ode,
}


def same(one: Any, two: Any) -> bool:
    """Every bit of a Dataset, of a fit with its reports."""
    if isinstance(one, xr.Dataset):
        return one.identical(two)
    rows = [(f.parameters, f.start_rmse, f.n_best, f.unidentifiable, str(f.findings)) for f in (one, two)]
    arrays = [(f.report.values, f.report.stderr, f.report.residual) for f in (one, two)]
    alike = all(np.array_equal(a, b, equal_nan=True) for a, b in zip(*arrays, strict=True))
    return alike and rows[0] == rows[1] and one.run.identical(two.run)


_KEPT: dict[str, Any] = {}


def plain(name: str) -> Any:
    """Return the result of a call without an executor, computed once in this process."""
    if name not in _KEPT:
        _KEPT[name] = CALLS[name]()
    return _KEPT[name]


def fixed_chunks(monkeypatch: Any, size: int) -> None:
    """Let every chunk have so many items."""
    monkeypatch.setattr(Plan, "_size", lambda plan: min(size, plan._n - plan._next))
