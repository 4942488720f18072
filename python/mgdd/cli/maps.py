"""`mgdd map optimize | smooth | show | diff | export`: best values, smoothed, shown, compared, and in other forms."""

from __future__ import annotations

import argparse
from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import datasets
from mgdd.cli.from_library import Options, named_options
from mgdd.cli.map_files import (
    FORMS,
    MAP_ENDINGS,
    READING,
    doubts_said,
    emit_map,
    grid_blocks,
    grid_table,
    map_blocks,
    map_in,
    shown_map,
    table_writers,
)
from mgdd.cli.options import option, refuse_idle
from mgdd.cli.output import check_file, emit, wrote
from mgdd.cli.ranges import assignments, number_pairs
from mgdd.errors import ParameterError
from mgdd.maps import CalibrationMap, apply_map, compare_maps, optimize_map, smooth_map, write_map
from mgdd.maps.cells import TEXTS, cell_at
from mgdd.maps.compare import achieved_figures, steepest
from mgdd.plot import map_cells, map_contour
from mgdd.plot.style import drawn
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_COMPARED = Options(compare_maps, "grid", "tolerance")


def _add_show(parser: Any) -> None:
    option(parser, "file MAP", FORMS)
    READING.add(parser)
    option(parser, "--column NAME",
           "what is shown of the cells: value, sd, low, high, source or another column of theirs",
           default="value")  # fmt: skip
    option(parser, "--sweep TABLE.nc", "also say what the map achieves in the table that it was made of")
    option(parser, "--figure FILE", "draw the cells of the map (.png, .svg or .pdf)")
    option(parser, "--contour", "draw contours instead of the cells")


def _show(args: argparse.Namespace) -> None:
    if args.contour and args.figure is None:
        raise ParameterError("--contour does not act here; it is a form of the picture: name one with --figure FILE")
    if args.contour and args.column in TEXTS:
        raise ParameterError(f"--contour and --column {args.column} contradict each other: it holds texts")
    table = map_in(args, args.file)
    if args.column not in ("value", *table.cells):
        raise ParameterError(f"--column {args.column}: the map has value, {', '.join(table.cells)}")
    text, more = map_blocks(table, args.column), {}
    if args.sweep is not None:
        more["achieved"], said = _achieved(table, grid_table(args.sweep))
        text += ["", f"in {args.sweep}:", *said]
    shown = table.name if args.column == "value" else args.column

    def draw(data: xr.Dataset, ax: Axes) -> Axes:
        return map_contour(data, shown, ax=ax) if args.contour else map_cells(data, shown, ax=ax)

    emit_map(args, table, text, draw=draw, **more)


def _achieved(table: CalibrationMap, sweep: xr.Dataset) -> tuple[dict[str, Any], list[str]]:
    """Say what objective, limited variables and loss become at the values of a map."""
    found = apply_map(table, sweep)
    figures, said = achieved_figures(table, found), []
    for name, own in figures.items():
        limit = "" if table.task is None or name not in table.task.limits else f", limit {table.task.limits[name]:g}"
        unit = label_of(found[name]).units
        worst = int(np.nanargmax(found[name].transpose(*table.axes).to_numpy()))
        said.append(
            f"  {name}{'' if unit == '-' else f' [{unit}]'}: mean {own['mean']:.4g}, {own['lowest']:.4g} to "
            f"{own['highest']:.4g}{limit}, highest at {cell_at(table.axes, worst)}"
        )
    return figures, said


def _add_diff(parser: Any) -> None:
    option(parser, "first FIRST", FORMS)
    option(parser, "second SECOND", "the map that the first is subtracted from")
    READING.add(parser)
    _COMPARED.add(parser)
    option(parser, "--figure FILE", "draw the differences (.png, .svg or .pdf)")


def _diff(args: argparse.Namespace) -> None:
    first, second = (map_in(args, file) for file in (args.first, args.second))
    found = compare_maps(first, second, **_COMPARED.given(args))
    axes = {name: found[name].to_numpy() for name in first.axes}
    payload = {
        "name": first.name,
        "first": args.first,
        "second": args.second,
        "unit": label_of(found["difference"]).units,
        **{name: found[name].item() for name in ("largest_difference", "rms_difference", "n_beyond")},
        "tolerance": args.tolerance,
        "axes": [{"name": name, "entries": entries} for name, entries in axes.items()],
        **{name: found[name].to_numpy() for name in ("difference", "sd", "held_outside", "beyond")},
    }
    picture = partial(drawn, map_cells, found, size=(6.6, 4.6), variable="difference")
    text = _differences(args, found, first, second)
    emit(args, payload, text=text, write=table_writers(found), figure=picture)


