"""Seekers of the best timing with settings that suit the bench that they run on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mgdd.errors import ParameterError, argument
from mgdd.optimize import (
    BoundedSeeking,
    ComponentLag,
    ExtremumSeeking,
    GaussianProcessSeeking,
    GoldenSection,
    Limit,
    NewtonSeeking,
    Spsa,
    tune,
)
from mgdd.optimize.by_curvature import approach_gain, newton_settings
from mgdd.optimize.tuning import Tuning

if TYPE_CHECKING:
    from mgdd.loop.bench import EngineBench
    from mgdd.optimize import Seeker
    from mgdd.optimize.optimum import Optimum

__all__ = ["Task", "amplitude_of", "components_of", "default_cycles", "make_seeker"]

_AMPLITUDE_CAD, _NEWTON_AMPLITUDE_CAD, _LATE_AMPLITUDE_CAD = 1.0, 2.0, 2.0
_NEWTON_LIMITED_CAD = 1.2  # a wide dither keeps its mean far from a limit
_PERTURBATION_CAD = 1.5  # of SPSA
_PERIOD, _TIME_CONSTANT = 10, 40.0  # cycles, without a late sensor
_CYCLES, _LATE_CYCLES, _LATE_TIME_CONSTANTS = 2000, 4000, 16
_PROCESS_CYCLES = 300  # of Gaussian process seeking, which needs tens
_LATE_PROCESS_CYCLES = 2000  # behind the analyser of the bench: 35 windows of 2 s and a delay of 3 s
# Dimensionless, from settings that were tuned to a curvature of 0.051: gain of SPSA and kappa times that curvature.
_SPSA_GAIN, _BOUNDED_KAPPA = 20.0 * 0.051, 0.051
_NEWTON_HOLD_PERIODS = 5
_HOLD = 300


@dataclass(frozen=True, kw_only=True)
class Task:
    """What is to be sought, on which bench, and where its optimum lies."""

    method: str
    form: str
    start_cad: float
    bounds_cad: tuple[float, float]
    seed: int
    noise_sd: float
    limits: Mapping[str, float]
    limit_method: str
    late: bool
    bench: EngineBench
    best: Optimum


def default_cycles(task: Task) -> int:
    """Return how long the run should be; a late sensor asks for a slow seeker."""
    if not task.late:
        return _PROCESS_CYCLES if task.method == "gaussian_process_seeking" else _CYCLES
    if task.method in ("curve", "gaussian_process_seeking"):
        return _LATE_PROCESS_CYCLES
    return max(_LATE_CYCLES, math.ceil(_LATE_TIME_CONSTANTS * _late_tuning(task).time_constant_cycles))


def make_seeker(task: Task) -> Seeker:
    """Make the seeker; its gain follows from the curvature of the steady map, its period from the lag."""
    low, high = task.bounds_cad
    amplitude = amplitude_of(task)
    if low + amplitude > high - amplitude:
        raise ParameterError(
            f"{argument('upper_cad', f'{high:g}')}: must be at least {2.0 * amplitude:g} °CA above "
            f"{argument('lower_cad', f'{low:g}')}, room for what {argument('method', task.method)} moves to both sides"
        )
    if not low + amplitude <= task.start_cad <= high - amplitude:
        moves = f"{amplitude:g} °CA that {argument('method', task.method)} moves about it"
        raise ParameterError(
            f"{argument('start_cad', f'{task.start_cad:g}')}: must be in [{low + amplitude:g}, {high - amplitude:g}], "
            f"{argument('lower_cad')} to {argument('upper_cad')}{f', less the {moves}' if amplitude else ''}; move it "
            "or widen the bounds"
        )
    space: dict[str, Any] = {"start": task.start_cad, "lower": low, "upper": high}
    curvature = abs(task.best.curvature)
    limits = [_limit(task, name, upper) for name, upper in task.limits.items()]
    if task.method == "bounded":
        return BoundedSeeking(**space, kappa=_BOUNDED_KAPPA / curvature, limits=limits)
    if task.method == "spsa":
        gain = _SPSA_GAIN / curvature
        return Spsa(**space, gain=gain, perturbation=_PERTURBATION_CAD, seed=task.seed, limits=limits)
    if task.method == "gaussian_process_seeking":
        return GaussianProcessSeeking(**space, seed=task.seed, limits=limits, components=components_of(task))
    if task.method == "golden":
        return GoldenSection(**space, noise_sd=task.noise_sd, limits=limits)
    period, time_constant = _PERIOD, _TIME_CONSTANT
    if task.late:
        tuning = _late_tuning(task)
        period, time_constant = max(_PERIOD, tuning.period), tuning.time_constant_cycles
    if task.method == "newton":
        return NewtonSeeking(
            **space,
            amplitude=amplitude,
            **newton_settings(curvature, period, reach=5.0),
            time_constant_cycles=time_constant,
            hold_cycles=_NEWTON_HOLD_PERIODS * period if task.late else _HOLD,
            components=components_of(task),
            limits=limits,
        )
    return ExtremumSeeking(
        **space,
        form=task.form,
        amplitude=amplitude,
        period=period,
        gain=approach_gain(curvature, time_constant, amplitude=amplitude),
        components=components_of(task),
        limits=limits,
    )


def amplitude_of(task: Task) -> float:
    """Return how far the method moves to both sides of its estimate [°CA]."""
    if task.method in ("bounded", "golden", "gaussian_process_seeking"):
        return 0.0
    if task.method == "spsa":
        return _PERTURBATION_CAD
    if task.late:
        return _LATE_AMPLITUDE_CAD
    if task.method == "newton":
        return _NEWTON_LIMITED_CAD if task.best.active_limits else _NEWTON_AMPLITUDE_CAD
    return _AMPLITUDE_CAD


def components_of(task: Task) -> list[ComponentLag] | None:
    """Return what stands between the plant and each component of J; None where nothing does."""
    return [ComponentLag(), _lag(task)] if task.late else None  # the order of Performance.efficiency_and_nox


def _lag(task: Task) -> ComponentLag:
    gain = task.bench.analyser_gain
    lag = -1.0 / math.log1p(-gain) if gain < 1.0 else 0.0
    return ComponentLag(delay_cycles=float(task.bench.analyser_delay_cycles), lag_cycles=lag)


def _late_tuning(task: Task) -> Tuning:
    lag = _lag(task)
    return tune(
        max(task.noise_sd, 0.01),
        task.best.curvature,
        delay_cycles=lag.delay_cycles,
        lag_cycles=lag.lag_cycles,
        amplitude_max=_LATE_AMPLITUDE_CAD,
    )


def _limit(task: Task, name: str, upper: float) -> Limit:
    """Make a limit; penalty and barrier balance the slope of J one scatter beyond it and one scatter before it."""
    slope_of_j = abs(task.best.curvature) * max(abs(task.best["soc_cad"] - task.best.free_inputs["soc_cad"]), 1.0)
    reach = max(float(task.bench.settings["soc_scatter_cad"]), 0.1)
    weight = 1.0
    if task.limit_method == "barrier":
        weight = slope_of_j * reach
    elif task.limit_method == "penalty":
        slope = _slope_of(task, name)
        weight = slope_of_j * (upper / slope) ** 2 / (2.0 * reach) if slope > 0.0 and upper != 0.0 else 1.0
    return Limit(name, upper, method=task.limit_method, weight=weight)


def _slope_of(task: Task, name: str) -> float:
    low, high = task.bench.window_cad
    around = task.bench.steady_map([max(task.best["soc_cad"] - 0.5, low), min(task.best["soc_cad"] + 0.5, high)])
    return abs(float(around[name][1] - around[name][0])) if name in around else 0.0
