"""What models with sampled inputs share: columns in, an even grid, a named state, a labelled run out."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from mgdd._arguments import as_floats, require_plain, shown
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.results.labels import VARIABLES, Label, labelled_dataset
from mgdd.signals.even_grid import even_step

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray


class RunInputs(NamedTuple):
    """What a free run is driven by: times [s], their step [s], the input columns, and the state at the first sample."""

    time_s: NDArray[np.float64]
    step_s: float
    columns: list[NDArray[np.float64]]
    state: list[float]


class SampledModel(ABC):
    """A model with sampled inputs: a kind gives names, labels and `_run`, and has `simulate` and `predict` of this."""

    input_names: tuple[str, ...]
    output_name: str
    state_names: tuple[str, ...] = ()
    observed_state: str | None = None  # the state that a measured output shows
    labels: ClassVar[Mapping[str, Label]] = MappingProxyType({})

    @property
    def output_names(self) -> tuple[str, ...]:
        """Outputs in the order of `_run`."""
        return (self.output_name,)

    @abstractmethod
    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        """Return the output on every sample, (n,), or (n, outputs) of several."""

    @abstractmethod
    def _rest(self) -> list[float]:
        """Return the state of a free run that is not given one."""

    def simulate(
        self, inputs: Any, *, initial_state: Mapping[str, float] | Sequence[float] | None = None
    ) -> xr.Dataset:
        """Run free.

        Parameters
        ----------
        inputs : Dataset, DataFrame, mapping of columns, DataArray, Series, or array_like, shape (n, columns)
            ``time_s`` [s], evenly spaced, and the inputs of the model; a DataArray or Series over ``time_s`` is the
            one input, the columns of an array are the time and the inputs in order. Sample k acts from ``time_s[k]`` to
            ``time_s[k + 1]``.
        initial_state : mapping of str to float, or sequence of float, optional
            State at the first sample, by name or in the order of `state_names`; what is left out is that of the model
            at rest.

        Returns
        -------
        xarray.Dataset
            Inputs and outputs over ``time_s``.

        Raises
        ------
        DataError
            A missing column, a value that is not finite, or times that are not even.
        ShapeError
            Columns of different length.
        ParameterError
            A state that the model does not have.
        """
        time, *columns = columns_of(inputs, ("time_s", *self.input_names))
        run = self._run(RunInputs(time, even_step(time), columns, self.state_of(initial_state)))
        outputs = zip(self.output_names, run.reshape(time.size, -1).T, strict=True)
        return self._labelled(time, {**dict(zip(self.input_names, columns, strict=True)), **dict(outputs)})

    def predict(self, record: Any, horizon: int) -> xr.Dataset:
        """Predict ahead: the measured output plus the change of the free run over the horizon.

        Parameters
        ----------
        record : Dataset, DataFrame, mapping of columns, or array_like, shape (n, columns)
            As `simulate` takes it, and the measured outputs as the last columns.
        horizon : int
            Samples ahead, at least 1.

        Returns
        -------
        xarray.Dataset
            The outputs over ``time_s`` from sample `horizon` on; entry k is predicted from the data up to sample k.

        Raises
        ------
        ParameterError
            A horizon that does not fit into the record.
        DataError, ShapeError
            As in `simulate`.
        """
        time, *measured = columns_of(record, ("time_s", *self.output_names))
        check_horizon(horizon, time.size)
        start = {} if self.observed_state is None else {self.observed_state: float(measured[0][0])}
        simulated, ahead = self.simulate(record, initial_state=start), {}
        for name, column in zip(self.output_names, measured, strict=True):
            run = simulated[name].to_numpy()
            ahead[name] = column[:-horizon] + run[horizon:] - run[:-horizon]
        return self._labelled(time[horizon:], ahead)

    def __getstate__(self) -> dict[str, Any]:
        return {key: dict(item) if isinstance(item, MappingProxyType) else item for key, item in vars(self).items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, MappingProxyType(value) if isinstance(value, dict) else value)

    def state_of(self, given: Mapping[str, float] | Sequence[float] | None) -> list[float]:
        """Return the whole state of a free run from what is given of it."""
        state = self._rest()
        if given is None:
            return state
        if not isinstance(given, Mapping):
            if len(given) != len(self.state_names):
                raise ShapeError(f"initial_state has {len(given)} values: must be {', '.join(self.state_names)}")
            given = dict(zip(self.state_names, given, strict=True))
        for name, value in given.items():
            if name not in self.state_names:
                raise ParameterError(
                    f"initial_state: {name!r} is not a state: must be one of {', '.join(self.state_names)}"
                )
            if not math.isfinite(value):
                raise ParameterError(f"initial_state: {name} = {value!r}: must be finite")
            state[self.state_names.index(name)] = float(value)
        return state

    def _labelled(self, time: NDArray[np.float64], columns: Mapping[str, NDArray[np.float64]]) -> xr.Dataset:
        named = {name: ("time_s", values, *self._label(name)) for name, values in columns.items()}
        return labelled_dataset({"time_s": ("time_s", time), **named}, attrs={"kind": str(getattr(self, "kind", ""))})

    def _label(self, name: str) -> Label:
        return self.labels[name] if name in self.labels else VARIABLES[name]


def columns_of(table: Any, names: Sequence[str], *, what: str = "inputs", least: int = 2) -> list[NDArray[np.float64]]:
    """Return columns of a Dataset, a DataFrame or a mapping, finite and of one length."""
    table, columns = table_of(table, names, what=what), []
    for name in names:
        if name not in table:
            have = ", ".join(map(str, getattr(table, "columns", table)))
            raise DataError(f"{what} have no {name}: needed are {', '.join(names)}; given are {have or 'none'}")
        require_plain(name, table[name])
        columns.append(as_floats(table[name]))
    shapes = [column.shape for column in columns]
    if columns[0].ndim != 1 or columns[0].size < least or set(shapes) != {shapes[0]}:
        raise ShapeError(f"{', '.join(names)} have shapes {shapes}: must be columns of one length >= {least}")
    for name, column in zip(names, columns, strict=True):
        if not np.isfinite(column).all():
            raise DataError(f"{name}: sample {int(np.argmin(np.isfinite(column)))} is not a finite number")
    return columns


def table_of(given: Any, names: Sequence[str], *, what: str) -> Any:
    """Return something that gives columns by name, of any form of a signal; the time is the first of `names`.

    The index of a DataFrame or Series that is named as it, or has no name and is not whole numbers, is that column; an
    array has its columns in the order of `names`.
    """
    table, time = getattr(given, "dataset", given), names[0]
    if isinstance(table, Mapping):
        return table
    timed = is_timed(table, time)
    if hasattr(table, "columns"):  # a DataFrame
        return table if time in table.columns or not timed else table.rename_axis(time).reset_index()
    column = str(getattr(table, "name", None) or "")
    column = column if column in names or len(names) < 2 else names[1]
    if hasattr(table, "coords"):
        return {**{str(name): table[name] for name in table.coords}, column: table}
    if timed:
        return {time: table.index, column: table}
    if getattr(table, "ndim", 0) == 2 and table.shape[1] == len(names):
        return dict(zip(names, np.asarray(table).T, strict=True))
    if isinstance(table, tuple | list) and len(table) == len(names) and all(np.ndim(each) == 1 for each in table):
        return dict(zip(names, table, strict=True))
    bound = f"a table with {', '.join(names)}, a DataArray or Series over {time}, or these columns as an array"
    raise ParameterError(f"{what} = {shown(given)}: must be {bound}", field=what, value=given, bound=bound)


def is_timed(given: Any, time: str = "time_s") -> bool:
    """Return whether a signal has its time: as a column, a coordinate or an index."""
    index: Any = getattr(given, "index", None)
    if hasattr(index, "dtype") and (index.name == time or (index.name is None and index.dtype.kind == "f")):
        return True
    names = getattr(given, "columns", getattr(given, "coords", given if isinstance(given, Mapping) else ()))
    return hasattr(given, "dataset") or time in names


def as_signal(given: Any, names: Sequence[str], *, what: str, optional: Sequence[str] = ()) -> xr.Dataset:
    """Return a Dataset over the first of the names of any form that `table_of` takes; a Dataset as it is."""
    table = table_of(given, names, what=what)
    if hasattr(table, "data_vars"):
        dataset: xr.Dataset = table
        return dataset
    columns = dict(zip(names, columns_of(table, names, what=what), strict=True))
    for name in optional:
        if name in table:
            (columns[name],) = columns_of(table, [name], what=what)
    return labelled_dataset({name: (names[0], column) for name, column in columns.items()})


def check_horizon(horizon: int, size: int) -> None:
    """Refuse a horizon that does not fit into a record."""
    if not 1 <= horizon < size:
        raise ParameterError.of("horizon", horizon, f"in [1, {size - 1}], below the samples of the record")
