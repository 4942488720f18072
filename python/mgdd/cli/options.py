"""Options that several commands share, and the records that they make."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from mgdd import presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, ParameterError
from mgdd.io import read_conditions, read_pressure

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
    parser.add_argument("files", nargs=nargs, metavar="FILE", help="pressure trace: CSV or two plain columns")
    group = parser.add_argument_group("files")
    group.add_argument("--pressure-unit", choices=("bar", "kPa", "Pa"), default="bar", help="default: bar")
    group.add_argument(
        "--pressure-column", default="1", metavar="NAME", help="column name, or number from 0 (default: 1)"
    )
    group.add_argument("--angle-column", default="0", metavar="NAME", help="column name, or number from 0 (default: 0)")
    group.add_argument("--angle-unit", choices=("deg", "rad"), default="deg", help="default: deg")
    group.add_argument("--decimal", choices=(".", ","), default=".", help="decimal mark (default: .)")
    group.add_argument("--delimiter", metavar="CHAR", help="column separator (default: found in the file)")
    group.add_argument(
        "--firing-tdc-deg", type=float, metavar="X", help="angle of firing TDC in files that count from elsewhere"
    )
    group.add_argument("--before-tdc", action="store_true", help="angles count degrees before firing TDC")
    group.add_argument(
        "--conditions", metavar="FILE.csv", help="columns file,speed_rpm,trapped_mass_g,soi_cad: one row per trace"
    )


def engine_of(args: argparse.Namespace) -> tuple[Cylinder, OperatingPoint, presets.Preset]:
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
    used: dict[str, str] = {}
    traces = []
    for file in args.files:
        trace = read_pressure(
            file,
            angle_column=column_of(args.angle_column),
            pressure_column=column_of(args.pressure_column),
            angle_unit=args.angle_unit,
            pressure_unit=args.pressure_unit,
            firing_tdc_deg=args.firing_tdc_deg,
            before_tdc=args.before_tdc,
            delimiter=args.delimiter,
            decimal=args.decimal,
        )
        if conditions:
            key = next((k for k in (file, Path(file).name, Path(file).stem) if k in conditions), None)
            if key is None:
                raise DataError(
                    f"{args.conditions}: no row for {file}: its column 'file' holds {', '.join(map(repr, conditions))}"
                )
            if key in used:
                raise DataError(
                    f"{args.conditions}: row {key!r} fits both {used[key]} and {file}: write their paths as given here"
                )
            used[key] = file
            trace = trace.assign_attrs(**conditions[key])
        traces.append(trace)
    return traces


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


def assignments(items: Sequence[str], fields: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Read repeated --set FIELD=VALUE; the caller judges a name that is not a field."""
    out: dict[str, Any] = {}
    for item in items:
        name, value = _pair(item, "--set", "FIELD=VALUE")
        _once(name, "--set", out)
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
