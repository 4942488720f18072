"""A page of this machine that a command serves: its port, its address, and the browser that opens it."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from collections.abc import Callable
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mgdd.cli.options import option
from mgdd.errors import ParameterError

_LAST_PORT = 65_535


def add_browser(parser: Any) -> None:
    """Add port and browser."""
    option(parser, "--port N", "of the page; 0 takes a free one", default=0)
    option(parser, "--no-browser", "print the address and open nothing")


def before_serving(args: argparse.Namespace) -> None:
    """Refuse a port that does not exist, and end the progress: the address is the next line."""
    if not 0 <= args.port <= _LAST_PORT:
        raise ParameterError.of("--port", args.port, f"0 to {_LAST_PORT}")
    args.progress.close()


def serve_page(args: argparse.Namespace, name: str, serve: Callable[[int, Callable[[str], None]], object]) -> None:
    """Serve a page until Ctrl-C: print its address, and open a browser by a way that hides the word in it."""
    with TemporaryDirectory(prefix="mgdd-page-", ignore_cleanup_errors=True) as folder:

        def ready(address: str) -> None:
            print(address, file=sys.stderr if args.json else sys.stdout, flush=True)
            if not args.no_browser:
                webbrowser.open(_way_to(address, Path(folder), name).as_uri())

        serve(args.port, ready)


def lower_priority(by: int) -> None:
    """Let this process yield to others, where the system can."""
    if hasattr(os, "nice"):
        os.nice(by)


def _way_to(address: str, folder: Path, name: str) -> Path:
    """Write a page that leads to the address: all users of the machine may read the arguments of a browser."""
    file = folder / "mgdd.html"  # in a folder of this user alone
    file.write_text(
        f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={escape(address)}">'
        f'<title>{name}</title><a href="{escape(address)}">{name}</a>\n',
        encoding="utf-8",
    )
    return file
