"""What a command prints and writes: JSON on stdout, or text and tables; files by their ending; errors as JSON too."""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.errors import Interrupted, ParameterError, printable
from mgdd.io.files import write_whole, write_whole_text
from mgdd.io.plain_csv import write_traces
from mgdd.report import Report, Table
from mgdd.results.labels import VARIABLES, to_jsonable

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


__all__ = ["emit", "whole_or_part"]  # what other packages take

_LOG = logging.getLogger(__name__)


def whole_or_part(work: Callable[..., Report], *given: Any, **options: Any) -> tuple[Report, bool]:
    """Do work that ends in a report, or as much of it as Ctrl-C leaves, and say whether it did."""
    try:
        return work(*given, **options), False
    except Interrupted as stop:
        if not isinstance(stop.partial, Report):
            raise
        return stop.partial, True


def check_files(args: argparse.Namespace) -> None:
    """Refuse an output file or a figure of unknown kind before any work is done."""
    if args.endings:  # none of a folder
        check_file("-o", args.output, args.endings)
    check_file("--figure", vars(args).get("figure"), (".png", ".svg", ".pdf"))


def check_file(option: str, file: str | None, endings: tuple[str, ...]) -> None:
    """Refuse a file of unknown kind, or in a folder that is not there."""
    if file is None:
        return
    if Path(file).suffix not in endings:
        raise ParameterError(f"{option} {file}: the ending must be one of {', '.join(endings)}")
    folder = Path(file).parent
    if not folder.resolve().is_dir():
        raise ParameterError(f"{option} {file}: the folder {folder} does not exist; make it, or name another file")


def save_figure(figure: Figure, file: str, *, quiet: bool = False) -> None:
    """Write a figure, whole or not at all, and say so."""
    write_whole(file, lambda half: figure.savefig(half, dpi=150, format=Path(file).suffix[1:]))
    if not quiet:
        wrote(file)


def wrote(file: str) -> None:
    """Say on stderr that a file was written."""
    print(f"wrote {file}", file=sys.stderr)


def warn(*doubts: object, of: str = "") -> None:
    """Say doubts on stderr, of a file if it is named."""
    for doubt in doubts:
        _LOG.warning("%s%s", f"{of}: " if of else "", doubt)


def emit(
    args: argparse.Namespace,
    payload: Mapping[str, Any],
    *,
    text: str | Sequence[str | Table] | None = None,
    traces: xr.Dataset | None = None,
    write: Mapping[str, Callable[[str], None]] | None = None,
    figure: Callable[[], Figure] | None = None,
) -> None:
    """Print the result, as one JSON object or as text, and write it to the output file, then the figure.

    `write` has by its ending what writes a file that is not this JSON; the object names the file then.
    """
    file, write = args.output, write if write is not None or traces is None else {".csv": partial(write_traces, traces)}
    plain = to_jsonable({**payload, "file": file} if write is not None and traces is None else payload)
    args.progress.close()
    if file is not None:
        writer = (write or {}).get(Path(file).suffix)
        if writer is None:
            write_whole_text(file, json_text(plain) + "\n")
        else:
            writer(file)
        wrote(file)
    args.emitted = True
    if args.json:
        print(json_text(plain))
    else:
        print(show([text] if isinstance(text, str) else text or [lines(plain)]))
    if figure is not None and args.figure is not None:
        save_figure(figure(), args.figure)


def lines(payload: Mapping[str, Any]) -> str:
    """Give one line per scalar: name, value, unit."""
    out = []
    for name, value in payload.items():
        if isinstance(value, dict | list):
            continue
        plain = name.removeprefix("free_")  # the same figure without the limit of p_max
        unit = VARIABLES[plain].units if plain in VARIABLES else ""
        shown = f"{value:.6g}" if isinstance(value, float) else "–" if value is None else str(value)
        out.append(f"{name:28} {shown:>14} {'' if unit == '-' else unit}".rstrip())
    return "\n".join(out)


def error_of(error: BaseException, message: str) -> dict[str, Any]:
    """Give type, field, value, bound and message of an error; what it does not know is None."""
    known = {name: getattr(error, name, None) for name in ("field", "value", "bound")}
    plain = {name: _plain(value) for name, value in known.items()}
    return {"type": type(error).__name__, **plain, "message": message}


def _plain(value: Any) -> Any:
    try:
        return to_jsonable(value)
    except TypeError:
        return repr(value)


def show(blocks: Sequence[str | Table]) -> str:
    """Lay out text and tables, numbers to the right; of heads and cells what a terminal would obey is written out."""
    return "\n".join(printable(block) if isinstance(block, str) else _columns(block) for block in blocks)


def _columns(table: Table) -> str:
    if not table.rows:
        return "(no rows)"
    columns = [
        [printable(cell).replace("\n", "\\n") for cell in column]
        for column in zip(table.columns, *table.rows, strict=True)
    ]
    for column in columns:
        width, text = max(map(len, column)), all(cell[:1].isalpha() or not cell for cell in column[1:])
        column[:] = [cell.ljust(width) if text else cell.rjust(width) for cell in column]
    return "\n".join("  ".join(line).rstrip() for line in zip(*columns, strict=True))


def json_text(plain: Any) -> str:
    """Write plain data as JSON."""
    return json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False)
