"""`mgdd map optimize | smooth`: the best value per operating point under limits, and a smooth map near it."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from mgdd.cli.from_library import Options, named_options
from mgdd.cli.map_files import FORMS, READING, doubts_said, emit_map, grid_table, map_in, shown_map
from mgdd.cli.options import option
from mgdd.cli.ranges import assignments, number_pairs
from mgdd.maps import CalibrationMap, optimize_map, smooth_map
from mgdd.maps.compare import steepest

_OPTIMUM = Options(optimize_map, "max_loss", "infeasible", over="along")
_SMOOTH = Options(smooth_map, "weight", "fill", "tolerance")


def _add_optimize(parser: Any) -> None:
    option(parser, "file TABLE.nc",
           "over a grid of one or two operating axes and the input: of mgdd engine sweep or mgdd map predict",
    )  # fmt: skip
    goal = parser.add_mutually_exclusive_group(required=True)
    option(goal, "--maximize NAME", "variable whose highest value is best, as efficiency_gross")
    option(goal, "--minimize NAME", "variable whose lowest value is best, as a consumption")
    option(parser, "--limit NAME=X ...",
           "keep a variable of the table at or below X, in the unit that its name ends in; repeatable")  # fmt: skip
    _OPTIMUM.add(parser)
    option(parser, "--sd NAME=X ...",
           "standard deviation of objective or limited variable at one point: a number, or a variable of the table; "
           "it makes that of the optimum; repeatable")  # fmt: skip
    _add_figure(parser)


def _optimize(args: argparse.Namespace) -> None:
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
    emit_map(args, best, shown_map(args, best), n_held=_held(best))


def _add_smooth(parser: Any) -> None:
    option(parser, "file MAP", f"of mgdd map optimize --max-loss; with --tolerance or --fill {FORMS}")
    READING.add(parser)
    _SMOOTH.add(parser)
    option(parser, "--slope-limit AXIS=X ...",
           "largest change of the value per unit of an axis, for example speed_rpm=0.004; repeatable")  # fmt: skip
    _add_figure(parser)


def _smooth(args: argparse.Namespace) -> None:
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
    text = [*shown_map(args, smooth), "", *said]
    more = {"tolerance": args.tolerance, "warnings": doubts}
    emit_map(args, smooth, text, largest_shift=shift, largest_slope=slopes_now, n_held=_held(smooth), **more)


def _add_figure(parser: argparse.ArgumentParser) -> None:
    option(parser, "--figure FILE", "draw the cells of the map (.png, .svg or .pdf)")


def _held(table: CalibrationMap) -> dict[str, int]:
    return dict(sorted(Counter(name for name in table.cells["active_limit"].ravel().tolist() if name).items()))


COMMANDS = {"optimize": (_add_optimize, _optimize), "smooth": (_add_smooth, _smooth)}
