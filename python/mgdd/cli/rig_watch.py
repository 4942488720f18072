"""`mgdd rig watch`: a live page of a run, a record, a bus, or a simulated throttle, on this machine alone."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import add_command
from mgdd.cli.output import check_output, emit
from mgdd.errors import ParameterError
from mgdd.rig import watch

__all__ = ["add"]

_LAST_PORT = 65_535
_NICE = 10  # a loop that is late costs more than a picture that is
_OPTIONS = Options(watch, "port", signal_map="map")


def add(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "watch", _watch,
        help_text="serve a live page on this machine alone, with a stop button that opens the bridge, until Ctrl-C",
        example="mgdd rig watch mgdd-runs/first",
    )  # fmt: skip
    parser.add_argument(
        "source", nargs="?", default="simulate", metavar="RUN | FILE.rec | INTERFACE:CHANNEL | simulate",
        help="folder of a run that goes on or is over, a record, a bus to listen on (default: a simulated throttle)",
    )  # fmt: skip
    _OPTIONS.add(parser)
    parser.add_argument("--no-browser", action="store_true", help="print the address and open nothing")


def _way_to(address: str, folder: Path) -> Path:
    """Write a page that leads to the address: all users of the machine may read the arguments of a browser."""
    file = folder / "mgdd.html"  # in a folder of this user alone
    file.write_text(
        f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={escape(address)}">'
        f'<title>mgdd rig watch</title><a href="{escape(address)}">mgdd rig watch</a>\n',
        encoding="utf-8",
    )
    return file


def _watch(args: argparse.Namespace) -> None:
    from mgdd.io.extras import import_extra
    from mgdd.rig.can.node import parent_watch
    from mgdd.rig.live.page import serve
    from mgdd.rig.live.sources import source_of

    check_output(args)
    how = _OPTIONS.of(args)
    if not 0 <= how["port"] <= _LAST_PORT:
        raise ParameterError.of("--port", how["port"], f"0 to {_LAST_PORT}")
    import_extra("bokeh", "watch", "a live page")  # before a simulation is started
    args.progress.close()
    source = source_of(args.source, how["signal_map"])

    with TemporaryDirectory(prefix="mgdd-watch-", ignore_cleanup_errors=True) as folder:

        def ready(address: str) -> None:
            if hasattr(os, "nice"):
                os.nice(_NICE)  # now that the simulation has begun: that one shall not yield
            print(address, file=sys.stderr if args.json else sys.stdout, flush=True)
            if not args.no_browser:
                webbrowser.open(_way_to(address, Path(folder)).as_uri())

        try:
            serve(source, how["port"], ready, alive=parent_watch())
        finally:
            source.close()
    emit(args, {"watched": source.name, "said": source.said, "trouble": source.trouble})
