"""What can be swept: the timing and every number of cylinder and operating point, with unit and name."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from types import MappingProxyType

from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.errors import ParameterError, did_you_mean
from mgdd.results.labels import VARIABLES, Label

__all__ = ["case_of", "input_labels", "require_input"]

_TIMING = "soc_cad"


@functools.cache
def input_labels() -> Mapping[str, Label]:
    """Give unit and name of every input that takes a number."""
    labels = {_TIMING: VARIABLES[_TIMING]}
    for name, info in {**OperatingPoint.fields(), **Cylinder.fields()}.items():
        if "choices" not in info:
            labels[name] = VARIABLES.get(name) or Label(info["unit"], info["meaning"].partition("; none = ")[0])
    return MappingProxyType(labels)


def require_input(name: str) -> None:
    """Refuse a name that no input has, and one that takes no numbers."""
    if name in input_labels():
        return
    choices = Cylinder.fields().get(name, {}).get("choices")
    if choices:
        raise ParameterError.of(
            "over", name, f"an input that is a number; sweep once per choice ({', '.join(choices)}) and join the results "
            "with xarray.concat"
        )  # fmt: skip
    hint = did_you_mean(name, input_labels()) or "known are"
    raise ParameterError.of("over", name, f"a known input: {hint} {', '.join(input_labels())}")


def case_of(
    cylinder: Cylinder, point: OperatingPoint, soc_cad: float, values: Mapping[str, float]
) -> tuple[Cylinder, OperatingPoint, float]:
    """Make one case: cylinder, point and timing with some inputs changed."""
    at = {name: value for name, value in values.items() if name in OperatingPoint.fields()}
    of = {name: value for name, value in values.items() if name not in at and name != _TIMING}
    return (
        cylinder.replace(**of) if of else cylinder,
        point.replace(**at) if at else point,
        values.get(_TIMING, soc_cad),
    )
