"""Guides of `mgdd engine seek`: a rough cycle model, a parabola or a map in front of the seeker."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mgdd import presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.cli.guide_map import add_map_options, check_map_options, read_map
from mgdd.cli.options import assignments, refuse_idle
from mgdd.cli.seekers import Task, amplitude_of, make_seeker
from mgdd.errors import ParameterError
from mgdd.guide import Curve, CurveSeeking, FeedForward, GuidedEngine, ModelOptimum, OnlineCalibration, TimingMap
from mgdd.optimize import Limit
from mgdd.optimize.optimum import Optimum

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.loop import EngineBench
    from mgdd.optimize import Seeker

__all__ = [
    "CURVES",
    "GUIDES",
    "GuidedTask",
    "add_guidance",
    "check_guidance",
    "guided_seeker",
    "late_loss",
    "task_with_guide",
    "with_start",
]

GUIDES = ("none", "feed_forward", "curve", "calibrated", "map")
CURVES = ("curve", "calibrated")
_SHAPES = ("model", "parabola")
_POINT = frozenset(OperatingPoint.fields())
_PARABOLA_BEND = -0.05  # of ten cycle models, wall heat 0 to 1 and 25 to 60 °CA of burn: -0.037 to -0.054
_CALIBRATED = ("wall_heat_scale",)  # no other setting is better on both engines of the study calibrated-guide
_REACH_CAD = 60.0
_STEADY_GRID_CAD = 0.1


@dataclass(frozen=True, kw_only=True)
class GuidedTask:
    """What guides a run, and where it says the best timing is."""

    kind: str
    cylinder: Cylinder
    guide_cad: float
    model: ModelOptimum | None = None
    curve: Curve | None = None
    table: TimingMap | None = None


def add_guidance(parser: argparse.ArgumentParser) -> None:
    """Add the options of the guide."""
    group = parser.add_argument_group("guide", "a rough model that leads while the measurements decide")
    group.add_argument(
        "--guide", choices=GUIDES, default="none",
        help="feed_forward: the model's best timing, the seeker learns the rest; curve: the model's whole curve, "
        "placed by the measurements; calibrated: the same while the model learns from the measured pressure; map: a "
        "table of timings as feed-forward (default: none)",
    )  # fmt: skip
    group.add_argument(
        "--guide-preset", metavar="NAME_OR_FILE.toml", help="cylinder of the model (default: that of the bench)"
    )
    group.add_argument(
        "--guide-set", action="append", default=[], metavar="FIELD=VALUE",
        help="any field of the model's cylinder, repeatable, for example wall_heat_scale=1.0",
    )  # fmt: skip
    group.add_argument(
        "--guide-shape", choices=_SHAPES,
        help="of the curve: the model's, or a plain parabola about the model's best timing (default: model)",
    )  # fmt: skip
    add_map_options(group)


def check_guidance(args: argparse.Namespace) -> None:
    """Refuse options of a guide that is not there, and a guide that does not fit the method."""
    if args.guide == "none":
        refuse_idle(args, "guide_preset", "guide_set", "guide_shape", why="--guide none has no model")
        check_map_options(args)
        return
    if args.guide == "map":
        refuse_idle(args, "guide_preset", "guide_set", "guide_shape", why="--guide map has a table, not a model")
    check_map_options(args)
    if args.guide in CURVES:
        if args.method is not None or args.form is not None:
            option = "--method" if args.method is not None else "--form"
            raise ParameterError(
                f"{option} acts with --guide none, feed_forward or map: --guide {args.guide} is a seeker itself"
            )
        if args.sensor == "analyser":
            raise ParameterError(
                f"--guide {args.guide} takes J of the same cycle, and the NOx of the analyser is late: use --sensor "
                "soft, or --guide feed_forward"
            )
        if args.guide == "calibrated" and args.guide_shape == "parabola":
            raise ParameterError("--guide-shape parabola: a parabola cannot be calibrated; use --guide curve, or model")
        refuse_idle(args, "limit_method", why=f"--guide {args.guide} keeps limits in its own way")
    else:
        refuse_idle(args, "guide_shape", why=f"--guide {args.guide} takes one timing, not a curve")
    if args.method == "golden":
        raise ParameterError("--method golden searches its whole bracket, whatever the guide says: use another method")


def task_with_guide(args: argparse.Namespace, bench: EngineBench) -> GuidedTask:
    """Make the guide and ask it for the best timing at the point of the bench."""
    if args.guide == "map":
        table = read_map(args.guide_map)
        said = table(bench.point)
        if said is None:
            raise ParameterError(
                f"--guide-map {args.guide_map}: has nothing to say at {bench.point}; its axes end before"
            )
        return GuidedTask(kind="map", cylinder=bench.settings["cylinder"], guide_cad=float(said), table=table)
    cylinder = _cylinder_of(args, bench)
    settings = bench.settings
    model = ModelOptimum(
        cylinder,
        performance=settings["performance"],
        nox=settings["true_nox"],
        bounds_cad=(args.lower_cad, args.upper_cad),
    )
    best = model(bench.point)
    if best is None or not best.curvature < 0.0:
        raise ParameterError(
            f"--guide {args.guide}: the model has no best timing between --lower-cad {args.lower_cad:g} and "
            f"--upper-cad {args.upper_cad:g}: move the bounds or change --guide-set"
        )
    curve = None
    if args.guide in CURVES:
        curve = model.curve(bench.point)
        if args.guide_shape == "parabola":
            curve = Curve.parabola(curvature=_PARABOLA_BEND, best=best["soc_cad"], reach=_REACH_CAD)
        if curve is not None and not args.lower_cad <= curve.best <= args.upper_cad:
            raise ParameterError(
                f"--guide {args.guide}: the best timing of the model, {curve.best:.3g} °CA aTDC, lies outside of "
                f"--lower-cad {args.lower_cad:g} to --upper-cad {args.upper_cad:g}: move the bounds, change "
                "--guide-set, or use --guide feed_forward"
            )
    return GuidedTask(
        kind=args.guide,
        cylinder=cylinder,
        guide_cad=best["soc_cad"] if curve is None else curve.best,
        model=model,
        curve=curve,
    )


def _cylinder_of(args: argparse.Namespace, bench: EngineBench) -> Cylinder:
    base: Cylinder = bench.settings["cylinder"]
    if args.guide_preset is not None:
        with _named("--guide-preset", f"{args.guide_preset}: "):
            base = presets.load(args.guide_preset, kind="engine").cylinder
    fields = {**Cylinder.fields(), **OperatingPoint.fields()}
    with _named("--guide-set"):
        given = assignments(args.guide_set, fields, "--guide-set")
        if known := sorted(_POINT & given.keys()):
            raise ParameterError(f"--guide-set {known[0]}: belongs to the operating point, which guide and bench share")
        if strange := [name for name in given if name not in fields]:
            raise ParameterError(
                f"--guide-set {strange[0]}: is not a field of the cylinder; mgdd.engine.Cylinder has "
                f"{', '.join(Cylinder.fields())}"
            )
        return base.replace(**given)


@contextmanager
def _named(option: str, given: str = "") -> Iterator[None]:
    """Let errors of the library name the option."""
    try:
        yield
    except ParameterError as error:
        said = str(error)
        raise error.reworded(said if said.startswith(option) else f"{option} {given}{said}") from error


def guided_seeker(task: Task, guided: GuidedTask) -> Seeker | FeedForward | GuidedEngine:
    """Make what the loop steers; its first cycle runs at the start of the task."""
    if guided.curve is not None:
        limits = [Limit(name, upper) for name, upper in task.limits.items()]
        drawn = guided.model.limit_curves(task.bench.point, list(task.limits)) if guided.model and limits else None
        seeker = CurveSeeking(
            start=task.start_cad, lower=task.bounds_cad[0], upper=task.bounds_cad[1], curve=guided.curve, limits=limits,
            limit_curves=drawn,
        )  # fmt: skip
        if guided.kind == "curve":
            return seeker
        if guided.model is None:
            raise ParameterError("--guide calibrated: has no model")
        calibration = OnlineCalibration(
            guided.cylinder, parameters=_CALIBRATED, steady_cycles=0, window_cycles=5,
            soc_scatter_cad=float(task.bench.settings["soc_scatter_cad"]),
        )  # fmt: skip
        return GuidedEngine(seeker, guided.model, task.bench.point, calibration=calibration, keep_start=True)
    plain = make_seeker(task)
    if guided.table is not None:
        return FeedForward(plain, guided.table, keep_start=True)
    if guided.model is None:
        raise ParameterError(f"--guide {guided.kind}: has no model")
    return GuidedEngine(plain, guided.model, task.bench.point, keep_start=True)


def late_loss(bench: EngineBench, cycles: xr.Dataset, best: Optimum) -> float:
    """Give the J that is lost per cycle over the second half, by what was applied, against the steady optimum."""
    applied = cycles["soc_applied_cad" if "soc_applied_cad" in cycles else "soc_requested_cad"].to_numpy()
    late = applied[applied.size // 2 :]
    if late.size == 0:
        return math.nan
    low, high = float(late.min()), float(late.max())
    grid = (
        np.linspace(low, high, max(2, math.ceil((high - low) / _STEADY_GRID_CAD) + 1))
        if high > low
        else np.array([low])
    )
    steady = bench.steady_map(grid, cycle=max(bench.cycle - 1, 0))["j"].to_numpy()
    return float(best.value - np.mean(np.interp(late, grid, steady)))


def with_start(task: Task, guided: GuidedTask) -> tuple[Task, str]:
    """Start at the guide's best timing, or where the bounds leave room for the dither, and say which."""
    room = 0.0 if guided.kind in CURVES else amplitude_of(task)
    low, high = task.bounds_cad
    start = min(max(guided.guide_cad, low + room), high - room)
    reason = "best timing of the guide" + ("" if start == guided.guide_cad else ", moved inside of the bounds")
    return replace(task, start_cad=start), reason
