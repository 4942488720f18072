"""`mgdd engine sweep`: cycles over a grid of inputs, or at the points of a file, into a table."""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

from mgdd.cli.from_library import Options, named_options
from mgdd.cli.map_files import write_table
from mgdd.cli.options import SCHEME, add_command, add_engine, engine_of
from mgdd.cli.output import Stopped, check_output, emit
from mgdd.cli.ranges import add_over, grid_of
from mgdd.errors import Interrupted
from mgdd.io.point_table import read_points
from mgdd.results.labels import labelled_dataset
from mgdd.sweep import sweep
from mgdd.sweep.cases import input_labels

__all__ = ["add_sweep"]

_POINT = Options(sweep, "soc_cad")


def add_sweep(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "sweep", _sweep,
        help_text="simulate a cycle for every point of a grid, or of a file; -o FILE.nc keeps the table",
        example="mgdd engine sweep --over soc_cad=-20:5:51 --over speed_rpm=1000:3000:9 -o table.nc --json",
        endings=".nc, netCDF; with --points also .csv",
    )  # fmt: skip
    what = parser.add_mutually_exclusive_group(required=True)
    add_over(what, what="an input")
    what.add_argument(
        "--points", metavar="FILE",
        help="the points of a .csv or .nc file instead of a grid, one per row, as mgdd map design writes it: its "
        "columns are inputs, and a column point numbers them",
    )  # fmt: skip
    parser.add_argument(
        "--outputs", metavar="NAME[,NAME]", help="indicators that are wanted (default: all of them and the NOx proxies)"
    )
    _POINT.add(parser)
    parser.add_argument("--workers", type=int, metavar="N", help="threads (default: one per core)")
    add_engine(parser)
    SCHEME.add(parser, "scheme")


def _sweep(args: argparse.Namespace) -> None:
    check_output(args, ".nc", *((".csv",) if args.points else ()))
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
    file, args.output = args.output, None  # the object below goes to stdout, the table into the file
    if file is not None:
        write_table(table, file)
    payload = {
        "preset": preset.name,
        "shape": dict(table.sizes),
        "cycles": cycles,
        "cycles_per_s": cycles / seconds,
        "interrupted": stopped,
        "n_void": table.attrs["n_void"],
        "warnings": table.attrs["warnings"].splitlines(),
        "file": file,
    }
    emit(args, payload)
    if stopped:
        kept = f"{cycles} of {math.prod(table.sizes.values())} cycles are"
        raise Stopped(f"{kept} kept in {file}" if file else f"{kept} finished, none kept; name a file with -o")
