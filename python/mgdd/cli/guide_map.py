"""Guides of `mgdd engine seek`, and the map that one reads and another learns."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mgdd import presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.cli.from_library import Options, default_of, named_options
from mgdd.cli.map_files import FORMS, MAP_ENDINGS, doubts_said
from mgdd.cli.options import option, refuse_idle
from mgdd.cli.output import check_file, wrote
from mgdd.cli.ranges import assignments
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.guide import FeedForward, TimingMap
from mgdd.loop import VirtualEngine
from mgdd.loop.engine_guide import KINDS, EngineGuide
from mgdd.maps import read_map, write_map

GUIDE = Options(EngineGuide, shape="guide_shape")
_POINT = frozenset(OperatingPoint.fields())


def add_guide(parser: argparse.ArgumentParser) -> None:
    """Add the options of the guide."""
    group = GUIDE.add(parser, "guide: a rough model proposes a starting point, measured cycles correct it")
    option(group, "--guide",
           "curve: the model's whole curve; calibrated: the same while the model learns from the pressure; "
           "feed_forward: the model's best timing; map: a calibration map of timings",
           default="none", choices=('none', *KINDS, 'map'))  # fmt: skip
    add_model(group)
    option(group, "--guide-map FILE", f"the map of --guide map: {FORMS}")
    option(group, "--guide-map-out FILE",
           f"write that map ({', '.join(MAP_ENDINGS)}) with the best timing of this run learnt, if the run has settled",
    )  # fmt: skip


def add_model(group: Any) -> None:
    """Add the options of the model that guides."""
    option(group, "--guide-preset NAME_OR_FILE.toml", "cylinder of the model (default: that of the bench)")
    option(group, "--guide-set FIELD=VALUE ...",
           "any field of the model's cylinder, repeatable, for example wall_heat_scale=1.0")  # fmt: skip


def check_guide(args: argparse.Namespace) -> None:
    """Refuse options of a guide that is not there, and a map that is not named, or written where nothing is learnt."""
    guide = args.guide
    why = {"none": "has no model", "map": "has a map, not a model"}.get(guide, "has a model, not a map")
    models, tables = ("guide_preset", "guide_set", "guide_shape"), ("guide_map", "guide_map_out")
    idle = {"none": (*models, *tables), "map": models}.get(guide, tables)
    refuse_idle(args, *idle, why=f"--guide {guide} {why}")
    if guide != "map":
        return
    if args.guide_map is None:
        raise ParameterError(f"--guide map needs --guide-map FILE, {FORMS}")
    check_file("--guide-map-out", args.guide_map_out, MAP_ENDINGS)
    if args.limit:
        why = "with --limit a run ends at the best timing within the limit, which is not what the map holds"
        refuse_idle(args, "guide_map_out", why=why)


def guide_of(args: argparse.Namespace, bench: VirtualEngine) -> TimingMap | EngineGuide | None:
    """Give the guide of a search on this bench, whose cylinder the model has unless another is named."""
    if args.guide == "none":
        return None
    if args.guide == "map":
        return _read_map(args.guide_map)
    own = bench.settings
    cylinder = cylinder_of(args, own["cylinder"])
    with named_options(kind="guide", shape="guide_shape"):
        return EngineGuide(
            cylinder=cylinder, kind=args.guide, performance=own["performance"], nox=own["true_nox"],
            **GUIDE.given(args),
        )  # fmt: skip


def cylinder_of(args: argparse.Namespace, base: Cylinder) -> Cylinder:
    """Give the cylinder of the model: that of the bench, or another preset, with fields set."""
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
    """Read a map whose axes are numbers of the operating point."""
    try:
        with doubts_said():
            table = read_map(file)
    except (DataError, ParameterError) as error:
        more = f"; mgdd map export {file} -o FILE.nc takes such options" if "--" in str(error) else ""
        raise error.reworded(f"--guide-map {error}{more}") from error
    try:
        timing = TimingMap(table)
    except DataError as error:
        raise error.reworded(f"--guide-map {file}: {error}") from error
    known = OperatingPoint.fields()
    for name in table.axes:
        if name not in known:
            near = did_you_mean(name, known) or f"known are {', '.join(known)}"
            raise ParameterError(f"--guide-map {file}: axis {name!r} is not a number of the operating point: {near}")
    return timing


def learn_map(
    args: argparse.Namespace, timing: TimingMap | None, seeker: Any, point: OperatingPoint, *, interrupted: bool
) -> tuple[dict[str, Any], list[str]]:
    """Let the map learn the best timing of a run and write it, if the last 100 cycles agree within 1 °CA.

    Returns
    -------
    tuple of dict and list
        ``guide_map_learnt``, ``guide_map_cad`` and ``guide_map_sd_cad``, what the map says of the point now [°CA
        aTDC], and ``guide_map_out``, None where no file was written; empty without ``--guide-map-out``. And why it was
        not written.
    """
    if args.guide_map_out is None or timing is None or not isinstance(seeker, FeedForward):
        return {}, []
    learnt = not interrupted and timing.learn_from(seeker, point)
    doubts = []
    if learnt:
        own = point.to_dict()
        where = " ".join(f"{name}={own[name]:g}" for name in timing.table.axes)
        origin = f"mgdd engine seek at {where} seed={args.seed or 0}"
        write_map(timing.table.replaced(provenance={"learned": origin}), args.guide_map_out)
        wrote(args.guide_map_out)
    else:
        spread_cad, cycles = (default_of(TimingMap.learn_from, name) for name in ("spread_cad", "cycles"))
        why = f"the estimate has not settled within {spread_cad:g} °CA over the last {cycles} cycles: raise --cycles"
        if interrupted:
            why = "the run was interrupted: let it run to its end"
        doubts.append(f"--guide-map-out {args.guide_map_out}: not written, {why}")
    figures = {
        "guide_map_learnt": learnt,
        "guide_map_cad": float(timing.table(point)),
        "guide_map_sd_cad": float(timing.table.sd_at(point)),
        "guide_map_out": args.guide_map_out if learnt else None,
    }
    return figures, doubts
