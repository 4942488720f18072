"""`mgdd engine analyze`: one trace or a record of cycles."""

from __future__ import annotations

import argparse
import logging
from typing import TYPE_CHECKING, Any

from mgdd.cli.calibration import add_pegging, check_pegging, tdc_payload
from mgdd.cli.options import add_command, add_engine, add_files, engine_of, refuse_idle, traces_of
from mgdd.cli.output import check_output, emit, lines
from mgdd.engine import analyze
from mgdd.errors import ParameterError
from mgdd.identify import estimate_tdc
from mgdd.io.pressure import mean_cycle
from mgdd.results.labels import VARIABLES
from mgdd.results.units import unit_of
from mgdd.studies.sections import Table

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["add_analyze"]

_LOG = logging.getLogger(__name__)

# Columns of a record: what stands before and after the name of a figure.
_COLUMNS = {
    "mean": ("", ""),
    "standard deviation": ("std_", ""),
    "COV [%]": ("cov_", "_percent"),
    "averaged cycle": ("cycle_mean_", ""),
}


def add_analyze(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "analyze", _analyze,
        help_text="analyse a measured pressure trace: pegging, heat release, burn angles, work",
        example="mgdd engine analyze mean.csv --preset hd_diesel_128x144 --pressure-unit Pa --json",
        endings=".json or .csv",
    )  # fmt: skip
    add_files(parser, nargs=1)
    group = parser.add_argument_group("analysis")
    add_pegging(group)
    group.add_argument(
        "--analysis-gamma", type=float, metavar="X",
        help="constant gamma of the heat release (default: 1.33, or the law that --gamma names)",
    )  # fmt: skip
    group.add_argument(
        "--heat-window-cad", type=float, nargs=2, metavar=("FROM", "TO"), help="default: found from the trace"
    )
    group.add_argument(
        "--smoothing", choices=("none", "savitzky_golay", "low_pass", "angle_window"),
        help="of the pressure before the heat release (default: savitzky_golay where 9 samples fall into the width)",
    )  # fmt: skip
    group.add_argument("--smoothing-width-cad", type=float, metavar="X", help="default: 4")
    group.add_argument("--smoothing-cutoff-hz", type=float, metavar="X", help="for low_pass (default: 3000)")
    brake = group.add_mutually_exclusive_group()
    brake.add_argument("--bmep-bar", type=float, metavar="X", help="measured BMEP: a gross IMEP below it is refused")
    brake.add_argument("--brake-torque-nm", type=float, metavar="X", help="measured torque, in place of the BMEP")
    group.add_argument("--cylinders", type=int, default=1, metavar="N", help="behind the torque (default: 1)")
    group.add_argument(
        "--tdc", action="store_true",
        help="also estimate TDC, of a fired trace by calibrations over a scan of the angle (seconds), and doubt it",
    )  # fmt: skip
    group.add_argument("--fractions", choices=("net", "gross"), default="net", help="heat that CA10/50/90 refer to")
    add_engine(parser)


