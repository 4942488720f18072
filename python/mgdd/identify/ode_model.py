"""A model whose right-hand side is a Python function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd.errors import ParameterError, ShapeError
from mgdd.io.parameters import Entry, ParameterFile, Wanted, entries, wanted
from mgdd.results.describe import described
from mgdd.results.labels import VARIABLES, Label
from mgdd.results.units import unit_of
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import RunInputs, SampledModel

Derivative = Callable[[float, NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]
Output = Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]

_FUNCTIONS = ("derivative", "output")
_STATE = "unit of the state"


@described
@dataclass(frozen=True, kw_only=True)
class OdeModel(SampledModel):
    """An ordinary differential equation with its parameters, on fixed Runge-Kutta steps with the input held.

    Parameters
    ----------
    derivative : callable
        ``derivative(t, x, u, p)`` as in `fit_ode`.
    output : callable
        ``output(x, u, p)`` as in `fit_ode`.
    parameters : mapping of str to float
        Values in the order that `derivative` expects.
    initial_state : tuple of float
        State at the first sample of a free run that is not given one.
    substeps : int
        Equal Runge-Kutta steps per sample.
    input_names : tuple of str
        Columns that make up the input, in order.
    output_name : str
        Name of the output.

    Examples
    --------
    >>> from mgdd.identify import OdeModel
    >>> lag = OdeModel(
    ...     derivative=lambda t, x, u, p: (p[0] * u[0] - x) / p[1],
    ...     output=lambda x, u, p: x[0],
    ...     parameters={"gain": 2.0, "time_s": 0.5},
    ...     initial_state=(0.0,),
    ... )
    >>> lag.simulate({"time_s": [0.0, 0.1, 0.2], "u": [1.0, 1.0, 1.0]})["y"].values.round(4).tolist()
    [0.0, 0.3625, 0.6594]
    """

    kind = "ode"

    derivative: Derivative
    output: Output
    parameters: Mapping[str, float]
    initial_state: tuple[float, ...]
    substeps: int = 1
    input_names: tuple[str, ...] = ("u",)
    output_name: str = "y"

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "state_names", tuple(f"state_{i}" for i in range(len(self.initial_state))))

    def _rest(self) -> list[float]:
        return list(self.initial_state)

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        p = np.array(list(self.parameters.values()))[:, None]
        start = np.array(run.state, dtype=np.float64)[:, None]
        return run_in_lockstep(
            self.derivative, self.output, run.time_s, np.column_stack(run.columns), start, p, self.substeps
        )[:, 0]

    def _label(self, name: str) -> Label:
        return VARIABLES.get(name, Label(f"unit of {name}", name))

    def to_toml(self) -> str:
        """Write parameters, initial state, columns and substeps as TOML, with the names of the two functions."""
        settings = {
            "initial_state": Entry(value=[float(x) for x in self.initial_state], unit=_STATE),
            "substeps": Entry(value=self.substeps),
            "input_names": Entry(value=list(self.input_names)),
            "output_name": Entry(value=self.output_name),
        }
        functions = {name: _name_of(getattr(self, name)) for name in _FUNCTIONS}
        tables = {"parameters": entries(self.parameters), "settings": settings, "functions": entries(functions)}
        return ParameterFile(kind="ode", tables=tables).to_toml()

    @classmethod
    def from_toml(
        cls, text: str, *, derivative: Derivative, output: Output | None = None, origin: str = "text"
    ) -> OdeModel:
        """Read what `to_toml` wrote; the functions are Python and are given again.

        Parameters
        ----------
        text : str
            The text of a parameter file.
        derivative, output : callable
            The functions of the model that was written; the first state without `output`.
        origin : str
            Name for the messages, for example the file.

        Returns
        -------
        OdeModel
            Simulates bit for bit as the one that was written.

        Raises
        ------
        DataError
            Not TOML, another kind or format version, a missing table or key.
        ParameterError
            An unknown key, a wrong type, or functions of other names than those that were written.
        """
        file = ParameterFile.from_toml(text, origin=origin)
        file.expect(kinds=("ode",), tables=("parameters", "settings", "functions"))
        read = output_or_first_state(output)
        functions = {"derivative": derivative, "output": read}
        for name, written in file.values("functions", wanted(_FUNCTIONS, form="text")).items():
            if _name_of(functions[name]) != written:
                raise ParameterError(
                    f"{name} = {_name_of(functions[name])}: {origin} was written with {written}; give that function, "
                    f"or change the line in [functions] if it was renamed"
                )
        expected = {
            "initial_state": Wanted(_STATE, "numbers"),
            "substeps": Wanted(form="integer"),
            "input_names": Wanted(form="texts"),
            "output_name": Wanted(form="text"),
        }
        settings = file.values("settings", expected)
        values = file.values("parameters", {name: Wanted(unit_of(name)) for name in file.tables["parameters"]})
        return cls(
            derivative=derivative,
            output=read,
            parameters=values,
            initial_state=tuple(float(value) for value in settings["initial_state"]),
            substeps=settings["substeps"],
            input_names=tuple(settings["input_names"]),
            output_name=settings["output_name"],
        )


def _name_of(function: Any) -> str:
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def output_or_first_state(output: Output | None) -> Output:
    """Give the output of an equation; the first state where it has none of its own."""
    return _first_state if output is None else output


def _first_state(x: NDArray[Any], u: NDArray[Any], p: NDArray[Any]) -> NDArray[Any]:
    del u, p
    first: NDArray[Any] = x[0]
    return first


def run_in_lockstep(
    derivative: Derivative,
    output: Output,
    time: NDArray[np.float64],
    inputs: NDArray[np.float64],
    state: NDArray[np.float64],
    p: NDArray[np.float64],
    substeps: int,
) -> NDArray[np.float64]:
    """Simulate columns of states and parameters side by side, shape (samples, columns) of the output."""
    x = state.copy()
    h = even_step(time) / substeps
    y = np.empty((time.size, p.shape[1]))

    def slope(t: float, at: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = derivative(t, at, u, p)
        if isinstance(rows, np.ndarray) and rows.shape == at.shape:
            return rows
        stacked = np.stack([np.broadcast_to(row, at.shape[1:]) for row in rows])  # type: ignore[union-attr]
        if stacked.shape != at.shape:
            raise ShapeError(f"derivative returned shape {stacked.shape}: must be {at.shape}, one row per state")
        return stacked

    for k in range(time.size):
        u = inputs[k]
        y[k] = output(x, u, p)
        if k + 1 == time.size:
            break
        for part in range(substeps):
            t = float(time[k] + part * h)
            k1 = slope(t, x, u)
            k2 = slope(t + 0.5 * h, x + 0.5 * h * k1, u)
            k3 = slope(t + 0.5 * h, x + 0.5 * h * k2, u)
            k4 = slope(t + h, x + h * k3, u)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return y
