"""Inputs by name, how they may be given and what their units are, and results with numbers per input."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core.optimize import Input
from mgdd.errors import ParameterError, ShapeError
from mgdd.results.describe import Row, rows_of
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import NumbersResult
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr


def inputs_of(inputs: Any) -> tuple[Input, ...]:
    """Read inputs in either form: `Input` objects, or bounds by name."""
    if inputs is None:
        return ()
    if isinstance(inputs, Mapping):
        out = list[Input]()
        for name, bounds in inputs.items():
            if isinstance(bounds, Input):
                if bounds.name != name:
                    raise ParameterError(f"inputs: {name!r} is called {bounds.name!r} in its Input: name it alike")
                out.append(bounds)
                continue
            numbers = tuple(bounds) if isinstance(bounds, Sequence) and not isinstance(bounds, str) else ()
            plain = all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers)
            if len(numbers) not in (2, 3) or not plain:
                raise ParameterError(
                    f"inputs: {name} = {bounds!r}: must be (lower, upper) or (lower, upper, step), numbers, or an Input"
                )
            lower, upper, step = (*map(float, numbers), 0.0)[:3]
            out.append(Input(str(name), lower, upper, step=step))
        return tuple(out)
    if isinstance(inputs, Sequence) and all(isinstance(one, Input) for one in inputs):
        names = [one.name for one in inputs]
        if len(set(names)) < len(names):
            raise ParameterError(f"inputs: {', '.join(names)}: each name once")
        return tuple(inputs)
    raise ParameterError(
        f"inputs = {inputs!r}: must map names to bounds, for example {{'soc_cad': (-20.0, 5.0)}}, or be Input objects"
    )


def bounds_pair(bounds: Any, names: Sequence[str] = ()) -> tuple[Any, Any]:
    """Give both sides of bounds, each a number or one per parameter, of pairs by name too; None is no bound."""
    if isinstance(bounds, Mapping):
        bounds = tuple(zip(*named_values("bounds", bounds, names), strict=True))
    given = (None, None) if bounds is None else bounds
    if isinstance(given, str) or not hasattr(given, "__len__") or len(given) != 2:
        raise ParameterError.of("bounds", bounds, "a pair (lower, upper), each a number or one per parameter")
    low, high = given
    return -math.inf if low is None else low, math.inf if high is None else high


def named_values(argument: str, values: Any, names: Sequence[str]) -> Any:
    """Put numbers by name into the order of the inputs; anything that is not a mapping stays as it is."""
    if not isinstance(values, Mapping):
        return values
    if not names:
        raise ParameterError(f"{argument} = {dict(values)!r}: names need `inputs`, which say what they are")
    if set(values) != set(names):
        raise ShapeError(
            f"{argument} has {', '.join(map(str, values))}: must have one number for each of {', '.join(names)}"
        )
    return [values[name] for name in names]


def with_inputs(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Give the settings of a seeker with inputs as `Input` objects, and with numbers in their order."""
    inputs = inputs_of(settings.get("inputs"))
    names = [one.name for one in inputs]
    own = {
        name: value if name in ("guide", "limit_guides") else named_values(name, value, names)  # no numbers
        for name, value in settings.items()
    }
    return {**own, "inputs": list(inputs)}


def by_name_or_number(function: Callable[..., Any], inputs: Mapping[str, float]) -> tuple[Any, bool]:
    """Call a function with its inputs by name, else as plain numbers, and say whether it took numbers."""
    try:
        return function(inputs), False
    except TypeError:
        with contextlib.suppress(TypeError):
            return function(*inputs.values()), True
        raise


def unit_of_input(given: Input) -> str:
    """Return the unit of an input: its own, else what its name says."""
    return given.unit or unit_of(given.name)


SEVERAL_ONLY = {"several": True}  # metadata of a field that is not shown while it is None or empty
_AXES = {1: ("input",), 2: ("input", "with_input")}


class InputNumbers(NumbersResult):
    """A record of numbers, some of them per input; `inputs` holds the names, where inputs have names."""

    inputs: tuple[str, ...]

    def _own(self) -> dict[str, Any]:
        return {
            own.name: getattr(self, own.name)
            for own in dataclasses.fields(self)  # type: ignore[arg-type]
            if not (own.metadata.get("several") and _says_nothing(getattr(self, own.name)))
        }

    def _rows(self) -> list[Row]:
        return rows_of({name: _written(value) for name, value in self._own().items()}, self._units)

    @property
    def dataset(self) -> xr.Dataset:
        """The numbers as variables, those per input over `input`, the texts as attributes."""
        plain = super().dataset
        over = {name: value for name, value in self._own().items() if isinstance(value, np.ndarray)}
        if not over:
            return plain
        count = len(next(iter(over.values())))
        names = np.array(self.inputs) if self.inputs else np.arange(count)
        which = "name of the input" if self.inputs else "index of the input"
        axes = sorted({axis for value in over.values() for axis in _AXES[value.ndim]})
        columns: dict[str, Any] = {axis: (axis, names, "-", which) for axis in axes}
        columns |= {name: (_AXES[value.ndim], value, *self._label(name)) for name, value in over.items()}
        return plain.assign(labelled_dataset(columns).variables)

    def _key(self) -> tuple[Any, ...]:
        own = [getattr(self, each.name) for each in dataclasses.fields(self)]  # type: ignore[arg-type]
        return tuple((one.shape, *one.ravel().tolist()) if isinstance(one, np.ndarray) else one for one in own)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, InputNumbers) and type(other) is type(self) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())


def _says_nothing(value: Any) -> bool:
    return value is None or (isinstance(value, tuple) and not value)


def _written(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.array2string(value, precision=6, separator=", ").replace("\n", "")
    return value
