"""`mgdd workbench`: the pages in a browser of this machine."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from mgdd.cli.browser import add_browser, before_serving, serve_page
from mgdd.cli.output import emit


def _run(args: argparse.Namespace) -> None:
    before_serving(args)
    from mgdd.io.extras import import_extra
    from mgdd.rig.can.node import parent_watch
    from mgdd.workbench.page import serve

    import_extra("panel", "workbench", "the workbench")

    def served(port: int, ready: Callable[[str], None]) -> None:
        serve(port, ready, alive=parent_watch())

    serve_page(args, "mgdd workbench", served)
    emit(args, {"served": "mgdd workbench"})


COMMANDS = {"workbench": (add_browser, _run)}
