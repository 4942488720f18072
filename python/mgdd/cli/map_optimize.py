"""`mgdd map optimize | smooth`: the best value per operating point under limits, and a smooth map near it."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from mgdd.cli.from_library import Options, named_options
from mgdd.cli.map_files import FORMS, MAP_ENDINGS, READING, doubts_said, emit_map, grid_table, map_in
from mgdd.cli.map_text import map_blocks
from mgdd.cli.options import add_command, assignments, number_pairs
from mgdd.cli.output import check_figure, check_output
from mgdd.maps import CalibrationMap, optimize_map, smooth_map
from mgdd.maps.compare import steepest

__all__ = ["add_optimize", "add_smooth"]

_OPTIMUM = Options(optimize_map, "max_loss", "infeasible", over="along")
_SMOOTH = Options(smooth_map, "weight", "fill", "tolerance")
_ENDINGS = ".csv, .json or .nc, which hold everything; .dcm or .cdfx for calibration tools"


def add_optimize(verbs: Any) -> None:
    """Add the command of the optimum."""
    parser = add_command(
        verbs, "optimize", _optimize,
        help_text="find the best value of an input at every operating point of a table, under limits",
        example="mgdd map optimize table.nc --maximize efficiency_gross --along soc_cad --limit p_max_bar=130 "
        "--max-loss 0.002 -o best.json",
        endings=_ENDINGS,
    )  # fmt: skip
    parser.add_argument(
        "file", metavar="TABLE.nc",
        help="over a grid of one or two operating axes and the input: of mgdd engine sweep or mgdd map predict",
    )  # fmt: skip
    goal = parser.add_mutually_exclusive_group(required=True)
    goal.add_argument("--maximize", metavar="NAME", help="variable whose highest value is best, as efficiency_gross")
    goal.add_argument("--minimize", metavar="NAME", help="variable whose lowest value is best, as a consumption")
    parser.add_argument(
        "--limit", action="append", default=[], metavar="NAME=X",
        help="keep a variable of the table at or below X, in the unit that its name ends in; repeatable",
    )  # fmt: skip
    _OPTIMUM.add(parser)
    parser.add_argument(
        "--sd", action="append", default=[], metavar="NAME=X",
        help="standard deviation of objective or limited variable at one point: a number, or a variable of the table; "
        "it makes that of the optimum; repeatable",
    )  # fmt: skip
    _add_figure(parser)


def _optimize(args: argparse.Namespace) -> None:
    check_output(args, *MAP_ENDINGS)
    check_figure(args.figure)
    limits = number_pairs(args.limit, "--limit")
    scatter = assignments(args.sd, {}, "--sd")
    with named_options(over="along"):
        best = optimize_map(
            grid_table(args.file),
            args.maximize or args.minimize,
            limits=limits,
            maximize=args.maximize is not None,
            sd=scatter,
            provenance={"from": " ".join(Path(args.file).name.split())},
            **_OPTIMUM.given(args),
        )
    emit_map(args, best, _shown(args, best), n_held=_held(best))


def add_smooth(verbs: Any) -> None:
    """Add the command of the smooth map."""
    parser = add_command(
        verbs, "smooth", _smooth,
        help_text="smooth a map inside of the allowed ranges of its cells, under limits on its slopes",
        example="mgdd map smooth best.json --slope-limit speed_rpm=0.004 --slope-limit fuel_mg=0.6 -o smooth.json",
        endings=_ENDINGS,
    )  # fmt: skip
    parser.add_argument(
        "file", metavar="MAP", help=f"of mgdd map optimize --max-loss; with --tolerance or --fill {FORMS}"
    )
    READING.add(parser)
    _SMOOTH.add(parser)
    parser.add_argument(
        "--slope-limit", action="append", default=[], metavar="AXIS=X",
        help="largest change of the value per unit of an axis, for example speed_rpm=0.004; repeatable",
    )  # fmt: skip
    _add_figure(parser)


def _smooth(args: argparse.Namespace) -> None:
    check_output(args, *MAP_ENDINGS)
    check_figure(args.figure)
    optimum = map_in(args, args.file)
    slopes = number_pairs(args.slope_limit, "--slope-limit")
    with doubts_said() as doubts:
        smooth = smooth_map(optimum, slope_limits=slopes, **_SMOOTH.given(args))
    moved = np.abs(smooth.values - optimum.values)
    shift = float(np.nanmax(moved))  # smooth_map refuses a map without a value
    slopes_now = {name: steepest(smooth, name) for name in smooth.axes}
    unit = smooth.unit.removesuffix(" aTDC")
    within = "" if args.tolerance is None else f", tolerance {args.tolerance:g}"
    said = [f"moved by at most {shift:.3g} {unit} in a cell{within}"]
    for name, slope in slopes_now.items():
        if slope is None:
            continue
        limit = f", limit {slopes[name]:g}" if name in slopes else ""
        before = steepest(optimum, name)
        was = "" if before is None else f"; before {before:.3g}"
        said.append(f"steepest over {name}: {slope:.3g} {unit}/{smooth.labels[name].units}{limit}{was}")
    text = [*_shown(args, smooth), "", *said]
    more = {"tolerance": args.tolerance, "warnings": doubts}
    emit_map(args, smooth, text, largest_shift=shift, largest_slope=slopes_now, n_held=_held(smooth), **more)


def _add_figure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--figure", metavar="FILE", help="draw the cells of the map (.png, .svg or .pdf)")


def _shown(args: argparse.Namespace, table: CalibrationMap) -> list[Any]:
    return [*map_blocks(table), *([] if args.output else ["", f"-o {table.name}.json keeps the map"])]


def _held(table: CalibrationMap) -> dict[str, int]:
    return dict(sorted(Counter(name for name in table.cells["active_limit"].ravel().tolist() if name).items()))
