"""`mgdd map trade-off`: what one variable costs in another along an input, and where a map stands on it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.map_files import READING, grid_table, map_in
from mgdd.cli.options import option, refuse_idle
from mgdd.cli.output import emit
from mgdd.cli.ranges import number_pairs
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.maps import apply_map
from mgdd.plot import trade_off
from mgdd.plot.style import drawn
from mgdd.report import Table
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr

_ALONG, _EVERY = Options(trade_off, over="along"), Options(trade_off, "every")


def _add_trade_off(parser: Any) -> None:
    option(parser, "file TABLE.nc",
           "over a grid of the input and perhaps operating axes: of mgdd engine sweep or mgdd map predict")  # fmt: skip
    option(parser, "--right NAME", "variable to the right, as nox_affine_log_ppm", required=True)
    option(parser, "--up NAME", "variable upwards, as efficiency_gross", required=True)
    _ALONG.add(parser)
    option(parser, "--at AXIS=X ...",
           "keep an operating axis at one of its breakpoints; one axis may be left, with a line for each of its "
           "breakpoints; repeatable")  # fmt: skip
    option(parser, "--map MAP", "also say where the values of this map stand on the lines")
    READING.add(parser)
    _EVERY.add(parser)
    option(parser, "--figure FILE", "draw it (.png, .svg or .pdf)")


def _trade_off(args: argparse.Namespace) -> None:
    args.along = _ALONG.of(args)["over"]
    if args.map is None:
        refuse_idle(args, "name", "rows", "columns", why="without --map no map is read")
    if args.figure is None:
        refuse_idle(args, "every", why="it labels the picture: name one with --figure FILE")
    table = grid_table(args.file)
    dims = _axes(args, table)
    fixed = _breakpoints(number_pairs(args.at, "--at"), table, dims, args.along)
    free = [name for name in dims if name not in fixed and name != args.along]
    if len(free) > 1:
        raise ParameterError(f"{args.file}: one line each for {' x '.join(free)} is too much: fix one with --at AXIS=X")
    shown, marked = table[[args.right, args.up]].sel(fixed), None
    if args.map is not None:
        marked = apply_map(map_in(args, args.map), table)
        if args.along not in marked.data_vars:
            raise DataError(f"{args.map}: not a map of {args.along}: choose another --along or another map")
        marked = marked[[args.along, args.right, args.up]].sel(fixed)
    lines = _lines(args, shown, marked, free)
    payload = {"right": args.right, "up": args.up, "along": args.along, "at": fixed, "lines": lines}
    how = {"x": args.right, "y": args.up, "over": args.along, **_EVERY.given(args)}
    picture = partial(drawn, trade_off, shown, size=(6.6, 4.6), marked=marked, **how)
    emit(args, payload, text=_text(args, shown, lines, free), figure=picture)


def _axes(args: argparse.Namespace, table: xr.Dataset) -> tuple[str, ...]:
    """Give the axes that both variables stand over, the input among them."""
    if args.right == args.up:
        raise ParameterError(f"--right and --up are both {args.up}: name two variables")
    for name in (args.right, args.up):
        if name not in table.data_vars:
            have = [str(each) for each in table.data_vars]
            hint = did_you_mean(name, have) or f"it has {', '.join(have)}"
            raise DataError(f"{args.file}: no variable {name!r}: {hint}")
    dims = tuple(map(str, table[args.up].dims))
    if args.along not in dims or set(dims) != set(map(str, table[args.right].dims)):
        raise DataError(
            f"{args.file}: {args.right} and {args.up} must stand over the same axes, one of them --along {args.along}; "
            f"they stand over {' x '.join(map(str, table[args.right].dims))} and {' x '.join(dims)}"
        )
    return dims


def _breakpoints(wanted: Mapping[str, float], table: xr.Dataset, dims: tuple[str, ...], along: str) -> dict[str, float]:
    fixed = {}
    for name, value in wanted.items():
        axes = [dim for dim in dims if dim != along]
        if name not in axes:
            raise ParameterError(f"--at {name}: not an operating axis of the table: it has {', '.join(axes) or 'none'}")
        entries = table[name].to_numpy()
        near = float(entries[np.argmin(np.abs(entries - value))])
        if not np.isclose(near, value, rtol=1e-9, atol=0.0):
            raise ParameterError(f"--at {name}={value:g}: not a breakpoint of the table; the nearest is {near:g}")
        fixed[name] = near
    return fixed


def _lines(
    args: argparse.Namespace, shown: xr.Dataset, marked: xr.Dataset | None, free: list[str]
) -> list[dict[str, Any]]:
    """Give every line: where it belongs, its values along the input, and those that the map chose."""
    names = (args.along, args.right, args.up)
    out = []
    for place in range(shown.sizes[free[0]] if free else 1):
        where = {free[0]: place} if free else {}
        line = shown.isel(where)
        own: dict[str, Any] = {name: float(shown[name].to_numpy()[place]) for name in free}
        own |= {name: line[name].to_numpy() for name in names}
        if marked is not None:
            own["chosen"] = {name: float(marked[name].isel(where)) for name in names}
        out.append(own)
    return out


def _text(
    args: argparse.Namespace, shown: xr.Dataset, lines: list[dict[str, Any]], free: list[str]
) -> list[str | Table]:
    names = (args.along, args.right, args.up)
    chosen = any("chosen" in line for line in lines)

    def headed(name: str) -> str:
        unit = label_of(shown[name]).units
        return name if unit == "-" else f"{name} [{unit}]"

    columns = (*free, *(headed(name) for name in names), *(f"chosen {name}" for name in names if chosen))
    rows = []
    for line in lines:
        row = [f"{line[name]:g}" for name in free]
        for name in names:
            known = line[name][np.isfinite(line[name])]
            row.append(f"{known.min():.4g} to {known.max():.4g}" if known.size else "none")
        row += [f"{line['chosen'][name]:.4g}" for name in names if chosen]
        rows.append(tuple(row))
    return [Table(columns=columns, rows=tuple(rows))]


COMMANDS = {"trade-off": (_add_trade_off, _trade_off)}
