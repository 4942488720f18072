"""`mgdd engine simulate | analyze | calibrate | optimum`; `analyze`, `seek` and `sweep` have modules of their own."""

from __future__ import annotations

import argparse
import math
from typing import Any

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.cli.analyze import add_analyze
from mgdd.cli.calibration import TDC_SPAN_CAD, add_calibration, calibrate, calibration_arguments, traces_for
from mgdd.cli.options import (
    add_command,
    add_engine,
    add_files,
    add_group,
    add_scheme,
    engine_of,
    number_pairs,
    refuse_idle,
)
from mgdd.cli.output import check_output, emit, lines
from mgdd.cli.seek import add_seek
from mgdd.cli.sweep import add_sweep
from mgdd.engine import find_optimum, ignition_delay, simulate, timing_sweep
from mgdd.errors import ConvergenceError, ParameterError
from mgdd.identify import best_timing, estimate_tdc
from mgdd.identify.engine.best_timing import doubts_of, headline_of
from mgdd.identify.engine.timing_records import BestTiming, MemberTiming

__all__ = ["add"]

_DEFAULT_SOC_CAD = -6.0
_RANGED = ("soc_cad", "ca50_cad", "shift_cad", "gain_percent")


def add(commands: Any) -> None:
    """Add the group and its commands."""
    verbs = add_group(
        commands, "engine",
        help_text="one cycle: simulate, analyze, calibrate, optimum; many: seek, sweep",
        example="mgdd engine simulate --preset puma_single --soc-cad -6 --json",
    )  # fmt: skip
    _add_simulate(verbs)
    add_analyze(verbs)
    _add_calibrate(verbs)
    _add_optimum(verbs)
    add_seek(verbs)
    add_sweep(verbs)


def _add_simulate(verbs: Any) -> None:
    parser = add_command(
        verbs, "simulate", _simulate,
        help_text="simulate one closed cycle and print its indicators; -o FILE.csv writes the traces",
        example="mgdd engine simulate --preset puma_single --soc-cad -6 --json",
        endings=".json or .csv",
    )  # fmt: skip
    timing = parser.add_mutually_exclusive_group()
    timing.add_argument(
        "--soc-cad", type=float, metavar="X", help=f"start of combustion [°CA aTDC] (default: {_DEFAULT_SOC_CAD:g})"
    )
    timing.add_argument(
        "--soi-cad", type=float, metavar="X", help="start of injection [°CA aTDC]; the delay model adds on"
    )
    add_engine(parser)
    add_scheme(parser, step_cad=1.0)


def _simulate(args: argparse.Namespace) -> None:
    check_output(args, ".json", ".csv")
    cylinder, point, preset = engine_of(args)
    soc = _start_of_combustion(args, cylinder, point)
    cycle = simulate(cylinder, point, soc_cad=soc, step_cad=args.step_cad, integrator=args.integrator)
    scalars = {str(name): float(v) for name, v in cycle.data_vars.items() if v.ndim == 0}
    soi = args.soi_cad if args.soi_cad is not None else _injection_of(cylinder, point, soc)
    payload = {
        "preset": preset.name,
        "integrator": args.integrator,
        "step_cad": args.step_cad,
        **scalars,
        "soi_cad": soi,
        "motored": point.fuel_mg == 0.0,
    }
    emit(args, payload, traces=cycle)


def _injection_of(cylinder: Cylinder, point: OperatingPoint, soc: float) -> float:
    timing = ignition_delay(cylinder, point, soc_cad=soc)
    return math.nan if timing.clipped else timing.soi_cad


def _start_of_combustion(args: argparse.Namespace, cylinder: Cylinder, point: OperatingPoint) -> float:
    if args.soi_cad is None:
        return _DEFAULT_SOC_CAD if args.soc_cad is None else float(args.soc_cad)
    timing = ignition_delay(cylinder, point, soi_cad=args.soi_cad)
    if not timing.ignites:
        raise ConvergenceError(f"soi_cad = {args.soi_cad:g} does not ignite before EVO: inject earlier")
    latest = _core.engine.timing_window_cad[1]
    if timing.soc_cad > latest:
        raise ParameterError(
            f"soi_cad = {args.soi_cad:g} ignites at {timing.soc_cad:.1f} °CA aTDC, later than {latest:g}, the latest "
            "start of combustion that is simulated: inject earlier"
        )
    return timing.soc_cad


def _add_calibrate(verbs: Any) -> None:
    parser = add_command(
        verbs, "calibrate", calibrate,
        help_text="calibrate the cycle model to measured traces, and name what the traces do not identify",
        example="mgdd engine calibrate a25.csv a50.csv --preset hd_diesel_128x144 --conditions conditions.csv --json",
    )  # fmt: skip
    add_files(parser, nargs="+")
    parser.add_argument(
        "--free",
        metavar="NAME[,NAME]",
        help="parameters to fit (default: soc_cad,burn_duration_cad,fuel_heat_j per trace and wall_heat_scale; "
        "the double Wiebe also its shape); gamma is that of the gamma law in use; with --fuel-mg the heat is held",
    )
    parser.add_argument("--report-folder", metavar="DIR", help="also write index.html and summary.json there")
    add_calibration(parser)
    add_engine(parser)
    add_scheme(parser, step_cad=0.25)


