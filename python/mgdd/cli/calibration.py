"""`mgdd engine calibrate`: the fit, the comparison of burn laws, and the report in words."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from mgdd._core.engine import Cylinder
from mgdd.cli.from_library import Options, named_options
from mgdd.cli.options import CYLINDER_CHOICES, SCHEME, engine_of, traces_of
from mgdd.cli.output import Stopped, check_output, emit
from mgdd.cli.study import run_or_part
from mgdd.engine import analyze
from mgdd.errors import ConvergenceError, ParameterError
from mgdd.identify import fit_cylinder
from mgdd.identify.engine.calibration import judge_fit
from mgdd.io.pressure import mean_cycle
from mgdd.report import write_report

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "PEGGING",
    "add_calibration",
    "calibrate",
    "calibration_arguments",
    "check_pegging",
    "traces_for",
]

PEGGING = Options(analyze, "pegging", "pegging_exponent", "inlet_pressure_kpa")


def add_calibration(parser: argparse.ArgumentParser) -> None:
    """Add how the traces of a calibration are made absolute."""
    group = parser.add_argument_group("pressure of the traces")
    PEGGING.add(group)
    group.add_argument(
        "--mean-cycle", action="store_true", help="calibrate to the mean of a file's cycles (one cycle is needed)"
    )


def traces_for(args: argparse.Namespace) -> list[xr.Dataset]:
    """Read the traces; with --mean-cycle the mean of each file's cycles."""
    traces = traces_of(args)
    return [mean_cycle(trace) for trace in traces] if args.mean_cycle else traces


def check_pegging(args: argparse.Namespace) -> None:
    """Refuse options of pegging that would act on nothing."""
    if args.pegging_exponent is not None and args.pegging not in ("two_point", "least_squares"):
        raise ParameterError("--pegging-exponent acts with --pegging two_point or least_squares only: choose one")
    if args.inlet_pressure_kpa is not None and args.pegging != "inlet":
        raise ParameterError("--inlet-pressure-kpa acts with --pegging inlet only: choose it")


def calibration_arguments(args: argparse.Namespace, cylinder: Cylinder) -> dict[str, Any]:
    """Give pegging, and the fuel heat where the fuel was said, as arguments of `fit_cylinder` and `best_timing`."""
    check_pegging(args)
    return {
        **PEGGING.given(args),
        "fuel_heat_j": None if args.fuel_mg is None else args.fuel_mg * cylinder.lower_heating_value_mj_per_kg,
    }


def calibrate(args: argparse.Namespace) -> None:
    """Fit, judge, compare, print."""
    check_output(args)
    cylinder, point, preset = engine_of(args)
    traces = traces_for(args)
    free = [name.strip() for name in args.free.split(",")] if args.free else None
    known, scheme = calibration_arguments(args, cylinder), SCHEME.given(args)
    step = args.progress.expect(45 + (90 if args.report_folder else 0))
    step("calibrate")
    fit = fit_cylinder(traces, cylinder, free=free, point=point, **known, **scheme)
    found = judge_fit(fit, fuel_heat_j=known["fuel_heat_j"], progress=step)
    stopped = False
    if args.report_folder:
        absolute = list(fit.request.traces)
        result, stopped = run_or_part(
            "measured-traces", traces=absolute, cylinder=cylinder, point=point, progress=step, **scheme
        )
        write_report(result, args.report_folder)
    with named_options(**{field: option for option, field in CYLINDER_CHOICES.items()}):
        payload = {"preset": preset.name, **found.to_dict()}
    emit(args, payload, text=payload["report"])
    if stopped:
        raise Stopped(f"the calibration is printed, and what was finished of the report is in {args.report_folder}")
    if not fit.report.success:
        raise ConvergenceError(f"the calibration did not converge: {fit.report.message}")
