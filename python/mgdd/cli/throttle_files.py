"""Options for throttle logs and the parameters of a throttle, shared by the commands of `mgdd throttle`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from mgdd.errors import ParameterError
from mgdd.io import read_throttle_log

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["add_log_options", "check_ending", "log_of", "wrote"]


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add how to read a log; the names are those of `mgdd.io.read_throttle_log`."""
    group = parser.add_argument_group("columns of the log, by name, or by number from 0")
    group.add_argument("--time", default="time_s", metavar="COLUMN", help="default: time_s")
    group.add_argument("--duty", default="duty", metavar="COLUMN", help="default: duty")
    group.add_argument("--angle", default="angle_deg", metavar="COLUMN", help="default: angle_deg")
    group.add_argument("--current", metavar="COLUMN", help="motor current [A] (default: current_a if there)")
    group.add_argument("--supply", metavar="COLUMN", help="supply voltage [V] (default: supply_v if there)")
    group.add_argument("--time-unit", choices=("s", "ms"), default="s", help="default: s")
    group.add_argument("--duty-unit", choices=("-", "%"), default="-", help="-1 to 1, or percent (default: -)")
    group.add_argument("--angle-unit", choices=("deg", "rad", "%"), default="deg", help="default: deg")
    group.add_argument("--travel-deg", type=float, default=90.0, metavar="X", help="angle at 100 %% (default: 90)")
    group.add_argument("--start-s", type=float, metavar="X", help="leave out what is earlier [s]")
    group.add_argument("--stop-s", type=float, metavar="X", help="leave out what is later [s]")
    group.add_argument("--step-s", type=float, metavar="X", help="resample to this even step [s]")
    group.add_argument("--delimiter", metavar="CHAR", help="column separator (default: found in the file)")
    group.add_argument("--decimal", choices=(".", ","), default=".", help="decimal mark (default: .)")


def log_of(args: argparse.Namespace, file: str) -> xr.Dataset:
    """Read a log with the options of `add_log_options`."""
    return read_throttle_log(
        file,
        time=_column(args.time),
        duty=_column(args.duty),
        angle=_column(args.angle),
        current=None if args.current is None else _column(args.current),
        supply=None if args.supply is None else _column(args.supply),
        time_unit=args.time_unit,
        duty_unit=args.duty_unit,
        angle_unit=args.angle_unit,
        travel_deg=args.travel_deg,
        start_s=args.start_s,
        stop_s=args.stop_s,
        step_s=args.step_s,
        delimiter=args.delimiter,
        decimal=args.decimal,
    )


def check_ending(file: str | None, endings: tuple[str, ...]) -> None:
    """Refuse an output of unknown kind, or into a folder that is not there, before any work is done."""
    if file is None:
        return
    if Path(file).suffix not in endings:
        raise ParameterError(f"-o {file}: the ending must be one of {', '.join(endings)}")
    if not Path(file).resolve().parent.is_dir():
        raise ParameterError(f"-o {file}: there is no folder {Path(file).parent}")


def wrote(file: str) -> None:
    """Say on stderr that a file was written."""
    print(f"wrote {file}", file=sys.stderr)


def _column(text: str) -> int | str:
    return int(text) if text.isdigit() else text
