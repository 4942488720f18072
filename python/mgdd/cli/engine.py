"""`mgdd engine simulate | calibrate | optimum`."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.cli.from_library import Options, default_of, named_options, shown
from mgdd.cli.options import (
    CYLINDER_CHOICES,
    PEGGING,
    SCHEME,
    add_engine,
    add_files,
    check_pegging,
    engine_of,
    option,
    point_given,
    refuse_idle,
    traces_of,
)
from mgdd.cli.output import check_file, emit, lines, warn, whole_or_part, wrote
from mgdd.cli.progress import Stopped
from mgdd.cli.ranges import number_pairs
from mgdd.engine import ThermalNo, find_optimum, simulate, timing_sweep
from mgdd.engine.ignition import ignited_soc_cad, reached_soi_cad
from mgdd.errors import ConvergenceError
from mgdd.identify import ModelFamily, best_timing, estimate_tdc, fit_cylinder
from mgdd.identify.engine.best_timing import doubts_of, headline_of
from mgdd.identify.engine.calibration import TDC_SPAN_CAD, judge_fit
from mgdd.identify.engine.timing_records import BestTiming, MemberTiming
from mgdd.io.pressure import mean_cycle
from mgdd.report import calibration_report, write_report

if TYPE_CHECKING:
    import xarray as xr

_TIMING = Options(simulate, "soc_cad")
_SEARCH = Options(find_optimum, "objective", "bounds_cad")
_NO = Options(
    ThermalNo, "lambda_burned", "mixing_time_ms", "intake_o2_fraction", "hydrogen_to_carbon",
    rates="no_rates", calibration="no_calibration",
)  # fmt: skip
_RANGED = ("soc_cad", "ca50_cad", "shift_cad", "gain_percent")


def _add_simulate(parser: Any) -> None:
    timing = parser.add_mutually_exclusive_group()
    _TIMING.add(timing)
    option(timing, "--soi-cad X", "start of injection [°CA aTDC]; the delay model adds on")
    add_engine(parser)
    SCHEME.add(parser, "scheme")
    group = parser.add_argument_group("thermal NO")
    option(group, "--thermal-no", "also NOx by the extended Zeldovich mechanism")
    _NO.add(group)


def _simulate(args: argparse.Namespace) -> None:
    cylinder, point, preset = engine_of(args)
    timing = _TIMING.of(args)
    if args.soi_cad is not None:
        timing["soc_cad"] = ignited_soc_cad(cylinder, point, soi_cad=args.soi_cad)
    scheme = SCHEME.of(args)
    if not args.thermal_no:
        refuse_idle(args, *_NO.options.values(), why="it is of --thermal-no: give that too")
    cycle = simulate(cylinder, point, **timing, **scheme)
    if args.thermal_no:
        with named_options(**_NO.options):
            nox = ThermalNo(**_NO.given(args)).cycle(cycle, cylinder, point=point)
        cycle = cycle.assign({name: nox[name] for name in nox.data_vars}).assign_attrs(cycle.attrs)
    scalars = {str(name): float(v) for name, v in cycle.data_vars.items() if v.ndim == 0}
    soi = reached_soi_cad(cylinder, point, **timing) if args.soi_cad is None else args.soi_cad
    known = {"soi_cad": soi, "motored": point.fuel_mg == 0.0}
    emit(args, {"preset": preset.name, **scheme, **scalars, **known}, traces=cycle)


def _add_calibrate(parser: Any) -> None:
    add_files(parser, nargs="+")
    option(parser, "--free NAME[,NAME]",
           "parameters to fit (default: soc_cad,burn_duration_cad,fuel_heat_j per trace and wall_heat_scale; the "
           "double Wiebe also its shape); gamma is that of the gamma law in use; with --fuel-mg the heat is held",
    )  # fmt: skip
    option(parser, "--report PAGE.html",
           "also write a page that needs no network: best timing by every model, its limits, figures (a minute)",
    )  # fmt: skip
    _add_pressure(parser)
    add_engine(parser)
    Options(fit_cylinder, "step_cad").add(parser, "scheme")
    Options(simulate, "integrator").add(parser)


def _add_pressure(parser: argparse.ArgumentParser) -> None:
    """Add how the traces of a calibration are made absolute."""
    group = parser.add_argument_group("pressure of the traces")
    PEGGING.add(group)
    option(group, "--mean-cycle", "calibrate to the mean of a file's cycles (one cycle is needed)")


def _traces_of(args: argparse.Namespace) -> list[xr.Dataset]:
    """Read the traces; with --mean-cycle the mean of each file's cycles."""
    traces = traces_of(args)
    return [mean_cycle(trace) for trace in traces] if args.mean_cycle else traces


def _known(args: argparse.Namespace, cylinder: Cylinder) -> dict[str, Any]:
    """Give pegging, and the fuel heat where the fuel was said, as arguments of `fit_cylinder` and `best_timing`."""
    check_pegging(args)
    fuel_mg = point_given(args).get("fuel_mg")
    heat = None if fuel_mg is None else fuel_mg * cylinder.lower_heating_value_mj_per_kg
    return {**PEGGING.given(args), "fuel_heat_j": heat}


