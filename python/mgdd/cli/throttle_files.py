"""Options for throttle logs and the parameters of a throttle, shared by the commands of `mgdd throttle`."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from mgdd.cli.options import column_of
from mgdd.io import read_throttle_log

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["add_log_options", "log_of"]

# Options and arguments of `mgdd.io.read_throttle_log` of one name.
_COLUMNS = ("time", "duty", "angle", "current", "supply")
_READING = (
    "time_unit", "duty_unit", "angle_unit", "travel_deg", "start_s", "stop_s", "step_s", "delimiter", "decimal",
)  # fmt: skip


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add how to read a log; the names are those of `mgdd.io.read_throttle_log`."""
    group = parser.add_argument_group("columns of the log, by name, or by number from 0")
    group.add_argument("--time", default="time_s", metavar="COLUMN", help="default: time_s")
    group.add_argument("--duty", default="duty", metavar="COLUMN", help="default: duty")
    group.add_argument("--angle", default="angle_deg", metavar="COLUMN", help="default: angle_deg")
    group.add_argument("--current", metavar="COLUMN", help="motor current [A] (default: current_a if there)")
    group.add_argument("--supply", metavar="COLUMN", help="supply voltage [V] (default: supply_v if there)")
    group.add_argument("--time-unit", choices=("s", "ms"), help="default: what the file says, else s")
    group.add_argument("--duty-unit", choices=("-", "%"), help="-1 to 1, or percent (default: said, else -)")
    group.add_argument("--angle-unit", choices=("deg", "rad", "%"), help="default: said, else deg")
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
        **{name: column_of(getattr(args, name)) for name in _COLUMNS},
        **{name: getattr(args, name) for name in _READING},
    )
