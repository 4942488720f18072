"""Where a search under limits begins when nobody says: on the side on which engines keep them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mgdd.loop.lower_limits import plain_name

if TYPE_CHECKING:
    from mgdd.optimize import Input, Limit

_TIMINGS = ("soc_cad", "soi_cad", "spark_cad")
_FALLS = ("p_max_", "dp_max_", "t_max_k", "nox_", "ringing_", "mapo_", "mean_noise_", "noise_level_")  # with it later
_RISES = ("t_evo_", "ca10_", "ca50_", "ca90_", "p_max_cad", "t_max_cad", "dp_max_cad")


def middle_of(inputs: Sequence[Input]) -> dict[str, float]:
    """Give the middle of the bounds."""
    return {one.name: 0.5 * (one.lower + one.upper) for one in inputs}


def safe_side(inputs: Sequence[Input], limits: Sequence[Limit]) -> dict[str, float]:
    """Give the bound of the timing at which the limits hold best; empty where their names do not say one side.

    Upper limits decide, which protect the engine; lower ones only where there are no others.
    """
    upper = [limit for limit in limits if plain_name(limit.name)[1] > 0.0]
    sides = {_side(limit.name) for limit in upper or limits}
    if len(sides) != 1 or 0.0 in sides:
        return {}
    late = sides.pop() > 0.0
    return {one.name: one.upper if late else one.lower for one in inputs if one.name in _TIMINGS}


def _side(limit: str) -> float:
    """Whether a later timing takes a quantity away from its limit, 1, or towards it, -1; 0 for who knows."""
    name, sign = plain_name(limit)
    return -sign if name.startswith(_RISES) else sign if name.startswith(_FALLS) else 0.0
