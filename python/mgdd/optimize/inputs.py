"""Inputs by name: how they may be given, and what their units are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mgdd._core.optimize import Input
from mgdd.errors import ParameterError, ShapeError
from mgdd.results.units import unit_of


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


def unit_of_input(given: Input) -> str:
    """Return the unit of an input: its own, else what its name says."""
    return given.unit or unit_of(given.name)
