"""Entry point: parses, runs a command, turns errors into messages and exit codes."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence

from mgdd import _core
from mgdd.cli import demo, doctor, engine
from mgdd.errors import ConvergenceError, Error

__all__ = ["main"]

EXIT_OK, EXIT_BAD_INPUT, EXIT_NO_CONVERGENCE, EXIT_INTERRUPTED = 0, 2, 3, 130

_EPILOG = """exit codes: 0 done, 2 bad input or usage, 3 no convergence or no feasible answer, 130 interrupted.

examples:
  mgdd demo
  mgdd engine simulate --preset puma_single --soc-cad -6 --json
  mgdd engine optimum --limit p_max_bar=95
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
        Exit code: 0 done, 2 bad input or usage, 3 no convergence or no feasible answer, 130 interrupted.

    Examples
    --------
    >>> from mgdd.cli import main
    >>> main(["engine", "optimum", "--burn-duration-cad", "30", "--limit", "p_max_bar=10"])
    3
    """
    parser = _parser()
    args = parser.parse_args(argv)
    logging.basicConfig(stream=sys.stderr, format="mgdd: %(levelname)s: %(message)s", level=logging.WARNING)
    if not hasattr(args, "run"):
        args.parser.print_help(sys.stderr)
        return EXIT_BAD_INPUT
    try:
        args.run(args)
    except ConvergenceError as error:
        print(f"mgdd: {error}", file=sys.stderr)
        return EXIT_NO_CONVERGENCE
    except (Error, OSError) as error:
        print(f"mgdd: error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        print("mgdd: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    return EXIT_OK


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
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
    doctor.add(commands)
    return parser
