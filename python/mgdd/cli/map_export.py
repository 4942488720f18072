"""`mgdd map export`: a map in another file form, a measured engine as a map, and the table of a guide."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mgdd import datasets
from mgdd.cli.from_library import Options
from mgdd.cli.map_files import FORMS, MAP_ENDINGS, READING, map_in
from mgdd.cli.options import option, refuse_idle
from mgdd.cli.output import check_file, emit, wrote
from mgdd.errors import ParameterError
from mgdd.io.files import write_whole_text
from mgdd.maps import CalibrationMap, write_map

_ENGINES = ("volkswagen", "mercedes")  # in the order of the set
_GUIDE = (".csv", ".toml")
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
    option(parser, "--guide-map",
           "write the table that mgdd engine seek --guide map --guide-map reads, another form of file")  # fmt: skip


def _export(args: argparse.Namespace) -> None:
    if args.output is None:
        raise ParameterError("-o is needed: name the file to write, for example -o engine.dcm")
    check_file("-o", args.output, _GUIDE if args.guide_map else MAP_ENDINGS)
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
    if args.guide_map:
        timing = maps[0].to_timing_map()
        if Path(args.output).suffix == ".csv":
            timing.write_csv(args.output)
        else:
            write_whole_text(args.output, timing.to_toml())
    elif has_labels:
        write_map(dict(zip(names, maps, strict=True)), args.output, **_WRITING.given(args))
    else:
        write_map(maps[0], args.output)
    wrote(args.output)
    file, args.output = args.output, None
    kept = {"sd"} if args.guide_map else set()
    lost = sorted({*_lost(maps)} - kept) if has_labels or args.guide_map else []
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
        text.append(f"this form has no place for {', '.join(lost)}: keep the map as .json, .csv or .nc too")
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
        if not all(str(entry) == str(plain[name][0]) for entry in column.ravel().tolist())
    ]


COMMANDS = {"export": (_add_export, _export)}
