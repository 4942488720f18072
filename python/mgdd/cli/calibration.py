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
from mgdd.identify import estimate_tdc, fit_cylinder, wall_heat_profile
from mgdd.identify.engine.burn_laws import better_laws, compare_laws
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import CylinderFit, figures_of
from mgdd.identify.engine.tdc import TdcEstimate
from mgdd.io.pressure import mean_cycle
from mgdd.report import write_report
from mgdd.studies.measured_traces import law_row

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "PEGGING",
    "TDC_SPAN_CAD",
    "add_calibration",
    "calibrate",
    "calibration_arguments",
    "check_pegging",
    "traces_for",
]

PEGGING = Options(analyze, "pegging", "pegging_exponent", "inlet_pressure_kpa")
TDC_SPAN_CAD = 2.0
_PER_TRACE = (
    "file p_max_bar rmse_bar rmse_percent imep_closed_error_percent soc_cad burn_duration_cad fuel_heat_j ca50_cad "
    "largest_error_bar largest_error_cad heat_loss_fraction"
).split()


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
    scheme = SCHEME.given(args)
    step = args.progress.expect(45 + (90 if args.report_folder else 0))
    step("calibrate")
    pegging = calibration_arguments(args, cylinder)
    fit = fit_cylinder(traces, cylinder, free=free, point=point, **pegging, **scheme)
    traces = list(fit.request.traces)  # absolute from here on
    profile = None
    if "wall_heat_scale" in fit.report.names and len(fit.report.names) > 1:
        profile = wall_heat_profile(fit, progress=step)
    tdc = estimate_tdc(
        traces, cylinder, point=point, fuel_heat_j=pegging["fuel_heat_j"], span_cad=TDC_SPAN_CAD, progress=step
    )
    laws = compare_laws(traces, cylinder, fuel_heat_j=pegging["fuel_heat_j"], point=point, progress=step, **scheme)
    stopped = False
    if args.report_folder:
        result, stopped = run_or_part(
            "measured-traces", traces=traces, cylinder=cylinder, point=point, progress=step, **scheme
        )
        write_report(result, args.report_folder)
    with named_options(**{field: option for option, field in CYLINDER_CHOICES.items()}):
        payload = {"preset": preset.name, **_payload(fit, profile, laws, tdc)}
    emit(args, payload, text=payload["report"])
    if stopped:
        raise Stopped(f"the calibration is printed, and what was finished of the report is in {args.report_folder}")
    if not fit.report.success:
        raise ConvergenceError(f"the calibration did not converge: {fit.report.message}")


def _payload(
    fit: CylinderFit, profile: WallHeatProfile | None, laws: list[CylinderFit], tdc: TdcEstimate
) -> dict[str, Any]:
    traces = []
    with_soi = any(load.soi_cad == load.soi_cad for load in fit.loads)
    for load in fit.loads:
        values = figures_of(load)
        row = {name: values[name] for name in _PER_TRACE}
        if with_soi:
            row |= {"soi_cad": load.soi_cad, "onset_against_soi_cad": load.onset_against_soi_cad}
        shape = load.cylinder.to_dict()
        row |= {name: shape[name] for name in fit.model.fields() if _was_fitted(fit, name)}
        traces.append(row)
    scale: dict[str, Any] = {"value": fit.model.wall_heat_scale, "stderr": None, "identifiable": None}
    unidentifiable = set(fit.report.unidentifiable)
    if profile is not None:
        scale = profile.to_dict()
        unidentifiable |= set() if profile.identifiable else {"wall_heat_scale"}
    common = {"wall_heat_scale": scale}
    for name in fit.report.names:
        if "[" not in name and name != "wall_heat_scale":
            at = fit.report.names.index(name)
            common[name] = {
                "value": float(fit.report.values[at]),
                "stderr": float(fit.report.stderr[at]),
                "identifiable": name not in unidentifiable,
            }
    ordered = [name for name in fit.report.names if name in unidentifiable]
    return {
        "law": fit.kind,
        "status": fit.report.status,
        "traces": traces,
        "common": common,
        "unidentifiable": ordered,
        "laws": [law_row(law) for law in laws],
        "tdc": tdc_payload(tdc),
        "warnings": [*(str(finding) for finding in fit.findings), *tdc.doubts(), *better_laws(fit, laws)],
        "cylinder": fit.model.to_dict(),
        "report": _report(fit, profile, laws, ordered, tdc),
    }


