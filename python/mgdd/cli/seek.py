"""`mgdd engine seek`: a seeker on the virtual bench, and what it came to."""

from __future__ import annotations

import argparse
import copy
import logging
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.guidance import (
    CURVES,
    GuidedTask,
    add_guidance,
    check_guidance,
    guided_seeker,
    late_loss,
    task_with_guide,
    with_start,
)
from mgdd.cli.guide_map import learn_map
from mgdd.cli.options import add_command, add_engine, engine_of, number_pairs
from mgdd.cli.output import Stopped, check_figure, check_output, emit, lines, save_figure
from mgdd.cli.seek_limits import COV, COV_CYCLES, choose_start, doubts_of, limit_report, limit_text
from mgdd.cli.seekers import Task, default_cycles, make_seeker
from mgdd.engine import Performance
from mgdd.errors import ConvergenceError, Interrupted, ParameterError
from mgdd.guide import GuidedEngine
from mgdd.loop import EngineBench, LoopCriteria, run_seeker
from mgdd.loop.plant_loop import LoopRun
from mgdd.optimize.optimum import Optimum
from mgdd.plot.style import drawn
from mgdd.results.labels import VARIABLES, to_jsonable
from mgdd.results.units import unit_attributes

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["add_seek"]

_LOG = logging.getLogger(__name__)
_METHODS = ("extremum_seeking", "newton", "bounded", "spsa", "golden")
_FORMS = ("batch", "moving_average", "washout")
_LATE = ("extremum_seeking", "newton")
_COV_TRIAL = 1000
_START_CAD = -20.0
_MOST_CYCLES = 2_000_000
_ARRIVAL_CAD = 1.0
_STAYS_CAD = 1.5
# Fields of the library and the options that set them.
_OPTIONS = {"efficiency_noise_percent": "--noise", "misfire_probability": "--misfire", "start": "--start-cad",
            "limits": "--limit", "soc_scatter_cad": "--soc-scatter-cad", "seed": "--seed"}  # fmt: skip


