"""Guides of `mgdd engine seek`, and the map that one reads and another learns."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd import presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.cli.from_library import Options, default_of, named_options
from mgdd.cli.options import option, refuse_idle
from mgdd.cli.output import check_file, wrote
from mgdd.cli.ranges import assignments
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.guide import FeedForward, TimingMap
from mgdd.guide.map_table import read_map_table
from mgdd.io.files import existing_file
from mgdd.io.parameters import ParameterFile
from mgdd.loop import VirtualEngine
from mgdd.loop.engine_guide import KINDS, EngineGuide

GUIDE = Options(EngineGuide, shape="guide_shape")
_ENDINGS = (".csv", ".toml")
_POINT = frozenset(OperatingPoint.fields())


def add_guide(parser: argparse.ArgumentParser) -> None:
    """Add the options of the guide."""
    group = GUIDE.add(parser, "guide: a rough model proposes a starting point, measured cycles correct it")
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
