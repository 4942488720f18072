"""`mgdd throttle simulate | demand | excite | identify | validate | track | tune`, each in a module of its own."""

from __future__ import annotations

from typing import Any

from mgdd.cli import throttle_demand, throttle_excite, throttle_identify, throttle_simulate, throttle_track
from mgdd.cli.options import add_group

__all__ = ["add"]


def add(commands: Any) -> None:
    """Add the group and its commands."""
    verbs = add_group(
        commands, "throttle",
        help_text="an electronic throttle: simulate, demand, excite, identify, validate, track, tune",
        example="mgdd throttle identify chirp.csv --model pw_r --test steps.csv --json",
    )  # fmt: skip
    throttle_simulate.add(verbs)
    throttle_demand.add(verbs)
    throttle_excite.add(verbs)
    throttle_identify.add(verbs)
    throttle_track.add(verbs)
