"""`mgdd map`: the chain from the points of an experiment to a calibration map, a file per step."""

from __future__ import annotations

from typing import Any

from mgdd.cli.map_design import add_design
from mgdd.cli.map_export import add_export
from mgdd.cli.map_fit import add_fit
from mgdd.cli.map_optimize import add_optimize, add_smooth
from mgdd.cli.map_predict import add_predict
from mgdd.cli.map_show import add_diff, add_show
from mgdd.cli.map_trade_off import add_trade_off
from mgdd.cli.options import add_group

__all__ = ["add"]


def add(commands: Any) -> None:
    """Add the group and its commands."""
    verbs = add_group(
        commands, "map",
        help_text="calibration maps, from the points of an experiment to a DCM file (the table of mgdd engine seek "
        "--guide-map is another file: mgdd map export --guide-map writes it)",
        example="mgdd map design --over soc_cad=-16:4 --over fuel_mg=6:30 --points 32 -o design.csv",
    )  # fmt: skip
    add_design(verbs)
    add_fit(verbs)
    add_predict(verbs)
    add_optimize(verbs)
    add_smooth(verbs)
    add_show(verbs)
    add_diff(verbs)
    add_trade_off(verbs)
    add_export(verbs)
