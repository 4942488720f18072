"""The kinds of the user's own models: a differential equation, a discrete step, a simulator of whole records."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify.grey_box.model import Acting, GreyBoxModel, Rows, check_columns, rows_of
from mgdd.io.parameters import Wanted
from mgdd.results.describe import described
from mgdd.signals.even_grid import is_same_step

Derivative = Callable[[Any, NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]
Step = Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]
Output = Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]
Simulator = Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]


def first_states(x: NDArray[Any], u: NDArray[Any], p: NDArray[Any]) -> NDArray[Any]:
    """Measure the first states, as many as there are outputs: the output of a model that has none of its own."""
    del u, p
    return x


@dataclass(frozen=True, kw_only=True)
class _Stepped(GreyBoxModel):
    """A model that goes from sample to sample, with an output on each."""

    output: Output = first_states

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.output is first_states and len(self.initial_state) < len(self.output_names):
            raise ShapeError(
                f"initial_state has {len(self.initial_state)} states for the outputs {', '.join(self.output_names)}: "
                "give output=, or a state for each"
            )

    @abstractmethod
    def _next(self, acting: Acting, k: int, x: Any, p: Any, call: Rows) -> NDArray[np.float64]:
        """Return the states of the next sample."""

    def run_columns(
        self, acting: Acting, state: NDArray[np.float64], p: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Simulate columns side by side."""
        n, outputs = acting.samples.shape[0], len(self.output_names)
        own = None if self.output is first_states else self._rows("output", outputs)
        call, x = self._rows(self.functions[0], len(state)), state.copy()
        y = np.empty((n, outputs, p.shape[1]))
        for k in range(n):
            y[k] = x[:outputs] if own is None else own(x, acting.samples[k], p)
            if k + 1 < n:
                x = self._next(acting, k, x, p, call)
        return y, x

    def check(self, acting: Acting, state: NDArray[np.float64], p: NDArray[np.float64]) -> None:
        """Refuse functions that do not take columns, or return something else than a row for each state or output."""
        first, u = self.functions[0], acting.samples[0]
        time = (float(acting.time_s[0]),) if first == "derivative" else ()
        calls = [(first, len(state), (*time, state, u, p))]
        if self.output is not first_states:
            calls.append(("output", len(self.output_names), (state, u, p)))
        for name, rows, given in calls:
            if self.vectorized:
                check_columns(getattr(self, name), name, rows, given)
            else:
                self._rows(name, rows)(*given)

    def _rows(self, name: str, rows: int) -> Rows:
        return rows_of(getattr(self, name), name, rows, vectorized=self.vectorized, timed=name == "derivative")


@described
@dataclass(frozen=True, kw_only=True)
class OdeModel(_Stepped):
    """An ordinary differential equation with its parameters, on fixed Runge-Kutta steps.

    Parameters
    ----------
    derivative : callable
        ``derivative(t, x, u, p)`` [state unit per s]: time [s], a number or (m,), state (n_states, m), input
        (n_inputs,) or (n_inputs, m), parameters (n_parameters, m) in the order of `parameters`; returns (n_states, m)
        or a sequence of n_states rows. Every column is a run of its own.
    output : callable
        ``output(x, u, p)``, (n_outputs, m) or a sequence of n_outputs rows; the first states without.
    parameters : mapping of str to float
        Values in the order that the functions expect; of a fit, where its search starts.
    initial_state : tuple of float
        State at the first sample of a free run that is not given one.
    substeps : int
        Equal Runge-Kutta steps per sample.
    input_names, output_names : sequence of str
        Columns of a record that make up the input and the output, in order.
    interpolation : {"hold", "linear", "cubic"}
        Inputs between the samples: each held to the next one, as a converter does; of signals that were measured on the
        way a line or a cubic spline comes nearer.
    input_delay_s : float
        By which the inputs act later than they are sampled [s]; before that the first sample acts.
    vectorized : bool
        Whether the functions take columns; False calls them for one run after the other, with one axis less: slower,
        and what functions of `math` or compiled ones for one state need.

    Examples
    --------
    >>> from mgdd.identify import OdeModel
    >>> lag = OdeModel(
    ...     derivative=lambda t, x, u, p: (p[0] * u[0] - x) / p[1],
    ...     parameters={"gain": 2.0, "time_s": 0.5},
    ...     initial_state=(0.0,),
    ... )
    >>> lag.simulate({"time_s": [0.0, 0.1, 0.2], "u": [1.0, 1.0, 1.0]})["y"].values.round(4).tolist()
    [0.0, 0.3625, 0.6594]
    """

    functions = ("derivative", "output")
    settings = MappingProxyType({"substeps": Wanted(form="integer")})
    kind = "ode"

    derivative: Derivative
    substeps: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        ParameterError.unless(self.substeps >= 1, "substeps", self.substeps, ">= 1")

    @property
    def n_substeps(self) -> int:
        """Runge-Kutta steps per sample."""
        return self.substeps

    def _next(self, acting: Acting, k: int, x: Any, p: Any, call: Rows) -> NDArray[np.float64]:
        h = acting.step_s
        for part in range(self.substeps):
            t = acting.time_s[k] + part * h
            begin, middle, end = acting.steps[k * self.substeps + part]
            k1 = call(t, x, begin, p)
            k2 = call(t + 0.5 * h, x + 0.5 * h * k1, middle, p)
            k3 = call(t + 0.5 * h, x + 0.5 * h * k2, middle, p)
            k4 = call(t + h, x + h * k3, end, p)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return x  # type: ignore[no-any-return]

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
            The functions of the model that was written; the first states without `output`.
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
        return cls._read(text, origin, {"derivative": derivative, "output": output or first_states})


