"""`mgdd throttle simulate | demand`: the plant under a duty, and what a pedal wants."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.cli.from_library import Options, as_option
from mgdd.cli.options import option
from mgdd.cli.output import emit
from mgdd.cli.ranges import assignments
from mgdd.errors import DataError, ParameterError, argument, did_you_mean
from mgdd.io import read_throttle_log
from mgdd.io.parameters import ParameterFile
from mgdd.io.table import Place, read_table
from mgdd.loop.plates import Plate, model_of, plate_of
from mgdd.plot import throttle_run
from mgdd.plot.style import drawn
from mgdd.signals.even_grid import even_step
from mgdd.throttle import DemandChain, Throttle, simulate_throttle
from mgdd.throttle.simulation import step_summary

if TYPE_CHECKING:
    import os

    import xarray as xr

LOG = Options(
    read_throttle_log, "time", "duty", "angle", "current", "supply", "time_unit", "duty_unit", "angle_unit",
    "travel_deg", "start_s", "stop_s", "sample_s", "delimiter", "decimal", "sheet",
)  # fmt: skip

_DEFAULT_PRESET = "P1"


def log_in(args: argparse.Namespace, file: str) -> xr.Dataset:
    """Read a log as the options of `LOG` say."""
    return read_throttle_log(file, **LOG.given(args))


def add_preset(group: Any) -> None:
    """Add the preset of a throttle."""
    what = f"{', '.join(presets.available('throttle'))}, a TOML file of one, or of a fit (default: {_DEFAULT_PRESET})"
    option(group, "--preset NAME_OR_FILE.toml", what)


def add_throttle(parser: argparse.ArgumentParser) -> None:
    """Add preset and fields; the names are those of the parameters."""
    group = parser.add_argument_group("throttle")
    add_preset(group)
    option(group, "--set FIELD=VALUE ...", "any field of the throttle, repeatable, for example coulomb_nm=0.3")


def plate_in(args: argparse.Namespace) -> tuple[Plate, str]:
    """Load what ``--preset`` names, a preset or a fit of `mgdd throttle identify`, with the fields of ``--set``."""
    given = args.preset or _DEFAULT_PRESET
    plate = plate_of(given)
    changes = changes_of(args, Throttle.fields()) if "set" in args else {}
    if isinstance(plate.plant, Throttle) and plate.model is None:
        return replace(plate, plant=plate.plant.replace(**changes)), presets.load(given).name
    if changes:
        raise ParameterError.of("--set", args.set, "left out with a fit: it goes with a preset")
    return plate, Path(given).stem


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


def _add_demand(parser: Any) -> None:
    option(parser, "--pedal-percent X", "pedal, 0 to 100", required=True)
    option(parser, "--speed-rpm X", "engine speed", required=True)
    group = parser.add_argument_group("chain")
    option(group, "--chain FILE.toml", "parameters of the chain (default: an engine of 2 L)")
    option(group, "--set FIELD=VALUE ...", "any field of the chain, repeatable, for example bore_mm=52")


def _demand(args: argparse.Namespace) -> None:
    chain = DemandChain() if args.chain is None else DemandChain.of_file(ParameterFile.read(args.chain))
    fields = {name: field for name, field in DemandChain.fields().items() if name != "pedal_map"}
    chain = chain.replace(**changes_of(args, fields))
    steady = chain.steady(args.pedal_percent, args.speed_rpm).isel(pedal_percent=0, speed_rpm=0)
    numbers = {str(name): float(steady[name]) for name in steady.data_vars}
    payload = {
        "pedal_percent": args.pedal_percent,
        "speed_rpm": args.speed_rpm,
        **numbers,
        "area_mm2": float(chain.area_mm2(numbers["opening_deg"])),
        "filling_time_s": float(chain.filling_time_s(args.speed_rpm)),
        "reachable": numbers["pressure_kpa"] < chain.ambient_kpa,
        "parameters": {name: value for name, value in chain.to_dict().items() if name != "pedal_map"},
    }
    emit(args, payload)


_TIME = Options(simulate_throttle, "duration_s", "sample_s")
_SIGNALS = Options(simulate_throttle, "supply_v", "airflow_torque_nm")  # columns of the input beside time and duty, too
_RUN = Options(simulate_throttle, "start_deg", "bridge", "step_s")


def _add_simulate(parser: Any) -> None:
    signal = parser.add_mutually_exclusive_group(required=True)
    option(signal, "--duty X", "constant duty, -1 to 1; positive opens")
    option(signal, "--input FILE.csv", "columns time_s and duty, evenly sampled; supply_v, airflow_torque_nm if there")
    group = parser.add_argument_group("run")
    _TIME.add(group)
    _SIGNALS.add(group)
    _RUN.add(group)
    option(parser, "--figure FILE", "draw the run (.png, .svg or .pdf)")
    add_throttle(parser)


def _simulate(args: argparse.Namespace) -> None:
    plate, preset = plate_in(args)
    meant = model_of(plate)
    timed, signals = _TIME.given(args), _SIGNALS.given(args)
    if args.input is None:
        given = {"duty": args.duty, **timed, **signals}
    elif timed:
        raise ParameterError(f"{as_option(next(iter(timed)))} goes with --duty: the times of --input are its own")
    else:
        given = read_duty(args.input, signals)
    run = simulate_throttle(meant, **given, **_RUN.given(args))
    physical = isinstance(meant, Throttle)
    payload = {
        "preset": preset,
        "duty": args.duty,
        "bridge": _RUN.of(args)["bridge"],
        **step_summary(run),
        **({"max_current_a": float(np.abs(run["current_a"]).max())} if physical else {}),
        "duration_s": float(run["time_s"][-1] - run["time_s"][0]),
        "samples": run.sizes["time_s"],
        **({"step_s": _RUN.of(args)["step_s"]} if physical else {}),
        "parameters": meant.to_dict() if isinstance(meant, Throttle) else dict(meant.parameters),
    }
    emit(args, payload, traces=run, figure=partial(drawn, throttle_run, run, size=(7.0, 5.4)))


COMMANDS = {"simulate": (_add_simulate, _simulate), "demand": (_add_demand, _demand)}


_OPTIONAL = ("supply_v", "airflow_torque_nm")


def read_duty(path: str | os.PathLike[str], given: Mapping[str, float]) -> dict[str, Any]:
    """Read what `mgdd.throttle.simulate_throttle` takes: ``time_s``, ``duty``, and other signals that the file has.

    A column of a `given` constant contradicts it.
    """
    table = read_table(path)
    header = table.header
    if header is None:
        raise DataError(f"{path}: no header: name the columns, at least time_s,duty")
    table.require_units_of_names()
    for name in given:
        if name in header:
            raise ParameterError(f"{argument(name)} and the column {name} of {path} contradict each other: give one")
    names = ("time_s", "duty", *(name for name in _OPTIONAL if name in header))
    out: dict[str, Any] = {name: table.numbers(table.index(name)) for name in names}
    place = Place(table.source, table.lines)
    even_step(out["time_s"], where=lambda at: place.cell(at, "time_s"), remedy="resample the duty first")
    duty, supply = out["duty"], out.get("supply_v", np.zeros(1))
    if np.abs(duty).max() > 1.0:
        at = int(np.argmax(np.abs(duty) > 1.0))
        raise DataError(
            f"{place.cell(at, 'duty')}: duty = {duty[at]:g}: must be in [-1, 1]; a duty in percent is divided by 100"
        )
    if supply.min() < 0.0:
        at = int(np.argmax(supply < 0.0))
        raise DataError(f"{place.cell(at, 'supply_v')}: supply_v = {supply[at]:g} V: must be >= 0")
    return out | dict(given)
