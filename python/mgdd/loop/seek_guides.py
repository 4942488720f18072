"""Guides of a search of the best timing: a rough cycle model, a parabola or a map in front of the seeker."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core.engine import Cylinder, Performance
from mgdd.errors import ParameterError, argument
from mgdd.guide import Curve, CurveSeeking, FeedForward, GuidedEngine, ModelOptimum, OnlineCalibration, TimingMap
from mgdd.loop.bench import EngineBench
from mgdd.loop.seek_task import Task, amplitude_of, components_of, make_seeker
from mgdd.optimize import GaussianProcessSeeking, Limit
from mgdd.optimize.optimum import Optimum

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.optimize import Seeker

__all__ = ["CURVES", "Guidance", "guidance_of", "guided_seeker", "late_loss", "with_start"]

CURVES = ("curve", "calibrated")
_PARABOLA_BEND = -0.05  # of ten cycle models, wall heat 0 to 1 and 25 to 60 °CA of burn: -0.037 to -0.054
_CALIBRATED = ("wall_heat_scale",)  # no other setting is better on both engines of the study calibrated-guide
_REACH_CAD = 60.0
_STEADY_GRID_CAD, _MODEL_GRID_CAD = 0.1, 1.0


@dataclass(frozen=True, kw_only=True)
class Guidance:
    """What guides a run, and where it says the best timing is; a model, or a table."""

    kind: str
    cylinder: Cylinder
    guide_cad: float
    model: ModelOptimum | None = None
    curve: Curve | None = None
    table: TimingMap | None = None


def guidance_of(
    kind: str,
    bench: EngineBench,
    bounds_cad: tuple[float, float],
    *,
    cylinder: Cylinder | None,
    shape: str | None,
    table: TimingMap | None,
) -> Guidance:
    """Make the guide and ask it for the best timing at the point of the bench."""
    own: Cylinder = bench.settings["cylinder"] if cylinder is None else cylinder
    said_by = argument("guide", kind)
    if table is not None:
        said = table(bench.point)
        if said is None:
            raise ParameterError(f"{argument('guide_table')}: has nothing to say at {bench.point}; its axes end before")
        return Guidance(kind=kind, cylinder=own, guide_cad=float(said), table=table)
    low, high = bounds_cad
    settings = bench.settings
    model = ModelOptimum(own, performance=settings["performance"], nox=settings["true_nox"], bounds_cad=bounds_cad)
    best = model(bench.point)
    lower, upper = argument("lower_cad", f"{low:g}"), argument("upper_cad", f"{high:g}")
    if best is None or not best.curvature < 0.0:
        raise ParameterError(
            f"{said_by}: the model has no best timing between {lower} and {upper}: move the bounds or change "
            f"{argument('guide_cylinder')}"
        )
    if kind not in CURVES:
        return Guidance(kind=kind, cylinder=own, guide_cad=best["soc_cad"], model=model)
    curve = model.curve(bench.point)
    if shape == "parabola":
        curve = Curve.parabola(curvature=_PARABOLA_BEND, best=best["soc_cad"], reach=_REACH_CAD)
    if curve is not None and not low <= curve.best <= high:
        raise ParameterError(
            f"{said_by}: the best timing of the model, {curve.best:.3g} °CA aTDC, lies outside of {lower} to {upper}: "
            f"move the bounds, change {argument('guide_cylinder')}, or use {argument('guide', 'feed_forward')}"
        )
    guide_cad = best["soc_cad"] if curve is None else curve.best
    return Guidance(kind=kind, cylinder=own, guide_cad=guide_cad, model=model, curve=curve)


def guided_seeker(task: Task, guided: Guidance) -> Seeker | FeedForward | GuidedEngine:
    """Make what the loop steers; its first cycle runs at the start of the task."""
    if guided.model is None:
        if guided.table is None:
            raise ParameterError(f"{argument('guide', guided.kind)}: has neither model nor table")
        return FeedForward(make_seeker(task), guided.table, keep_start=True)
    if guided.curve is None:
        return GuidedEngine(make_seeker(task), guided.model, task.bench.point, keep_start=True)
    limits = [Limit(name, upper) for name, upper in task.limits.items()]
    drawn = guided.model.limit_curves(task.bench.point, list(task.limits)) if limits else None
    low, high = task.bounds_cad
    if task.late:
        return _late_seeker(task, guided, limits, drawn)
    seeker = CurveSeeking(
        start=task.start_cad, lower=low, upper=high, curve=guided.curve, limits=limits, limit_curves=drawn
    )
    if guided.kind == "curve":
        return seeker
    calibration = OnlineCalibration(
        guided.cylinder, parameters=_CALIBRATED, steady_cycles=0, window_cycles=5,
        soc_scatter_cad=float(task.bench.settings["soc_scatter_cad"]),
    )  # fmt: skip
    return GuidedEngine(seeker, guided.model, task.bench.point, calibration=calibration, keep_start=True)


def _late_seeker(task: Task, guided: Guidance, limits: list[Limit], drawn: list[Curve] | None) -> Seeker:
    """Seek behind a late component: each has a process of its own, with what the model says of it as the mean."""
    low, high = task.bounds_cad
    own = {name: value for name, value in task.bench.settings.items() if name != "cylinder"} | {"limits": []}
    grid = np.linspace(low, high, math.ceil((high - low) / _MODEL_GRID_CAD) + 1)
    guides = []
    for term in own["performance"].terms:
        model = EngineBench(guided.cylinder, **own | {"performance": Performance([term])})
        guides.append(model.steady_map(grid)["j"])
    settings: dict[str, Any] = {
        "inputs": {"soc_cad": task.bounds_cad},
        "guide": guides,
        "limits": limits,
        "seed": task.seed,
    }
    if drawn is not None:
        settings["limit_guides"] = [lambda x, one=one: one(x["soc_cad"]) for one in drawn]
    return GaussianProcessSeeking(start={"soc_cad": task.start_cad}, components=components_of(task), **settings)


def late_loss(bench: EngineBench, cycles: xr.Dataset, best: Optimum) -> float:
    """Give the J that is lost per cycle over the second half, by what was applied, against the steady optimum."""
    applied = cycles["soc_applied_cad" if "soc_applied_cad" in cycles else "soc_requested_cad"].to_numpy()
    late = applied[applied.size // 2 :]
    if late.size == 0:
        return math.nan
    low, high = float(late.min()), float(late.max())
    points = max(2, math.ceil((high - low) / _STEADY_GRID_CAD) + 1) if high > low else 1
    grid = np.linspace(low, high, points)
    steady = bench.steady_map(grid, cycle=max(bench.cycle - 1, 0))["j"].to_numpy()
    return float(best.value - np.mean(np.interp(late, grid, steady)))


def with_start(task: Task, guided: Guidance) -> tuple[Task, str]:
    """Start at the guide's best timing, or where the bounds leave room for the dither, and say which."""
    room = 0.0 if guided.kind in CURVES else amplitude_of(task)
    low, high = task.bounds_cad
    start = min(max(guided.guide_cad, low + room), high - room)
    reason = "best timing of the guide" + ("" if start == guided.guide_cad else ", moved inside of the bounds")
    return replace(task, start_cad=start), reason
