"""Results with numbers per input: plain numbers for one input, arrays in the order of the inputs for several."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.describe import Row, rows_of
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import NumbersResult

if TYPE_CHECKING:
    import xarray as xr

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
