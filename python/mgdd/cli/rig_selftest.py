"""`mgdd rig selftest`: what a user does before the first run on a bench."""

from __future__ import annotations

import argparse
from typing import Any

from mgdd.cli.options import add_command
from mgdd.cli.output import check_output, emit
from mgdd.studies.sections import Table

__all__ = ["add"]

_FAILED = 1


def add(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "selftest", _selftest,
        help_text="let a process that drives a simulated throttle over a bus die in six ways, and time the plate's way "
        "to limp-home; exit code 1 above 0.4 s",
        example="mgdd rig selftest --json",
    )  # fmt: skip
    parser.add_argument(
        "--loop", choices=("python", "core"), default="python",
        help="what drives the throttle: python, command by command, or an experiment on the loop of the core, whose "
        "controllers give no NaN: five ways (default: python)",
    )  # fmt: skip


def _selftest(args: argparse.Namespace) -> None:
    from mgdd.rig.experiment.self_test import WAYS_OF, run_self_test

    check_output(args)
    step = args.progress.expect(len(WAYS_OF[args.loop]))
    test = run_self_test(loop=args.loop, progress=step)
    rows = tuple(
        (way, "–" if time is None else f"{time:.3f}", test.notes.get(way, "")) for way, time in test.ways_to_die.items()
    )
    verdict = "passed" if test.passed else "failed"
    said = f"\n{verdict}: at most {test.limit_s:g} s are allowed"
    emit(args, test.to_dict(), text=[Table(columns=("way to die", "home after [s]", "note"), rows=rows), said])
    if not test.passed:
        args.exit_code = _FAILED
