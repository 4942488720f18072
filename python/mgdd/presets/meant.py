"""The one gate for a cylinder, an operating point or a throttle: a preset, its name or file, a fit, or the object."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import Any, Literal

from mgdd._arguments import shown
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd._core.throttle import Throttle
from mgdd.errors import ParameterError, argument
from mgdd.presets.preset import Preset, available, load
from mgdd.results import Fit

CylinderLike = str | os.PathLike[str] | Preset | Cylinder | Fit
PointLike = str | os.PathLike[str] | Preset | OperatingPoint | Mapping[str, float]
ThrottleLike = str | os.PathLike[str] | Preset | Throttle


def cylinder_of(given: Any) -> Cylinder:
    """Return the cylinder that is meant by one, a preset of an engine, its name, its ``.toml`` file, or a fit."""
    meant = _loaded(given, "engine")
    if isinstance(meant, Preset):
        return meant.cylinder
    meant = getattr(meant, "model", meant)  # of a fit
    if isinstance(meant, Cylinder):
        return meant
    raise _refusal("cylinder", given, "a Cylinder", "engine")


def point_of(given: Any, nominal: OperatingPoint | None = None) -> OperatingPoint | None:
    """Return the operating point that is meant, None for None; numbers by name replace those of a nominal one."""
    meant = _loaded(given, "engine")
    if meant is None or isinstance(meant, OperatingPoint):
        return meant
    if isinstance(meant, Preset):
        return meant.point
    if isinstance(meant, Mapping):
        return (nominal or OperatingPoint()).replace(**meant)
    bound = "an OperatingPoint, a preset or its name, or numbers by name, as {'speed_rpm': 1200.0}"
    raise ParameterError(f"point = {shown(given)}: must be {bound}", field="point", value=given, bound=bound)


def stated(name: str, keyword: float | None, point: Any) -> float | None:
    """Return what a caller states of this record, by keyword or by name in its point; None where neither does."""
    named = point.get(name) if isinstance(point, Mapping) else None
    if named is None or keyword is None or float(keyword) == float(named):
        return keyword if named is None else float(named)
    raise ParameterError(
        f"{name} = {keyword:g} and point['{name}'] = {named:g} contradict each other: give one",
        field=name, value=keyword, bound=f"{named:g}, as the point states",
    )  # fmt: skip


def engine_of(cylinder: Any, point: Any = None, **fields: float | None) -> tuple[Cylinder, OperatingPoint]:
    """Return the cylinder and the operating point that are meant; numbers by name replace those of the nominal one."""
    meant = _loaded(cylinder, "engine")
    engine, nominal = cylinder_of(meant), meant.point if isinstance(meant, Preset) else OperatingPoint()
    changes = {name: value for name, value in fields.items() if value is not None}
    for name, value in changes.items():
        stated(name, value, point)
    point = point_of(point, nominal)
    if point is None and not changes and not isinstance(meant, Preset):
        raise TypeError(
            "point is missing: a Cylinder has no operating point of its own; give an OperatingPoint, or numbers by "
            "name as {'speed_rpm': 1200.0}, or a preset instead of the Cylinder"
        )
    whole = nominal if point is None else point
    return engine, whole.replace(**changes) if changes else whole


def throttle_of(given: Any, needed: str = "a Throttle") -> Throttle:
    """Return the throttle that is meant by one, a preset of one, its name, or its ``.toml`` file."""
    meant = _loaded(given, "throttle")
    if isinstance(meant, Preset):
        return meant.throttle
    if isinstance(meant, Throttle):
        return meant
    raise _refusal("throttle", given, needed, "throttle")


# Of a fit of duty and angle: they do not show how strong the motor is and how heavy the plate.
_OF_NO_MATTER = {"resistance_ohm": 1.0, "supply_v": 12.0, "inertia_kgm2": 2e-3}


def moving_throttle_of(given: Any) -> tuple[Throttle, Any]:
    """Return a throttle that moves as what is given, and the model that it was made of, None for a throttle itself."""
    meant = throttle_model_of(given)
    if hasattr(meant, "to_throttle"):
        return meant.to_throttle(**_OF_NO_MATTER), meant
    return throttle_of(meant, "a Throttle, a first-principle fit of one"), None


def unknown_to_a_fit(name: str, value: Any) -> ParameterError:
    """Return the refusal of what a fit of duty and angle says nothing of; its remedy serves Python and the shell."""
    way = "its model's to_throttle(...), or mgdd throttle identify --throttle FILE.toml, makes a throttle of it"
    return ParameterError.of(argument(name), value, f"left out with a fit, which knows duty and angle only; {way}")


def whole_delay_of(model: Any, sample_s: float) -> int | None:
    """Return the delay of a fitted model in seconds, to the nearest sample; None where it has none."""
    numbers: Mapping[str, float] = getattr(model, "parameters", {})
    if "delay_samples" not in numbers:
        return None
    own = numbers.get("sample_s", getattr(model, "sample_s", sample_s))
    return math.floor(numbers["delay_samples"] * own / sample_s + 0.5)


def throttle_model_of(given: Any) -> Any:
    """Return the throttle of a preset or of its name, the model of a fit, and everything else as it is."""
    meant = _loaded(given, "throttle")
    return meant.throttle if isinstance(meant, Preset) else getattr(meant, "model", meant)


def _loaded(given: Any, kind: str) -> Any:
    return load(given, kind=kind) if isinstance(given, str | os.PathLike) else given


def _refusal(argument: str, given: Any, needed: str, kind: str) -> ParameterError:
    bound = f"{needed}, a preset, or the name of one: {', '.join(available(kind))}"
    part = getattr(given, argument, None)
    remedy = f"; give its .{argument}" if isinstance(part, Cylinder | Throttle) else ""
    if kind == "throttle" and hasattr(getattr(given, "model", given), "to_throttle"):
        own = ".model" if hasattr(given, "model") else ""
        call = f"{own}.to_throttle(resistance_ohm=..., supply_v=..., torque_constant_nm_per_a=...)"
        remedy = f"; its {call} is one: what a log in duty and angle leaves open must be stated"
    return ParameterError(
        f"{argument} = {shown(given)}: must be {bound}{remedy}", field=argument, value=given, bound=bound
    )


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
