"""Options that several commands share, and the records that they make."""

from __future__ import annotations

import argparse
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from mgdd import presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, ParameterError
from mgdd.io import read_pressure
from mgdd.io.point_table import CONDITIONS, read_conditions
from mgdd.io.pressure_checks import PRESSURE_UNITS
from mgdd.io.pressure_file import ANGLE_UNITS
from mgdd.presets.preset import Preset

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Parser",
    "UsageError",
    "add_command",
    "add_engine",
    "add_files",
    "add_group",
    "add_scheme",
    "as_option",
    "assignments",
    "column_of",
    "engine_of",
    "number_pairs",
    "refuse_idle",
    "require_positive",
    "traces_of",
]

_LOG = logging.getLogger(__name__)
_DEFAULT_PRESET = "puma_single"
_POINT = tuple(OperatingPoint.fields())
_CYLINDER_CHOICES = {
    "burn": "burn_shape",
    "gamma": "gamma_model",
    "wall_heat": "wall_heat_model",
    "ignition": "ignition_model",
}


class UsageError(Exception):
    """A command line that no command takes; it carries the parser that knows the usage."""

    def __init__(self, message: str, parser: argparse.ArgumentParser) -> None:
        super().__init__(message)
        self.parser = parser


class Parser(argparse.ArgumentParser):
    """An argument parser that raises usage errors, so that ``--json`` commands can print them as JSON."""

    def error(self, message: str) -> NoReturn:
        """Raise the message."""
        raise UsageError(message, self)


def as_option(name: str, text: str | None = None) -> str:
    """Write an argument of the library as the option that sets it."""
    option = f"--{name.replace('_', '-')}"
    if text in ("True", "False"):
        return option if text == "True" else f"{option} left out"
    return f"{option} {text}" if text else option


