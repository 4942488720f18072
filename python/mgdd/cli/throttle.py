"""`mgdd throttle simulate | excite | identify | validate`, each in a module of its own."""

from __future__ import annotations

import argparse
from typing import Any

from mgdd.cli import throttle_excite, throttle_identify, throttle_simulate

__all__ = ["add"]


def add(commands: Any) -> None:
    """Add the group and its commands."""
    group = commands.add_parser(
        "throttle",
        help="an electronic throttle: simulate, excite, identify, validate",
        epilog="example:\n  mgdd throttle identify chirp.csv --model pw_r --test steps.csv --json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    group.set_defaults(parser=group)
    verbs = group.add_subparsers(title="commands", metavar="COMMAND")
    throttle_simulate.add(verbs)
    throttle_excite.add(verbs)
    throttle_identify.add(verbs)