def _analyze(args: argparse.Namespace) -> None:
    check_output(args, ".json", ".csv")
    cylinder, point, preset = engine_of(args)
    check_pegging(args)
    _check_analysis(args)
    refuse_idle(args, "fuel_mg", "burn", "burn_duration_cad", "ignition", why="an analysis takes no burn: leave it out")
    (trace,) = traces_of(args)
    gamma: float | str = 1.33 if args.gamma is None else "cylinder"
    if args.analysis_gamma is not None:
        if args.gamma is not None:
            raise ParameterError("--analysis-gamma and --gamma contradict each other: give one")
        gamma = args.analysis_gamma
    result = analyze(
        trace,
        cylinder,
        point=point,
        pegging=args.pegging,
        pegging_exponent=args.pegging_exponent or 1.35,
        inlet_pressure_kpa=args.inlet_pressure_kpa or args.intake_pressure_kpa,
        gamma=gamma,
        heat_window_cad=tuple(args.heat_window_cad) if args.heat_window_cad else None,
        fractions=args.fractions,
        smoothing=args.smoothing,
        smoothing_width_cad=4.0 if args.smoothing_width_cad is None else args.smoothing_width_cad,
        smoothing_cutoff_hz=3000.0 if args.smoothing_cutoff_hz is None else args.smoothing_cutoff_hz,
        bmep_bar=args.bmep_bar,
        brake_torque_nm=args.brake_torque_nm,
        n_cylinders=args.cylinders,
    )
    named = gamma if args.gamma is None else (cylinder.gamma if args.gamma == "constant" else args.gamma)
    payload = {
        "file": result.attrs["file"],
        "preset": preset.name,
        **_figures(result),
        "method": result.attrs["method"],
        "gamma": named,
        **{name: result.attrs[name] for name in ("fractions", "smoothing", "heat_window", "mass_source", "motored")},
        "warnings": result.attrs["warnings"].splitlines(),
    }
    if args.tdc:
        found = estimate_tdc([_absolute(trace, float(payload["pegging_bar"]))], cylinder, point=point, span_cad=4.0)
        payload["tdc"] = tdc_payload(found)
        payload["warnings"] += found.doubts()
        for doubt in found.doubts():
            _LOG.warning("%s: %s", payload["file"], doubt)
    if "cycles" in result.attrs:  # a CSV holds the figures of every cycle then
        result = result[[name for name, v in result.data_vars.items() if v.dims == ("cycle",)]]
    text: list[str | Table] = _table(payload) if "cycles" in payload else [lines(payload)]
    if args.tdc:
        low, high = payload["tdc"]["low_cad"], payload["tdc"]["high_cad"]
        text.append(f"TDC offset {payload['tdc']['tdc_offset_cad']:+.2f} °CA, {low:+.2f} to {high:+.2f} possible")
    emit(args, payload, text=text, traces=result)


def _absolute(trace: xr.Dataset, offset_bar: float) -> xr.Dataset:
    """Give the trace, or the mean of its cycles, with the pegging that was found."""
    one = mean_cycle(trace)
    moved = one.assign(pressure_bar=one["pressure_bar"] + offset_bar)
    moved["pressure_bar"].attrs.update(one["pressure_bar"].attrs)
    return moved


def _figures(result: xr.Dataset) -> dict[str, float]:
    """Give the figures of the trace; of a record of cycles their means by the plain names, then their scatter."""
    single = {str(name): float(v) for name, v in result.data_vars.items() if v.ndim == 0}
    if "cycles" not in result.attrs:
        return single
    means = {name.removeprefix("mean_"): v for name, v in single.items() if name.startswith("mean_")}
    rest = {name: v for name, v in single.items() if not name.startswith("mean_")}
    return {"cycles": result.attrs["cycles"], **means, **rest}


def _table(payload: dict[str, Any]) -> list[str | Table]:
    """Set mean, scatter and averaged cycle of a record side by side."""

    def cell(name: str) -> str:
        value = payload.get(name)
        return "–" if value is None or value != value else f"{value:.5g}"

    names = [name.removeprefix("cycle_mean_") for name in payload if name.startswith("cycle_mean_")]
    rows = tuple(
        (
            name,
            *(cell(f"{before}{name}{after}") for before, after in _COLUMNS.values()),
            VARIABLES[name].units if name in VARIABLES else unit_of(name),
        )
        for name in names
    )
    said = {name: value for name, value in payload.items() if isinstance(value, str | int) or name.startswith("lnv_")}
    return [lines(said), "", Table(columns=("figure", *_COLUMNS, "unit"), rows=rows)]


def _check_analysis(args: argparse.Namespace) -> None:
    if args.smoothing_width_cad is not None and args.smoothing in ("none", "low_pass"):
        raise ParameterError("--smoothing-width-cad acts with --smoothing savitzky_golay or angle_window: choose one")
    if args.smoothing_cutoff_hz is not None and args.smoothing != "low_pass":
        raise ParameterError("--smoothing-cutoff-hz acts with --smoothing low_pass only: choose it")
    if args.cylinders != 1 and args.brake_torque_nm is None:
        raise ParameterError("--cylinders acts with --brake-torque-nm only: give it")
