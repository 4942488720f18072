"""`mgdd completion`: a script by which a shell completes commands, options and their choices."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from typing import Any

from mgdd.cli.commands import root_parser
from mgdd.cli.options import option
from mgdd.cli.output import emit
from mgdd.cli.parser import Parser, UsageError
from mgdd.io.extras import import_extra


def _completion(args: argparse.Namespace) -> None:
    shtab = import_extra("shtab", "completion", "a script for the completion of a shell")
    root = root_parser()
    for action in _actions(root):
        names = action.metavar if isinstance(action.metavar, tuple) else (str(action.metavar),)
        if any(word in name for name in names for word in ("FILE", "DIR", "MAP", "TABLE", ".toml")):
            action.complete = shtab.FILE
    emit(args, {"shell": args.shell, "script": (script := shtab.complete(root, shell=args.shell))}, text=script)


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


COMMANDS = {
    "completion": (lambda parser: option(parser, "shell", "whose script", choices=("bash", "zsh")), _completion),
}
