"""`mgdd engine check`: whether pressure files can be trusted."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import (
    GEOMETRY,
    PEGGING,
    add_command,
    add_engine,
    add_files,
    assumed_geometry,
    check_pegging,
    engine_of,
    point_given,
    readers_of,
)
from mgdd.cli.output import check_output, emit
from mgdd.engine import Trust, trust
from mgdd.engine.trust import Check
from mgdd.errors import DataError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["add_check"]

_STATED = Options(trust, "bmep_bar", "brake_torque_nm", n_cylinders="cylinders")


def add_check(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "check", _check,
        help_text="check whether pressure files can be trusted: each check with its verdict, the cause and the remedy",
        example="mgdd engine check monday/*.csv --preset hd_diesel_128x144",
        endings=".json",
    )  # fmt: skip
    add_files(parser, nargs="+")
    group = parser.add_argument_group("what is known of the record")
    PEGGING.add(group)
    _STATED.add(group)
    add_engine(parser)


def _check(args: argparse.Namespace) -> None:
    check_output(args, ".json")
    check_pegging(args)
    cylinder, point, preset = engine_of(args)
    given = PEGGING.given(args) | _STATED.given(args) | {"fuel_mg": point_given(args).get("fuel_mg")}
    assumed = assumed_geometry(args)

    def report(file: str, read: Callable[[], xr.Dataset]) -> Trust:
        try:
            return trust(read(), cylinder, point=point, assumed=assumed, **given)
        except DataError as error:
            return Trust(Path(file).name, (Check("file", "fail", str(error)),))

    reports = [report(file, read) for file, read in readers_of(args).items()]
    payload = {
        "preset": preset.name,
        "assumed": assumed,
        "engine": {name: getattr(cylinder, name) for name in GEOMETRY},
        "files": [
            {
                "file": each.file,
                "verdict": each.verdict,
                "checks_made": each.made,
                "checks": [vars(check) for check in each.checks],
                "warnings": [] if each.analysis is None else each.analysis.attrs["warnings"].splitlines(),
            }
            for each in reports
        ],
    }
    emit(args, payload, text="\n\n".join(each.summary() for each in reports))
