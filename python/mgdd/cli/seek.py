"""`mgdd engine seek`: `mgdd.loop.seek` on the virtual bench, and what it came to."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd._core.loop import bench_inputs, bench_limits
from mgdd.cli.from_library import Options, as_option, default_of, named_options
from mgdd.cli.options import add_engine, engine_of, option, refuse_idle
from mgdd.cli.output import check_file, emit, lines, warn, wrote
from mgdd.cli.progress import Stopped
from mgdd.cli.ranges import assignments, bounds_of, limits_given, number_pairs
from mgdd.engine import Performance
from mgdd.errors import ConvergenceError, DataError, Interrupted, ParameterError, did_you_mean, hinted
from mgdd.guide import FeedForward, GuidedEngine, TimingMap
from mgdd.guide.map_table import read_map_table
from mgdd.io.files import existing_file
from mgdd.io.parameters import ParameterFile
from mgdd.io.point_table import read_points
from mgdd.loop import VirtualEngine, seek
from mgdd.loop.engine_guide import KINDS, EngineGuide
from mgdd.loop.lower_limits import plain_name
from mgdd.loop.seek_choice import SEEKERS
from mgdd.loop.seek_result import SeekResult
from mgdd.loop.summary import FIGURES, NOISE_FREE
from mgdd.optimize import ComponentLag
from mgdd.optimize.optimum import Optimum
from mgdd.plot import seeking
from mgdd.plot.style import drawn
from mgdd.results.labels import VARIABLES, to_jsonable
from mgdd.results.units import unit_attributes

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

_BENCH = Options(
    VirtualEngine, "soc_scatter_cad", "seed", efficiency_noise_percent="noise", misfire_probability="misfire"
)  # fmt: skip
_SEARCH = Options(seek, "cycles", "noise_sd")
_BOUNDS_CAD = (-30.0, 10.0)  # of the timing, where nobody says
_NEAR = 40.0  # arrived: within a fortieth of the bounds, the scale that an input has by itself
_COV = "cov_imep_percent"  # has no steady value
# Arguments of the library and the options that set them.
_NAMES = {**_BENCH.options, **_SEARCH.options, "start": "start", "limits": "limit", "nox_sensor": "sensor",
          "tolerance": "tolerance", "known": "known", "inputs": "input", "guide_cylinder": "guide_set",
          "guide_table": "guide_map",
          "settings": "seeker_set", **{name: name for name in OperatingPoint.fields()}}  # fmt: skip


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
    option(parser, "--figure FILE", "draw the run (.png, .svg or .pdf)")
    group = parser.add_argument_group("bench")
    option(group, "--sensor",
           "none: J is the efficiency in percent; else less 0.004 per ppm NOx by that sensor",
           default="none", choices=('none', 'analyser', 'soft'))  # fmt: skip
    _BENCH.add(group)
    add_guide(parser)
    add_engine(parser)


def _seek(args: argparse.Namespace) -> None:
    check_guide(args)
    limits, start = limits_given(args.limit), number_pairs(args.start, "--start")
    known = None if args.known is None else read_points(args.known)
    with _option_names():
        given = bounds_of(args.input)
        bench, preset = _bench(args, limits, given)
        bounds = {name: given.get(name, _BOUNDS_CAD) for name in bench.input_names}
        guide = guide_of(args, bench)
        best = bench.find_optimum(
            {name: value for name, value in limits.items() if name != _COV},
            bounds={name: (low, high) for name, (low, high, *_) in bounds.items()},
        )
        try:
            found: SeekResult = seek(
                bench, bounds, seeker=args.seeker, start=start or None, limits=limits,
                tolerance=number_pairs(args.tolerance, "--tolerance") or None, components=_lags(bench),
                guide=guide, known=known, settings=assignments(args.seeker_set, {}, "--seeker-set"), seed=bench.seed,
                **_SEARCH.given(args),
            )  # fmt: skip
        except Interrupted as stop:
            if not isinstance(stop.partial, SeekResult):
                raise
            found = stop.partial
    run, table = found.run, guide if isinstance(guide, TimingMap) else None
    learnt, unlearnt = learn_map(args, table, found.seeker, bench.point, interrupted=run.interrupted)
    doubts = [*map(str, found.findings), *unlearnt]
    warn(*doubts)
    payload = found.to_dict() | {"preset": preset, "sensor": args.sensor, "seed": bench.seed}
    payload |= _judged(bench, best, found) | _guided(args, found, guide) | learnt | {"warnings": doubts}
    how = {"optimum_cad": best["soc_cad"]} if len(best.inputs) == 1 else {}
    picture = partial(drawn, seeking, run.dataset, size=(8.0, 7.0), **how)
    emit(args, payload, text=_text(payload, found), traces=_table(run.dataset), figure=picture)
    if run.interrupted:
        raise Stopped(f"{run.dataset.sizes['cycle']} cycles are kept")


def _bench(args: argparse.Namespace, limits: Mapping[str, Any], inputs: Mapping[str, Any]) -> tuple[VirtualEngine, str]:
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
    return bench, preset.name


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


COMMANDS = {"seek": (_add_seek, _seek)}


GUIDE = Options(EngineGuide, shape="guide_shape")
_ENDINGS = (".csv", ".toml")
_POINT = frozenset(OperatingPoint.fields())


def add_guide(parser: argparse.ArgumentParser) -> None:
    """Add the options of the guide."""
    group = GUIDE.add(parser, "guide: a rough model that leads while the measurements decide")
    option(group, "--guide",
           "curve: the model's whole curve; calibrated: the same while the model learns from the pressure; "
           "feed_forward: the model's best timing; map: a table of timings",
           default="none", choices=('none', *KINDS, 'map'))  # fmt: skip
    option(group, "--guide-preset NAME_OR_FILE.toml", "cylinder of the model (default: that of the bench)")
    option(group, "--guide-set FIELD=VALUE ...",
           "any field of the model's cylinder, repeatable, for example wall_heat_scale=1.0")  # fmt: skip
    option(group, "--guide-map FILE", "the table of --guide map, .csv or .toml")
    option(group, "--guide-map-out FILE",
           "write that table, .csv or .toml, with the best timing of this run learnt, if the run has settled",
    )  # fmt: skip


def check_guide(args: argparse.Namespace) -> None:
    """Refuse options of a guide that is not there, and a table that is not said, or written where nothing is learnt."""
    guide = args.guide
    why = {"none": "has no model", "map": "has a table, not a model"}.get(guide, "has a model, not a table")
    models, tables = ("guide_preset", "guide_set", "guide_shape"), ("guide_map", "guide_map_out")
    idle = {"none": (*models, *tables), "map": models}.get(guide, tables)
    refuse_idle(args, *idle, why=f"--guide {guide} {why}")
    if guide != "map":
        return
    if args.guide_map is None:
        raise ParameterError(
            "--guide map needs --guide-map FILE, a table as TimingMap.write_csv or TimingMap.to_toml writes it"
        )
    check_file("--guide-map", args.guide_map, _ENDINGS)
    check_file("--guide-map-out", args.guide_map_out, _ENDINGS)
    if args.limit:
        why = "with --limit a run ends at the best timing within the limit, which is not what the table holds"
        refuse_idle(args, "guide_map_out", why=why)


def guide_of(args: argparse.Namespace, bench: VirtualEngine) -> TimingMap | EngineGuide | None:
    """Give the guide of a search on this bench, whose cylinder the model has unless another is named."""
    if args.guide == "none":
        return None
    if args.guide == "map":
        return _read_map(args.guide_map)
    own = bench.settings
    cylinder = _cylinder_of(args, own["cylinder"])
    with named_options(kind="guide", shape="guide_shape"):
        return EngineGuide(
            cylinder=cylinder, kind=args.guide, performance=own["performance"], nox=own["true_nox"],
            **GUIDE.given(args),
        )  # fmt: skip


def _cylinder_of(args: argparse.Namespace, base: Cylinder) -> Cylinder:
    if args.guide_preset is not None:
        with _named("--guide-preset", f"{args.guide_preset}: "):
            base = presets.load(args.guide_preset, kind="engine").cylinder
    fields = {**Cylinder.fields(), **OperatingPoint.fields()}
    with _named("--guide-set"):
        given = assignments(args.guide_set, fields, "--guide-set")
        if known := sorted(_POINT & given.keys()):
            raise ParameterError(f"--guide-set {known[0]}: belongs to the operating point, which guide and bench share")
        if strange := [name for name in given if name not in fields]:
            raise ParameterError(
                f"--guide-set {strange[0]}: is not a field of the cylinder; mgdd.engine.Cylinder has "
                f"{', '.join(Cylinder.fields())}"
            )
        return base.replace(**given)


@contextmanager
def _named(option: str, given: str = "") -> Iterator[None]:
    """Let errors of the library name the option."""
    try:
        yield
    except ParameterError as error:
        said = str(error)
        raise error.reworded(said if said.startswith(option) else f"{option} {given}{said}") from error


def _read_map(file: str) -> TimingMap:
    """Read a table by the ending of its file; its axes are numbers of the operating point."""
    is_csv = Path(file).suffix == ".csv"
    if is_csv and existing_file(file).read_bytes()[:64].lstrip(b"\xef\xbb\xbf").startswith(b"mgdd_map"):
        raise DataError(
            f"--guide-map {file}: a calibration map, another form of file: mgdd map export {file} --guide-map "
            "-o guide.csv writes the table that is read here"
        )
    table = TimingMap.read_csv(file) if is_csv else TimingMap.of_file(ParameterFile.read(file))
    known = OperatingPoint.fields()
    for name in table.axes:
        if name not in known:
            near = did_you_mean(name, known) or f"known are {', '.join(known)}"
            raise ParameterError(f"--guide-map {file}: axis {name!r} is not a number of the operating point: {near}")
    return table


def learn_map(
    args: argparse.Namespace, table: TimingMap | None, seeker: Any, point: OperatingPoint, *, interrupted: bool
) -> tuple[dict[str, Any], list[str]]:
    """Let the table learn the best timing of a run and write it, if the last 100 cycles agree within 1 °CA.

    Returns
    -------
    tuple of dict and list
        ``guide_map_learnt``, ``guide_map_cad`` and ``guide_map_sd_cad``, what the table says of the point now [°CA
        aTDC], and ``guide_map_out``, None where no file was written; empty without ``--guide-map-out``. And why it was
        not written.
    """
    if args.guide_map_out is None or table is None or not isinstance(seeker, FeedForward):
        return {}, []
    before = table.support
    learnt = not interrupted and table.learn_from(seeker, point)
    doubts = []
    if learnt:
        _write(table, args, point, before)
    else:
        spread_cad, cycles = (default_of(TimingMap.learn_from, name) for name in ("spread_cad", "cycles"))
        why = f"the estimate has not settled within {spread_cad:g} °CA over the last {cycles} cycles: raise --cycles"
        if interrupted:
            why = "the run was interrupted: let it run to its end"
        doubts.append(f"--guide-map-out {args.guide_map_out}: not written, {why}")
    now = table.lookup(point)
    figures = {
        "guide_map_learnt": learnt,
        "guide_map_cad": now.timing_cad,
        "guide_map_sd_cad": now.sd_cad,
        "guide_map_out": args.guide_map_out if learnt else None,
    }
    return figures, doubts


def _write(table: TimingMap, args: argparse.Namespace, point: OperatingPoint, before: NDArray[np.float64]) -> None:
    """Write the table; the cells that have learnt say so, the others what they said before."""
    own = point.to_dict()
    where = " ".join(f"{name}={own[name]:g}" for name in table.axes if own.get(name) is not None)
    said = f"mgdd engine seek at {where} seed={args.seed or 0}"
    known, out = Path(args.guide_map), Path(args.guide_map_out)
    if out.suffix == ".csv":
        old = read_map_table(known, ".")[1] if known.suffix == ".csv" else np.full(before.shape, _plain(known.name))
        table.write_csv(out, source=np.where(table.support != before, _plain(said), old))
    else:
        source = f"{known.name}; {said}"
        out.write_text(replace(table.to_parameters(), notes={"source": source}).to_toml(), encoding="utf-8")
    wrote(str(out))


def _plain(text: str) -> str:
    """Leave out what would end a cell: a file may be called anything."""
    return "".join(" " if mark in ',"\r\n' else mark for mark in text)