def _calibrate(args: argparse.Namespace) -> None:
    """Fit, judge, compare, print."""
    check_file("--report", args.report, (".html",))
    cylinder, point, preset = engine_of(args)
    traces = _traces_of(args)
    free = [name.strip() for name in args.free.split(",")] if args.free else None
    known, scheme = _known(args, cylinder), SCHEME.given(args)
    step = args.progress.expect(45 + (90 if args.report else 0))
    step("calibrate")
    fit = fit_cylinder(traces, cylinder, free=free, point=point, **known, **scheme)
    found = judge_fit(fit, fuel_heat_j=known["fuel_heat_j"], progress=step)
    with named_options(**{field: option for option, field in CYLINDER_CHOICES.items()}):
        payload = {"preset": preset.name, **found.to_dict()}
    emit(args, payload, text=payload["report"])
    if args.report:
        result, stopped = whole_or_part(
            calibration_report, traces, cylinder, point=point, name="mgdd engine calibrate", progress=step, **known,
            **scheme,
        )  # fmt: skip
        write_report(result, args.report)
        wrote(args.report)
        if stopped:
            raise Stopped(f"the calibration is printed, and what was finished of the report is in {args.report}")
    if not fit.report.success:
        raise ConvergenceError(f"the calibration did not converge: {fit.report.message}")


def _add_optimum(parser: Any) -> None:
    add_files(parser, nargs="*")
    option(parser, "--limit NAME=X ...", "upper limit on an indicator, repeatable")
    objective, step_cad = (
        f"{shown(default_of(find_optimum, name))}, with files {shown(default_of(best_timing, name))}"
        for name in ("objective", "step_cad")
    )
    _SEARCH.add(parser, "search", objective=objective)
    _add_pressure(parser)
    add_engine(parser)
    SCHEME.add(parser, "scheme", step_cad=step_cad)


def _optimum(args: argparse.Namespace) -> None:
    cylinder, point, preset = engine_of(args)
    limits = number_pairs(args.limit, "--limit")
    if args.files:
        check_file("-o", args.output, (".json",))
        _optimum_of_files(args, cylinder, point, limits, preset.name)
        return
    scheme = SCHEME.given(args)
    best = find_optimum(cylinder, point, limits=limits, **_SEARCH.given(args), **scheme)
    warn(*best.findings)
    known = {"preset": preset.name, "soi_cad": reached_soi_cad(cylinder, point, soc_cad=best["soc_cad"])}
    sweep = timing_sweep(cylinder, point, **scheme) if args.output and args.output.endswith(".csv") else None
    held = ", ".join(best.active_limits) or "no limit"
    text = lines({**best.inputs, **best.values, **known, "curvature": best.curvature, "held_by": held})
    emit(args, {**known, **best.to_dict()}, text=text, traces=sweep)


def _optimum_of_files(
    args: argparse.Namespace, cylinder: Cylinder, point: OperatingPoint, limits: dict[str, float], preset: str
) -> None:
    refuse_idle(args, "burn", "burn_duration_cad", why="the family tries its own burn laws: leave it out")
    traces = _traces_of(args)
    rows = best_timing(
        traces,
        cylinder,
        point=point,
        limits=limits,
        progress=args.progress.expect(70),
        **_SEARCH.given(args),
        **SCHEME.given(args),
        **_known(args, cylinder),
    )
    main = headline_of(rows)
    pegging = _known(args, cylinder)
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
            direction = row.free_direction if name.startswith("free_") else row.direction
            if direction == "not determined" and name.endswith("shift_cad"):
                return f"no direction is determined ({low:z.2f} to {high:z.2f})"
            if direction == "not determined" and name.endswith("gain_percent"):
                return f"open ({low:z.2f} to {high:z.2f})"
            return f"{getattr(best, name):z.2f} ({low:z.2f} to {high:z.2f})"

        parts.append(
            f"{row.file}: {best.member.name}\n own p_max kept\n"
            + lines({name: told(name) for name in _RANGED})
            + f"\n {kept}\n"
            + lines({f"free_{name}": told(f"free_{name}") for name in _RANGED})
        )
    parts.append(
        f"In brackets: the range over the plausible models of the family, angles with {ModelFamily().misfit_cad:g} °CA "
        "on both sides for what all of them lack; --json lists every one."
    )
    parts += ["limitations found:\n" + "\n".join(f"  - {text}" for text in warnings)] if warnings else []
    payload = {"preset": preset, "law": main.name, "traces": [row.to_dict() for row in rows], "warnings": warnings}
    emit(args, payload, text="\n\n".join(parts))
    if not any(row.plausible for row in rows):
        raise ConvergenceError("no model of the family is plausible for any trace: see what each of them fails")


COMMANDS = {
    "simulate": (_add_simulate, _simulate),
    "calibrate": (_add_calibrate, _calibrate),
    "optimum": (_add_optimum, _optimum),
}
