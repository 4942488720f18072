"""Operating points as a guide sees them: numbers by name, and how far one lies from the last."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

from mgdd._core.engine import OperatingPoint
from mgdd.errors import ParameterError

NEW_POINT = 0.05  # relative change of any number that makes a new operating point, as of the engine bench
Change = Literal["same", "following", "new_point"]


def numbers_of(point: Any) -> dict[str, float]:
    """Give the numbers of an operating point by name."""
    if isinstance(point, OperatingPoint):
        return {name: float(value) for name, value in point.to_dict().items() if value is not None}
    try:
        if isinstance(point, Mapping):
            return {str(name): float(value) for name, value in point.items()}
        if isinstance(point, str):
            raise TypeError
        values = [float(point)] if isinstance(point, int | float) else [float(value) for value in point]
    except (TypeError, ValueError):
        raise ParameterError.of(
            "point", point, "an OperatingPoint, numbers by name, or a sequence of numbers"
        ) from None
    return {str(place): value for place, value in enumerate(values)}


def change_between(now: Mapping[str, float], before: Mapping[str, float] | None) -> Change:
    """Judge how far an operating point has moved: not at all, a little, or by more than 5 % in any number."""
    if before is None or set(now) != set(before):
        return "new_point"
    if dict(now) == dict(before):
        return "same"
    far = any(
        not math.isclose(now[name], before[name], rel_tol=0.0, abs_tol=NEW_POINT * abs(before[name])) for name in now
    )
    return "new_point" if far else "following"
