"""What a command prints and writes: JSON on stdout, or a readable table; files by their ending; progress on stderr."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.errors import ParameterError
from mgdd.io import write_traces
from mgdd.results import VARIABLES, to_jsonable

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Stopped", "check_figure", "check_output", "emit", "lines", "progress"]


class Stopped(KeyboardInterrupt):
    """Ctrl-C after which something was kept; the message says what."""


def check_output(args: argparse.Namespace, *, csv: bool) -> None:
    """Refuse an output file of unknown kind before any work is done."""
    if args.output is None:
        return
    allowed = (".json", ".csv") if csv else (".json",)
    if Path(args.output).suffix not in allowed:
        raise ParameterError(f"-o {args.output}: the ending must be one of {', '.join(allowed)}")
    if not Path(args.output).resolve().parent.is_dir():
        raise ParameterError(f"-o {args.output}: there is no folder {Path(args.output).parent}")


def check_figure(file: str | None) -> None:
    """Refuse a figure of unknown kind before any work is done."""
    if file is None:
        return
    if Path(file).suffix not in (".png", ".svg", ".pdf"):
        raise ParameterError(f"--figure {file}: the ending must be one of .png, .svg, .pdf")
    if not Path(file).resolve().parent.is_dir():
        raise ParameterError(f"--figure {file}: there is no folder {Path(file).parent}")


def emit(
    args: argparse.Namespace,
    payload: Mapping[str, Any],
    *,
    text: str | None = None,
    traces: xr.Dataset | None = None,
) -> None:
    """Print the result, as one JSON object or as text, and write it to the output file."""
    plain = to_jsonable(payload)
    if args.output is not None:
        if Path(args.output).suffix == ".csv" and traces is not None:
            write_traces(traces, args.output)
        else:
            Path(args.output).write_text(_json(plain) + "\n", encoding="utf-8")
        print(f"wrote {args.output}", file=sys.stderr)
    print(_json(plain) if args.json else (text or lines(plain)))


def lines(payload: Mapping[str, Any]) -> str:
    """Give one line per scalar: name, value, unit."""
    out = []
    for name, value in payload.items():
        if isinstance(value, dict | list):
            continue
        unit = VARIABLES[name].units if name in VARIABLES else ""
        shown = f"{value:.6g}" if isinstance(value, float) else "–" if value is None else str(value)
        out.append(f"{name:28} {shown:>14} {'' if unit == '-' else unit}".rstrip())
    return "\n".join(out)


@contextmanager
def progress(args: argparse.Namespace, *, expected: int) -> Iterator[Callable[[str], None]]:
    """Show a bar on stderr while work is long; nothing when stderr is no terminal or the user wants quiet.

    How many refits a profile takes is known only at its end: `expected` steps is where the bar starts from.
    """
    from tqdm import tqdm

    quiet = args.quiet or not sys.stderr.isatty()
    with tqdm(total=expected, disable=quiet, file=sys.stderr, unit="step", leave=False) as bar:

        def step(text: str) -> None:
            bar.set_description(text)
            bar.total = max(expected, bar.n + 1)
            bar.update()

        yield step


def _json(plain: Any) -> str:
    return json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False)
