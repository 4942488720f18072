"""`mgdd completion`: a script by which a shell completes commands, options and their choices."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from typing import Any

from mgdd.cli.options import Parser, UsageError, add_command
from mgdd.cli.output import check_output, emit
from mgdd.io.extras import import_extra

__all__ = ["add"]


def add(commands: Any, root: argparse.ArgumentParser) -> None:
    """Add the command, which completes what `root` parses."""

    def run(args: argparse.Namespace) -> None:
        check_output(args)
        shtab = import_extra("shtab", "completion", "a script for the completion of a shell")
        for action in _actions(root):
            names = action.metavar if isinstance(action.metavar, tuple) else (str(action.metavar),)
            if any(word in name for name in names for word in ("FILE", "DIR", "MAP", "TABLE", ".toml")):
                action.complete = shtab.FILE
        emit(args, {"shell": args.shell, "script": (script := shtab.complete(root, shell=args.shell))}, text=script)

    parser = add_command(
        commands, "completion", run,
        help_text="print a script that completes commands, options and choices in a shell",
        example='eval "$(mgdd completion bash)"',
    )  # fmt: skip
    parser.add_argument("shell", choices=("bash", "zsh"), help="whose script")


def _actions(parser: argparse.ArgumentParser) -> Iterator[Any]:
    """Walk over everything that can be given; argparse has no public way, shtab takes the same one."""
    if isinstance(parser, Parser):
        with contextlib.suppress(UsageError):  # a command whose package is not there has no options
            parser.filled()
    for action in parser._actions:
        yield action
        if isinstance(action.choices, dict):
            for below in action.choices.values():
                yield from _actions(below)
