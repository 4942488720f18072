"""What can be swept: the timing and every number of cylinder and operating point, with unit and name."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from types import MappingProxyType

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.errors import ParameterError, argument, did_you_mean
from mgdd.results.labels import VARIABLES, Label

_TIMING = "soc_cad"
_REMARK = re.compile(r"[,;] (0|none) = .*")  # what a value stands for is not a name for an axis
_BURN = ("burn_", "wiebe_", "second_", "lower_heating_value")
_TABLES = tuple("ivc_cad evo_cad bore_mm stroke_mm connecting_rod_mm compression_ratio bowl_area_factor gamma".split())


@functools.cache
def input_labels() -> Mapping[str, Label]:
    """Give unit and name of every input that takes a number."""
    return MappingProxyType(
        {
            name: VARIABLES.get(name) or Label(unit, _REMARK.sub("", meaning))
            for name, (unit, meaning) in _core.engine.batch_inputs().items()
        }
    )


def rank_of(name: str) -> int:
    """Say where in a grid an input belongs: the higher, the less of a cycle has to be computed anew when it changes."""
    if name == _TIMING:
        return 3
    if name == "fuel_mg" or name.startswith(_BURN):
        return 2
    return 0 if name in _TABLES else 1


def require_input(name: str) -> None:
    """Refuse a name that no input has, and one that takes no numbers."""
    if name in input_labels():
        return
    choices = Cylinder.fields().get(name, {}).get("choices")
    if choices:
        raise ParameterError.of(
            argument("over"),
            name,
            f"an input that is a number; sweep once per choice ({', '.join(choices)}) and join the results with "
            "xarray.concat",
        )
    hint = did_you_mean(name, input_labels()) or "known are"
    raise ParameterError.of(argument("over"), name, f"a known input: {hint} {', '.join(input_labels())}")


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
