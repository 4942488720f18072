"""Grey-box fit: the user's own ordinary differential equation, written in Python, on the house's least squares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._describe import described
from mgdd._units import unit_of
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.io.parameters import Entry, ParameterFile, Wanted, entries, wanted
from mgdd.optimize import FitReport, least_squares

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from numpy.typing import ArrayLike, NDArray

    Derivative = Callable[[float, NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]
    Output = Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], ArrayLike]

__all__ = ["OdeFit", "OdeModel", "fit_ode"]

# Central differences: the truncation h^2 and the rounding eps/h meet near eps^(1/3).
_STEP = 6e-6
_FUNCTIONS = ("derivative", "output")
_STATE = "unit of the state"


@described
@dataclass(frozen=True, kw_only=True)
class OdeModel:
    """An ordinary differential equation with its parameters, on fixed Runge-Kutta steps with the input held.

    Parameters
    ----------
    derivative : callable
        ``derivative(t, x, u, p)`` as in `fit_ode`.
    output : callable
        ``output(x, u, p)`` as in `fit_ode`.
    parameters : mapping of str to float
        Values in the order that `derivative` expects.
    start : tuple of float
        State at the first sample.
    substeps : int
        Equal Runge-Kutta steps per sample.

    Examples
    --------
    >>> from mgdd.identify import OdeModel
    >>> lag = OdeModel(
    ...     derivative=lambda t, x, u, p: (p[0] * u[0] - x) / p[1],
    ...     output=lambda x, u, p: x[0],
    ...     parameters={"gain": 2.0, "time_s": 0.5},
    ...     start=(0.0,),
    ... )
    >>> lag.simulate([0.0, 0.1, 0.2], [1.0, 1.0, 1.0]).round(4).tolist()
    [0.0, 0.3625, 0.6594]
    """

    derivative: Derivative
    output: Output
    parameters: Mapping[str, float]
    start: tuple[float, ...]
    substeps: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def simulate(self, time_s: ArrayLike, u: ArrayLike, *, start: ArrayLike | None = None) -> NDArray[np.float64]:
        """Run free.

        Parameters
        ----------
        time_s : array_like, shape (n,)
            Constant sample time [s].
        u : array_like, shape (n,) or (n, n_inputs)
            Input, held from each sample to the next.
        start : array_like, shape (n_states,), optional
            State at the first sample; the model's own without.

        Returns
        -------
        ndarray, shape (n,)
            Output on every sample.
        """
        time, inputs = _record(time_s, u)
        state = np.array(self.start if start is None else start, dtype=np.float64)[:, None]
        p = np.array(list(self.parameters.values()))[:, None]
        return _simulate(self.derivative, self.output, time, inputs, state, p, self.substeps)[:, 0]

    def to_toml(self) -> str:
        """Write parameters, start and substeps as TOML, with the names of the two functions.

        Returns
        -------
        str
            The text of a parameter file, for `from_toml`.
        """
        settings = {
            "start": Entry(value=[float(x) for x in self.start], unit=_STATE),
            "substeps": Entry(value=self.substeps),
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
        read: Output = _first_state if output is None else output
        functions = {"derivative": derivative, "output": read}
        for name, written in file.values("functions", wanted(_FUNCTIONS, form="text")).items():
            if _name_of(functions[name]) != written:
                raise ParameterError(
                    f"{name} = {_name_of(functions[name])}: {origin} was written with {written}; give that function, "
                    f"or change the line in [functions] if it was renamed"
                )
        settings = file.values("settings", {"start": Wanted(_STATE, "numbers"), "substeps": Wanted(form="integer")})
        values = file.values("parameters", {name: Wanted(unit_of(name)) for name in file.tables["parameters"]})
        return cls(
            derivative=derivative,
            output=read,
            parameters=values,
            start=tuple(float(value) for value in settings["start"]),
            substeps=settings["substeps"],
        )


@described
@dataclass(frozen=True, kw_only=True)
class OdeFit:
    """Result of `fit_ode`.

    Parameters
    ----------
    report : mgdd.optimize.FitReport
        Of the best start: estimates, uncertainty, what the data leave open.
    model : OdeModel
        With the estimates.
    reports : tuple of mgdd.optimize.FitReport
        One per start.
    n_reached : int
        Starts whose rmse is within 0.5 % of the best.

    Examples
    --------
    >>> from mgdd.identify import OdeFit
    >>> sorted(OdeFit.__dataclass_fields__)
    ['model', 'n_reached', 'report', 'reports']
    """

    report: FitReport
    model: OdeModel
    reports: tuple[FitReport, ...]
    n_reached: int


def fit_ode(
    derivative: Derivative,
    time_s: ArrayLike,
    *,
    u: ArrayLike,
    y: ArrayLike,
    parameters: Mapping[str, float],
    start: ArrayLike,
    output: Output | None = None,
    free: Collection[str] | None = None,
    free_start: Sequence[int] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    log_scaled: Collection[str] = (),
    substeps: int = 1,
    skip: int = 0,
    sigma: float = 1.0,
    n_starts: int = 1,
    seed: int = 0,
    max_iterations: int = 100,
    cost_tolerance: float = 1e-9,
) -> OdeFit:
    """Fit parameters and start of the user's own ODE to a record: output error of the free run.

    The function is evaluated on stacked perturbed parameters, so that a simulation and all its central differences
    run in lockstep: write it with ``x[0]``, ``p[1]`` and NumPy functions, and it takes columns unchanged. For long
    records or many parameters write the model as a C++ functor instead (docs, Identification).

    Parameters
    ----------
    derivative : callable
        ``derivative(t, x, u, p)`` [state unit per s]: time [s], state (n_states, m), input (n_inputs,), parameters
        (n_parameters, m) in the order of `parameters`; returns (n_states, m) or a sequence of n_states rows.
    time_s : array_like, shape (n,)
        Constant sample time [s].
    u : array_like, shape (n,) or (n, n_inputs)
        Input, held from each sample to the next.
    y : array_like, shape (n,)
        Measured output.
    parameters : mapping of str to float
        Start values.
    start : array_like, shape (n_states,)
        State at the first sample; for the free ones where the search starts.
    output : callable, optional
        ``output(x, u, p)`` to (m,); the first state without.
    free : collection of str, optional
        Parameters that are estimated; all without.
    free_start : sequence of int
        States whose value at the first sample is estimated; reported as ``start_0``, ...
    bounds : mapping of str to (float, float), optional
        Per parameter, also for ``start_0``.
    log_scaled : collection of str
        Parameters searched as logarithms; they need a positive lower bound.
    substeps : int
        Equal Runge-Kutta steps per sample.
    skip : int
        First samples without a residual.
    sigma : float
        Noise level in the unit of `y`; the residual is divided by it.
    n_starts : int
        Above 1: further starts from a Latin hypercube between the bounds, which must then be finite.
    seed : int
        Of that hypercube.
    max_iterations : int
        Trial steps per start.
    cost_tolerance : float
        Relative decrease of the cost that ends a search [-].

    Returns
    -------
    OdeFit
        Report, model, and the reports of all starts.

    Raises
    ------
    ParameterError
        Unknown names, bounds that do not hold the start, or a model without a finite first simulation.
    ShapeError
        Arrays that do not belong together.
    DataError
        A record that is not finite or not evenly sampled.

    See Also
    --------
    mgdd.optimize.least_squares : the search.

    References
    ----------
    Nielsen (1999) for the damping; Bates and Watts (1988), section 2.2, for the uncertainty.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import fit_ode
    >>> time = np.linspace(0.0, 10.0, 201)
    >>> def lag(t, x, u, p):
    ...     return (p[0] * u[0] - x) / p[1]
    >>> y = 2.0 * (1.0 - np.exp(-time / 0.5))
    >>> fit = fit_ode(lag, time, u=np.ones(201), y=y, parameters={"gain": 1.0, "time_s": 1.0}, start=[0.0])
    >>> fit.report.values.round(3).tolist()
    [2.0, 0.5]
    """
    time, inputs = _record(time_s, u)
    measured = np.array(y, dtype=np.float64)
    if measured.shape != time.shape:
        raise ShapeError(f"y has shape {measured.shape}: must be {time.shape} as time_s")
    if not np.isfinite(measured).all():
        raise DataError(
            f"y: sample {int(np.argmin(np.isfinite(measured)))} is not a number: interpolate or cut the record"
        )
    state = np.array(start, dtype=np.float64)
    if state.ndim != 1 or not np.isfinite(state).all():
        raise ShapeError("start: must be a vector of finite numbers, one per state")
    if not 0 <= skip < time.size:
        raise ParameterError(f"skip = {skip}: must be within [0, {time.size - 1}]")
    if not (np.isfinite(sigma) and sigma > 0.0):
        raise ParameterError(f"sigma = {sigma!r}: must be > 0")
    for field, value in {"substeps": substeps, "n_starts": n_starts}.items():
        if value < 1:
            raise ParameterError(f"{field} = {value}: must be >= 1")
    names = list(parameters)
    chosen = names if free is None else [name for name in names if name in set(free)]
    start_names = [f"start_{i}" for i in free_start]
    unknowns = [*chosen, *start_names]
    for given in (free or (), bounds or (), log_scaled):
        for name in given:
            if name not in names and name not in start_names:
                raise ParameterError(
                    f"{name!r}: no parameter of this model; it has {', '.join([*names, *start_names])}"
                )
    if any(not 0 <= i < state.size for i in free_start):
        raise ParameterError(f"free_start = {list(free_start)}: must be indices of the {state.size} states")
    p0 = np.array([float(parameters[name]) for name in names])
    where = [names.index(name) for name in chosen]
    limits = [(bounds or {}).get(name, (-np.inf, np.inf)) for name in unknowns]
    lower = np.array([low for low, _ in limits], dtype=np.float64)
    upper = np.array([high for _, high in limits], dtype=np.float64)
    logs = [name in set(log_scaled) for name in unknowns]
    read = output if output is not None else _first_state
    n = len(unknowns)

    def stack(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        steps = _STEP * np.maximum(np.abs(x), np.where(logs, 0.0, 1e-3))
        columns = np.repeat(x[:, None], 2 * n + 1, axis=1)
        columns[np.arange(n), 1 + np.arange(n)] += steps
        columns[np.arange(n), 1 + n + np.arange(n)] -= steps
        p = np.repeat(p0[:, None], 2 * n + 1, axis=1)
        p[where] = columns[: len(chosen)]
        s = np.repeat(state[:, None], 2 * n + 1, axis=1)
        s[list(free_start)] = columns[len(chosen) :]
        return p, s, columns[np.arange(n), 1 + np.arange(n)] - columns[np.arange(n), 1 + n + np.arange(n)]

    def residual(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        p, s, widths = stack(x)
        with np.errstate(all="ignore"):
            simulated = _simulate(derivative, read, time, inputs, s, p, substeps)[skip:]
        if not np.isfinite(simulated).all():
            return None
        difference = (simulated[:, 1 : n + 1] - simulated[:, n + 1 :]) / widths
        return (simulated[:, 0] - measured[skip:]) / sigma, difference / sigma

    first = np.concatenate([p0[where], state[list(free_start)]])
    starts = [first]
    if n_starts > 1:
        box = [
            _core.Parameter(name=name, lower=low, upper=high, log_scaled=log)
            for name, low, high, log in zip(unknowns, lower.tolist(), upper.tolist(), logs, strict=True)
        ]
        starts += [np.asarray(point) for point in _core.latin_hypercube(box, n_starts - 1, seed)]
    reports = tuple(
        least_squares(
            residual,
            point,
            names=unknowns,
            lower=lower,
            upper=upper,
            log_scaled=logs,
            data=measured[skip:] / sigma,
            max_iterations=max_iterations,
            cost_tolerance=cost_tolerance,
        )
        for point in starts
    )
    if reports[0].status == "evaluation_failed" and n_starts == 1:
        raise ParameterError("the model gives no finite simulation at the start values: change them or raise substeps")
    best = min(reports, key=lambda report: report.cost if np.isfinite(report.cost) else np.inf)
    p0[where] = best.values[: len(chosen)]
    state[list(free_start)] = best.values[len(chosen) :]
    model = OdeModel(
        derivative=derivative,
        output=read,
        parameters=dict(zip(names, p0.tolist(), strict=True)),
        start=tuple(state.tolist()),
        substeps=substeps,
    )
    reached = sum(bool(report.rmse <= 1.005 * best.rmse) for report in reports)
    return OdeFit(report=best, model=model, reports=reports, n_reached=reached)


def _name_of(function: Any) -> str:
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def _first_state(x: NDArray[Any], u: NDArray[Any], p: NDArray[Any]) -> NDArray[Any]:
    del u, p
    first: NDArray[Any] = x[0]
    return first


def _record(time_s: ArrayLike, u: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    time = np.array(time_s, dtype=np.float64)
    inputs = np.array(u, dtype=np.float64)
    inputs = inputs[:, None] if inputs.ndim == 1 else inputs
    if time.ndim != 1 or time.size < 2 or inputs.ndim != 2 or len(inputs) != time.size:
        raise ShapeError(f"time_s has shape {time.shape}, u {inputs.shape}: must be (n,) and (n,) or (n, n_inputs)")
    steps = np.diff(time)
    if not np.isfinite(inputs).all() or not np.isfinite(time).all():
        raise DataError("time_s, u: must be finite numbers")
    if not (steps > 0.0).all() or steps.max() - steps.min() > 1e-3 * steps.mean():
        raise DataError("time_s: must rise in equal steps; resample the record first")
    return time, inputs


def _simulate(
    derivative: Derivative,
    output: Output,
    time: NDArray[np.float64],
    inputs: NDArray[np.float64],
    state: NDArray[np.float64],
    p: NDArray[np.float64],
    substeps: int,
) -> NDArray[np.float64]:
    x = state.copy()
    h = (time[-1] - time[0]) / (time.size - 1) / substeps
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
