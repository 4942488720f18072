"""`mgdd preset list | show | copy`: the shipped parameter sets, their values, and one as a file to change."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mgdd import presets
from mgdd.cli.from_library import Options
from mgdd.cli.options import option
from mgdd.cli.output import check_file, emit, wrote
from mgdd.errors import ParameterError
from mgdd.io.files import write_whole_text
from mgdd.presets.preset import Preset
from mgdd.report import Table

_KIND = Options(presets.available, "kind")


def _add_name(parser: Any) -> None:
    option(parser, "name NAME_OR_FILE.toml", ", ".join(presets.available()))


def _add_copy(parser: Any) -> None:
    _add_name(parser)
    option(parser, "file FILE.toml", "new file (default: NAME.toml)", nargs="?")


def _list(args: argparse.Namespace) -> None:
    found = [presets.load(name) for name in presets.available(**_KIND.given(args))]
    rows = [{"name": preset.name, "kind": preset.kind, "title": preset.title} for preset in found]
    table = Table(columns=("name", "kind", "title"), rows=tuple(tuple(row.values()) for row in rows))
    emit(args, {"presets": rows}, text=[table])


def _show(args: argparse.Namespace) -> None:
    preset = presets.load(args.name)
    tables = preset.to_parameters().tables
    values = {
        table: {name: {"value": e.value, "unit": e.unit, "source": e.source} for name, e in entries.items()}
        for table, entries in tables.items()
    }
    rows = tuple(
        (name, f"{e.value:g}" if isinstance(e.value, float) else str(e.value), str(e.unit), str(e.source))
        for entries in tables.values()
        for name, e in entries.items()
    )
    head = f"{preset.name}, {preset.kind}: {preset.title}\n"
    text: list[str | Table] = [head, Table(columns=("field", "value", "unit", "source"), rows=rows)]
    emit(args, {"name": preset.name, "kind": preset.kind, "title": preset.title, **values}, text=text)


def _copy(args: argparse.Namespace) -> None:
    args.file = args.file or f"{Path(args.name).stem}.toml"
    check_file("FILE", args.file, (".toml",))
    preset = presets.load(args.name)
    if Path(args.file).exists():
        raise ParameterError(f"{args.file}: exists already, and is not replaced: name another file")
    records: dict[str, Any] = dict(preset.records)
    own = Preset(name=Path(args.file).stem, title=preset.title, sources=preset.sources, **records)
    write_whole_text(args.file, own.to_toml())
    emit(args, {"name": preset.name, "file": args.file}, text=f"--preset {args.file} reads it")
    wrote(args.file)


COMMANDS = {"list": (_KIND.add, _list), "show": (_add_name, _show), "copy": (_add_copy, _copy)}
