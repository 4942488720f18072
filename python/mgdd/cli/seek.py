"""`mgdd engine seek`: a seeker on the virtual bench, and what it came to."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from mgdd._core.loop import bench_inputs, bench_limits
from mgdd.cli.from_library import Options, as_option, named_options
from mgdd.cli.guide_map import add_guide, check_guide, guide_of, learn_map
from mgdd.cli.options import add_command, add_engine, engine_of, number_pairs
from mgdd.cli.output import Stopped, check_figure, check_output, emit, lines, save_figure
from mgdd.cli.ranges import bounds_of
from mgdd.cli.seek_inputs import seek_inputs
from mgdd.engine import Performance
from mgdd.errors import ConvergenceError, ParameterError, hinted
from mgdd.loop import EngineBench
from mgdd.loop.limit_figures import FIGURES
from mgdd.loop.seek_limits import COV, SCATTER, limit_report
from mgdd.loop.timing_search import TimingSearch, TimingSearchRun
from mgdd.optimize.optimum import Optimum
from mgdd.plot.style import drawn
from mgdd.results.labels import VARIABLES, to_jsonable
from mgdd.results.units import unit_attributes

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["add_seek"]

_LOG = logging.getLogger(__name__)
_BENCH = Options(
    EngineBench, "soc_scatter_cad", "seed", efficiency_noise_percent="noise", misfire_probability="misfire"
)  # fmt: skip
_SEARCH = Options(
    TimingSearch, "method", "form", "start_cad", "lower_cad", "upper_cad", "cycles", "limit_method"
)  # fmt: skip
# Arguments of the library and the options that set them.
_NAMES = {**_BENCH.options, "start": "start_cad", "limits": "limit", "nox_sensor": "sensor",
          "guide_cylinder": "guide_set", "guide_table": "guide_map"}  # fmt: skip


def add_seek(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "seek", _seek,
        help_text="let a seeker find the best start of combustion on the virtual bench, one cycle at a time",
        example="mgdd engine seek --method extremum_seeking --limit p_max_bar=95 --json",
        endings=".json or .csv, the cycles",
    )  # fmt: skip
    _SEARCH.add(parser)
    parser.add_argument(
        "--input", action="append", default=[], metavar="NAME=LOW:HIGH",
        help=f"bounds of an input of the bench ({', '.join(bench_inputs)}), of soc_cad in place of --lower-cad and "
        "--upper-cad; repeatable: several are sought at once, by gaussian_process_seeking",
    )  # fmt: skip
    parser.add_argument(
        "--limit", action="append", default=[], metavar="NAME=X",
        help=f"keep an indicator, {', '.join(bench_limits)} or {COV} below X; repeatable",
    )  # fmt: skip
    parser.add_argument("--figure", metavar="FILE", help="draw the run (.png, .svg or .pdf)")
    group = parser.add_argument_group("bench")
    group.add_argument(
        "--sensor", choices=("none", "analyser", "soft"), default="none",
        help="none: J is the efficiency in percent; else less 0.004 per ppm NOx by that sensor (default: %(default)s)",
    )  # fmt: skip
    _BENCH.add(group)
    add_guide(parser)
    add_engine(parser)


def _seek(args: argparse.Namespace) -> None:
    check_output(args, ".json", ".csv")
    check_figure(args.figure)
    check_guide(args)
    limits = number_pairs(args.limit, "--limit")
    with _option_names():
        given = bounds_of(args.input)
        bench, preset = _bench(args, limits, given)
        bounds = _bounds(args, bench, given)
        if len(bench.input_names) > 1:
            _seek_several(args, bench, preset, bounds, limits)
            return
        guide = guide_of(args, bench.settings["cylinder"])
        search = TimingSearch(bench=bench, limits=limits, **guide, **_SEARCH.given(args) | _timings(bounds))
        found = search.run()
        doubts = found.doubts()
    run, table = found.run, search.guide_table
    learnt, unlearnt = learn_map(args, table, found.seeker, bench.point, interrupted=run.interrupted)
    doubts += unlearnt
    for doubt in doubts:
        _LOG.warning("%s", doubt)
    payload = _payload(args, preset, found) | found.guide_figures() | learnt
    payload |= {"start_cad": found.start_cad, "start_reason": found.start_reason, "warnings": doubts}
    text = [lines(to_jsonable(payload)), *_limit_text(payload["limit_report"], int(run.summary["judged_from"]))]
    emit(args, payload, text=text, traces=_table(run.dataset))
    if args.figure:
        _draw(run.dataset, found.best, limits, args.figure)
    if run.interrupted:
        raise Stopped(f"{run.dataset.sizes['cycle']} of {found.cycles} cycles are kept")


def _bench(args: argparse.Namespace, limits: Mapping[str, float], inputs: Mapping[str, Any]) -> tuple[EngineBench, str]:
    for name in inputs:
        if name not in bench_inputs:
            raise ParameterError(hinted(f"--input {name}: the bench has {', '.join(bench_inputs)}", name, bench_inputs))
    cylinder, point, preset = engine_of(args)
    if not point.fuel_mg > 0.0:
        raise ParameterError("fuel_mg = 0: nothing burns, so a best timing does not exist; leave --motored out")
    nox = args.sensor != "none"
    bench = EngineBench(
        cylinder,
        point,
        performance=Performance.efficiency_and_nox() if nox else Performance.efficiency_only(),
        nox_sensor=args.sensor,
        limits=list(limits),
        inputs=["soc_cad", *(name for name in inputs if name != "soc_cad")],
        **_BENCH.given(args),
    )
    return bench, preset.name


def _bounds(
    args: argparse.Namespace, bench: EngineBench, given: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Check the bounds of ``--input`` against the bench."""
    for name, bounds in given.items():
        least, greatest = bench.input_bounds[name]
        for value in bounds:
            if not least <= value <= greatest:
                bound = f"must be in [{least:g}, {greatest:g}], the window of the bench"
                raise ParameterError(f"--input {name}={bounds[0]:g}:{bounds[1]:g}: {value:g} {bound}")
    for option in ("lower_cad", "upper_cad"):
        if "soc_cad" in given and getattr(args, option) is not None:
            raise ParameterError(f"--input soc_cad and {as_option(option)} contradict each other: give one")
    return dict(given)


