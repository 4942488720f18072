"""`mgdd throttle simulate`: the plant under a constant duty, or under that of a file."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from mgdd.cli.from_library import Options, as_option
from mgdd.cli.options import add_command
from mgdd.cli.output import check_figure, check_output, emit, save_figure
from mgdd.cli.throttle_parameters import add_throttle, throttle_of
from mgdd.errors import ParameterError
from mgdd.plot import throttle_run
from mgdd.plot.style import drawn
from mgdd.throttle import simulate_throttle
from mgdd.throttle.duty_file import read_duty
from mgdd.throttle.simulation import step_summary

__all__ = ["add"]

_TIME = Options(simulate_throttle, "duration_s", "sample_s")
_SIGNALS = Options(simulate_throttle, "supply_v", "airflow_torque_nm")  # columns of the input beside time and duty, too
_RUN = Options(simulate_throttle, "start_deg", "bridge", "step_s")


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
    _TIME.add(group)
    _SIGNALS.add(group)
    _RUN.add(group)
    parser.add_argument("--figure", metavar="FILE", help="draw the run (.png, .svg or .pdf)")
    add_throttle(parser)


def _simulate(args: argparse.Namespace) -> None:
    check_output(args, ".json", ".csv")
    check_figure(args.figure)
    throttle, preset = throttle_of(args)
    timed, signals = _TIME.given(args), _SIGNALS.given(args)
    if args.input is None:
        given = {"duty": args.duty, **timed, **signals}
    elif timed:
        raise ParameterError(f"{as_option(next(iter(timed)))} goes with --duty: the times of --input are its own")
    else:
        given = read_duty(args.input, signals)
    run = simulate_throttle(throttle, **given, **_RUN.given(args))
    payload = {
        "preset": preset,
        "duty": args.duty,
        "bridge": _RUN.of(args)["bridge"],
        **step_summary(run),
        "max_current_a": float(np.abs(run["current_a"]).max()),
        "duration_s": float(run["time_s"][-1] - run["time_s"][0]),
        "samples": run.sizes["time_s"],
        "step_s": _RUN.of(args)["step_s"],
        "parameters": throttle.to_dict(),
    }
    emit(args, payload, traces=run)
    if args.figure is not None:
        save_figure(drawn(throttle_run, run, size=(7.0, 5.4)), args.figure)