def tdc_payload(tdc: TdcEstimate) -> dict[str, Any]:
    """Give an estimate of TDC as plain values."""
    names = ("method", "tdc_offset_cad", "low_cad", "high_cad", "suspect")
    return {**{name: getattr(tdc, name) for name in names}, "others_cad": list(tdc.others_cad)}


def _was_fitted(fit: CylinderFit, name: str) -> bool:
    return any(parameter.startswith(f"{name}[") for parameter in fit.report.names)


def _report(
    fit: CylinderFit,
    profile: WallHeatProfile | None,
    laws: list[CylinderFit],
    unidentifiable: list[str],
    tdc: TdcEstimate,
) -> str:
    out = [f"Calibration with {fit.kind}: {fit.report.message}", ""]
    out += _loads(fit)
    for name, value, error in zip(fit.report.names, fit.report.values, fit.report.stderr, strict=True):
        if "[" not in name and name != "wall_heat_scale":
            out.append(f"  {name} = {value:.6g} +- {error:.2g} (all traces)")
    if profile is not None:
        error = f" +- {profile.stderr:.3f}" if profile.stderr == profile.stderr else ", at a bound"
        verdict = "identifiable" if profile.identifiable else "not identifiable from these traces"
        out += [
            "",
            f"wall-heat scale {profile.value:.3f}{error}: {verdict}",
            f"  strongest correlation {profile.correlation:+.2f}, with {profile.correlated_with}",
            *(f"  {reason}" for reason in profile.reasons),
        ]
    if unidentifiable:
        out += ["", f"not identifiable: {', '.join(unidentifiable)}"]
    out += ["", f"TDC offset {tdc.tdc_offset_cad:+.2f} CAD, {tdc.low_cad:+.2f} to {tdc.high_cad:+.2f} possible"]
    doubts = [*map(str, fit.findings), *tdc.doubts(), *better_laws(fit, laws)]
    if doubts:
        out += ["", "what to distrust:", *(f"  - {text}" for text in doubts)]
    out += ["", "every burn law on the same traces:"]
    for law in laws:
        out += ["", f"{law.kind}  (wall-heat scale {law.model.wall_heat_scale:.2f})", *_loads(law)]
        out += [f"  - {text}" for text in law.findings]
    return "\n".join(out)


def _loads(fit: CylinderFit) -> list[str]:
    onset = any(load.soi_cad == load.soi_cad for load in fit.loads)
    last = f" {'SOC - SOI':>10}" if onset else ""
    form = "  {:24} {:>9} {:>15} {:>7} {:>9} {:>9} {:>7} {:>20}"
    head = ("trace", "RMSE [%]", "closed IMEP [%]", "SOC", "duration", "heat [J]", "CA50", "largest error")
    out = [form.format(*head) + last]
    for load in fit.loads:
        error = f"{load.largest_error_bar:+.1f} bar at {load.largest_error_cad:.0f}"
        late = f" {load.onset_against_soi_cad:+10.1f}" if onset else ""
        out.append(
            f"  {load.file:24} {load.rmse_percent:9.2f} {load.imep_closed_error_percent:+15.1f} {load.soc_cad:7.2f} "
            f"{load.burn_duration_cad:9.1f} {load.fuel_heat_j:9.0f} {load.ca50_cad:7.1f} {error:>20}{late}"
        )
    return out
