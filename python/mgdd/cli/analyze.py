"""`mgdd engine analyze | check`: pressure files, as numbers or as a page, and whether they can be trusted."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import (
    GEOMETRY,
    PEGGING,
    add_engine,
    add_files,
    assumed_geometry,
    check_pegging,
    engine_of,
    option,
    point_given,
    readers_of,
    refuse_idle,
)
from mgdd.cli.output import check_file, emit, error_of, lines, warn, wrote
from mgdd.engine import Cylinder, OperatingPoint, PressureCheck, analyze, check_pressure
from mgdd.engine.pressure_check import Check
from mgdd.errors import DataError, ParameterError
from mgdd.identify import estimate_tdc
from mgdd.io.pressure import mean_cycle
from mgdd.presets.preset import Preset
from mgdd.report import Section, Table
from mgdd.report.page import write_page
from mgdd.report.records import DRAWN_CYCLES, figures_table, record_section

if TYPE_CHECKING:
    import xarray as xr


_LOG = logging.getLogger(__name__)

_ANALYSIS = Options(
    analyze, "heat_window_cad", "smoothing", "smoothing_width_cad", "smoothing_cutoff_hz", "fractions",
    "knock_band_hz", "knock_window_cad", "knock_threshold_bar", gamma="analysis_gamma", n_cylinders="cylinders",
)  # fmt: skip
_BRAKE = Options(analyze, "bmep_bar", "brake_torque_nm")
_STATED = Options(check_pressure, "bmep_bar", "brake_torque_nm", n_cylinders="cylinders")
_FAILED, _REFUSED = 1, 2  # exit codes where a file fails its check, and where it is refused
# Figures of a record that a cycle does not have.
_OF_RECORDS = ("lnv_", "ringing_", "tangential_", "knock_")


def _add_analyze(parser: Any) -> None:
    add_files(parser, nargs="+")
    group = parser.add_argument_group("analysis")
    PEGGING.add(group)
    _ANALYSIS.add(group, knock_band_hz="4000 20000", knock_window_cad="-10 90")
    _BRAKE.add(group.add_mutually_exclusive_group())
    option(group, "--tdc",
           "also estimate TDC, of a fired trace by calibrations over a scan of the angle (seconds), and doubt it",
    )  # fmt: skip
    option(group, "--chunk-cycles N",
           "read N cycles at a time, for files larger than memory: the figures are those of the whole file",
    )  # fmt: skip
    option(group, "--report PAGE.html",
           "write a page that needs no network: of each file the checks, the figures and their pictures")  # fmt: skip
    add_engine(parser)


def _analyze(args: argparse.Namespace) -> None:
    several = len(args.files) > 1
    if several:  # a CSV holds one file
        check_file("-o", args.output, (".json",))
    check_file("--report", args.report, (".html",))
    cylinder, point, preset = engine_of(args)
    check_pegging(args)
    _check_analysis(args)
    refuse_idle(args, "burn", "burn_duration_cad", "ignition", why="an analysis takes no burn: leave it out")
    given = _ANALYSIS.given(args) | _BRAKE.given(args) | PEGGING.given(args)
    if args.gamma is not None:
        if args.analysis_gamma is not None:
            raise ParameterError("--analysis-gamma and --gamma contradict each other: give one")
        given["gamma"] = "cylinder"
    known, assumed = point_given(args), assumed_geometry(args)
    if "intake_pressure_kpa" in known:
        given.setdefault("inlet_pressure_kpa", known["intake_pressure_kpa"])
    given["fuel_mg"] = fuel_mg = known.get("fuel_mg")
    engine = (cylinder, point, preset)
    step = args.progress.expect(len(args.files))
    payloads: list[dict[str, Any]] = []
    texts: list[str | Table] = []
    sections: list[Section] = []
    verdicts: list[str] = []
    result = None
    for file, read in readers_of(args).items():
        step(f"analyse {Path(file).name}")
        try:
            trace = read()
            own = given
            record = args.chunk_cycles is not None or "cycle" in trace.dims
            if several and not record:  # the threshold is for the records among the files
                own = {name: value for name, value in given.items() if name != "knock_threshold_bar"}
            result, payload, text = _one(args, trace, engine, own, traces=not record)
            checked = None
            if args.report:
                own_checks = {"assumed": assumed, "fuel_mg": fuel_mg, **PEGGING.given(args), **_STATED.given(args)}
                checked = check_pressure(trace, cylinder, point=point, **own_checks)
        except DataError as error:  # one that is refused does not stop the others
            if not several and args.report is None:
                raise
            result, checked = None, _refused(file, error)
            payload = {"file": checked.file, "error": error_of(error, str(error))}
            text = [f"{checked.file}: refused: {error}"]
            _LOG.error("%s", error)
            args.exit_code = _REFUSED
        payloads.append(payload)
        texts += [*text, ""]
        if checked is not None and args.report:
            traces = None if result is None else _drawn(trace, cylinder, point, own)
            sections.append(record_section(checked, result, traces))
            verdicts.append(_verdict(checked))
    if args.report:
        texts.append(f"Report: {args.report}")
    whole = {"files": payloads} if several else payloads[0]
    if args.report:
        whole["report"] = args.report
    if result is not None and "cycles" in result.attrs:  # a CSV holds the figures of every cycle then
        result = result[[name for name, v in result.data_vars.items() if v.dims == ("cycle",)]]
    emit(args, whole, text=texts if args.report else texts[:-1], traces=result)
    if args.report:
        engine_name = f"{'assumed: ' if assumed else ''}{preset.name}"
        _write_report(args.report, sections, verdicts, engine_name, cylinder)


def _one(
    args: argparse.Namespace,
    trace: Any,
    engine: tuple[Cylinder, OperatingPoint, Preset],
    given: dict[str, Any],
    *,
    traces: bool,
) -> tuple[xr.Dataset, dict[str, Any], list[str | Table]]:
    """Analyse one file: its figures, and what is printed of them."""
    cylinder, point, preset = engine
    result = analyze(trace, cylinder, point=point, keep_traces=traces, **given)
    named = result.attrs["gamma"]
    if named == "cylinder":
        named = cylinder.gamma if args.gamma == "constant" else args.gamma
    payload = {
        "file": result.attrs["file"],
        "preset": preset.name,
        **_figures(result),
        "method": result.attrs["method"],
        "gamma": named,
        **{name: result.attrs[name] for name in ("fractions", "smoothing", "heat_window", "mass_source", "motored")},
        "warnings": result.attrs["warnings"].splitlines(),
        "open": result.attrs["open"].splitlines(),
    }
    text: list[str | Table] = [lines(payload)]
    if "cycles" in payload:
        plain = (str, int)
        said = {name: v for name, v in payload.items() if isinstance(v, plain) or name.startswith(_OF_RECORDS)}
        text = [lines(said), "", figures_table(result, by_name=True)]
    if not args.tdc:
        text += [f"open: {each}; --tdc scans it, a motored record shows it" for each in payload["open"]]
    if args.tdc:
        found = estimate_tdc([_absolute(trace, float(payload["pegging_bar"]))], cylinder, point=point, span_cad=4.0)
        payload["tdc"] = found.figures
        payload["warnings"] += found.doubts()
        warn(*found.doubts(), of=payload["file"])
        place = f"{found.tdc_offset_cad:+.2f} °CA, {found.low_cad:+.2f} to {found.high_cad:+.2f} possible"
        text.append(f"TDC offset {place}; {found.cost}")
    return result, payload, text


def _drawn(trace: xr.Dataset, cylinder: Cylinder, point: OperatingPoint, given: dict[str, Any]) -> xr.Dataset | None:
    """Analyse with traces as many cycles as a picture shows; one cycle has its traces already."""
    if "cycle" not in trace.dims:
        return None
    every = -(-trace.sizes["cycle"] // DRAWN_CYCLES)
    return analyze(trace.isel(cycle=slice(None, None, every)), cylinder, point=point, quiet=True, **given)


def _verdict(report: PressureCheck) -> str:
    """Name the worst of a file's checks."""
    worst = ", ".join(check.name for check in report.checks if check.verdict == report.verdict)
    return report.title + (f" ({worst})" if report.verdict in ("doubt", "fail") else "")


