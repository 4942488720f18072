"""Options that several commands share, and the records that they make."""

from __future__ import annotations

import argparse
import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mgdd import presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.cli.from_library import Options, as_option
from mgdd.cli.output import warn
from mgdd.cli.ranges import assignments
from mgdd.engine import analyze, simulate
from mgdd.errors import ParameterError
from mgdd.io import Encoder, pressure_chunks, read_pressure
from mgdd.io.files import existing_file
from mgdd.io.point_table import CONDITIONS, conditions_of
from mgdd.presets.preset import Preset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["refuse_idle"]  # what other packages take

_DEFAULT_PRESET = "puma_single"
_POINT = tuple(OperatingPoint.fields())
GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")
SCHEME = Options(simulate, "integrator", "step_cad")
PEGGING = Options(analyze, "pegging", "pegging_exponent", "inlet_pressure_kpa")
_COLUMNS = Options(read_pressure, "pressure_column", "angle_column")
READING = Options(
    read_pressure, "pressure_unit", "gain_bar_per_v", "offset_bar", "tdc_offset_cad", "angle_unit", "firing_tdc_deg",
    "before_tdc", "angle_step_deg", "angle_start_deg", "decimal", "delimiter", "sheet", "cycle_per_row",
)  # fmt: skip
_ENCODER = Options(
    Encoder, column="encoder", teeth="encoder_teeth", missing_teeth="encoder_missing_teeth",
    index_column="encoder_index", falling="encoder_falling", level="encoder_level",
)  # fmt: skip
CYLINDER_CHOICES = {
    "burn": "burn_shape",
    "gamma": "gamma_model",
    "wall_heat": "wall_heat_model",
    "ignition": "ignition_model",
}


_NUMBERS: dict[str, type] = {"X": float, "N": int}


