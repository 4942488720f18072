"""A model whose right-hand side is a Python function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

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

Interpolation = Literal["hold", "linear", "cubic"]

_FUNCTIONS = ("derivative", "output")
_STATE = "unit of the state"


@described
@dataclass(frozen=True, kw_only=True)
class OdeModel(SampledModel):
    """An ordinary differential equation with its parameters, on fixed Runge-Kutta steps.

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
    interpolation : {"hold", "linear", "cubic"}
        Inputs between the samples, as in `fit_ode`.
    input_delay_s : float
        By which the inputs act later than they are sampled [s]; before that the first sample acts.

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
    interpolation: Interpolation = "hold"
    input_delay_s: float = 0.0

    def __post_init__(self) -> None:
        delay_s = self.input_delay_s
        ParameterError.unless(0.0 <= delay_s < np.inf, "input_delay_s", delay_s, "a delay >= 0 [s]")
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "state_names", tuple(f"state_{i}" for i in range(len(self.initial_state))))

    def _rest(self) -> list[float]:
        return list(self.initial_state)

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        p = np.array(list(self.parameters.values()))[:, None]
        start = np.array(run.state, dtype=np.float64)[:, None]
        drive = Drive(run.time_s, np.column_stack(run.columns), self.substeps, self.interpolation)
        return run_in_lockstep(self.derivative, self.output, drive, start, p, self.input_delay_s)[:, 0]

    def _label(self, name: str) -> Label:
        return VARIABLES.get(name, Label(f"unit of {name}", name))

    def to_toml(self) -> str:
        """Write parameters, initial state, columns and substeps as TOML, with the names of the two functions."""
        settings = {
            "initial_state": Entry(value=[float(x) for x in self.initial_state], unit=_STATE),
            "substeps": Entry(value=self.substeps),
            "input_names": Entry(value=list(self.input_names)),
            "output_name": Entry(value=self.output_name),
            "interpolation": Entry(value=self.interpolation),
            "input_delay_s": Entry(value=self.input_delay_s, unit="s"),
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
            "interpolation": Wanted(form="text"),
            "input_delay_s": Wanted("s"),
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
            interpolation=settings["interpolation"],
            input_delay_s=settings["input_delay_s"],
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


@dataclass(frozen=True)
class Drive:
    """Sampled inputs, shape (samples, inputs), and what lies between the samples."""

    time_s: NDArray[np.float64]
    inputs: NDArray[np.float64]
    substeps: int
    interpolation: Interpolation

    def __post_init__(self) -> None:
        known = ("hold", "linear", "cubic")
        ParameterError.unless(self.interpolation in known, "interpolation", self.interpolation, f"one of {known}")
        if self.interpolation == "cubic" and self.time_s.size < 4:
            raise ShapeError(f"interpolation = 'cubic': needs 4 samples, the record has {self.time_s.size}")

    @property
    def step_s(self) -> float:
        """Length of a Runge-Kutta step."""
        return even_step(self.time_s) / self.substeps

    def acting(self, delay_s: float | NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the inputs at the samples, and at the begin, the middle and the end of every step, as second axis.

        A delay for each of m columns adds an axis of length m. Of inputs that are held a step sees their mean over it,
        so that what a delay does is continuous.
        """
        from scipy.interpolate import make_interp_spline

        if np.ndim(delay_s) > 0:
            several, which = np.unique(delay_s, return_inverse=True)
            each = [self.acting(float(one)) for one in several]
            if len(each) > 1:
                samples, steps = (np.stack(parts, axis=-1)[..., which] for parts in zip(*each, strict=True))
                return samples, steps
            return each[0]
        n = (self.time_s.size - 1) * self.substeps
        ends = self.time_s[0] + self.step_s * np.arange(n + 1) - delay_s
        if self.interpolation != "hold":
            spline = make_interp_spline(self.time_s, self.inputs, k=1 if self.interpolation == "linear" else 3)
            first, last = self.time_s[0], self.time_s[-1]
            middles = 0.5 * (ends[:-1] + ends[1:])
            samples, *nodes = (
                spline(np.clip(at, first, last)) for at in (self.time_s - delay_s, ends[:-1], middles, ends[1:])
            )
            return samples, np.stack(nodes, axis=1)
        if delay_s == 0.0:
            held = np.repeat(self.inputs[:-1], self.substeps, axis=0)
            return self.inputs, np.repeat(held[:, None], 3, axis=1)
        knots = np.concatenate([[self.time_s[0] - delay_s - 1.0], self.time_s, [self.time_s[-1] + 1.0]])
        areas = np.vstack([self.inputs[:1], self.inputs]) * np.diff(knots)[:, None]
        whole = np.vstack([np.zeros_like(areas[:1]), np.cumsum(areas, axis=0)])
        until = np.column_stack([np.interp(ends, knots, column) for column in whole.T])
        mean = np.diff(until, axis=0) / self.step_s
        at = np.searchsorted(self.time_s, self.time_s - delay_s, side="right") - 1
        return self.inputs[np.maximum(at, 0)], np.repeat(mean[:, None], 3, axis=1)


def run_in_lockstep(
    derivative: Derivative,
    output: Output,
    drive: Drive,
    state: NDArray[np.float64],
    p: NDArray[np.float64],
    delay_s: float | NDArray[np.float64],
) -> NDArray[np.float64]:
    """Simulate columns of states and parameters side by side, shape (samples, columns) of the output."""
    x = state.copy()
    h = drive.step_s
    time = drive.time_s
    samples, steps = drive.acting(delay_s)
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
        y[k] = output(x, samples[k], p)
        if k + 1 == time.size:
            break
        for part in range(drive.substeps):
            t = float(time[k] + part * h)
            begin, middle, end = steps[k * drive.substeps + part]
            k1 = slope(t, x, begin)
            k2 = slope(t + 0.5 * h, x + 0.5 * h * k1, middle)
            k3 = slope(t + 0.5 * h, x + 0.5 * h * k2, middle)
            k4 = slope(t + h, x + h * k3, end)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return y
