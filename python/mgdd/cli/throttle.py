"""`mgdd throttle simulate | demand | excite | identify | validate | track | tune`, each in a module of its own."""

from __future__ import annotations

import argparse
from typing import Any

from mgdd.cli import throttle_excite, throttle_identify, throttle_simulate, throttle_track
from mgdd.cli.options import add_command, add_group
from mgdd.cli.output import check_output, emit
from mgdd.cli.throttle_parameters import changes_of
from mgdd.io.parameters import ParameterFile
from mgdd.throttle import DemandChain

__all__ = ["add"]


def add(commands: Any) -> None:
    """Add the group and its commands."""
    verbs = add_group(
        commands, "throttle",
        help_text="an electronic throttle: simulate, demand, excite, identify, validate, track, tune",
        example="mgdd throttle identify chirp.csv --model pw_r --test steps.csv --json",
    )  # fmt: skip
    throttle_simulate.add(verbs)
    _add_demand(verbs)
    throttle_excite.add(verbs)
    throttle_identify.add(verbs)
    throttle_track.add(verbs)


def _add_demand(verbs: Any) -> None:
    parser = add_command(
        verbs, "demand", _demand,
        help_text="steady torque, air flow, manifold pressure and opening that a pedal wants at a speed",
        example="mgdd throttle demand --pedal-percent 30 --speed-rpm 2000 --json",
    )  # fmt: skip
    parser.add_argument("--pedal-percent", type=float, required=True, metavar="X", help="pedal, 0 to 100")
    parser.add_argument("--speed-rpm", type=float, required=True, metavar="X", help="engine speed")
    group = parser.add_argument_group("chain")
    group.add_argument("--chain", metavar="FILE.toml", help="parameters of the chain (default: an engine of 2 L)")
    group.add_argument(
        "--set", action="append", default=[], metavar="FIELD=VALUE",
        help="any field of the chain, repeatable, for example bore_mm=52",
    )  # fmt: skip


def _demand(args: argparse.Namespace) -> None:
    check_output(args)
    chain = _chain(args)
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


def _chain(args: argparse.Namespace) -> DemandChain:
    chain = DemandChain() if args.chain is None else DemandChain.of_file(ParameterFile.read(args.chain))
    fields = {name: field for name, field in DemandChain.fields().items() if name != "pedal_map"}
    return chain.replace(**changes_of(args, fields))