def add_seek(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "seek", _seek,
        help_text="let a seeker find the best start of combustion on the virtual bench, one cycle at a time",
        example="mgdd engine seek --method extremum_seeking --limit p_max_bar=95 --json",
        endings=".json or .csv, the cycles",
    )  # fmt: skip
    parser.add_argument("--method", choices=_METHODS, help="default: extremum_seeking")
    parser.add_argument("--form", choices=_FORMS, help="of extremum_seeking (default: batch)")
    parser.add_argument(
        "--start-cad", type=float, metavar="X",
        help="first SOC (default: -20; with --guide the guide's best timing; with --limit a start whose noise-free "
        "values stay below the limits)",
    )  # fmt: skip
    parser.add_argument("--lower-cad", type=float, default=-30.0, metavar="X", help="earliest SOC (default: -30)")
    parser.add_argument("--upper-cad", type=float, default=10.0, metavar="X", help="latest SOC (default: 10)")
    parser.add_argument(
        "--cycles", type=int, metavar="N",
        help="length of the run (default: 2000; with --sensor analyser 16 time constants of the seeker, 4000 at least)",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all noise (default: 0)")
    parser.add_argument(
        "--limit", action="append", default=[], metavar="NAME=X",
        help=f"keep an indicator, or {COV}, below X; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--limit-method", choices=("switching", "penalty", "barrier"),
        help="how J knows of the limit: not at all, by a penalty or by a barrier (default: switching)",
    )  # fmt: skip
    parser.add_argument("--figure", metavar="FILE", help="draw the run (.png, .svg or .pdf)")
    group = parser.add_argument_group("bench")
    group.add_argument(
        "--sensor", choices=("none", "analyser", "soft"), default="none",
        help="none: J is the efficiency in percent; otherwise less 0.004 per ppm NOx by that sensor (default: none)",
    )  # fmt: skip
    group.add_argument(
        "--soc-scatter-cad", type=float, default=0.3, metavar="X", help="standard deviation of SOC (default: 0.3)"
    )
    group.add_argument(
        "--noise", type=float, default=0.25, metavar="X",
        help="standard deviation of the measured efficiency, in points (default: 0.25)",
    )  # fmt: skip
    group.add_argument("--misfire", type=float, default=0.0, metavar="P", help="probability per cycle (default: 0)")
    add_guidance(parser)
    add_engine(parser)


def _seek(args: argparse.Namespace) -> None:
    check_output(args, ".json", ".csv")
    check_figure(args.figure)
    check_guidance(args)
    guided_curve = args.guide in CURVES
    if args.method is None and not guided_curve:
        args.method = "extremum_seeking"
    _check(args)
    limits = number_pairs(args.limit, "--limit")
    for name, value in limits.items():
        if not math.isfinite(value):
            raise ParameterError(f"--limit {name}={value:g}: must be finite")
    bench, preset = _bench(args, limits)
    _check_bounds(args, bench)
    best = _optimum(args, bench, limits)
    guided = None if args.guide == "none" else task_with_guide(args, bench)
    task = Task(
        method=args.guide if guided_curve else args.method,
        form=args.form or "batch",
        start_cad=_START_CAD if args.start_cad is None else args.start_cad,
        bounds_cad=(args.lower_cad, args.upper_cad),
        seed=args.seed,
        noise_sd=args.noise,
        limits=limits,
        limit_method=args.limit_method or "switching",
        late=args.sensor == "analyser",
        bench=bench,
        best=best,
    )
    reason = "default" if args.start_cad is None else "as given"
    if args.start_cad is None and guided is not None:
        task, reason = with_start(task, guided)
    if args.start_cad is None and limits:
        start, reason = choose_start(task, wanted=reason)
        task = replace(task, start_cad=start)
    with _option_names():
        seeker = make_seeker(task) if guided is None else guided_seeker(task, guided)
    cycles = default_cycles(task) if args.cycles is None else args.cycles
    goal = LoopCriteria(optimum=best["soc_cad"], arrival=_ARRIVAL_CAD)
    try:
        run = run_seeker(bench, seeker, cycles, criteria=goal)
    except Interrupted as stop:
        if not isinstance(stop.partial, LoopRun):
            raise
        run = stop.partial
    bracketing = args.start_cad is None or args.method == "golden"
    remedy = "narrow --lower-cad to --upper-cad" if bracketing else "leave --start-cad out or move it"
    table = None if guided is None else guided.table
    learnt, unlearnt = learn_map(args, table, seeker, bench.point, interrupted=run.interrupted)
    doubts = [*doubts_of(run, limits, remedy), *unlearnt]
    for doubt in doubts:
        _LOG.warning("%s", doubt)
    payload = _payload(args, preset, run, best, limits, seeker.limit_states)
    payload |= _guidance_figures(args, guided, seeker, bench, run, best)
    payload |= learnt
    payload |= {"start_cad": task.start_cad, "start_reason": reason, "warnings": doubts}
    report = payload["limit_report"]
    text = [lines(to_jsonable(payload)), *limit_text(report, int(run.summary["judged_from"]))]
    emit(args, payload, text=text, traces=_table(run.dataset))
    if args.figure:
        _draw(run.dataset, best, limits, args.figure)
    if run.interrupted:
        raise Stopped(f"{run.dataset.sizes['cycle']} of {cycles} cycles are kept")


def _check(args: argparse.Namespace) -> None:
    if args.form is not None and args.method != "extremum_seeking":
        raise ParameterError(f"--form acts with --method extremum_seeking only, not with {args.method}: leave it out")
    if args.limit_method is not None and not args.limit:
        raise ParameterError("--limit-method acts with --limit NAME=X only: give a limit or leave it out")
    if args.cycles is not None and not 1 <= args.cycles <= _MOST_CYCLES:
        raise ParameterError(
            f"--cycles {args.cycles}: must be in [1, {_MOST_CYCLES}]; mgdd.loop.run_seeker continues longer runs"
        )
    if args.method == "bounded" and any(item.partition("=")[0] == COV for item in args.limit):
        raise ParameterError(
            f"--method bounded reads limits off its own oscillation, and {COV} looks back {COV_CYCLES} cycles: use "
            "another method"
        )
    if args.sensor == "analyser" and args.method not in _LATE:
        raise ParameterError(
            f"--method {args.method} takes J of the same cycle, and the analyser is late: use --sensor soft, or "
            "--method extremum_seeking or newton, which turn their demodulation back by the lag"
        )


def _check_bounds(args: argparse.Namespace, bench: EngineBench) -> None:
    low, high = bench.window_cad
    for option, value in (("--lower-cad", args.lower_cad), ("--upper-cad", args.upper_cad)):
        if not low <= value <= high:
            raise ParameterError(f"{option} {value:g}: must be in [{low:g}, {high:g}], the window of the bench")
    if not args.lower_cad < args.upper_cad:
        raise ParameterError(
            f"--lower-cad {args.lower_cad:g}: must be below --upper-cad {args.upper_cad:g}; move one of them"
        )


def _bench(args: argparse.Namespace, limits: Mapping[str, float]) -> tuple[EngineBench, str]:
    cylinder, point, preset = engine_of(args)
    if not point.fuel_mg > 0.0:
        raise ParameterError("fuel_mg = 0: nothing burns, so a best timing does not exist; leave --motored out")
    nox = args.sensor != "none"
    with _option_names():
        bench = EngineBench(
            cylinder,
            point,
            performance=Performance.efficiency_and_nox() if nox else Performance.efficiency_only(),
            nox_sensor=args.sensor,
            limits=list(limits),
            soc_scatter_cad=args.soc_scatter_cad,
            efficiency_noise_percent=args.noise,
            misfire_probability=args.misfire,
            seed=args.seed,
        )
    return bench, preset.name


def _optimum(args: argparse.Namespace, bench: EngineBench, limits: Mapping[str, float]) -> Optimum:
    """Find where the seeker should end; COV of IMEP has no steady value, so it is judged there."""
    steady = {name: value for name, value in limits.items() if name != COV}
    with _option_names():
        best = bench.find_optimum(steady, bounds_cad=(args.lower_cad, args.upper_cad))
    if not best.curvature < 0.0:
        raise ConvergenceError(
            f"the performance has no maximum near --lower-cad {args.lower_cad:g} to --upper-cad {args.upper_cad:g} "
            f"(curvature {best.curvature:.3g} at {best.free_inputs['soc_cad']:.1f}): move the bounds"
        )
    if COV in limits:
        trial = copy.deepcopy(bench).run([best["soc_cad"]] * _COV_TRIAL)
        cov = float(trial["limits"].sel(limit=COV)[COV_CYCLES:].mean())
        if cov > limits[COV]:
            raise ConvergenceError(
                f"--limit {COV}={limits[COV]:g}: the bench has {cov:.3g} % at its best timing, "
                f"{best['soc_cad']:.1f}; raise the limit, or lower --noise, --soc-scatter-cad or --misfire"
            )
    return best


def _payload(
    args: argparse.Namespace,
    preset: str,
    run: LoopRun,
    best: Optimum,
    limits: Mapping[str, float],
    states: Mapping[str, str],
) -> dict[str, Any]:
    summary = run.summary
    out: dict[str, Any] = {
        "method": args.method,
        "preset": preset,
        "sensor": args.sensor,
        "seed": args.seed,
        "cycles": run.dataset.sizes["cycle"],
        "start_cad": None,
        "start_reason": None,
        "final_cad": summary["final_cad"],
        "optimum_cad": best["soc_cad"],
        "free_optimum_cad": best.free_inputs["soc_cad"],
        "cycles_to_1_cad": summary["cycles_to"],
        "rms_cad": summary["rms_cad"],
        "mean_j": summary["mean_j"],
        "mean_efficiency_percent": summary["mean_efficiency_percent"],
        "mean_nox_ppm": summary["mean_nox_ppm"],
        "misfires": int(summary["misfires"]),
        "findings": [str(finding) for finding in run.findings],
        "limits": dict(limits),
        "judged_from": int(summary["judged_from"]),
        "limit_report": limit_report(run, best, limits, states),
        "interrupted": run.interrupted,
    }
    if args.method == "extremum_seeking":
        out["form"] = args.form or "batch"
    if limits and args.guide not in CURVES:
        out["limit_method"] = args.limit_method or "switching"
    return out


def _guidance_figures(
    args: argparse.Namespace, guided: GuidedTask | None, seeker: Any, bench: EngineBench, run: LoopRun, best: Optimum
) -> dict[str, Any]:
    """Say what the guide did, and what every run is compared by."""
    away = np.abs(run.dataset["estimate_cad"].to_numpy() - best["soc_cad"])
    outside = np.flatnonzero(away > _STAYS_CAD)
    stays = 0 if outside.size == 0 else int(outside[-1]) + 1
    sd, trust = getattr(seeker, "estimate_sd", math.nan), getattr(seeker, "trust", math.nan)
    out: dict[str, Any] = {
        "guide": args.guide,
        "guide_cad": None if guided is None else guided.guide_cad,
        "cycles_stays_1_5_cad": stays if stays < away.size else None,
        "late_loss_percent": late_loss(bench, run.dataset, best),
        "estimate_sd_cad": sd if math.isfinite(sd) else None,
        "trust": trust if math.isfinite(trust) else None,
    }
    if guided is not None and guided.kind in CURVES:
        out["guide_shape"] = args.guide_shape or "model"
    if isinstance(seeker, GuidedEngine) and guided is not None and guided.kind == "calibrated":
        out |= {"guide_wall_heat_scale": seeker.cylinder.wall_heat_scale, "recalibrations": seeker.recalibrations}
    return out


def _table(cycles: xr.Dataset) -> xr.Dataset:
    """Leave the columns over cycles; limited indicators are among them, COV is added."""
    table = cycles.drop_dims([dim for dim in cycles.dims if dim != "cycle"])
    if "limit" in cycles.dims and COV in cycles["limit"].to_numpy():
        cov = cycles["limits"].sel(limit=COV, drop=True).drop_vars("limit_units", errors="ignore")
        table[COV] = cov.assign_attrs(unit_attributes(*VARIABLES[COV]))
    return table


def _draw(cycles: xr.Dataset, best: Optimum, limits: Mapping[str, float], file: str) -> None:
    from mgdd import plot

    how = {"optimum_cad": best["soc_cad"], "limit_values": limits}
    save_figure(drawn(plot.seeking, cycles, size=(8.0, 7.0), **how), file)


@contextmanager
def _option_names() -> Iterator[None]:
    """Let errors of the library name the options."""
    try:
        yield
    except (ParameterError, ConvergenceError) as error:
        option = _OPTIONS.get(error.field or "")
        if option is None:
            raise
        said = str(error).removeprefix(error.field or "").removeprefix(" =").removeprefix(":")
        raise error.reworded(option + said) from error
