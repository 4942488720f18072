"""Entry point: parses, runs a command, turns errors into messages and exit codes."""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence

from mgdd.cli.commands import root_parser, understood
from mgdd.cli.parser import UsageError
from mgdd.cli.progress import Progress, Stopped, gated_streams
from mgdd.errors import ConvergenceError, Error, arguments_written

__all__ = ["main"]

EXIT_OK, EXIT_BAD_INPUT, EXIT_NO_CONVERGENCE, EXIT_INTERRUPTED, EXIT_PIPE = 0, 2, 3, 130, 141


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
    parser = root_parser()
    given = sys.argv[1:] if argv is None else list(argv)
    try:
        args = parser.parse_args(understood(given, parser))
    except UsageError as error:
        print(f"{error.parser.prog}: error: {error}", file=sys.stderr)
        _fail(argparse.Namespace(json="--json" in given), error, str(error))
        raise SystemExit(EXIT_BAD_INPUT) from None
    if not hasattr(args, "run"):
        args.parser.print_help(sys.stderr)
        return EXIT_BAD_INPUT
    import logging

    from mgdd.cli.from_library import as_option
    from mgdd.cli.output import check_files

    logging.basicConfig(stream=sys.stderr, format="mgdd: %(levelname)s: %(message)s", level=logging.WARNING)
    try:
        with Progress(quiet=args.quiet) as args.progress, arguments_written(as_option):
            check_files(args)
            args.run(args)
    except ConvergenceError as error:
        print(f"mgdd: {error}", file=sys.stderr)
        _fail(args, error, str(error))
        return EXIT_NO_CONVERGENCE
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader has left; nothing more to say
        return EXIT_PIPE
    except (Error, OSError, ImportError) as error:  # an extra that is not installed is named
        text = _text_of(error)
        print(f"mgdd: error: {text}", file=sys.stderr)
        _fail(args, error, text)
        return EXIT_BAD_INPUT
    except KeyboardInterrupt as error:
        printed = vars(args).get("emitted")
        rest = "the result is printed, what is drawn of it is not whole" if printed else "nothing was kept"
        kept = f"interrupted: {error if isinstance(error, Stopped) else rest}"
        print(f"mgdd: {kept}", file=sys.stderr)
        _fail(args, error, kept)
        return EXIT_INTERRUPTED
    return int(getattr(args, "exit_code", EXIT_OK))


def _fail(args: argparse.Namespace, error: BaseException, message: str) -> None:
    """Print an error as the one JSON object of a ``--json`` command, unless its result is there already."""
    if not vars(args).get("emitted") and vars(args).get("json"):
        from mgdd.cli.output import error_of, json_text

        print(json_text({"error": error_of(error, message)}))


def _text_of(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"  # without the number of the operating system
    return str(error)
