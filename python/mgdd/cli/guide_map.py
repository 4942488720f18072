"""The table of `--guide map`: read, and written back once the run has confirmed an optimum."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.options import refuse_idle
from mgdd.cli.output import check_file, wrote
from mgdd.engine import OperatingPoint
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.guide import FeedForward, TimingMap
from mgdd.guide.map_table import read_map_table
from mgdd.io.files import existing_file
from mgdd.io.parameters import ParameterFile

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["MAP_ENDINGS", "add_map_options", "check_map_options", "learn_map", "read_map"]

MAP_ENDINGS = (".csv", ".toml")
_CYCLES, _SPREAD_CAD = 100, 1.0  # what `TimingMap.learn_from` takes for settled


def add_map_options(group: Any) -> None:
    """Add the options of the table."""
    group.add_argument("--guide-map", metavar="FILE", help="the table of --guide map, .csv or .toml")
    group.add_argument(
        "--guide-map-out", metavar="FILE",
        help="write that table, .csv or .toml, with the best timing of this run learnt, if the run has settled",
    )  # fmt: skip


def check_map_options(args: argparse.Namespace) -> None:
    """Refuse a table that is not said, or is written where nothing is learnt."""
    if args.guide != "map":
        why = "--guide none has no model" if args.guide == "none" else f"--guide {args.guide} has a model, not a table"
        refuse_idle(args, "guide_map", "guide_map_out", why=why)
        return
    if args.guide_map is None:
        raise ParameterError(
            "--guide map needs --guide-map FILE, a table as TimingMap.write_csv or TimingMap.to_toml writes it"
        )
    check_file("--guide-map", args.guide_map, MAP_ENDINGS)
    check_file("--guide-map-out", args.guide_map_out, MAP_ENDINGS)
    if args.limit:
        why = "with --limit a run ends at the best timing within the limit, which is not what the table holds"
        refuse_idle(args, "guide_map_out", why=why)


def read_map(file: str) -> TimingMap:
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
    learnt = not interrupted and table.learn_from(seeker, point, cycles=_CYCLES, spread_cad=_SPREAD_CAD)
    doubts = []
    if learnt:
        _write(table, args, point, before)
    else:
        why = f"the estimate has not settled within {_SPREAD_CAD:g} °CA over the last {_CYCLES} cycles: raise --cycles"
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
    said = f"mgdd engine seek at {where} seed={args.seed}"
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
