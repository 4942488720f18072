"""Several inputs of the bench sought at once: from where, how long, and what it came to."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from mgdd.errors import Interrupted, ParameterError
from mgdd.loop import EngineBench, run_seeker
from mgdd.loop.plant_loop import LoopRun
from mgdd.loop.seek_limits import COV
from mgdd.optimize import GaussianProcessSeeking

__all__ = ["seek_inputs"]

_CYCLES = 300
_GRID = 7  # per input, of which the start is chosen
_ROOM = 0.1  # of a limit


def seek_inputs(
    bench: EngineBench,
    bounds: Mapping[str, tuple[float, float]],
    limits: Mapping[str, float],
    *,
    start_cad: float | None,
    cycles: int | None,
) -> tuple[LoopRun, dict[str, Any]]:
    """Seek on a bench of several inputs, and give the run with its figures."""
    best = bench.find_optimum({name: upper for name, upper in limits.items() if name != COV}, bounds=bounds)
    start, reason = _start(bench, bounds, limits, start_cad)
    settings: dict[str, Any] = {"inputs": bounds, "limits": limits}  # the core's stub knows one form of each
    seeker = GaussianProcessSeeking(start=start, seed=bench.seed, **settings)
    try:
        run = run_seeker(bench, seeker, _CYCLES if cycles is None else cycles)
    except Interrupted as stop:
        if not isinstance(stop.partial, LoopRun):
            raise
        run = stop.partial
    final = dict(zip(bounds, map(float, seeker.estimate), strict=True))
    steady = bench.steady_map({name: [value] for name, value in final.items()})["j"]
    figures = {
        name: value for name, value in run.summary.items() if name.endswith(tuple(limits)) or name == "judged_from"
    }
    return run, {
        "seed": bench.seed,
        "cycles": run.dataset.sizes["cycle"],
        "start": start,
        "start_reason": reason,
        "final": final,
        "optimum": dict(best.inputs),
        "optimum_active_limits": list(best.active_limits),
        "j_lost_at_final": best.value - float(steady.squeeze()),
        "mean_j": run.summary["mean_j"],
        "mean_efficiency_percent": run.summary["mean_efficiency_percent"],
        "mean_nox_ppm": run.summary["mean_nox_ppm"],
        "misfires": int(run.summary["misfires"]),
        "findings": [str(finding) for finding in run.findings],
        "limits": dict(limits),
        "limit_figures": figures,
        "interrupted": run.interrupted,
    }


def _start(
    bench: EngineBench, bounds: Mapping[str, tuple[float, float]], limits: Mapping[str, float], start_cad: float | None
) -> tuple[dict[str, float], str]:
    """Take the middle of the bounds, or what is nearest to it of a grid and keeps clear of the limits."""
    low, high = (np.array(side) for side in zip(*bounds.values(), strict=True))
    axes = [np.linspace(a, b, _GRID) for a, b in bounds.values()]
    if start_cad is not None:
        if not low[0] <= start_cad <= high[0]:
            raise ParameterError(f"--start-cad {start_cad:g}: must be in [{low[0]:g}, {high[0]:g}]")
        axes[0] = np.array([start_cad])
    grid = np.array(list(itertools.product(*axes)))
    away = np.linalg.norm((grid - (low + high) / 2) / (high - low), axis=1)
    names = [name for name in bench.limit_names if name != COV]
    reason = "nearest to the middle of the bounds"
    if names:
        at = [bench.limit_names.index(name) for name in names]
        first, *further = grid.T
        values = bench.noise_free_limits(first, [bench.cycle] * len(grid), further)[:, at]
        uppers = np.array([limits[name] for name in names])
        over = np.max((values - uppers) / np.maximum(np.abs(uppers), 1e-9) + _ROOM, axis=1)
        kept = np.nan_to_num(over, nan=np.inf) <= 0.0
        reason += f" with noise-free values {100 * _ROOM:g} % below the limits"
        if not kept.any():
            kept, reason = over == np.nanmin(over), "lowest values; nothing keeps clear of the limits"
        away = np.where(kept, away, np.inf)
    return dict(zip(bounds, map(float, grid[int(np.argmin(away))]), strict=True)), reason
