"""Receding-horizon control of any discrete model of one input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.control.discrete_model import DiscreteModel
from mgdd.errors import ParameterError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["RecedingHorizon"]


class RecedingHorizon:
    """Nonlinear model predictive control of one input: every sample the inputs of a horizon are planned anew.

    The plan minimises ``sum q (y - r)^2 + w u^2 + v (change of u)^2 + p (excess of y)^2`` under hard bounds of the
    input and of its change. Each sample its quadratic program is solved exactly by Riccati sweeps over an active set;
    `max_iterations` 1 does so once per sample, along the plan of the sample before (real-time iteration), more
    linearise again, with a line search on the true cost. Everything is in the units of the model, per sample.

    Parameters
    ----------
    model : DiscreteModel, PseudoWiener or FirstPrincipleModel
        What is predicted with. Those of a throttle have an observer and take measured angles; their friction has slopes
        in its smooth form only (`PseudoWiener` with ``friction="tanh"``; `FirstPrincipleModel` is run in that form).
        An actuation delay is one of the model (``delay_samples``).
    horizon_samples : int
        Length N of the plan, 1 to 1000.
    output_weight, terminal_weight : float
        q, of each squared error but the last, and of the last.
    input_weight, change_weight : float
        w and v; one of them must be positive.
    lower, upper, largest_change : float
        Bounds of the input, and of its change from sample to sample.
    least_output, largest_output, output_limit_weight : float
        Soft bounds of the output, and the price p of the squared excess; 0 for none.
    tolerance : float
        With several iterations: converged where no input changes by more.
    max_iterations : int
        Linearisations per sample.
    max_sweeps : int
        Of the quadratic program, per iteration; the plan is feasible after every one. Soft bounds need more, up to
        about 100 where many outputs are beyond them.
    observer_gain : array_like, shape (n,), optional
        Of a `DiscreteModel` whose output is measured: ``x += gain (y - h(x))`` every sample. Without it `step` takes
        the state. A constant disturbance is met without offset where the model has a state for it.
    tanh_deg_per_s : float
        Of a `FirstPrincipleModel`: speed over which its friction changes sides [deg/s].

    Raises
    ------
    mgdd.errors.ParameterError, mgdd.errors.ShapeError
        A setting outside its domain, naming field, value and bound; a gain of the wrong length.

    See Also
    --------
    GuidedPredictive : of a throttle, three moves, learns friction while it runs.

    Notes
    -----
    In the core a step takes microseconds (the cost grows with N n^3). A `DiscreteModel` of Python functions is called
    from there some N (2 n + 6) times per step and iteration, and sets the pace; an exception of it comes out of `step`
    and leaves the controller as it was. C++ programs include ``mgdd/control/receding_horizon.hpp``, without a heap.

    References
    ----------
    Diehl, Bock and Schlöder (2005), A real-time iteration scheme for nonlinear optimization in optimal feedback
    control.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.control import DiscreteModel, RecedingHorizon
    >>> cart = DiscreteModel.linear([[1.0, 0.1], [0.0, 1.0]], [0.005, 0.1], [1.0, 0.0], sample_s=0.1)
    >>> controller = RecedingHorizon(cart, horizon_samples=25, lower=-1.0, upper=0.5, largest_change=0.2)
    >>> x = np.zeros(2)
    >>> for _ in range(80):
    ...     x = cart.step(x, controller.step(2.0, x))
    >>> bool(abs(x[0] - 2.0) < 0.01), controller.status
    (True, 'converged')

    A throttle, from its measured angle, in the loop:

    >>> from mgdd.loop import track
    >>> from mgdd.throttle import PseudoWiener, Throttle
    >>> groups = {**PseudoWiener.of_throttle(Throttle()).parameters, "delay_samples": 1.0, "ramp_deg": 0.5}
    >>> plate = PseudoWiener("pw_r", groups, friction="tanh")
    >>> run = track(RecedingHorizon(plate, horizon_samples=30, change_weight=100.0), "step:20:60", seed=1)
    >>> float(run["static_error_deg"]) < 0.5
    True
    """

    def __init__(
        self,
        model: Any,
        *,
        horizon_samples: int = 20,
        output_weight: float = 1.0,
        terminal_weight: float = 1.0,
        input_weight: float = 0.0,
        change_weight: float = 1e-3,
        lower: float = -1.0,
        upper: float = 1.0,
        largest_change: float = 1e300,
        least_output: float = -1e300,
        largest_output: float = 1e300,
        output_limit_weight: float = 0.0,
        tolerance: float = 1e-6,
        max_iterations: int = 1,
        max_sweeps: int = 60,
        observer_gain: ArrayLike | None = None,
        tanh_deg_per_s: float = 40.0,
    ) -> None:
        numbers = {
            "output_weight": output_weight,
            "terminal_weight": terminal_weight,
            "input_weight": input_weight,
            "change_weight": change_weight,
            "lower": lower,
            "upper": upper,
            "largest_change": largest_change,
            "least_output": least_output,
            "largest_output": largest_output,
            "output_limit_weight": output_limit_weight,
            "tolerance": tolerance,
        }
        counts = {"horizon_samples": horizon_samples, "max_iterations": max_iterations, "max_sweeps": max_sweeps}
        gain = None if observer_gain is None else np.array(observer_gain, float)
        self._settings: dict[str, Any] = {
            **counts,
            **numbers,
            "observer_gain": None if gain is None else gain.tolist(),
            "tanh_deg_per_s": tanh_deg_per_s,
        }
        self.model = model
        self._core = _made(model, gain, tanh_deg_per_s, {**counts, "numbers": numbers})
        self._takes_output = gain is not None or not isinstance(model, DiscreteModel)

    @staticmethod
    def fields() -> dict[str, dict[str, Any]]:
        """Give every number by name: unit, bounds, meaning, default.

        Returns
        -------
        dict
            As of the other controllers.
        """
        described: dict[str, dict[str, Any]] = _core.loop.RecedingHorizon.fields()
        return described

    @property
    def settings(self) -> dict[str, Any]:
        """All settings but the model as a new dict: keywords that make the controller again."""
        return dict(self._settings)

    @property
    def status(self) -> str:
        """How the last sample ended: ``converged``, ``iteration_limit`` (feasible, the best so far) or ``not_finite``.

        The last repeats the input before: a number of state, reference or prediction was not finite.
        """
        return str(self._core.status)

    @property
    def iterations(self) -> int:
        """Linearisations of the last sample."""
        return int(self._core.iterations)

    @property
    def sweeps(self) -> int:
        """Sweeps of the quadratic programs of the last sample."""
        return int(self._core.sweeps)

    @property
    def planned_inputs(self) -> NDArray[np.float64]:
        """Inputs of the plan, shape (N,), from the one that `step` gave on."""
        plan: NDArray[np.float64] = self._core.inputs
        return plan

    @property
    def predicted_outputs(self) -> NDArray[np.float64]:
        """Outputs that the model predicts for them, shape (N,): entry k after k + 1 samples."""
        outputs: NDArray[np.float64] = self._core.predicted
        return outputs

    @property
    def state(self) -> dict[str, list[float]]:
        """What a run needs to go on bit for bit; a refused state changes nothing."""
        columns: dict[str, list[float]] = self._core.state
        return columns

    @state.setter
    def state(self, saved: Mapping[str, Sequence[float]]) -> None:
        self._core.state = {name: list(values) for name, values in saved.items()}

    def step(self, reference: ArrayLike, measurement: ArrayLike) -> float:
        """Give the input of this sample.

        Parameters
        ----------
        reference : float or array_like, shape (m,)
            Wanted output; an array is a preview, entry k wanted after k + 1 samples, the last one from there on.
        measurement : float or array_like, shape (n,)
            The state; with an observer the measured output, NaN where there is none.

        Returns
        -------
        float
            Input, inside its bounds.

        Raises
        ------
        mgdd.errors.ShapeError
            A preview of more than one dimension or none, a state of another length.
        Exception
            What a function of the model raised; the controller is as before.
        """
        wanted = np.atleast_1d(np.asarray(reference, float))
        if wanted.ndim != 1 or not wanted.size:
            raise ShapeError(f"reference has shape {wanted.shape}: must be a number or a preview of one dimension")
        seen = np.asarray(measurement, float)
        if self._takes_output:
            if seen.size != 1:
                raise ShapeError(f"measurement has shape {seen.shape}: must be the measured output, a number")
            return float(self._core.step(wanted, float(seen.reshape(()))))
        if seen.size != self._core.n_states:
            raise ShapeError(
                f"measurement has shape {seen.shape}: must be the state, {self._core.n_states} numbers, "
                "or give the controller an observer_gain"
            )
        return float(self._core.step_from(wanted, seen.reshape(-1).tolist()))

    def start(self, state: ArrayLike, *, applied: float = 0.0) -> None:
        """Start from a state, with an input that acted last, from which the first change counts.

        Parameters
        ----------
        state : array_like, shape (n,)
            State of the model.
        applied : float
            Input; clipped to its bounds.

        Raises
        ------
        mgdd.errors.ShapeError, mgdd.errors.ParameterError
            A wrong length, a number that is not finite.
        """
        numbers = np.asarray(state, float).reshape(-1)
        if not (np.isfinite(numbers).all() and np.isfinite(applied)):
            raise ParameterError("state, applied: must be finite")
        self._core.start(numbers.tolist(), applied)

    def applied(self, value: float) -> None:
        """Give what acted instead of the last result, where it differs: the next change counts from it.

        Parameters
        ----------
        value : float
            Input; clipped to its bounds, ignored if it is not finite.
        """
        self._core.applied(value)

    def reset(self) -> None:
        """Forget everything that was measured."""
        self._core.reset()

    def __repr__(self) -> str:
        """Name, model and length of the plan."""
        return f"RecedingHorizon({type(self.model).__name__}, horizon_samples={self._settings['horizon_samples']})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle settings, model and state."""
        return _restored, (self.model, self.settings, self.state)


