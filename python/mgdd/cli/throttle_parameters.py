"""Options that the commands of `mgdd throttle` share: parameters of a throttle, and how to read a log."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from mgdd import presets
from mgdd.cli.from_library import Options
from mgdd.cli.options import assignments
from mgdd.errors import ParameterError, did_you_mean
from mgdd.io import read_throttle_log
from mgdd.presets.preset import Preset
from mgdd.throttle import Throttle

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["LOG", "add_preset", "add_throttle", "changes_of", "known_only", "log_in", "preset_of", "throttle_of"]

LOG = Options(
    read_throttle_log, "time", "duty", "angle", "current", "supply", "time_unit", "duty_unit", "angle_unit",
    "travel_deg", "start_s", "stop_s", "sample_s", "delimiter", "decimal", "sheet",
)  # fmt: skip

_DEFAULT_PRESET = "P1"
_LOG = logging.getLogger(__name__)


def log_in(args: argparse.Namespace, file: str) -> xr.Dataset:
    """Read a log as the options of `LOG` say, and say what was left out of it."""
    log = read_throttle_log(file, **LOG.given(args))
    for warning in log.attrs["warnings"].splitlines():
        _LOG.warning("%s: %s", file, warning)
    return log


def add_preset(group: Any, option: str) -> None:
    """Add the preset of a throttle."""
    names = ", ".join(presets.available("throttle"))
    what = f"{names} or a TOML file (default: {_DEFAULT_PRESET})"
    group.add_argument(option, dest="preset", metavar="NAME_OR_FILE.toml", help=what)


def add_throttle(parser: argparse.ArgumentParser) -> None:
    """Add preset and fields; the names are those of the parameters."""
    group = parser.add_argument_group("throttle")
    add_preset(group, "--preset")
    group.add_argument(
        "--set", action="append", default=[], metavar="FIELD=VALUE",
        help="any field of the throttle, repeatable, for example coulomb_nm=0.3",
    )  # fmt: skip


def preset_of(args: argparse.Namespace) -> Preset:
    """Load the preset of a throttle; it refuses to be an engine when it is asked for its throttle."""
    return presets.load(args.preset or _DEFAULT_PRESET)


def throttle_of(args: argparse.Namespace) -> tuple[Throttle, str]:
    """Make the throttle of a preset and the fields over it."""
    preset = preset_of(args)
    return preset.throttle.replace(**changes_of(args, Throttle.fields())), preset.name


def changes_of(args: argparse.Namespace, fields: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Read ``--set FIELD=VALUE`` over the fields of a record; an unknown name is refused with the closest one."""
    return known_only(assignments(args.set, fields), fields, "--set")


def known_only(values: dict[str, Any], fields: Iterable[str], option: str) -> dict[str, Any]:
    """Refuse a name that is not among the fields."""
    for name in values:
        if name not in fields:
            guess = did_you_mean(name, fields)
            have = f"{guess + '; ' if guess else ''}the fields are {', '.join(fields)}"
            raise ParameterError(f"{option} {name}: no field {name!r}; {have}")
    return values
