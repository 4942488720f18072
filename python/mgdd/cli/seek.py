"""`mgdd engine seek`: a seeker on the virtual bench, and what it came to."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from mgdd.cli.from_library import Options, as_option, named_options
from mgdd.cli.guide_map import add_guide, check_guide, guide_of, learn_map
from mgdd.cli.options import add_command, add_engine, engine_of, number_pairs
from mgdd.cli.output import Stopped, check_figure, check_output, emit, lines, save_figure
from mgdd.cli.ranges import bounds_of
from mgdd.engine import Performance
from mgdd.errors import ConvergenceError, ParameterError, hinted
from mgdd.loop import EngineBench
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
        help="bounds of an input of the bench by its name, in place of --lower-cad and --upper-cad",
    )  # fmt: skip
    parser.add_argument(
        "--limit", action="append", default=[], metavar="NAME=X",
        help=f"keep an indicator, or {COV}, below X; repeatable",
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
        bench, preset = _bench(args, limits)
        guide = guide_of(args, bench.settings["cylinder"])
        search = TimingSearch(bench=bench, limits=limits, **guide, **_SEARCH.given(args) | _bounds(args, bench))
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


def _bench(args: argparse.Namespace, limits: Mapping[str, float]) -> tuple[EngineBench, str]:
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
        **_BENCH.given(args),
    )
    return bench, preset.name


def _bounds(args: argparse.Namespace, bench: EngineBench) -> dict[str, float]:
    """Read ``--input`` as the bounds of the search."""
    out: dict[str, float] = {}
    for name, (low, high) in bounds_of(args.input).items():
        if name not in bench.input_names:
            known = ", ".join(bench.input_names)
            raise ParameterError(hinted(f"--input {name}: the bench has {known}", name, bench.input_names))
        for option in ("lower_cad", "upper_cad"):
            if getattr(args, option) is not None:
                raise ParameterError(f"--input {name} and {as_option(option)} contradict each other: give one")
        out = {"lower_cad": low, "upper_cad": high}
    return out


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
    if search.limits and not search.is_curve:
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