def _differences(
    args: argparse.Namespace, found: xr.Dataset, first: CalibrationMap, second: CalibrationMap
) -> list[Any]:
    label = label_of(found["difference"])
    values = found["difference"].to_numpy()
    flags = {
        "a map is held at its edge": found["held_outside"].to_numpy(),
        "only one map has a value": np.isfinite(found["first"].to_numpy()) != np.isfinite(found["second"].to_numpy()),
    }
    if args.tolerance is not None:
        flags[f"beyond {args.tolerance:g} {label.units}"] = found["beyond"].to_numpy()
    axes = {name: found[name].to_numpy() for name in first.axes}
    out: list[Any] = [f"first:  {args.first}: {repr(first)[1:-1]}", f"second: {args.second}: {repr(second)[1:-1]}"]
    known = values[np.isfinite(values)]
    if not known.size:
        said = "no cell has a value in both maps"
    elif not known.any():
        said = f"no difference in {known.size} cells"
    else:
        largest, rms = float(found["largest_difference"]), float(found["rms_difference"])
        at = cell_at(axes, int(np.nanargmax(np.abs(values))))
        said = f"largest {largest:+.4g} {label.units} at {at}; root mean square {rms:.4g} {label.units}"
    return [*out, "", *grid_blocks(axes, first.labels, values, f"{label.long_name} [{label.units}]", flags), said]


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


_ENGINES = ("volkswagen", "mercedes")  # in the order of the set
_WRITING = Options(write_map, "encoding")


def _add_export(parser: Any) -> None:
    option(parser, "files MAP", f"{FORMS}; several only into a .dcm or .cdfx", nargs="*")
    READING.add(parser)
    option(parser, "--label NAME ...",
           "label in a DCM or CDFX file, one per map in their order (default: the names of the maps)")  # fmt: skip
    _WRITING.add(parser)
    option(parser, "--advisor",
           "instead of a file: the measured map of this engine of the data set advisor_engine_maps, whose variable "
           "--name says (default: bsfc_g_per_kwh, brake specific fuel consumption [g/kWh])",
           choices=_ENGINES)  # fmt: skip


def _export(args: argparse.Namespace) -> None:
    if args.output is None:
        raise ParameterError("-o is needed: name the file to write, for example -o engine.dcm")
    check_file("-o", args.output, MAP_ENDINGS)
    maps = _maps(args)
    has_labels = Path(args.output).suffix in (".dcm", ".cdfx")
    if not has_labels:
        refuse_idle(args, "label", "encoding", why="only a .dcm or .cdfx file has labels and encodings")
    if len(maps) > 1 and not has_labels:
        raise ParameterError(
            f"-o {args.output}: {len(maps)} maps fit into a .dcm or .cdfx only: give one map, or that ending"
        )
    if args.label and len(args.label) != len(maps):
        raise ParameterError(f"--label: {len(args.label)} for {len(maps)} maps: give one per map, in their order")
    names = args.label or [table.name for table in maps]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ParameterError(f"two maps would be called {twice!r} in {args.output}: give each a --label")
    if has_labels:
        write_map(dict(zip(names, maps, strict=True)), args.output, **_WRITING.given(args))
    else:
        write_map(maps[0], args.output)
    wrote(args.output)
    file, args.output = args.output, None
    lost = sorted({*_lost(maps)}) if Path(file).suffix != ".nc" else []
    payload = {
        "file": file,
        "maps": [
            {"name": name, "unit": table.unit, "axes": {axis: entries.size for axis, entries in table.axes.items()}}
            for name, table in zip(names, maps, strict=True)
        ],
        "left_out": lost,
    }
    text = [f"{name}: {repr(table)[1:-1]}" for name, table in zip(names, maps, strict=True)]
    if lost:
        text.append(f"this form has no place for {', '.join(lost)}: keep the map as .nc too")
    emit(args, payload, text="\n".join(text))


def _maps(args: argparse.Namespace) -> list[CalibrationMap]:
    if args.advisor is None:
        if not args.files:
            raise ParameterError("no map: name a file, or a measured engine with --advisor")
        return [map_in(args, file) for file in args.files]
    if args.files:
        raise ParameterError(f"--advisor and {args.files[0]} contradict each other: give one")
    data = datasets.read("advisor_engine_maps")[_ENGINES.index(args.advisor)]
    table = CalibrationMap.from_dataset(data, args.name or "bsfc_g_per_kwh", source="measured")
    said = {"from": "title", "origin": "source", "citation": "citation", "licence": "licence", "note": "note"}
    return [table.replaced(provenance={key: " ".join(str(data.attrs[name]).split()) for key, name in said.items()})]


def _lost(maps: list[CalibrationMap]) -> list[str]:
    """Name the columns of cells that say something and that axes, values and comments cannot hold."""
    plain = CalibrationMap({"x": [0.0, 1.0]}, 0.0, name="y").cells
    return [
        name
        for table in maps
        for name, column in table.cells.items()
        if name not in plain or any(str(entry) != str(plain[name][0]) for entry in column.ravel().tolist())
    ]


COMMANDS = {
    "optimize": (_add_optimize, _optimize),
    "smooth": (_add_smooth, _smooth),
    "show": (_add_show, _show),
    "diff": (_add_diff, _diff),
    "export": (_add_export, _export),
}