def _add_optimum(verbs: Any) -> None:
    parser = add_command(
        verbs, "optimum", _optimum,
        help_text="find the best start of combustion of the model, or of measured traces after calibration",
        example="mgdd engine optimum --preset puma_single --limit p_max_bar=95 --json",
        endings=".json, without files also .csv",
    )  # fmt: skip
    add_files(parser, nargs="*")
    parser.add_argument(
        "--objective", choices=("efficiency_gross", "imep_gross_bar", "imep_closed_bar"),
        help="default: efficiency_gross; with files imep_closed_bar, the work that a closed-valve trace carries",
    )  # fmt: skip
    parser.add_argument(
        "--limit", action="append", default=[], metavar="NAME=X", help="upper limit on an indicator, repeatable"
    )
    parser.add_argument(
        "--bounds-cad", type=float, nargs=2, metavar=("LOW", "HIGH"), help="searched range of SOC (default: -30 10)"
    )
    add_calibration(parser)
    add_engine(parser)
    add_scheme(parser, step_cad=None)


def _bounds(args: argparse.Namespace) -> tuple[float, float] | None:
    return (args.bounds_cad[0], args.bounds_cad[1]) if args.bounds_cad else None


def _optimum(args: argparse.Namespace) -> None:
    check_output(args, *((".json",) if args.files else (".json", ".csv")))
    cylinder, point, preset = engine_of(args)
    limits = number_pairs(args.limit, "--limit")
    if args.files:
        _optimum_of_files(args, cylinder, point, limits, preset.name)
        return
    scheme = {"step_cad": args.step_cad or 1.0, "integrator": args.integrator}
    best = find_optimum(
        cylinder, point, args.objective or "efficiency_gross", limits=limits, bounds_cad=_bounds(args), **scheme
    )
    now = simulate(cylinder, point, soc_cad=best["soc_cad"], **scheme)
    payload: dict[str, Any] = {name: best[name] for name in ("soc_cad", "ca50_cad", "efficiency_gross")}
    payload |= {
        "curvature_per_cad2": best.curvature,
        "objective": best.objective,
        "value": best.value,
        "limits": limits,
    }
    payload |= {"active_limits": list(best.active_limits), "at_bound": best.at_bound, "preset": preset.name}
    payload |= {name: float(now[name]) for name in ("imep_gross_bar", "p_max_bar", "dp_max_bar_per_cad", "t_max_k")}
    payload["soi_cad"] = _injection_of(cylinder, point, best["soc_cad"])
    sweep = timing_sweep(cylinder, point, **scheme) if args.output and args.output.endswith(".csv") else None
    emit(args, payload, traces=sweep)


def _optimum_of_files(
    args: argparse.Namespace, cylinder: Cylinder, point: OperatingPoint, limits: dict[str, float], preset: str
) -> None:
    refuse_idle(args, "burn", "burn_duration_cad", why="the family tries its own burn laws: leave it out")
    traces = traces_for(args)
    rows = best_timing(
        traces,
        cylinder,
        point=point,
        objective=args.objective or "imep_closed_bar",
        limits=limits,
        bounds_cad=_bounds(args),
        progress=args.progress.expect(70),
        step_cad=args.step_cad or 0.25,
        integrator=args.integrator,
        **calibration_arguments(args, cylinder),
    )
    main = headline_of(rows)
    pegging = calibration_arguments(args, cylinder)
    tdc = estimate_tdc(
        list(main.fit.request.traces), cylinder, point=point, fuel_heat_j=pegging["fuel_heat_j"], span_cad=TDC_SPAN_CAD,
        progress=args.progress,
    )  # fmt: skip
    warnings = doubts_of(rows, tdc)
    kept = "given limits kept" if limits else "no limit"
    parts = []
    for row in rows:
        if not row.plausible:
            near = next(answer for answer in row.members if answer.member is main)
            parts.append(f"{row.file}\n  no plausible model; the nearest, {main.name}: {near.why_not}")
            continue
        best = row.best

        def told(name: str, best: MemberTiming = best, row: BestTiming = row) -> str:
            low, high = getattr(row, name)
            return f"{getattr(best, name):z.2f} ({low:z.2f} to {high:z.2f})"

        parts.append(
            f"{row.file}: {best.member.name}\n own p_max kept\n"
            + lines({name: told(name) for name in _RANGED})
            + f"\n {kept}\n"
            + lines({f"free_{name}": told(f"free_{name}") for name in _RANGED})
        )
    parts.append("In brackets: the range over the plausible models of the family; --json lists every one.")
    parts += ["what to distrust:\n" + "\n".join(f"  - {text}" for text in warnings)] if warnings else []
    payload = {"preset": preset, "law": main.name, "traces": [row.to_dict() for row in rows], "warnings": warnings}
    emit(args, payload, text="\n\n".join(parts))
    if not any(row.plausible for row in rows):
        raise ConvergenceError("no model of the family is plausible for any trace: see what each of them fails")
