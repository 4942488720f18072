"""Grey-box models: the user's own ordinary differential equation, written in Python, run and fitted."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError
from mgdd.identify.ode_model import Derivative, OdeModel, Output, output_or_first_state, run_in_lockstep
from mgdd.optimize import least_squares
from mgdd.optimize.least_squares import FitOptions, Resolved, fit_of, fit_options, fit_run, quality_of, spread_starts
from mgdd.parallel.finished import hand_over, keep_finished
from mgdd.results import Fit
from mgdd.results.fit_report import FitReport
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import columns_of

# Central differences: the truncation h^2 and the rounding eps/h meet near eps^(1/3).
_STEP = 6e-6


def fit_ode(
    derivative: Derivative,
    record: Any,
    *,
    parameters: Mapping[str, float],
    initial_state: ArrayLike,
    input_names: Sequence[str] = ("u",),
    output_name: str = "y",
    output: Output | None = None,
    free: Collection[str] | None = None,
    free_state: Sequence[int] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    log_scaled: Collection[str] = (),
    substeps: int = 1,
    skip: int = 0,
    sigma: float = 1.0,
    options: FitOptions | None = None,
) -> Fit:
    """Fit parameters and start of the user's own ODE to a record: output error of the free run.

    The function is evaluated on stacked perturbed parameters, so that a simulation and all its central differences
    run in lockstep: write it with ``x[0]``, ``p[1]`` and NumPy functions, and it takes columns unchanged. For long
    records or many parameters write the model as a C++ functor instead (docs, Identification).

    Parameters
    ----------
    derivative : callable
        ``derivative(t, x, u, p)`` [state unit per s]: time [s], state (n_states, m), input (n_inputs,), parameters
        (n_parameters, m) in the order of `parameters`; returns (n_states, m) or a sequence of n_states rows.
    record : xarray.Dataset, DataFrame or mapping of columns
        ``time_s`` [s], evenly spaced, the inputs, each held to the next sample, and the measured output.
    parameters : mapping of str to float
        Start values.
    initial_state : array_like, shape (n_states,)
        State at the first sample; for the free ones where the search starts.
    input_names : sequence of str
        Columns that make up the input, in order.
    output_name : str
        Column of the measured output.
    output : callable, optional
        ``output(x, u, p)`` to (m,); the first state without.
    free : collection of str, optional
        Parameters that are estimated; all without.
    free_state : sequence of int
        States whose value at the first sample is estimated; reported as ``state_0``, ...
    bounds : mapping of str to (float, float), optional
        Per parameter, also for ``state_0``.
    log_scaled : collection of str
        Parameters searched as logarithms; they need a positive lower bound.
    substeps : int
        Equal Runge-Kutta steps per sample.
    skip : int
        First samples without a residual.
    sigma : float
        Noise level in the unit of the output; the residual is divided by it.
    options : FitOptions, optional
        1 start, 100 trial steps and a tolerance of 1e-9 by default; more starts come from a Latin
        hypercube (seed 0) between the bounds, which must then be finite.

    Returns
    -------
    mgdd.results.Fit
        Report, model, and the reports of all starts.

    Raises
    ------
    ParameterError
        Unknown names, bounds that do not hold the start, or a model without a finite first simulation.
    ShapeError
        Arrays that do not belong together.
    DataError
        A record that is not finite or not evenly sampled.
    Interrupted
        Ctrl-C; ``partial`` is the best fit of the starts that were finished.

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
    >>> record = {"time_s": time, "u": np.ones(201), "y": y}
    >>> fit = fit_ode(lag, record, parameters={"gain": 1.0, "time_s": 1.0}, initial_state=[0.0])
    >>> fit.report.values.round(3).tolist()
    [2.0, 0.5]
    """
    chosen_options = fit_options(options, n_starts=1, seed=0, max_iterations=100, tolerance=1e-9)
    n_starts = chosen_options.n_starts
    time, *columns, measured = columns_of(record, ("time_s", *input_names, output_name))
    even_step(time)
    inputs = np.column_stack(columns)
    state = np.array(initial_state, dtype=np.float64)
    if state.ndim != 1 or not np.isfinite(state).all():
        raise ShapeError("initial_state: must be a vector of finite numbers, one per state")
    ParameterError.unless(0 <= skip < time.size, "skip", skip, f"within [0, {time.size - 1}]")
    ParameterError.unless(np.isfinite(sigma) and sigma > 0.0, "sigma", sigma, "> 0")
    ParameterError.unless(substeps >= 1, "substeps", substeps, ">= 1")
    names = list(parameters)
    chosen = names if free is None else [name for name in names if name in set(free)]
    free_states = [f"state_{i}" for i in free_state]
    unknowns = [*chosen, *free_states]
    for i, name in enumerate(unknowns):
        if name in unknowns[:i]:
            raise ParameterError(f"parameter name {name!r} appears twice: names must be unique")
    for given in (free or (), bounds or (), log_scaled):
        for name in given:
            if name not in names and name not in free_states:
                raise ParameterError(
                    f"{name!r}: no parameter of this model; it has {', '.join([*names, *free_states])}"
                )
    if any(not 0 <= i < state.size for i in free_state):
        raise ParameterError.of("free_state", list(free_state), f"indices of the {state.size} states")
    p0 = np.array([float(parameters[name]) for name in names])
    where = [names.index(name) for name in chosen]
    limits = [(bounds or {}).get(name, (-np.inf, np.inf)) for name in unknowns]
    lower = np.array([low for low, _ in limits], dtype=np.float64)
    upper = np.array([high for _, high in limits], dtype=np.float64)
    logs = [name in set(log_scaled) for name in unknowns]
    read = output_or_first_state(output)
    search = _Search(
        derivative=derivative,
        output=read,
        time=time,
        inputs=inputs,
        measured=measured,
        substeps=substeps,
        skip=skip,
        sigma=sigma,
        p0=p0.copy(),
        state=state.copy(),
        where=where,
        free_state=tuple(free_state),
        names=tuple(unknowns),
        lower=lower,
        upper=upper,
        logs=logs,
        options=chosen_options,
    )
    first = dict(zip(unknowns, [*p0[where].tolist(), *state[list(free_state)].tolist()], strict=True))
    box = [
        _core.optimize.Parameter(name=name, lower=low, upper=high, log_scaled=log)
        for name, low, high, log in zip(unknowns, lower.tolist(), upper.tolist(), logs, strict=True)
    ]
    starts = spread_starts(first, box, n_starts, chosen_options.seed)
    reports: list[FitReport] = []
    stop = keep_finished(search.one, starts, reports)
    if reports[0].status == "evaluation_failed" and n_starts == 1:
        raise ParameterError("the model gives no finite simulation at the start values: change them or raise substeps")
    best = min(reports, key=lambda report: report.cost if np.isfinite(report.cost) else np.inf)
    p0[where] = best.values[: len(chosen)]
    state[list(free_state)] = best.values[len(chosen) :]
    model = OdeModel(
        derivative=derivative,
        output=read,
        parameters=dict(zip(names, p0.tolist(), strict=True)),
        initial_state=tuple(state.tolist()),
        substeps=substeps,
        input_names=tuple(input_names),
        output_name=output_name,
    )
    errors = [report.rmse if np.isfinite(report.rmse) else np.inf for report in reports]
    run, quality = None, None
    if np.isfinite(best.rmse):
        simulated = model.simulate(record)[output_name].to_numpy()
        run = fit_run(time, measured, simulated, model._label(output_name))
        quality = quality_of(run.isel(time_s=slice(skip, None)))
    fit = fit_of(best, model, run, errors, train=quality, start_reports=tuple(reports))
    return hand_over(fit, stop)


@dataclass(frozen=True, kw_only=True)
class _Search:
    """All that a search needs beside its start."""

    derivative: Derivative
    output: Output
    time: NDArray[np.float64]
    inputs: NDArray[np.float64]
    measured: NDArray[np.float64]
    substeps: int
    skip: int
    sigma: float
    p0: NDArray[np.float64]
    state: NDArray[np.float64]
    where: Sequence[int]
    free_state: tuple[int, ...]
    names: tuple[str, ...]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    logs: Sequence[bool]
    options: Resolved

    def one(self, start: Mapping[str, float]) -> FitReport:
        return least_squares(
            self.residual,
            list(start.values()),
            names=self.names,
            bounds=(self.lower, self.upper),
            log_scaled=self.logs,
            data=self.measured[self.skip :] / self.sigma,
            max_iterations=self.options.max_iterations,
            cost_tolerance=self.options.tolerance,
        )

    def residual(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        p, s, widths = self.stack(x)
        with np.errstate(all="ignore"):
            simulated = run_in_lockstep(self.derivative, self.output, self.time, self.inputs, s, p, self.substeps)
        simulated = simulated[self.skip :]
        if not np.isfinite(simulated).all():
            return None
        n = x.size
        difference = (simulated[:, 1 : n + 1] - simulated[:, n + 1 :]) / widths
        return (simulated[:, 0] - self.measured[self.skip :]) / self.sigma, difference / self.sigma

    def stack(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        n, m = x.size, len(self.where)
        steps = _STEP * np.maximum(np.abs(x), np.where(self.logs, 0.0, 1e-3))
        columns = np.repeat(x[:, None], 2 * n + 1, axis=1)
        columns[np.arange(n), 1 + np.arange(n)] += steps
        columns[np.arange(n), 1 + n + np.arange(n)] -= steps
        p = np.repeat(self.p0[:, None], 2 * n + 1, axis=1)
        p[self.where] = columns[:m]
        s = np.repeat(self.state[:, None], 2 * n + 1, axis=1)
        s[list(self.free_state)] = columns[m:]
        return p, s, columns[np.arange(n), 1 + np.arange(n)] - columns[np.arange(n), 1 + n + np.arange(n)]
