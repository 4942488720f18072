"""A Python function of inputs by name, as a plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any

from mgdd.errors import DataError
from mgdd.loop.plant import Measurement, checked_inputs

__all__ = ["FunctionPlant"]

_FORMS = "return J, or (J, {limit: value}), or None for a failed cycle"


class FunctionPlant:
    """A function that takes inputs by name and gives J, or J and limits by name, or None for a failed cycle.

    Parameters
    ----------
    function : callable
        ``function({"soc_cad": -6.0}) -> J``, or ``-> (J, {"p_max_bar": 96.0})``.
    inputs : sequence of str
        Names of the inputs.
    limits : sequence of str
        Names of the limits that it has to give.
    values : sequence of str
        Names of quantities that it gives instead of J, in one mapping together with the limits.

    Examples
    --------
    >>> from mgdd.loop.function_plant import FunctionPlant
    >>> plant = FunctionPlant(lambda x: 56.0 - 0.03 * x["soc_cad"] ** 2, ["soc_cad"])
    >>> plant.apply({"soc_cad": -10.0})
    >>> plant.measure().performance
    53.0
    """

    def __init__(
        self,
        function: Callable[[Any], Any],
        inputs: Sequence[str],
        limits: Sequence[str] = (),
        *,
        values: Sequence[str] = (),
    ) -> None:
        self._function, self._values = function, tuple(values)
        self.input_names, self.limit_names = tuple(inputs), tuple(limits)
        self._applied = dict[str, float]()

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next call."""
        self._applied = dict(zip(self.input_names, checked_inputs(inputs, self.input_names), strict=True))

    def measure(self) -> Measurement:
        """Call the function; DataError for an answer that is not one."""
        answer = self._function(dict(self._applied))
        if answer is None:
            return Measurement(components=(math.nan,), limits=dict.fromkeys(self.limit_names, math.nan), misfire=True)
        if self._values:
            return self._named(answer)
        j, limits = answer if isinstance(answer, tuple) and len(answer) == 2 else (answer, {})
        number = self._number("J", j)
        if not isinstance(limits, Mapping) or set(self.limit_names) - set(limits):
            gave = ", ".join(map(str, limits)) if isinstance(limits, Mapping) else repr(limits)
            raise DataError(
                f"limits = {gave or 'none'}{self._where()}: must name {', '.join(self.limit_names) or 'none'}; {_FORMS}"
            )
        return Measurement(
            components=(number,),
            limits={name: self._number(name, limits[name]) for name in self.limit_names},
        )

    def _named(self, answer: Any) -> Measurement:
        wanted = (*self._values, *self.limit_names)
        if not isinstance(answer, Mapping) or set(wanted) - set(answer):
            raise DataError(f"function gave {answer!r}{self._where()}: must map {', '.join(wanted)} to numbers")
        numbers = {name: self._number(name, answer[name]) for name in wanted}
        return Measurement(values=numbers, limits={name: numbers[name] for name in self.limit_names})

    def _number(self, name: str, value: Any) -> float:
        number = getattr(value, "item", lambda: value)() if getattr(value, "ndim", 1) == 0 else value
        if not isinstance(number, Real) or not math.isfinite(number):
            raise DataError(f"{name} = {value!r}{self._where()}: must be a finite number; {_FORMS}")
        return float(number)

    def _where(self) -> str:
        return " at " + ", ".join(f"{name} = {value:.6g}" for name, value in self._applied.items())
