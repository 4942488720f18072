"""`mgdd engine seek`: `mgdd.loop.seek` on the virtual bench, and what it came to."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core.engine import OperatingPoint
from mgdd._core.loop import bench_inputs, bench_limits
from mgdd.cli.from_library import Options, as_option, named_options
from mgdd.cli.guide_map import add_guide, check_guide, guide_of, learn_map
from mgdd.cli.options import add_engine, engine_of, option, refuse_idle
from mgdd.cli.output import emit, lines, warn
from mgdd.cli.progress import Stopped
from mgdd.cli.ranges import assignments, bounds_of, limits_given, number_pairs
from mgdd.engine import Performance
from mgdd.errors import ConvergenceError, Interrupted, ParameterError, hinted
from mgdd.guide import GuidedEngine, TimingMap
from mgdd.io.point_table import read_points
from mgdd.loop import VirtualEngine, seek
from mgdd.loop.lower_limits import limits_by_name, plain_name
from mgdd.loop.seek_choice import SEEKERS
from mgdd.loop.seek_result import SeekResult
from mgdd.loop.summary import FIGURES, NOISE_FREE
from mgdd.optimize import ComponentLag, MapSeeking
from mgdd.optimize.map_driver import MapDriver
from mgdd.optimize.optimum import Optimum
from mgdd.plot import seeking
from mgdd.plot.style import drawn
from mgdd.results.labels import VARIABLES, to_jsonable
from mgdd.results.units import unit_attributes

if TYPE_CHECKING:
    import xarray as xr

_BENCH = Options(
    VirtualEngine, "soc_scatter_cad", "seed", efficiency_noise_percent="noise", misfire_probability="misfire"
)  # fmt: skip
_SEARCH = Options(seek, "cycles", "noise_sd")
_BOUNDS_CAD = (-30.0, 10.0)  # of the timing, where nobody says
_NEAR = 40.0  # arrived: within a fortieth of the bounds, the scale that an input has by itself
_COV = "cov_imep_percent"  # has no steady value
# Arguments of the library and the options that set them.
BENCH_NAMES = {**_BENCH.options, "limits": "limit", "nox_sensor": "sensor", "inputs": "input",
               **{name: name for name in ("start", "tolerance", *OperatingPoint.fields())}}  # fmt: skip
_NAMES = {**BENCH_NAMES, **_SEARCH.options, "known": "known", "guide_cylinder": "guide_set",
          "guide_table": "guide_map", "settings": "seeker_set"}  # fmt: skip


def _add_seek(parser: Any) -> None:
    option(parser, "--seeker NAME",
           f"the seeker: auto or one of {', '.join(SEEKERS)}", default="auto", choices=('auto', *SEEKERS))  # fmt: skip
    option(parser, "--seeker-set FIELD=VALUE ...", "any setting of the seeker, repeatable, for example form=washout")
    option(parser, "--input NAME=LOW:HIGH[:STEP] ...",
           f"bounds of an input of the bench ({', '.join(bench_inputs)}), and the step in which it is set; "
           "repeatable: several are sought at once (default: soc_cad=-30:10)")  # fmt: skip
    option(parser, "--start NAME=X ...",
           "first value of an input, repeatable; left out: the best of the guide, or the middle of the bounds, under "
           "limits the safe side of the timing")  # fmt: skip
    _SEARCH.add(parser)
    option(parser, "--tolerance NAME=X ...",
           "stop before all cycles once the estimate moves by less, one for each input")  # fmt: skip
    option(parser, "--limit NAME=X ...",
           f"keep an indicator, {', '.join(bench_limits)} or {_COV} below X, or with NAME=LOW:HIGH between two, of "
           "which one may be left out; repeatable")  # fmt: skip
    option(parser, "--known FILE.csv", "readings of before, as -o writes them: they are told to the seeker first")
    option(parser, "--map FILE.json",
           "seek by what mgdd map seek --search has written, which learns on in every cycle and is written back",
    )  # fmt: skip
    option(parser, "--figure FILE", "draw the run (.png, .svg or .pdf)")
    add_bench(parser, "none", "analyser", "soft")
    add_guide(parser)
    add_engine(parser)


def add_bench(parser: Any, *sensors: str) -> None:
    """Add the options of the bench."""
    group = parser.add_argument_group("bench")
    option(group, "--sensor",
           "none: J is the efficiency in percent; else less 0.004 per ppm NOx by that sensor",
           default="none", choices=sensors)  # fmt: skip
    _BENCH.add(group)


def _seek(args: argparse.Namespace) -> None:
    check_guide(args)
    driver = None if args.map is None else _driver(args)
    limits = limits_given(args.limit) if driver is None else limits_by_name(driver.search.settings["limits"])
    start = number_pairs(args.start, "--start")
    known = None if args.known is None else read_points(args.known)
    with option_names(_NAMES):
        bench, bounds, preset = bench_of(args, limits)
        guide = guide_of(args, bench)
        best = bench.find_optimum(
            {name: value for name, value in limits.items() if name != _COV},
            bounds={name: (low, high) for name, (low, high, *_) in bounds.items()},
        )
        try:
            found: SeekResult = seek(
                bench, bounds, seeker=driver or args.seeker, start=start or None, limits=limits,
                tolerance=number_pairs(args.tolerance, "--tolerance") or None, components=_lags(bench),
                guide=guide, known=known, settings=assignments(args.seeker_set, {}, "--seeker-set"),
                seed=0 if driver is not None else bench.seed,
                **_SEARCH.given(args),
            )  # fmt: skip
        except Interrupted as stop:
            if not isinstance(stop.partial, SeekResult):
                raise
            found = stop.partial
    if driver is not None:
        driver.search.save(args.map)
    run, timing = found.run, guide if isinstance(guide, TimingMap) else None
    learnt, unlearnt = learn_map(args, timing, found.seeker, bench.point, interrupted=run.interrupted)
    doubts = [*map(str, found.findings), *unlearnt]
    warn(*doubts)
    payload = found.to_dict() | {"preset": preset, "sensor": args.sensor, "seed": bench.seed}
    payload |= _judged(bench, best, found) | _guided(args, found, guide) | learnt | {"warnings": doubts}
    how = {"optimum_cad": best["soc_cad"]} if len(best.inputs) == 1 else {}
    picture = partial(drawn, seeking, run.dataset, size=(8.0, 7.0), **how)
    emit(args, payload, text=_text(payload, found), traces=_table(run.dataset), figure=picture)
    if run.interrupted:
        raise Stopped(f"{run.dataset.sizes['cycle']} cycles are kept")


def _driver(args: argparse.Namespace) -> MapDriver:
    """Read the map that is driven by, whose inputs become those of the bench."""
    why = "the search of --map has its own"
    refuse_idle(args, "input", "limit", "start", "seeker_set", "known", "tolerance", "noise_sd", why=why)
    for name, default in (("seeker", "auto"), ("guide", "none"), ("sensor", "none")):
        if getattr(args, name) not in (None, default):
            raise ParameterError(f"--{name} does not act here; {why}")
    search = MapSeeking.load(args.map)
    args.input = [
        f"{one.name}={one.lower!r}:{one.upper!r}" + (f":{one.step!r}" if one.step > 0.0 else "")
        for one in search.settings["inputs"]
    ]
    return search.driver()


def bench_of(
    args: argparse.Namespace, limits: Mapping[str, Any]
) -> tuple[VirtualEngine, dict[str, tuple[float, ...]], str]:
    """Make the bench, the bounds of its inputs, and the name of its preset."""
    inputs = bounds_of(args.input)
    for name in inputs:
        if name not in bench_inputs:
            raise ParameterError(hinted(f"--input {name}: the bench has {', '.join(bench_inputs)}", name, bench_inputs))
    cylinder, point, preset = engine_of(args)
    if not point.fuel_mg > 0.0:
        raise ParameterError("fuel_mg = 0: nothing burns, so a best timing does not exist; leave --motored out")
    nox = args.sensor != "none"
    bench = VirtualEngine(
        cylinder,
        point,
        performance=Performance.efficiency_and_nox() if nox else Performance.efficiency_only(),
        nox_sensor=args.sensor,
        limits=list(limits),
        inputs=["soc_cad", *(name for name in inputs if name != "soc_cad")],
        **_BENCH.given(args),
    )
    for name, bounds in inputs.items():
        least, greatest = bench.input_bounds[name]
        for value in bounds:
            if not least <= value <= greatest:
                bound = f"must be in [{least:g}, {greatest:g}], the window of the bench"
                raise ParameterError(f"--input {name}={bounds[0]:g}:{bounds[1]:g}: {value:g} {bound}")
    return bench, {name: inputs.get(name, _BOUNDS_CAD) for name in bench.input_names}, preset.name


def _lags(bench: VirtualEngine) -> list[ComponentLag] | None:
    """Say what stands between the plant and each component of J: the data sheet of the analyser."""
    if bench.settings["nox_sensor"] != "analyser":
        return None
    gain = bench.analyser_gain
    lag = -1.0 / math.log1p(-gain) if gain < 1.0 else 0.0
    return [ComponentLag(), ComponentLag(delay_cycles=float(bench.analyser_delay_cycles), lag_cycles=lag)]


def _judged(bench: VirtualEngine, best: Optimum, found: SeekResult) -> dict[str, Any]:
    """Judge by the noise-free bench, which the search does not know."""
    steady = bench.steady_map({name: [value] for name, value in found.inputs.items()}, cycle=max(bench.cycle - 1, 0))
    names, aim = list(best.inputs), np.array(list(best.inputs.values()))
    estimates = found.run.dataset["estimate"].sel(input=names).to_numpy()
    width = np.array([high - low for low, high in best.bounds.values()])
    near = (np.abs(estimates - aim) <= width / _NEAR).all(axis=1)
    late = (estimates - aim)[len(estimates) // 2 :]
    return {
        "optimum": dict(best.inputs),
        "optimum_active_limits": list(best.active_limits),
        "free_optimum": dict(best.free_inputs),
        "j_lost": best.value - float(steady["j"].squeeze()),
        "cycles_to": int(near.argmax()) if near.any() else None,
        "rms": dict(zip(best.inputs, np.sqrt(np.mean(late**2, axis=0)).tolist(), strict=True)) if late.size else None,
    }


def _guided(args: argparse.Namespace, found: SeekResult, guide: Any) -> dict[str, Any]:
    if guide is None:
        return {"guide": "none"}
    out: dict[str, Any] = {"guide": args.guide}
    if isinstance(found.seeker, GuidedEngine) and args.guide == "calibrated":
        out |= {
            "guide_wall_heat_scale": found.seeker.cylinder.wall_heat_scale,
            "recalibrations": found.seeker.recalibrations,
        }
    return out


def _text(payload: Mapping[str, Any], found: SeekResult) -> list[str]:
    plain = to_jsonable(payload)
    text = [
        lines(plain | plain["figures"]),
        *(
            f"{name}: start {found.start[name]:.4g}, best {value:.4g}, optimum {payload['optimum'][name]:.4g}"
            for name, value in found.inputs.items()
        ),
    ]
    summary = found.run.summary
    judged_from = int(summary["judged_from"])
    for limit in found.asked.limits:
        for prefix, how in (("", "as measured"), (NOISE_FREE, "noise-free at what was applied")):
            own = {figure: summary.get(f"{prefix}{figure}_{limit.name}") for figure in FIGURES}
            own["limit"] = limit.upper
            if own["worst"] is not None and math.isfinite(own["worst"]):
                name, side = plain_name(limit.name)
                text.append(f"{name} {how}: {_kept(own, side, judged_from)}")
    return text


def _kept(own: Mapping[str, Any], side: float, judged_from: int) -> str:
    return (
        f"worst {side * own['worst']:.6g} in cycle {own['worst_cycle']:.0f}; "
        f"{'above' if side > 0.0 else 'below'} {side * own['limit']:g} in "
        f"{own['above_cycles']:.0f} cycles ({_percent(own['above_fraction'])}), from cycle {judged_from} on in "
        f"{own['judged_above_cycles']:.0f} ({_percent(own['judged_above_fraction'])})"
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def _table(cycles: xr.Dataset) -> xr.Dataset:
    """Leave the columns over cycles, those of the inputs by name; limits that are no indicator are added."""
    table = cycles.drop_dims([dim for dim in cycles.dims if dim != "cycle"])
    for name in cycles["input"].to_numpy().tolist():
        for kind in ("estimate", "asked", "applied"):
            table[f"{kind}_{name}"] = cycles[kind].sel(input=name, drop=True)
    for name in cycles["limit"].to_numpy().tolist() if "limit" in cycles.dims else []:
        if name not in table and name == plain_name(name)[0]:
            column = cycles["limits"].sel(limit=name, drop=True).drop_vars("limit_units", errors="ignore")
            table[name] = column.assign_attrs(unit_attributes(*VARIABLES[name]))
    return table


@contextmanager
def option_names(names: Mapping[str, str]) -> Iterator[None]:
    """Let messages and errors of the library name the options, by arguments."""
    try:
        with named_options(**names):
            yield
    except (ParameterError, ConvergenceError) as error:
        option = names.get(error.field or "")
        if option is None:
            raise
        said = str(error).removeprefix(error.field or "").removeprefix(" =").removeprefix(":")
        raise error.reworded(as_option(option) + said) from error


COMMANDS = {"seek": (_add_seek, _seek)}
