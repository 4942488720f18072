"""`mgdd map show | diff`: a map as a table or a picture, what it achieves in a sweep, and two maps side by side."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.map_files import (
    FORMS,
    READING,
    emit_map,
    grid_blocks,
    grid_table,
    map_blocks,
    map_in,
    table_writers,
)
from mgdd.cli.options import option
from mgdd.cli.output import emit
from mgdd.errors import ParameterError
from mgdd.maps import CalibrationMap, apply_map, compare_maps
from mgdd.maps.cells import TEXTS, cell_at
from mgdd.maps.compare import achieved_figures
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


COMMANDS = {"show": (_add_show, _show), "diff": (_add_diff, _diff)}