def option(parser: Any, form: str, text: str, **how: Any) -> None:
    """Add an option, written as it is typed: `--step`, `--port N`, `--gain X`, `--limit NAME=X ...` if repeatable."""
    name, _, value = form.removesuffix(" ...").partition(" ")
    if form.endswith(" ..."):
        how |= {"action": "append", "default": []}
    if value:
        how = {"metavar": value, "type": _NUMBERS.get(value), **how}
    elif "choices" not in how:
        how["action"] = "store_true"
    shown = " (default: %(default)s)" if how.get("default") else ""
    parser.add_argument(name, help=text + shown, **how)


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add the options of a cylinder and an operating point; their names are those of the parameters."""
    group = parser.add_argument_group("engine")
    option(group, "--preset NAME_OR_FILE.toml",
           f"{', '.join(presets.available('engine'))} or a TOML file (default: {_DEFAULT_PRESET})")  # fmt: skip
    option(group, "--set FIELD=VALUE ...", "any field of the cylinder or point, repeatable, for example bore_mm=90")
    for field, info in OperatingPoint.fields().items():
        unit = "" if info["unit"] == "-" else f" [{info['unit']}]"
        option(group, f"{as_option(field)} X", info["meaning"].replace("; none = ", "; left out: ") + unit)
    option(group, "--motored", "no fuel")
    for name, field in CYLINDER_CHOICES.items():
        option(group, as_option(name), Cylinder.fields()[field]["meaning"], choices=Cylinder.fields()[field]["choices"])


def add_files(parser: argparse.ArgumentParser, *, nargs: int | str) -> None:
    """Add pressure files and how to read them."""
    option(parser, "files FILE",
           "measured pressure as text: one column of crank angle [°CA aTDC: firing TDC = 0, compression negative] and "
           "one of pressure, or one per cycle; several cycles may also stand below each other",
           nargs=nargs)  # fmt: skip
    group = parser.add_argument_group("what the files hold, where they do not say it or say it otherwise")
    for options in (_COLUMNS, READING):
        options.add(group)
    add_encoder(parser)
    option(group, "--conditions FILE.csv",
           f"operating conditions, one row per trace, columns file and any of {', '.join(CONDITIONS)}")  # fmt: skip


def add_encoder(parser: argparse.ArgumentParser) -> None:
    """Add the options of an encoder."""
    _ENCODER.add(parser.add_argument_group("an encoder instead of an angle, with --firing-tdc-deg behind its mark"))


def encoder_of(args: argparse.Namespace) -> dict[str, Any]:
    """Give the encoder as the keyword of a reader, where one is given."""
    given = _ENCODER.given(args)
    if given and "column" not in given:
        idle = as_option(_ENCODER.options[next(iter(given))])
        raise ParameterError(f"{idle} acts with --encoder COLUMN only: give it")
    return {"encoder": Encoder(**given)} if given else {}


def point_given(args: argparse.Namespace) -> dict[str, float]:
    """Give the numbers of the point that were given, by an option or by --set, which mean the same."""
    point = {name: value for name, value in _set(args).items() if name in _POINT}
    for field in _POINT:
        if getattr(args, field) is not None:
            if field in point:
                raise ParameterError(f"{as_option(field)} and --set {field} contradict each other: give one")
            point[field] = getattr(args, field)
    if args.motored:
        if point.get("fuel_mg"):
            raise ParameterError(f"--motored and --fuel-mg {point['fuel_mg']:g} contradict each other: give one")
        point["fuel_mg"] = 0.0
    return point


def assumed_geometry(args: argparse.Namespace) -> str:
    """Say what of the geometry nobody gave and a default preset fills in; empty where it was given."""
    if args.preset is not None:
        return ""
    given, own = _set(args), presets.load(_DEFAULT_PRESET, kind="engine").cylinder
    taken = [f"{name} = {getattr(own, name):g}" for name in GEOMETRY if name not in given]
    return f"{', '.join(taken)} of {_DEFAULT_PRESET}" if taken else ""


def _set(args: argparse.Namespace) -> dict[str, Any]:
    return assignments(args.set, {**Cylinder.fields(), **OperatingPoint.fields()})


def engine_of(args: argparse.Namespace) -> tuple[Cylinder, OperatingPoint, Preset]:
    """Make cylinder and point from a preset and the options over it."""
    preset = presets.load(args.preset or _DEFAULT_PRESET, kind="engine")
    cylinder = {name: value for name, value in _set(args).items() if name not in _POINT}
    if getattr(args, "files", None) and (assumed := assumed_geometry(args)):
        warn(f"no engine is given: the traces are read with {assumed}; give --preset or --set")
    for name, field in CYLINDER_CHOICES.items():
        if getattr(args, name) is not None:
            if field in cylinder:
                raise ParameterError(f"{as_option(name)} and --set {field} contradict each other: give one")
            cylinder[field] = getattr(args, name)
    return preset.cylinder.replace(**cylinder), preset.point.replace(**point_given(args)), preset


def traces_of(args: argparse.Namespace) -> list[xr.Dataset]:
    """Read the pressure files, with their conditions as attributes."""
    return [read() for read in readers_of(args).values()]


def readers_of(args: argparse.Namespace) -> dict[str, Callable[[], Any]]:
    """Give for each pressure file what reads it, so that one which is refused does not stop the others.

    It reads a Dataset, or with --chunk-cycles one after the other.
    """
    if args.files and args.motored:
        raise ParameterError("--motored does not act on measured traces: leave it out")
    for file in args.files:
        existing_file(file)
    rows = conditions_of(args.files, args.conditions)
    speed = point_given(args).get("speed_rpm")
    encoder = encoder_of(args)
    cycles = getattr(args, "chunk_cycles", None)

    def read(file: str) -> Any:
        angle = encoder or {"speed_rpm": rows[file].get("speed_rpm", speed)}
        how = angle | _COLUMNS.given(args) | READING.given(args)
        if cycles is not None:
            return (noted(chunk, file) for chunk in pressure_chunks(file, cycles=cycles, **how))
        return noted(read_pressure(file, **how), file)

    def noted(trace: xr.Dataset, file: str) -> xr.Dataset:
        warn(*trace.attrs["warnings"].splitlines(), of=trace.attrs["file"])
        return trace.assign_attrs(**rows[file])

    return {file: functools.partial(read, file) for file in args.files}


def check_pegging(args: argparse.Namespace) -> None:
    """Refuse options of pegging that would act on nothing."""
    if args.pegging_exponent is not None and args.pegging not in ("two_point", "least_squares"):
        raise ParameterError("--pegging-exponent acts with --pegging two_point or least_squares only: choose one")
    if args.inlet_pressure_kpa is not None and args.pegging != "inlet":
        raise ParameterError("--inlet-pressure-kpa acts with --pegging inlet only: choose it")


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


def add_over(parser: Any, *, what: str) -> None:
    """Add the option of a grid."""
    option(parser, "--over NAME=LOW:HIGH:N ...",
           f"N even values of {what} from LOW to HIGH, both included, or NAME=VALUE,VALUE for values of your own, in "
           "the unit that the name ends in; repeatable, one dimension each")  # fmt: skip