@described
@dataclass(frozen=True, kw_only=True)
class DiscreteModel(_Stepped):
    """A model in discrete time: the state of the next sample from that of this one.

    A one-step predictor is one too: the measured output is an input of it, and `step` corrects the state by it.

    Parameters
    ----------
    step : callable
        ``step(x, u, p)``, the next state: state (n_states, m), input (n_inputs,) or (n_inputs, m), parameters
        (n_parameters, m); returns (n_states, m) or a sequence of n_states rows. Every column is a run of its own.
    sample_s : float, optional
        Sampling that the parameters belong to [s]: another one is refused; a fit sets it.
    output, parameters, initial_state, input_names, output_names, interpolation, input_delay_s, vectorized
        As of `OdeModel`.

    Examples
    --------
    >>> from mgdd.identify import DiscreteModel
    >>> lag = DiscreteModel(
    ...     step=lambda x, u, p: p[0] * x + (1.0 - p[0]) * u[0], parameters={"pole": 0.5}, initial_state=(0.0,))
    >>> lag.simulate({"time_s": [0.0, 1.0, 2.0], "u": [1.0, 1.0, 1.0]})["y"].values.tolist()
    [0.0, 0.5, 0.75]
    """

    functions = ("step", "output")
    settings = MappingProxyType({"sample_s": Wanted("s", required=False)})
    kind = "discrete"

    step: Step
    sample_s: float | None = None

    def run_columns(
        self, acting: Acting, state: NDArray[np.float64], p: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Simulate columns side by side, on the sampling of the model."""
        check_sample(self.sample_s, acting.step_s)
        return super().run_columns(acting, state, p)

    def _next(self, acting: Acting, k: int, x: Any, p: Any, call: Rows) -> NDArray[np.float64]:
        return call(x, acting.steps[k, 0], p)

    @classmethod
    def from_toml(cls, text: str, *, step: Step, output: Output | None = None, origin: str = "text") -> DiscreteModel:
        """Read what `to_toml` wrote; arguments and errors as of `OdeModel.from_toml`."""
        return cls._read(text, origin, {"step": step, "output": output or first_states})


@described
@dataclass(frozen=True, kw_only=True)
class SimulatorModel(GreyBoxModel):
    """Any simulator of a whole record: filters of SciPy, a compiled loop, another program.

    Parameters
    ----------
    simulator : callable
        ``simulator(x, u, p)``, the outputs on all samples: state at the first sample (n_states,), inputs (n, n_inputs),
        parameters (n_parameters,); returns (n,), or (n, n_outputs) of several outputs. It is called once for every
        run; ``"time_s"`` among the `input_names` gives it the time.
    sample_s : float, optional
        Sampling that the parameters belong to [s]: another one is refused; without, every one is taken.
    parameters, initial_state, input_names, output_names, interpolation, input_delay_s
        As of `OdeModel`.
    vectorized : bool
        Unused: `simulator` takes one run.

    Examples
    --------
    >>> from scipy.signal import lfilter
    >>> from mgdd.identify import SimulatorModel
    >>> lag = SimulatorModel(
    ...     simulator=lambda x, u, p: lfilter([1.0 - p[0]], [1.0, -p[0]], u[:, 0]), parameters={"pole": 0.5})
    >>> lag.simulate({"time_s": [0.0, 1.0, 2.0], "u": [1.0, 1.0, 1.0]})["y"].values.tolist()
    [0.5, 0.75, 0.875]
    """

    functions = ("simulator",)
    settings = DiscreteModel.settings
    kind: ClassVar[str] = "simulator"

    simulator: Simulator
    sample_s: float | None = None

    def run_columns(
        self, acting: Acting, state: NDArray[np.float64], p: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Simulate column after column; the state at the last sample is not known."""
        check_sample(self.sample_s, acting.step_s)
        u = acting.held()
        shape = (u.shape[0], len(self.output_names))
        y = np.empty((*shape, p.shape[1]))
        for i in range(p.shape[1]):
            own = np.asarray(self.simulator(state[:, i], u[..., i] if u.ndim == 3 else u, p[:, i]), dtype=np.float64)
            if own.shape not in (shape, shape[: 1 if shape[1] == 1 else 2]):
                raise ShapeError(f"simulator returned shape {own.shape}: must be {shape}, a row for each sample")
            y[:, :, i] = own.reshape(shape)
        return y, np.full_like(state, np.nan)

    def check(self, acting: Acting, state: NDArray[np.float64], p: NDArray[np.float64]) -> None:
        """Refuse a simulator that returns something else than a row for each sample."""
        self.run_columns(acting, state, p)

    @classmethod
    def from_toml(cls, text: str, *, simulator: Simulator, origin: str = "text") -> SimulatorModel:
        """Read what `to_toml` wrote; arguments and errors as of `OdeModel.from_toml`."""
        return cls._read(text, origin, {"simulator": simulator})


def check_sample(sample_s: float | None, step_s: float) -> None:
    """Refuse a record of another sampling than that of a discrete model."""
    if sample_s is not None and not is_same_step(step_s, sample_s):
        raise DataError(
            f"time_s: sampled every {step_s:g} s: the parameters belong to sample_s = {sample_s:g} s; resample the "
            "record, or fit the model to it"
        )


def at_estimates(
    model: GreyBoxModel, parameters: Mapping[str, float], state: NDArray[np.float64], delay_s: float, step_s: float
) -> GreyBoxModel:
    """Return a model with what was found; one in discrete time belongs to the sampling of its record."""
    own: dict[str, Any] = {"sample_s": step_s} if isinstance(model, DiscreteModel | SimulatorModel) else {}
    return replace(model, parameters=parameters, initial_state=tuple(state.tolist()), input_delay_s=delay_s, **own)
