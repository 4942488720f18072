"""Limits of a search of the best timing: where a run with limits starts, and how its limits were kept."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from mgdd.loop.limit_figures import FIGURES, NOISE_FREE
from mgdd.loop.plant_loop import LoopRun
from mgdd.loop.seek_task import Task, amplitude_of
from mgdd.optimize.optimum import Optimum

__all__ = ["COV", "COV_CYCLES", "SCATTER", "choose_start", "doubts_of", "limit_report"]

COV, COV_CYCLES = "cov_imep_percent", 50
SCATTER = 3.0  # standard deviations of the reading
_START_MARGIN = 0.1  # of a limit
_SCAN_CAD = 0.1


def choose_start(task: Task, *, wanted: str = "default") -> tuple[float, str]:
    """Choose a start whose noise-free values, dither included, stay below the limits by a margin, and say why.

    The start of the task is taken where it does; `wanted` says what it is.
    """
    if task.method == "golden":
        return task.start_cad, f"{wanted}; golden section tries the whole range, wherever it starts"
    low, high = task.bounds_cad
    amplitude = amplitude_of(task)
    timings = np.linspace(low, high, max(2, round((high - low) / _SCAN_CAD) + 1))
    excess = _excess(task, timings)
    starts = timings[(timings >= low + amplitude - 1e-9) & (timings <= high - amplitude + 1e-9)]
    if excess is None or starts.size == 0:
        return task.start_cad, f"{wanted}; no limit has a noise-free value to choose by"

    def worst(start: float) -> float:
        reach = max(amplitude, 0.5 * (timings[1] - timings[0]))  # without dither the nearest timing of the scan
        return float(np.max(excess[np.abs(timings - start) <= reach + 1e-9]))

    below = f"noise-free values stay {100 * _START_MARGIN:g} % below the limits" + (
        f" over ±{amplitude:g} °CA" if amplitude else ""
    )
    if starts[0] <= task.start_cad <= starts[-1] and worst(task.start_cad) <= 0.0:
        return task.start_cad, f"{wanted}; the {below}"
    found = np.array([worst(start) for start in starts])
    kept = found <= 0.0
    if kept[-1]:
        first = starts.size - int(np.argmin(kept[::-1])) if not kept.all() else 0
        return round(float(starts[first]), 6), f"earliest start from which on the {below}"
    if kept.any():
        return round(float(starts[kept][-1]), 6), f"latest start at which the {below}"
    lowest = round(float(starts[int(np.argmin(found))]), 6)
    return lowest, f"start with the lowest values; there is none at which the {below}"


def _excess(task: Task, timings: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Give the largest relative excess over the limits less their margin; None where none has a noise-free value."""
    upper = np.array([task.limits[name] for name in task.bench.limit_names])
    values = np.asarray(task.bench.noise_free_limits(timings, [task.bench.cycle] * timings.size))
    known = np.isfinite(values).any(axis=0)
    if not known.any():
        return None
    size = np.maximum(np.abs(upper), 1e-9)
    relative = (values - upper) / size + _START_MARGIN
    out: np.ndarray[Any, np.dtype[np.float64]] = np.where(np.isfinite(relative), relative, math.inf)[:, known].max(
        axis=1
    )
    return out


def limit_report(
    run: LoopRun, best: Optimum, limits: Mapping[str, float], states: Mapping[str, str]
) -> dict[str, dict[str, Any]]:
    """Give per limit the figures of the run, its state at the end, and the share above three standard deviations."""
    summary, out = run.summary, dict[str, dict[str, Any]]()
    own = 1.0 / math.sqrt(2.0 * (COV_CYCLES - 1))  # a COV of n cycles scatters by 1/sqrt(2n - 2) of its value
    for name, upper in limits.items():
        margin = SCATTER * best.values.get(f"scatter_{name}", own * upper)
        judged = run.dataset["limits"].sel(limit=name).to_numpy()[int(summary["judged_from"]) :]
        free = {figure: summary.get(f"{NOISE_FREE}{figure}_{name}") for figure in FIGURES}
        out[name] = {figure: summary[f"{figure}_{name}"] for figure in FIGURES if f"{figure}_{name}" in summary}
        out[name] |= {
            "state": states[name],
            "noise_free": {figure: value for figure, value in free.items() if value is not None} or None,
            "scatter_margin": margin,
            "threshold_with_margin": upper + margin,
            "judged_above_threshold_fraction": float((judged > upper + margin).mean()) if judged.size else math.nan,
        }
    return out


def doubts_of(run: LoopRun, limits: Mapping[str, float], remedy: str) -> list[str]:
    """Doubt a run whose first reading is above a limit."""
    if not limits or run.dataset.sizes["cycle"] == 0:
        return []
    first = run.dataset.isel(cycle=0)
    out = []
    for name, upper in limits.items():
        reading = float(first["limits"].sel(limit=name))
        if reading > upper:
            out.append(
                f"the first reading has {name} = {reading:.6g}, above the limit {upper:g}, at "
                f"{float(first['soc_requested_cad']):.2f} °CA aTDC: {remedy}"
            )
    return out