def add_group(commands: Any, name: str, *, help_text: str, example: str) -> Any:
    """Add a group of commands, and return what they are added to."""
    group = commands.add_parser(
        name, help=help_text, epilog=f"example:\n  {example}", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    group.set_defaults(parser=group)
    return group.add_subparsers(title="commands", metavar="COMMAND")


def add_command(
    commands: Any,
    name: str,
    run: Callable[[argparse.Namespace], None],
    *,
    help_text: str,
    example: str,
    endings: str = ".json",
) -> argparse.ArgumentParser:
    """Add a command with its example, its JSON switch and its output file."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=help_text,
        description=help_text,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("-o", "--output", metavar="FILE", help=f"write the result to FILE ({endings})")
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")
    parser.set_defaults(run=run, parser=parser)
    return parser


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add the options of a cylinder and an operating point; their names are those of the parameters."""
    group = parser.add_argument_group("engine")
    group.add_argument(
        "--preset", metavar="NAME_OR_FILE.toml",
        help=f"{', '.join(presets.available('engine'))} or a TOML file (default: puma_single)",
    )  # fmt: skip
    group.add_argument(
        "--set", action="append", default=[], metavar="FIELD=VALUE",
        help="any field of the cylinder or point, repeatable, for example bore_mm=90",
    )  # fmt: skip
    for field, info in OperatingPoint.fields().items():
        unit = "" if info["unit"] == "-" else f" [{info['unit']}]"
        meaning = info["meaning"].replace("; none = ", "; left out: ")
        group.add_argument(as_option(field), type=float, metavar="X", help=f"{meaning}{unit}")
    group.add_argument("--motored", action="store_true", help="no fuel")
    for option, field in _CYLINDER_CHOICES.items():
        info = Cylinder.fields()[field]
        group.add_argument(as_option(option), choices=info["choices"], help=info["meaning"])


def add_scheme(parser: argparse.ArgumentParser, *, step_cad: float | None) -> None:
    """Add integrator and crank step."""
    group = parser.add_argument_group("scheme")
    group.add_argument("--integrator", choices=("trapezoid", "split", "seed", "euler"), default="trapezoid")
    group.add_argument(
        "--step-cad",
        type=float,
        default=step_cad,
        metavar="X",
        help=f"crank step, 0.001 to 5 (default: {'1, with files 0.25' if step_cad is None else f'{step_cad:g}'})",
    )


def add_files(parser: argparse.ArgumentParser, *, nargs: int | str) -> None:
    """Add pressure files and how to read them."""
    parser.add_argument(
        "files", nargs=nargs, metavar="FILE",
        help="measured pressure as text: one column of crank angle [°CA aTDC: firing TDC = 0, compression negative] "
        "and one of pressure, or one per cycle; several cycles may also stand below each other",
    )  # fmt: skip
    group = parser.add_argument_group("files", "what the files hold, where they do not say it or say it otherwise")
    group.add_argument(
        "--pressure-column", action="append", metavar="NAME",
        help="column name, or number from 0; repeat it for several cycles (default: all behind the angle, if they are "
        "cycles of one cylinder)",
    )  # fmt: skip
    group.add_argument(
        "--pressure-unit", choices=PRESSURE_UNITS, help="default: what header or units row say, else bar"
    )
    group.add_argument(
        "--gain-bar-per-v",
        type=float,
        metavar="X",
        help="the pressure is in volts: bar per volt of the charge amplifier",
    )
    group.add_argument(
        "--offset-bar", type=float, metavar="X", help="bar at 0 V (left out: relative pressure, use --pegging)"
    )
    group.add_argument(
        "--tdc-offset-cad",
        type=float,
        default=0.0,
        metavar="X",
        help="the angles are too large by this; taken off [°CA]",
    )
    group.add_argument("--angle-column", metavar="NAME", help="column name, or number from 0 (default: 0)")
    group.add_argument(
        "--angle-unit", choices=ANGLE_UNITS,
        help="s, ms and us are a time, which needs --speed-rpm (default: what header or units row say, else deg)",
    )  # fmt: skip
    group.add_argument(
        "--firing-tdc-deg", type=float, metavar="X",
        help="angle of firing TDC in files that count 0 to 720 or run on: 360 if they start at gas-exchange TDC, 0 if "
        "at firing TDC",
    )  # fmt: skip
    group.add_argument("--before-tdc", action="store_true", help="angles count degrees before firing TDC")
    group.add_argument("--angle-step-deg", type=float, metavar="X", help="no angle column: degrees between two samples")
    group.add_argument(
        "--angle-start-deg", type=float, metavar="X",
        help="no angle column, or a time: angle of the first sample [°CA aTDC, or as --firing-tdc-deg counts]",
    )  # fmt: skip
    group.add_argument("--decimal", choices=(".", ","), default=".", help="decimal mark (default: .)")
    group.add_argument("--delimiter", metavar="CHAR", help="column separator (default: found in the file)")
    group.add_argument(
        "--conditions", metavar="FILE.csv",
        help=f"operating conditions, one row per trace, columns file and any of {', '.join(CONDITIONS)}",
    )  # fmt: skip


def engine_of(args: argparse.Namespace) -> tuple[Cylinder, OperatingPoint, Preset]:
    """Make cylinder and point from a preset and the options over it."""
    preset = presets.load(args.preset or _DEFAULT_PRESET, kind="engine")
    if args.preset is None and getattr(args, "files", None):
        c = preset.cylinder
        _LOG.warning(
            "no --preset: the traces are read with the geometry of %s (%g x %g mm, compression ratio %g)",
            preset.name, c.bore_mm, c.stroke_mm, c.compression_ratio,
        )  # fmt: skip
    given = assignments(args.set, {**Cylinder.fields(), **OperatingPoint.fields()})
    point = {name: value for name, value in given.items() if name in _POINT}
    cylinder = {name: value for name, value in given.items() if name not in _POINT}
    for option, field in _CYLINDER_CHOICES.items():
        if getattr(args, option) is not None:
            if field in cylinder:
                raise ParameterError(f"{as_option(option)} and --set {field} contradict each other: give one")
            cylinder[field] = getattr(args, option)
    for field in _POINT:
        if getattr(args, field) is not None:
            if field in point:
                raise ParameterError(f"{as_option(field)} and --set {field} contradict each other: give one")
            point[field] = getattr(args, field)
    if args.motored:
        if point.get("fuel_mg"):
            raise ParameterError(f"--motored and --fuel-mg {point['fuel_mg']:g} contradict each other: give one")
        point["fuel_mg"] = 0.0
    return preset.cylinder.replace(**cylinder), preset.point.replace(**point), preset


def traces_of(args: argparse.Namespace) -> list[xr.Dataset]:
    """Read the pressure files, with their conditions as attributes."""
    if args.files and args.motored:
        raise ParameterError("--motored does not act on measured traces: leave it out")
    conditions = read_conditions(args.conditions) if args.conditions else {}
    rows = _rows_of(args.files, conditions, args.conditions)
    speed = args.speed_rpm or assignments(args.set, OperatingPoint.fields()).get("speed_rpm")
    columns = [column_of(name) for name in args.pressure_column or ()]
    traces = []
    for file in args.files:
        trace = read_pressure(
            file,
            angle_column=column_of(args.angle_column),
            pressure_column=columns or None,
            angle_unit=args.angle_unit,
            pressure_unit=args.pressure_unit,
            firing_tdc_deg=args.firing_tdc_deg,
            before_tdc=args.before_tdc,
            tdc_offset_cad=args.tdc_offset_cad,
            angle_step_deg=args.angle_step_deg,
            angle_start_deg=args.angle_start_deg,
            speed_rpm=rows[file].get("speed_rpm", speed),
            gain_bar_per_v=args.gain_bar_per_v,
            offset_bar=args.offset_bar,
            delimiter=args.delimiter,
            decimal=args.decimal,
        )
        for warning in trace.attrs["warnings"].splitlines():
            _LOG.warning("%s: %s", trace.attrs["file"], warning)
        traces.append(trace.assign_attrs(**rows[file]))
    return traces


def _rows_of(
    files: Sequence[str], conditions: Mapping[str, dict[str, float]], table: str | None
) -> dict[str, dict[str, float]]:
    """Give each file its row of the conditions, by path, name or stem; an empty row without a table."""
    used: dict[str, str] = {}
    rows: dict[str, dict[str, float]] = {}
    for file in files:
        if not conditions:
            rows[file] = {}
            continue
        key = next((k for k in (file, Path(file).name, Path(file).stem) if k in conditions), None)
        if key is None:
            raise DataError(f"{table}: no row for {file}: its column 'file' holds {', '.join(map(repr, conditions))}")
        if key in used:
            raise DataError(f"{table}: row {key!r} fits both {used[key]} and {file}: write their paths as given here")
        used[key], rows[file] = file, conditions[key]
    return rows


def refuse_idle(args: argparse.Namespace, *names: str, why: str) -> None:
    """Refuse options that were given and would act on nothing."""
    for name in names:
        if getattr(args, name, None) not in (None, []):  # a repeatable option that is not given is an empty list
            raise ParameterError(f"{as_option(name)} does not act here; {why}")


def require_positive(args: argparse.Namespace, *names: str) -> None:
    """Refuse options whose number must be positive; the unit is the end of the name."""
    for name in names:
        value = getattr(args, name)
        if value is not None and not 0.0 < value < math.inf:
            raise ParameterError.of(as_option(name), value, f"> 0 {name.rpartition('_')[2]} and finite")


def number_pairs(items: Sequence[str], option: str) -> dict[str, float]:
    """Read repeated NAME=NUMBER options."""
    out: dict[str, float] = {}
    for item in items:
        name, value = _pair(item, option, "NAME=NUMBER")
        number = _value(name, value, {})
        if isinstance(number, str):
            raise ParameterError(f"{option} {item}: {value!r} is not a number")
        _once(name, option, out)
        out[name] = number
    return out


def assignments(items: Sequence[str], fields: Mapping[str, Mapping[str, Any]], option: str = "--set") -> dict[str, Any]:
    """Read repeated FIELD=VALUE of an option; the caller judges a name that is not a field."""
    out: dict[str, Any] = {}
    for item in items:
        name, value = _pair(item, option, "FIELD=VALUE")
        _once(name, option, out)
        out[name] = _value(name, value, fields)
    return out


def _once(name: str, option: str, known: Mapping[str, Any]) -> None:
    if name in known:
        raise ParameterError(f"{option} {name} is given twice: give it once")


def _pair(item: str, option: str, form: str) -> tuple[str, str]:
    name, sign, value = item.partition("=")
    if not (sign and name.strip() and value.strip()):
        raise ParameterError(f"{option} {item}: write {form}")
    return name.strip().replace("-", "_"), value.strip()


def _value(name: str, text: str, fields: Mapping[str, Mapping[str, Any]]) -> float | str:
    if "choices" in fields.get(name, {}):
        return text
    try:
        return float(text)
    except ValueError:
        if name in fields:
            raise ParameterError.of(name, text, f"a number [{fields[name]['unit']}]") from None
        return text


def column_of(text: str | None) -> Any:
    """Read a column, by name or by number from 0; None where none is named."""
    return int(text) if text is not None and text.isdigit() else text
