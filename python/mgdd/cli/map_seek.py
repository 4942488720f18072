"""`mgdd map seek`: one search for a map of the virtual engine."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core.loop import bench_inputs, bench_limits
from mgdd.cli.from_library import Options
from mgdd.cli.guide_map import add_model, cylinder_of
from mgdd.cli.map_files import MAP_ENDINGS, shown_map
from mgdd.cli.options import add_engine, add_over, option, point_given, refuse_idle
from mgdd.cli.output import check_file, emit, lines, save_figure, warn
from mgdd.cli.progress import Stopped
from mgdd.cli.ranges import grid_of, limits_given, number_pairs
from mgdd.cli.seek import BENCH_NAMES, add_bench, bench_of, option_names
from mgdd.errors import Interrupted, ParameterError
from mgdd.io.point_table import read_points
from mgdd.loop import VirtualEngine, seek
from mgdd.loop.map_result import MapSearch
from mgdd.loop.seek_map import Progress, seek_map
from mgdd.loop.seek_result import SeekResult
from mgdd.maps import write_map
from mgdd.plot import map_cells
from mgdd.plot.style import new_figure
from mgdd.results.labels import to_jsonable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from mgdd.maps import CalibrationMap

_SEARCH, _SETTLING = Options(seek_map, "visits", "tolerance", "smoothness"), Options(seek_map, "settling")
_NAMES = {**BENCH_NAMES, **{name: name for name in ("visits", "smoothness", "settling", "averaged", "record")},
          "axes": "over", "guide": "guide_set"}  # fmt: skip


def _add_seek(parser: Any) -> None:
    add_over(parser, what="a number of the operating point, an axis of the map,")
    option(parser, "--input NAME=LOW:HIGH[:STEP] ...",
           f"bounds of an input of the bench ({', '.join(bench_inputs)}), and the step in which it is set; "
           "repeatable: a map of each is sought (default: soc_cad=-30:10)")  # fmt: skip
    option(parser, "--start NAME=X ...",
           "without --guide: first value of an input, where the limits hold in the middle of the map, repeatable; left "
           "out: the middle of the bounds, under limits the safe side of the timing")  # fmt: skip
    option(parser, "--limit NAME=X ...",
           f"keep an indicator, {', '.join(bench_limits)}, below X, or with NAME=LOW:HIGH between two, of which one "
           "may be left out; repeatable")  # fmt: skip
    _SEARCH.add(parser)
    option(parser, "--averaged N[:MOST]",
           "cycles of a visit that are averaged; with MOST a visit ends between the two, where its mean is surer than "
           "half of what was not known there (default: 50)")  # fmt: skip
    _SETTLING.add(parser, settling="20")
    option(parser, "--record FILE.csv",
           "write a row per visit; where the file holds some of this search, it goes on behind them")  # fmt: skip
    option(parser, "--drive FILE.csv",
           "then drive the engine through the points of the file, a row each: the axes, and cycles; the map goes on "
           "learning in every one of them")  # fmt: skip
    option(parser, "--search FILE.json", "write the search too: mgdd engine seek --map drives an engine by it")
    option(parser, "--figure FILE", "draw the cells of the map (.png, .svg or .pdf)")
    parser.add_argument("--live", action="store_true", help="draw --figure anew after every visit, to be watched")
    add_bench(parser, "none", "soft")
    group = parser.add_argument_group("guide: a rough model of the same bench, which the visits correct")
    option(group, "--guide", "model: J and limits of a model", default="none", choices=("none", "model"))
    add_model(group)
    add_engine(parser)


def _seek(args: argparse.Namespace) -> None:
    check_file("--record", args.record, (".csv",))
    check_file("--search", args.search, (".json",))
    limits, axes, start = limits_given(args.limit), grid_of(args.over), number_pairs(args.start, "--start")
    if args.guide == "none":
        refuse_idle(args, "guide_preset", "guide_set", why="--guide none has no model: give --guide model")
    else:
        refuse_idle(args, "start", why="with --guide model the search starts at the best of the model")
    if args.live and args.figure is None:
        raise ParameterError("--live draws --figure anew after every visit: give --figure too")
    if not 1 <= len(axes) <= 2:
        raise ParameterError(f"--over is given {len(axes)} times: a map has one axis or two, as speed_rpm=1000:3000:5")
    if both := sorted(axes.keys() & point_given(args).keys()):
        raise ParameterError(f"{both[0]} is an axis, --over, and a number of the point: give one")
    with option_names(_NAMES):
        bench, bounds, preset = bench_of(args, limits)
        if len(bounds) > 1 and Path(args.output or "").suffix in (".nc", ".csv"):
            raise ParameterError(f"-o {args.output}: {len(bounds)} maps fit into a .dcm or .cdfx only")
        guide = cylinder_of(args, bench.settings["cylinder"]) if args.guide == "model" else None
        drive = None if args.drive is None else _drive_of(args.drive, list(axes), bench)
        interrupted, driven = False, None
        try:
            found = seek_map(
                bench, bounds, axes, limits=limits, guide=guide, start=start or None, averaged=_averaged(args.averaged),
                record=args.record, on_visit=partial(_say, args), seed=bench.seed,
                **_SEARCH.given(args), **_SETTLING.given(args),
            )  # fmt: skip
            if drive is not None:
                found, driven = _driven(found, *drive)
                interrupted = driven.run.interrupted
        except Interrupted as stop:
            if not isinstance(stop.partial, MapSearch):
                raise
            found, interrupted = stop.partial, True
            if not found.visits:
                raise Stopped("interrupted before the first visit was finished: nothing to keep") from stop
    if args.search is not None:
        found.seeker.save(args.search)
    warn(*found.findings)
    maps = list(found.maps.values())
    payload = found.to_dict() | {"interrupted": interrupted, "preset": preset, "sensor": args.sensor}
    payload |= {"seed": bench.seed, "guide": args.guide}
    if driven is not None:
        payload |= {"driven_cycles": driven.run.dataset.sizes["cycle"], "driven_j": driven.run.summary["mean_j"]}
    text = [*shown_map(args, *maps), "", lines(to_jsonable(payload))]
    write = dict.fromkeys(MAP_ENDINGS, partial(write_map, maps if len(maps) > 1 else maps[0]))
    emit(args, payload, text=text, write=write, figure=partial(_drawn, maps))
    if interrupted:
        raise Stopped(f"{len(found.visits)} visits are kept")


def _drive_of(file: str, axes: list[str], bench: VirtualEngine) -> tuple[VirtualEngine, int]:
    """Make the engine of the bench that runs through the points of a file, and say for how many cycles."""
    table = read_points(file, [*axes, "cycles"])
    counts = table["cycles"].to_numpy()
    if not ((counts >= 1.0) & (counts == np.round(counts))).all():
        raise ParameterError(f"--drive {file}: column cycles: must be whole numbers >= 1")
    schedule, cycle = [], 0
    for k, count in enumerate(counts.astype(int).tolist()):
        try:
            schedule.append((cycle, bench.point_at(0).replace(**{name: float(table[name][k]) for name in axes})))
        except ParameterError as error:
            raise ParameterError(f"--drive {file}, point {k + 1}: {error}") from error
        cycle += count
    own = bench.settings | {"schedule": schedule}
    try:
        return VirtualEngine(own.pop("cylinder"), **own), cycle
    except ParameterError as error:
        raise ParameterError(f"--drive {file}: {error}") from error


def _driven(found: MapSearch, engine: VirtualEngine, cycles: int) -> tuple[MapSearch, SeekResult]:
    """Drive an engine by the map, which learns in every cycle; Ctrl-C ends the drive, and the map stays."""
    driver = found.seeker.driver()
    try:
        run = seek(engine, seeker=driver, cycles=cycles)
    except Interrupted as stop:
        if not isinstance(stop.partial, SeekResult):
            raise
        run = stop.partial
    return found.driven(driver), run


def _say(args: argparse.Namespace, so_far: Progress) -> None:
    settled = "" if args.tolerance is None else f", {so_far.settled} cells settled"
    args.progress.expect(_SEARCH.of(args)["visits"])(
        f"visit {so_far.visit}: expected regret {so_far.regret:.3g}{settled}"
    )
    if args.live:
        save_figure(_drawn(list(so_far.search.maps.values())), args.figure, quiet=True)


def _averaged(given: str | None) -> int | tuple[int, int] | None:
    if given is None:
        return None
    try:
        least, *most = map(int, given.split(":"))
        return (least, *most) if most else least  # type: ignore[return-value]
    except ValueError:
        raise ParameterError(f"--averaged {given}: write N or N:MOST, whole numbers of cycles") from None


def _drawn(maps: Sequence[CalibrationMap]) -> Figure:
    figure = new_figure(6.6 * len(maps), 4.6)
    for place, table in enumerate(maps, 1):
        map_cells(table, ax=figure.add_subplot(1, len(maps), place))
    return figure


COMMANDS = {"seek": (_add_seek, _seek)}
