"""Best timing and gain of measured loads, as a range over the wall heat that their traces do not determine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine import find_optimum, simulate
from mgdd.engine.optimum import check_request
from mgdd.errors import ConvergenceError
from mgdd.identify.engine.cylinder import BURN_FIELDS, SHAPE_FIELDS, fit_cylinder
from mgdd.identify.engine.records import Load

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["WALL_HEAT_RANGE", "best_timing"]

WALL_HEAT_RANGE = (0.5, 1.0)


def best_timing(
    traces: Sequence[xr.Dataset],
    cylinder: Cylinder,
    *,
    point: OperatingPoint | None = None,
    scales: Sequence[float] = WALL_HEAT_RANGE,
    objective: str = "imep_closed_bar",
    limits: dict[str, float] | None = None,
    bounds_cad: tuple[float, float] | None = None,
    progress: Callable[[str], None] | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> list[dict[str, Any]]:
    """Give each load's best timing and gain as a range over the wall-heat scale, the rest refitted at each.

    The traces do not determine the wall heat, so a single best timing would be false precision.

    Parameters
    ----------
    traces, cylinder, point, step_cad, integrator
        As in `mgdd.identify.fit_cylinder`; the cylinder's burn shape and gamma law are used.
    scales : sequence of float
        Wall-heat scales to refit at [-].
    objective : str
        As in `mgdd.engine.find_optimum`. Closed-cycle work is the default because a closed-valve trace carries no more.
    limits : dict, optional
        Further limits, as in `mgdd.engine.find_optimum`; they hold beside the trace's own p_max.
    bounds_cad : tuple of float, optional
        Searched range of SOC, as in `mgdd.engine.find_optimum`.
    progress : callable, optional
        Called with a short text before each fit.

    Returns
    -------
    list of dict
        Per trace: ``file``, ``p_max_limit_bar`` (the trace's own highest sample, or the model's where that is higher at
        the measured timing), ``points`` (one per scale) and the ranges ``soc_cad``, ``ca50_cad``, ``gain_percent``
        under that limit and ``free_soc_cad``, ``free_ca50_cad``, ``free_gain_percent`` without. A gain is the
        objective's relative rise over the fitted timing [%].

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import best_timing
    >>> rows = best_timing(datasets.load("hd_diesel_128x144")[:1], presets.load("hd_diesel_128x144").cylinder)
    >>> [round(soc) for soc in rows[0]["free_soc_cad"]]
    [-6, -4]
    """
    limits = limits or {}
    check_request(objective, limits)
    search: dict[str, Any] = {"bounds_cad": bounds_cad, "step_cad": step_cad, "integrator": integrator}
    names = BURN_FIELDS + (SHAPE_FIELDS if cylinder.burn_shape == "double_wiebe" else ())
    points: list[list[dict[str, float]]] = [[] for _ in traces]
    for scale in scales:
        if progress is not None:
            progress(f"best timing at wall-heat scale {scale:g}")
        held = cylinder.replace(wall_heat_scale=scale)
        fit = fit_cylinder(traces, held, free=names, point=point, step_cad=step_cad, integrator=integrator)
        if not math.isfinite(fit.report.rmse):
            raise ConvergenceError(f"no calibration at wall-heat scale {scale:g}: {fit.report.message}")
        for own, load in zip(points, fit.loads, strict=True):
            own.append({**_timing(load, scale, objective, limits, search), "converged": fit.report.success})
    return [_as_range(load.file, own) for load, own in zip(fit.loads, points, strict=True)]


def _timing(
    load: Load, scale: float, objective: str, limits: dict[str, float], search: dict[str, Any]
) -> dict[str, float]:
    scheme = {"step_cad": search["step_cad"], "integrator": search["integrator"]}
    now = simulate(load.cylinder, load.point, soc_cad=load.soc_cad, **scheme)
    # The model's own error in p_max at the measured timing is not a violation of the limit.
    ceiling = max(load.p_max_bar, float(now["p_max_bar"]) * (1.0 + 1e-9))
    own = {**limits, "p_max_bar": min(ceiling, limits.get("p_max_bar", math.inf))}
    free = find_optimum(load.cylinder, load.point, objective, limits=limits, **search)
    kept = find_optimum(load.cylinder, load.point, objective, limits=own, **search)
    base = float(now[objective])
    return {
        "wall_heat_scale": scale,
        "fitted_soc_cad": load.soc_cad,
        "p_max_limit_bar": ceiling,
        "soc_cad": kept["soc_cad"],
        "ca50_cad": kept["ca50_cad"],
        "gain_percent": 100.0 * (kept.value / base - 1.0),
        "free_soc_cad": free["soc_cad"],
        "free_ca50_cad": free["ca50_cad"],
        "free_gain_percent": 100.0 * (free.value / base - 1.0),
        "free_p_max_bar": float(simulate(load.cylinder, load.point, soc_cad=free["soc_cad"], **scheme)["p_max_bar"]),
        "at_bound": free.at_bound or kept.at_bound,
        "p_max_model_error_bar": float(now["p_max_bar"]) - load.p_max_bar,
        "efficiency_gross": float(now["efficiency_gross"]),
        "curvature_per_cad2": free.curvature,
    }


def _as_range(file: str, points: list[dict[str, float]]) -> dict[str, Any]:
    def span(name: str) -> list[float]:
        values = [p[name] for p in points]
        return [min(values), max(values)]

    ranged = "soc_cad ca50_cad gain_percent free_soc_cad free_ca50_cad free_gain_percent fitted_soc_cad".split()
    return {
        "file": file,
        "wall_heat_scale": span("wall_heat_scale"),
        "p_max_limit_bar": max(p["p_max_limit_bar"] for p in points),
        **{name: span(name) for name in ranged},
        "points": points,
    }