def _timings(bounds: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    return dict(zip(("lower_cad", "upper_cad"), bounds["soc_cad"], strict=True)) if bounds else {}


def _seek_several(
    args: argparse.Namespace,
    bench: EngineBench,
    preset: str,
    bounds: Mapping[str, tuple[float, float]],
    limits: Mapping[str, float],
) -> None:
    """Seek several inputs at once."""
    for option in ("form", "limit_method", "guide_shape"):
        if getattr(args, option, None):
            raise ParameterError(
                f"{as_option(option)} acts with soc_cad alone, not with several of --input: leave it out"
            )
    if args.guide not in (None, "none"):
        raise ParameterError(f"--guide {args.guide} guides soc_cad alone, not several of --input: leave it out")
    if args.method not in (None, "gaussian_process_seeking"):
        raise ParameterError(
            f"--method {args.method} has settings for soc_cad alone here: leave it out, or use mgdd.loop.run_seeker"
        )
    if args.sensor == "analyser":
        raise ParameterError("--sensor analyser is late, and one search takes J of the same cycle: use --sensor soft")
    low = TimingSearch.lower_cad if args.lower_cad is None else args.lower_cad
    high = TimingSearch.upper_cad if args.upper_cad is None else args.upper_cad
    everything = {name: bounds.get(name, (low, high)) for name in bench.input_names}
    run, payload = seek_inputs(bench, everything, limits, start_cad=args.start_cad, cycles=args.cycles)
    payload = {"method": "gaussian_process_seeking", "preset": preset, "sensor": args.sensor} | payload
    table = _table(run.dataset)
    for name in bench.input_names:
        for kind in ("estimate", "asked"):
            table[f"{kind}_{name}"] = run.dataset[kind].sel(input=name, drop=True)
    text = [
        f"{name}: start {payload['start'][name]:.4g}, estimate {payload['final'][name]:.4g}, "
        f"optimum {payload['optimum'][name]:.4g}"
        for name in bench.input_names
    ]
    for name in limits:
        own = {figure: payload["limit_figures"].get(f"{figure}_{name}") for figure in FIGURES}
        text.append(f"{name} as measured: {_kept(own, int(payload['limit_figures']['judged_from']))}")
    emit(args, payload, text=[lines(to_jsonable(payload)), *text], traces=table)
    if args.figure:
        from mgdd import plot

        save_figure(drawn(plot.seeking, run.dataset, size=(8.0, 7.0), limit_values=dict(limits)), args.figure)
    if run.interrupted:
        raise Stopped(f"{run.dataset.sizes['cycle']} cycles are kept")


def _payload(args: argparse.Namespace, preset: str, found: TimingSearchRun) -> dict[str, Any]:
    search, run, best = found.search, found.run, found.best
    summary = run.summary
    out: dict[str, Any] = {
        "method": search.method,
        "preset": preset,
        "sensor": args.sensor,
        "seed": search.bench.settings["seed"],
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
        "limits": dict(search.limits),
        "judged_from": int(summary["judged_from"]),
        "limit_report": limit_report(run, best, search.limits, found.seeker.limit_states),
        "interrupted": run.interrupted,
    }
    if search.method == "extremum_seeking":
        out["form"] = search.form or "batch"
    if search.limits and not search.is_curve and search.method != "gaussian_process_seeking":
        out["limit_method"] = search.limit_method or "switching"
    return out


def _limit_text(report: Mapping[str, Mapping[str, Any]], judged_from: int) -> list[str]:
    """Say in two lines per limit how it was kept."""
    out = []
    for name, own in report.items():
        infeasible = "; infeasible with the other limits and the bounds" if own["state"] == "infeasible" else ""
        out.append(
            f"{name} as measured: {_kept(own, judged_from)}, {_percent(own['judged_above_threshold_fraction'])} above "
            f"{own['threshold_with_margin']:.6g} (plus {SCATTER:g} standard deviations of the scatter){infeasible}"
        )
        if own["noise_free"] is not None:
            free = {"limit": own["limit"], **own["noise_free"]}
            out.append(f"{name} noise-free at the applied timing: {_kept(free, judged_from)}")
    return out


def _kept(own: Mapping[str, Any], judged_from: int) -> str:
    return (
        f"worst {own['worst']:.6g} in cycle {own['worst_cycle']:.0f}; above {own['limit']:g} in "
        f"{own['above_cycles']:.0f} cycles ({_percent(own['above_fraction'])}), from cycle {judged_from} on in "
        f"{own['judged_above_cycles']:.0f} ({_percent(own['judged_above_fraction'])})"
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


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
    """Let messages and errors of the library name the options."""
    try:
        with named_options(**_NAMES):
            yield
    except (ParameterError, ConvergenceError) as error:
        option = _NAMES.get(error.field or "")
        if option is None:
            raise
        said = str(error).removeprefix(error.field or "").removeprefix(" =").removeprefix(":")
        raise error.reworded(as_option(option) + said) from error