def _restored(model: Any, settings: dict[str, Any], state: dict[str, list[float]]) -> RecedingHorizon:
    made = RecedingHorizon(model, **settings)
    made.state = state
    return made


def _made(model: Any, gain: NDArray[np.float64] | None, tanh_deg_per_s: float, settings: dict[str, Any]) -> Any:
    core = _core.loop.RecedingHorizon
    if isinstance(model, DiscreteModel):
        if gain is not None and (gain.shape != (model.n_states,) or not np.isfinite(gain).all()):
            raise ShapeError(f"observer_gain has shape {gain.shape}: must hold {model.n_states} finite numbers")
        with_gain = {"sample_s": model.sample_s, "observer_gain": [] if gain is None else gain.tolist(), **settings}
        if model._matrix is not None:
            return core.of_matrices(model._matrix, model._input_column, model._weights, **with_gain)
        return core.of_object(model, n_states=model.n_states, **with_gain)
    if gain is not None:
        raise ParameterError.of("observer_gain", gain, "left out: a model of a throttle has its own observer")
    inner = getattr(model, "_core", None)
    if isinstance(inner, _core.throttle.PseudoWienerModel):
        return core.of_pseudo_wiener(inner, **settings)
    if getattr(model, "kind", None) == "first_principle":
        return core.of_first_principle(
            list(model.parameters.values()),
            sample_s=model.sample_s,
            closed_deg=model.closed_deg,
            open_deg=model.open_deg,
            substeps=model.substeps,
            tanh_deg_per_s=tanh_deg_per_s,
            **settings,
        )
    raise ParameterError.of("model", model, "a DiscreteModel, a PseudoWiener or a FirstPrincipleModel")
