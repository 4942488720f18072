"""The cases of a sweep: which inputs vary, and over what."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd._arguments import shown
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.errors import ParameterError, ShapeError, argument, did_you_mean
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
    """Return the rank of an input in a grid: the higher, the less of a cycle has to be computed anew by a change."""
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


POINT = "point"


class Cases:
    """Inputs by name, over a grid with one dimension per input, or over `POINT`.

    The cases of a grid are numbered with the timing fastest, then the burn, and the geometry slowest: cycles in a row
    share then what the kernel computes once for an operating point. `arranged` brings results into the given order.
    """

    def __init__(self, inputs: Mapping[str, NDArray[np.float64]], numbers: NDArray[Any] | None) -> None:
        self.inputs, self._numbers = dict(inputs), numbers
        self.names = list(inputs)
        self.shape = tuple(map(len, inputs.values())) if numbers is None else (len(numbers),)
        self.dims = tuple(inputs) if numbers is None else (POINT,)
        self.n = math.prod(self.shape)
        axes = range(len(self.shape))
        self._order = sorted(axes, key=lambda axis: rank_of(self.dims[axis])) if numbers is None else list(axes)
        self._sizes = tuple(self.shape[axis] for axis in self._order)

    def columns(self, start: int, stop: int) -> NDArray[np.float64]:
        """Spell out the cases from `start` to `stop` (exclusive), shape (cases, inputs)."""
        return self.rows(np.arange(start, stop))

    def rows(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Spell out some cases, shape (cases, inputs)."""
        out = np.empty((len(numbers), len(self.names)))
        columns = list(self.inputs.values())
        if self._numbers is not None:
            for column, values in enumerate(columns):
                out[:, column] = values[numbers]
            return out
        for column, place in zip(self._order, np.unravel_index(numbers, self._sizes), strict=True):
            out[:, column] = columns[column][place]
        return out

    def arranged(self, array: NDArray[Any]) -> NDArray[Any]:
        """Give results by number of the case the dimensions `dims`, as a view."""
        more = array.shape[1:]
        back = np.argsort(self._order).tolist()
        return array.reshape(*self._sizes, *more).transpose(*back, *range(len(back), len(back) + len(more)))

    def extremes(self) -> NDArray[np.int64]:
        """Find the cases with the least and the greatest value of each input, the others of a grid at their first."""
        lowest_highest = [(int(values.argmin()), int(values.argmax())) for values in self.inputs.values()]
        if self._numbers is not None:
            return np.unique(np.array(lowest_highest))
        strides = [math.prod(self._sizes[self._order.index(axis) + 1 :]) for axis in range(len(self.shape))]
        return np.unique(
            [place * stride for pair, stride in zip(lowest_highest, strides, strict=True) for place in pair]
        )

    def coordinates(self) -> dict[str, tuple[Any, ...]]:
        """Give the coordinates as `labelled_dataset` takes them."""
        variables: dict[str, tuple[Any, ...]] = {}
        if self._numbers is not None:
            variables[POINT] = (POINT, self._numbers, "-", "number of the point")
        for name, values in self.inputs.items():
            variables[name] = (name if self._numbers is None else POINT, values, *input_labels()[name])
        return variables


def cases_of(over: Any, *, pointwise: bool) -> Cases:
    """Read what a sweep goes over: a mapping of axes, or with `pointwise` of columns, or a Dataset over `POINT`."""
    numbers = None
    if hasattr(over, "data_vars"):
        if tuple(over.sizes) != (POINT,):
            raise ShapeError(f"over: a Dataset must be over {POINT!r} alone, this one has {dict(over.sizes)}")
        numbers = np.asarray(over[POINT].to_numpy()) if POINT in over.coords else None
        pointwise, over = True, over.data_vars
    if not hasattr(over, "keys") or not len(list(over.keys())):
        raise ParameterError.of(
            "over",
            shown(over),
            "a mapping of at least one input to its values, as {'soc_cad': [-10.0, -5.0]}, or a design",
        )
    inputs = {str(name): _values(str(name), over[name]) for name in over.keys()}  # noqa: SIM118 - a DataFrame too
    if not pointwise:
        for name, values in inputs.items():
            entries, counts = np.unique(values, return_counts=True)
            if (counts > 1).any():
                raise ParameterError.of(
                    name, float(entries[counts > 1][0]), "on the axis once; it is given several times"
                )
        return Cases(inputs, None)
    lengths = {name: len(values) for name, values in inputs.items()}
    if len(set(lengths.values())) > 1:
        raise ShapeError(f"over: points need columns of one length, these have {lengths}; a grid is without pointwise")
    return Cases(inputs, np.arange(next(iter(lengths.values()))) if numbers is None else numbers)


def _values(name: str, given: Any) -> NDArray[np.float64]:
    require_input(name)
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError.of(name, shown(given), "a sequence of numbers") from None
    if values.ndim != 1 or not values.size:
        remedy = "; a single value belongs into the cylinder, the point or soc_cad" if values.ndim == 0 else ""
        raise ParameterError.of(name, shown(given), f"a sequence of at least one number{remedy}")
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise ParameterError.of(f"{name}[{bad[0]}]", float(values[bad[0]]), "finite")
    return values
