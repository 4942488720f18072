"""What a bench would show noise-free and without waiting: steady maps of J and limits, and their optimum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core.loop import EngineBench
from mgdd._core.optimize import Limit
from mgdd.engine.optimum import OBJECTIVES, check_request
from mgdd.errors import ConvergenceError, ParameterError, ShapeError
from mgdd.optimize.optimum import Optimum, limits_of
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

__all__ = ["find_optimum", "steady_map"]

_SCAN_CAD = 0.25
_SECANT_CAD = 3.0


def steady_map(quiet: EngineBench, soc_cad: ArrayLike) -> xr.Dataset:
    """Measure a bench that shows nothing random or slow, each sensor settled."""
    timings = np.atleast_1d(np.asarray(soc_cad, float))
    if timings.ndim != 1:
        raise ShapeError(f"soc_cad has {timings.ndim} dimensions: must be a column")
    low, high = quiet.window_cad
    for soc in timings:
        if not low <= soc <= high:
            raise ParameterError(f"soc_cad = {soc:g}: must lie in [{low:g}, {high:g}], the window of the bench")
    rows = [_settled(quiet, float(soc)) for soc in timings]
    names = ("efficiency_gross", "imep_gross_bar", "p_max_bar", "dp_max_bar_per_cad", "t_max_k")
    variables: dict[str, tuple[Any, ...]] = {"soc_cad": ("soc_cad", timings)}
    variables["j"] = ("soc_cad", [row["j"] for row in rows])
    for name in (*names, "nox_true_ppm", "nox_soft_ppm"):
        variables[name] = ("soc_cad", [row[name] for row in rows])
    return labelled_dataset(variables)


def find_optimum(
    quiet: EngineBench,
    limits: Mapping[str, float] | Sequence[Limit] | None,
    bounds_cad: tuple[float, float],
    scatter_cad: float,
) -> Optimum:
    """Find the best timing of such a bench, and what this scatter of SOC would do there."""
    from scipy.optimize import brentq, minimize_scalar

    kept_limits = limits_of(limits)
    check_request(OBJECTIVES[0], [limit.name for limit in kept_limits])
    caps = {limit.name: limit.upper - limit.margin for limit in kept_limits}
    low, high = bounds_cad
    window = quiet.window_cad
    if not window[0] <= low < high <= window[1]:
        raise ParameterError(
            f"bounds_cad = ({low:g}, {high:g}): must increase and lie in [{window[0]:g}, {window[1]:g}]"
        )

    def j(soc: float) -> float:
        return float(_settled(quiet, soc)["j"])

    def excess(soc: float) -> float:
        now = _settled(quiet, soc)
        return max((float(now[name]) - limit for name, limit in caps.items()), default=-1.0)

    def peak(a: float, b: float) -> float:
        return float(minimize_scalar(lambda x: -j(x), bounds=(a, b), method="bounded", options={"xatol": 1e-4}).x)

    grid = np.linspace(low, high, round((high - low) / _SCAN_CAD) + 1)
    values = np.array([j(x) for x in grid])
    top = int(np.argmax(values))
    free = peak(grid[max(top - 1, 0)], grid[min(top + 1, grid.size - 1)])
    soc = free
    if excess(free) > 0.0:
        kept = np.array([excess(x) <= 0.0 for x in grid])
        if not kept.any():
            raise ConvergenceError(f"no soc_cad in [{low:g}, {high:g}] keeps {caps}: raise a limit")
        best = int(np.argmax(np.where(kept, values, -np.inf)))
        step = 1 if grid[best] < free else -1
        outside = grid[best + step] if abs(grid[best + step] - grid[best]) < abs(free - grid[best]) else free
        soc = float(brentq(excess, grid[best], outside, xtol=1e-6)) if excess(outside) > 0.0 else float(grid[best])
    at = _settled(quiet, soc)
    around = [j(free - _SECANT_CAD), j(free), j(free + _SECANT_CAD)]
    early, late = _settled(quiet, soc - 0.05), _settled(quiet, soc + 0.05)
    numbers = {name: float(value) for name, value in at.items() if isinstance(value, float) and name != "soc_cad"}
    spread = {f"scatter_{name}": abs(late[name] - early[name]) / 0.1 * scatter_cad for name in caps}
    return Optimum(
        inputs={"soc_cad": soc},
        objective="j",
        value=float(at["j"]),
        values={**numbers, **spread},
        limits=kept_limits,
        active_limits=tuple(name for name, limit in caps.items() if at[name] > limit - 1e-3 * max(1.0, abs(limit))),
        at_bound=min(soc - low, high - soc) < 1e-3,
        bounds={"soc_cad": (low, high)},
        curvature=(around[0] - 2.0 * around[1] + around[2]) / _SECANT_CAD**2,
        free_inputs={"soc_cad": free},
    )


def _settled(quiet: EngineBench, soc_cad: float) -> dict[str, Any]:
    """Measure one cycle from rest: every sensor stands at its steady value."""
    quiet.reset()
    return quiet.step(soc_cad)