def _write_report(file: str, sections: list[Section], verdicts: list[str], engine: str, c: Cylinder) -> None:
    """Write the page: what the checks came to first, then one section per file."""
    geometry = f"{c.bore_mm:g} x {c.stroke_mm:g} mm, compression ratio {c.compression_ratio:g}"
    write_page(
        file,
        "Measured pressure",
        sections,
        verdict=verdicts,
        made_by="mgdd engine analyze",
        facts={"Engine": f"{engine}, {geometry}"},
    )
    wrote(file)


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


def _refused(file: str, error: DataError) -> PressureCheck:
    return PressureCheck(Path(file).name, (Check("file", "fail", str(error)),))


def _check_analysis(args: argparse.Namespace) -> None:
    whole = "--tdc" if args.tdc else "--report" if args.report else None
    if args.chunk_cycles is not None and whole:
        raise ParameterError(f"--chunk-cycles and {whole}, which needs the whole record, contradict each other")
    if args.chunk_cycles is not None and args.chunk_cycles < 1:
        raise ParameterError.of("--chunk-cycles", args.chunk_cycles, ">= 1")
    if args.smoothing_width_cad is not None and args.smoothing in ("none", "low_pass"):
        raise ParameterError("--smoothing-width-cad acts with --smoothing savitzky_golay or angle_window: choose one")
    if args.smoothing_cutoff_hz is not None and args.smoothing != "low_pass":
        raise ParameterError("--smoothing-cutoff-hz acts with --smoothing low_pass only: choose it")
    if args.cylinders is not None and args.brake_torque_nm is None:
        raise ParameterError("--cylinders acts with --brake-torque-nm only: give it")


def _add_check(parser: Any) -> None:
    add_files(parser, nargs="+")
    group = parser.add_argument_group("what is known of the record")
    PEGGING.add(group)
    _STATED.add(group)
    add_engine(parser)


def _check(args: argparse.Namespace) -> None:
    check_pegging(args)
    cylinder, point, preset = engine_of(args)
    given = PEGGING.given(args) | _STATED.given(args) | {"fuel_mg": point_given(args).get("fuel_mg")}
    assumed = assumed_geometry(args)

    def report(file: str, read: Callable[[], xr.Dataset]) -> PressureCheck:
        try:
            return check_pressure(read(), cylinder, point=point, assumed=assumed, **given)
        except DataError as error:
            return _refused(file, error)

    reports = [report(file, read) for file, read in readers_of(args).items()]
    payload = {
        "preset": preset.name,
        "assumed": assumed,
        "engine": {name: getattr(cylinder, name) for name in GEOMETRY},
        "files": [
            {
                "file": each.file,
                "verdict": each.verdict,
                "checks_made": each.made,
                "checks": [vars(check) for check in each.checks],
                "warnings": [] if each.analysis is None else each.analysis.attrs["warnings"].splitlines(),
            }
            for each in reports
        ],
    }
    if any(each.verdict == "fail" for each in reports):
        args.exit_code = _FAILED
    emit(args, payload, text="\n\n".join(each.summary() for each in reports))


COMMANDS = {"analyze": (_add_analyze, _analyze), "check": (_add_check, _check)}
