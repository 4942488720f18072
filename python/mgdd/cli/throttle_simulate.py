"""`mgdd throttle simulate`: the plant under a constant duty, or under that of a file."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from mgdd.cli.options import add_command, as_option
from mgdd.cli.output import check_figure, check_output, emit, save_figure
from mgdd.cli.throttle_parameters import add_throttle, throttle_of
from mgdd.errors import DataError, ParameterError
from mgdd.io.table import Place, read_table
from mgdd.plot.style import drawn
from mgdd.signals.even_grid import even_step
from mgdd.throttle import simulate_throttle
from mgdd.throttle.simulation import step_summary

__all__ = ["add"]

# Columns of the input beside time and duty, and the option of the same meaning.
_SIGNALS = {"supply_v": "--supply-v", "airflow_torque_nm": "--airflow-torque-nm"}


def add(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "simulate", _simulate,
        help_text="simulate a throttle from rest and print the summary of its step; -o FILE.csv writes the run",
        example="mgdd throttle simulate --preset P1 --duty 0.6 --duration-s 0.3 --json",
        endings=".json or .csv",
    )  # fmt: skip
    signal = parser.add_mutually_exclusive_group(required=True)
    signal.add_argument("--duty", type=float, metavar="X", help="constant duty, -1 to 1; positive opens")
    signal.add_argument(
        "--input",
        metavar="FILE.csv",
        help="columns time_s and duty, evenly sampled; supply_v, airflow_torque_nm if there",
    )
    group = parser.add_argument_group("run")
    group.add_argument("--start-deg", type=float, metavar="X", help="angle at the start (default: limp-home)")
    group.add_argument("--duration-s", type=float, metavar="X", help="length with --duty (default: 1)")
    group.add_argument("--sample-s", type=float, metavar="X", help="time between samples with --duty (default: 0.001)")
    group.add_argument(
        "--bridge", choices=("brake", "open"), default="brake", help="at zero duty: short the motor, or let go of it"
    )
    group.add_argument("--supply-v", type=float, metavar="X", help="supply (default: that of the throttle)")
    group.add_argument(
        "--airflow-torque-nm", type=float, metavar="X", help="torque on the plate, positive opens (default: 0)"
    )
    group.add_argument(
        "--step-s", type=float, default=1e-4, metavar="X", help="integration step, 1e-6 to 5e-3 (default: 0.0001)"
    )
    parser.add_argument("--figure", metavar="FILE", help="draw the run (.png, .svg or .pdf)")
    add_throttle(parser)


def _simulate(args: argparse.Namespace) -> None:
    check_output(args, ".json", ".csv")
    check_figure(args.figure)
    throttle, preset = throttle_of(args)
    run = simulate_throttle(
        throttle,
        **(_constant(args) if args.input is None else _from_file(args)),
        start_deg=args.start_deg,
        bridge=args.bridge,
        step_s=args.step_s,
    )
    payload = {
        "preset": preset,
        "duty": args.duty,
        "bridge": args.bridge,
        **step_summary(run),
        "max_current_a": float(np.abs(run["current_a"]).max()),
        "duration_s": float(run["time_s"][-1] - run["time_s"][0]),
        "samples": run.sizes["time_s"],
        "step_s": args.step_s,
        "parameters": throttle.to_dict(),
    }
    if args.figure is not None:
        from mgdd.plot.throttle_run import throttle_run

        save_figure(drawn(throttle_run, run, size=(7.0, 5.4)), args.figure)
    emit(args, payload, traces=run)


def _constant(args: argparse.Namespace) -> dict[str, Any]:
    given = {"duration_s": args.duration_s, "sample_s": args.sample_s}
    given |= {name: getattr(args, name) for name in _SIGNALS}
    return {"duty": args.duty, **{name: value for name, value in given.items() if value is not None}}


def _from_file(args: argparse.Namespace) -> dict[str, Any]:
    for name in ("duration_s", "sample_s"):
        if getattr(args, name) is not None:
            raise ParameterError(f"{as_option(name)} goes with --duty: the times of --input are its own")
    table = read_table(args.input)
    header = table.header
    if header is None:
        raise DataError(f"{args.input}: no header: name the columns, at least time_s,duty")
    table.require_units_of_names()
    out: dict[str, Any] = {name: table.numbers(table.index(name)) for name in ("time_s", "duty")}
    for name, option in _SIGNALS.items():
        value = getattr(args, name)
        if value is not None and name in header:
            raise ParameterError(f"{option} and the column {name} of {args.input} contradict each other: give one")
        if value is not None:
            out[name] = value
        elif name in header:
            out[name] = table.numbers(table.index(name))
    _check_rows(out, Place(table.source, table.lines))
    return out


def _check_rows(columns: dict[str, Any], place: Place) -> None:
    """Refuse by line of the file what the simulation would refuse by sample."""
    even_step(columns["time_s"], where=lambda at: place.cell(at, "time_s"), remedy="resample the duty first")
    duty = columns["duty"]
    if np.abs(duty).max() > 1.0:
        at = int(np.argmax(np.abs(duty) > 1.0))
        raise DataError(
            f"{place.cell(at, 'duty')}: duty = {duty[at]:g}: must be in [-1, 1]; a duty in percent is divided by 100"
        )
    supply = np.asarray(columns.get("supply_v", 0.0))
    if supply.ndim and supply.min() < 0.0:
        at = int(np.argmax(supply < 0.0))
        raise DataError(f"{place.cell(at, 'supply_v')}: supply_v = {supply[at]:g} V: must be >= 0")
