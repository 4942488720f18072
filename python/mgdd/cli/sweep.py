"""`mgdd engine sweep`: cycles over a grid of inputs, or at the points of a file, into a table."""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

from mgdd.cli.from_library import Options, named_options
from mgdd.cli.map_files import table_writers
from mgdd.cli.options import SCHEME, add_engine, add_over, engine_of, option
from mgdd.cli.output import emit
from mgdd.cli.progress import Stopped
from mgdd.cli.ranges import grid_of
from mgdd.errors import Interrupted
from mgdd.io.point_table import read_points
from mgdd.results.labels import labelled_dataset
from mgdd.sweep import sweep
from mgdd.sweep.cases import input_labels

_POINT = Options(sweep, "soc_cad")


def _add_sweep(parser: Any) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    add_over(what, what="an input")
    option(what, "--points FILE",
           "the points of a .csv or .nc file instead of a grid, one per row, as mgdd map design writes it: its "
           "columns are inputs, and a column point numbers them")  # fmt: skip
    option(parser, "--outputs NAME[,NAME]", "indicators that are wanted (default: all of them and the NOx proxies)")
    _POINT.add(parser)
    option(parser, "--workers N", "threads (default: one per core)")
    add_engine(parser)
    SCHEME.add(parser, "scheme")


def _sweep(args: argparse.Namespace) -> None:
    over: Any = read_points(args.points, always=input_labels()) if args.points else grid_of(args.over)
    cylinder, point, preset = engine_of(args)
    labelled_dataset({"soc_cad": ("soc_cad", [0.0])})  # the first one imports as long as a million cycles take
    begun, stopped = time.perf_counter(), False
    try:
        with named_options(over="points" if args.points else "over"):
            outputs = args.outputs.split(",") if args.outputs else None
            given = _POINT.given(args) | SCHEME.given(args)
            table = sweep(cylinder, point, over, outputs=outputs, workers=args.workers, **given)
        cycles = math.prod(table.sizes.values())
    except Interrupted as stop:
        stopped, table = True, stop.partial
        cycles = int(table["finished"].sum())
    seconds = time.perf_counter() - begun
    payload = {
        "preset": preset.name,
        "shape": dict(table.sizes),
        "cycles": cycles,
        "cycles_per_s": cycles / seconds,
        "interrupted": stopped,
        "n_void": table.attrs["n_void"],
        "warnings": table.attrs["warnings"].splitlines(),
    }
    emit(args, payload, write=table_writers(table))
    if stopped:
        kept = f"{cycles} of {math.prod(table.sizes.values())} cycles are"
        raise Stopped(
            f"{kept} kept in {args.output}" if args.output else f"{kept} finished, none kept; name a file with -o"
        )


COMMANDS = {"sweep": (_add_sweep, _sweep)}
