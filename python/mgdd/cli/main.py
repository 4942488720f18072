"""Entry point: parses, runs a command, turns errors into messages and exit codes."""

from __future__ import annotations

import argparse
import io
import logging
import os
import sys
from collections.abc import Sequence

from mgdd import _core
from mgdd.cli import completion, data, demo, doctor, engine, maps, preset, rig, study, throttle
from mgdd.cli.from_library import as_option
from mgdd.cli.options import Parser, UsageError
from mgdd.cli.output import Stopped, fail, gated_streams
from mgdd.cli.progress import Progress
from mgdd.errors import ConvergenceError, Error, arguments_written

__all__ = ["main"]

EXIT_OK, EXIT_BAD_INPUT, EXIT_NO_CONVERGENCE, EXIT_INTERRUPTED, EXIT_PIPE = 0, 2, 3, 130, 141

_EPILOG = """exit codes: 0 done, 1 a self-test or replay that failed, 2 bad input or usage, 3 no convergence or no
feasible answer, 130 interrupted.

examples:
  mgdd demo
  mgdd engine simulate --preset puma_single --soc-cad -6 --json
  mgdd engine optimum --limit p_max_bar=95
  mgdd map design --over soc_cad=-16:4 --over fuel_mg=6:30 --points 32 -o design.csv
  mgdd throttle simulate --preset P1 --duty 0.6 --json
  mgdd study --list
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program name; those of the process if left out.

    Returns
    -------
    int
        Exit code: 0 done, 1 a self-test or replay that failed, 2 bad input or usage, 3 no convergence or no feasible
        answer, 130 interrupted.

    Examples
    --------
    >>> from mgdd.cli import main
    >>> main(["engine", "optimum", "--burn-duration-cad", "30", "--limit", "p_max_bar=10"])
    3
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without °: a question mark, not a traceback
    with gated_streams():
        return _run(argv)


def _run(argv: Sequence[str] | None) -> int:
    parser = _parser()
    given = sys.argv[1:] if argv is None else list(argv)
    try:
        args = parser.parse_args(given)
    except UsageError as error:
        error.parser.print_usage(sys.stderr)
        print(f"{error.parser.prog}: error: {error}", file=sys.stderr)
        fail(argparse.Namespace(json="--json" in given), error, str(error))
        raise SystemExit(EXIT_BAD_INPUT) from None
    logging.basicConfig(stream=sys.stderr, format="mgdd: %(levelname)s: %(message)s", level=logging.WARNING)
    if not hasattr(args, "run"):
        args.parser.print_help(sys.stderr)
        return EXIT_BAD_INPUT
    try:
        with Progress(quiet=args.quiet) as args.progress, arguments_written(as_option):
            args.run(args)
    except ConvergenceError as error:
        print(f"mgdd: {error}", file=sys.stderr)
        fail(args, error, str(error))
        return EXIT_NO_CONVERGENCE
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader has left; nothing more to say
        return EXIT_PIPE
    except (Error, OSError, ImportError) as error:  # an extra that is not installed is named
        text = _text_of(error)
        print(f"mgdd: error: {text}", file=sys.stderr)
        fail(args, error, text)
        return EXIT_BAD_INPUT
    except KeyboardInterrupt as error:
        rest = (
            "the result is printed, what is drawn of it is not whole"
            if vars(args).get("emitted")
            else "nothing was kept"
        )
        kept = f"interrupted: {error if isinstance(error, Stopped) else rest}"
        print(f"mgdd: {kept}", file=sys.stderr)
        fail(args, error, kept)
        return EXIT_INTERRUPTED
    return int(getattr(args, "exit_code", EXIT_OK))


def _text_of(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"  # without the number of the operating system
    return str(error)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="mgdd",
        description="Model-guided data-driven optimization and control for internal combustion engine systems.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"mgdd {_core.__version__}")
    parser.set_defaults(parser=parser)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    demo.add(commands)
    engine.add(commands)
    maps.add(commands)
    throttle.add(commands)
    rig.add(commands)
    study.add(commands)
    data.add(commands)
    preset.add(commands)
    doctor.add(commands)
    completion.add(commands, parser)
    return parser
