"""Limits of a search: lower ones, as upper ones of the negated quantity ``-NAME``, and where it begins under them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from mgdd.errors import ParameterError, argument
from mgdd.loop.plant import AnnouncingPlant, Measurement, Plant
from mgdd.optimize import Input, Limit
from mgdd.optimize.optimum import limits_of

_LOWER = "-"


def both_sides(limits: Any) -> tuple[Limit, ...]:
    """Read limits as `limits_of` does, and pairs (lower, upper) by name, of which one may be None or infinite."""
    if not isinstance(limits, Mapping):
        return limits_of(limits)
    sides = dict[str, Any]()
    for name, value in limits.items():
        if not isinstance(value, Sequence) or isinstance(value, str):
            sides[name] = value
            continue
        low, high = (
            (None if each in (-math.inf, math.inf) else each for each in value) if len(value) == 2 else (None, None)
        )
        if not (-math.inf if low is None else low) < (math.inf if high is None else high) or low is high is None:
            raise ParameterError(
                f"{argument('limits')}: {name} = {value!r}: must be (lower, upper), lower < upper, one may be None"
            )
        sides |= {} if low is None else {f"{_LOWER}{name}": -low}
        sides |= {} if high is None else {name: high}
    return limits_of(sides)


def limits_by_name(limits: Sequence[Limit]) -> dict[str, tuple[float | None, float | None]]:
    """Give the pairs (lower, upper) that `both_sides` makes these of, margins taken off."""
    pairs = dict[str, tuple[float | None, float | None]]()
    for limit in limits:
        name, side = plain_name(limit.name)
        low, high = pairs.get(name, (None, None))
        bound = side * (limit.upper - limit.margin)
        pairs[name] = (low, bound) if side > 0.0 else (bound, high)
    return pairs


def plain_name(name: str) -> tuple[str, float]:
    """Give the quantity of a limit, and the sign by which it was taken."""
    return (name[1:], -1.0) if name.startswith(_LOWER) else (name, 1.0)


def measured_names(limits: Sequence[Limit]) -> list[str]:
    """Give the quantities that a plant has to measure."""
    return list(dict.fromkeys(plain_name(limit.name)[0] for limit in limits))


def with_lower_sides(plant: Plant, limits: Sequence[Limit]) -> Plant:
    """Let a plant measure the negated quantities as well; the same plant where none is needed."""
    lower = tuple(limit.name for limit in limits if limit.name.startswith(_LOWER))
    if not lower:
        return plant
    return (_AnnouncingTwoSided if isinstance(plant, AnnouncingPlant) else _TwoSided)(plant, lower)


class _TwoSided:
    def __init__(self, plant: Any, lower: tuple[str, ...]) -> None:
        self._plant, self._lower = plant, lower
        self.input_names = tuple(plant.input_names)
        self.limit_names = (*plant.limit_names, *lower)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._plant, name)  # as its operating point

    def apply(self, inputs: Mapping[str, float]) -> None:
        self._plant.apply(inputs)

    def measure(self) -> Measurement:
        measured: Measurement = self._plant.measure()
        free = measured.noise_free_limits
        return replace(
            measured, limits={**measured.limits, **self._negated(measured.limits)},
            noise_free_limits={**free, **self._negated(free)},
        )  # fmt: skip

    def _negated(self, values: Mapping[str, float]) -> dict[str, float]:
        return {name: -values.get(plain_name(name)[0], math.nan) for name in self._lower} if values else {}


class _AnnouncingTwoSided(_TwoSided):
    @property
    def operating_point_changes(self) -> bool:
        return bool(self._plant.operating_point_changes)


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
