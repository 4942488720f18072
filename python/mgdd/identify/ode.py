"""Grey-box models: the user's own ordinary differential equation, written in Python, run and fitted."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd import _core
from mgdd._arguments import shown
from mgdd.errors import ParameterError
from mgdd.identify.ode_model import Derivative, Interpolation, OdeModel, Output, output_or_first_state, run_in_lockstep
from mgdd.identify.ode_records import OdeRecord, records_of, states_of
from mgdd.optimize import least_squares
from mgdd.optimize.least_squares import FitOptions, Resolved, fit_of, fit_options, fit_run, quality_of, spread_starts
from mgdd.parallel.finished import hand_over, keep_finished
from mgdd.results import Fit
from mgdd.results.fit_report import FitReport

# Central differences: the truncation h^2 and the rounding eps/h meet near eps^(1/3).
_STEP = 6e-6
_DELAY = "input_delay_s"


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
    interpolation: Interpolation = "hold",
    input_delay_s: float | tuple[float, float] = 0.0,
    substeps: int = 1,
    skip: int = 0,
    sigma: ArrayLike | Sequence[ArrayLike] = 1.0,
    options: FitOptions | None = None,
) -> Fit:
    """Fit parameters and start of the user's own ODE to records: output error of the free run.

    The function is evaluated on stacked perturbed parameters, so that a simulation and all its central differences
    run in lockstep: write it with ``x[0]``, ``p[1]`` and NumPy functions, and it takes columns unchanged. For long
    records or many parameters write the model as a C++ functor instead (docs, Identification).

    Parameters
    ----------
    derivative : callable
        ``derivative(t, x, u, p)`` [state unit per s]: time [s], state (n_states, m), input (n_inputs,), or (n_inputs,
        m) while a delay is searched, parameters (n_parameters, m) in the order of `parameters`; returns (n_states, m)
        or a sequence of n_states rows.
    record : xarray.Dataset, DataFrame or mapping of columns, or a list of them
        ``time_s`` [s], evenly spaced, the inputs, and the measured output; a sample of that which is NaN is missing.
    parameters : mapping of str to float
        Start values.
    initial_state : array_like, shape (n_states,) or (n_records, n_states)
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
        States whose value at the first sample is estimated; reported as ``state_0``, ..., of several records as
        ``state_0_of_1``, ...
    bounds : mapping of str to (float, float), optional
        Per parameter, also for ``state_0``, which holds for all records.
    log_scaled : collection of str
        Parameters searched as logarithms; they need a positive lower bound.
    interpolation : {"hold", "linear", "cubic"}
        Inputs between the samples: each held to the next one, as a converter does; of signals that were measured on the
        way a line or a cubic spline comes nearer.
    input_delay_s : float or (float, float)
        By which the inputs act later than they are sampled, >= 0 [s]; between two bounds it is estimated, and reported
        as ``input_delay_s``. It need not be whole samples.
    substeps : int
        Equal Runge-Kutta steps per sample.
    skip : int
        First samples without a residual.
    sigma : float, array_like with one per sample, or a list of these with one per record
        Noise level in the unit of the output; the residual is divided by it.
    options : FitOptions, optional
        1 start, 100 trial steps and a tolerance of 1e-9 by default; more starts come from a Latin
        hypercube (seed 0) between the bounds, which must then be finite.

    Returns
    -------
    mgdd.results.Fit
        Report, model with the start of the first record and its free run, and the reports of all starts. Standard
        errors count blocks of a residual that is correlated in time (Kuensch 1989).

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
    Nielsen (1999) for the damping; Bates and Watts (1988), section 2.2, for the uncertainty; Kuensch (1989), The
    jackknife and the bootstrap for general stationary observations.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import fit_ode
    >>> time = np.linspace(0.0, 10.0, 201)
    >>> def lag(t, x, u, p):
    ...     return (p[0] * u[0] - x) / p[1]
    >>> u = np.where(time > 0.99, 1.0, 0.0)
    >>> y = np.where(time > 1.3, 2.0 * (1.0 - np.exp(-(time - 1.3) / 0.5)), 0.0)
    >>> record = {"time_s": time, "u": u, "y": y}
    >>> start = {"gain": 1.0, "time_constant_s": 1.0}
    >>> fit = fit_ode(lag, record, parameters=start, initial_state=[0.0], input_delay_s=(0.0, 1.0))
    >>> fit.report.values.round(2).tolist()
    [2.0, 0.5, 0.3]
    """
    chosen_options = fit_options(options, n_starts=1, seed=0, max_iterations=100, tolerance=1e-9)
    n_starts = chosen_options.n_starts
    ParameterError.unless(substeps >= 1, "substeps", substeps, ">= 1")
    runs = records_of(
        record, ("time_s", *input_names, output_name), interpolation=interpolation, substeps=substeps, skip=skip,
        sigma=sigma,
    )  # fmt: skip
    states = states_of(initial_state, len(runs))
    delay, delay_bounds = _delay_of(input_delay_s)
    names = list(parameters)
    chosen = names if free is None else [name for name in names if name in set(free)]
    free_states = [f"state_{i}" for i in free_state]
    starts_of = {f"{own}_of_{k}": own for k in range(len(runs)) for own in free_states}
    if len(runs) == 1:
        starts_of = {own: own for own in free_states}
    unknowns = [*chosen, *starts_of, *([_DELAY] if delay_bounds else [])]
    for i, name in enumerate(unknowns):
        if name in unknowns[:i]:
            raise ParameterError(f"parameter name {name!r} appears twice: names must be unique")
    for mentioned in (free or (), bounds or (), log_scaled):
        for name in mentioned:
            if name not in names and name not in free_states and name not in unknowns:
                raise ParameterError(
                    f"{name!r}: no parameter of this model; it has {', '.join([*names, *free_states])}"
                )
    if any(not 0 <= i < states.shape[1] for i in free_state):
        raise ParameterError.of("free_state", list(free_state), f"indices of the {states.shape[1]} states")
    p0 = np.array([float(parameters[name]) for name in names])
    where = [names.index(name) for name in chosen]
    known = {_DELAY: delay_bounds or (0.0, 0.0), **(bounds or {})}
    limits = [known.get(name, known.get(starts_of.get(name, name), (-np.inf, np.inf))) for name in unknowns]
    lower, upper = (np.array([ends[side] for ends in limits], dtype=np.float64) for side in (0, 1))
    logs = [not {name, starts_of.get(name, name)}.isdisjoint(log_scaled) for name in unknowns]
    read = output_or_first_state(output)
    search = _Search(
        derivative=derivative,
        output=read,
        runs=runs,
        p0=p0.copy(),
        states=states.copy(),
        delay=delay,
        delay_free=delay_bounds is not None,
        where=where,
        free_state=tuple(free_state),
        names=tuple(unknowns),
        lower=lower,
        upper=upper,
        logs=logs,
        options=chosen_options,
    )
    started = [*p0[where].tolist(), *states[:, list(free_state)].ravel().tolist(), *([delay] if delay_bounds else [])]
    box = [
        _core.optimize.Parameter(name=name, lower=low, upper=high, log_scaled=log)
        for name, low, high, log in zip(unknowns, lower.tolist(), upper.tolist(), logs, strict=True)
    ]
    starts = spread_starts(dict(zip(unknowns, started, strict=True)), box, n_starts, chosen_options.seed)
    reports: list[FitReport] = []
    stop = keep_finished(search.one, starts, reports)
    if reports[0].status == "evaluation_failed" and n_starts == 1:
        raise ParameterError("the model gives no finite simulation at the start values: change them or raise substeps")
    best = min(reports, key=lambda report: report.cost if np.isfinite(report.cost) else np.inf)
    p, start, found_delay = (array[..., 0] for array in search.columns(best.values[:, None]))
    model = OdeModel(
        derivative=derivative,
        output=read,
        parameters=dict(zip(names, p.tolist(), strict=True)),
        initial_state=tuple(start[0].tolist()),
        substeps=substeps,
        input_names=tuple(input_names),
        output_name=output_name,
        interpolation=interpolation,
        input_delay_s=float(found_delay),
    )
    errors = [report.rmse if np.isfinite(report.rmse) else np.inf for report in reports]
    run, quality = None, None
    if np.isfinite(best.rmse):
        first = runs[0]
        simulated = model.simulate(first.table)[output_name].to_numpy()
        run = fit_run(first.drive.time_s, first.measured, simulated, model._label(output_name))
        quality = quality_of(run.isel(time_s=first.kept))
    fit = fit_of(best, model, run, errors, train=quality, start_reports=tuple(reports))
    return hand_over(fit, stop)


@dataclass(frozen=True, kw_only=True)
class _Search:
    """All that a search needs beside its start."""

    derivative: Derivative
    output: Output
    runs: Sequence[OdeRecord]
    p0: NDArray[np.float64]
    states: NDArray[np.float64]
    delay: float
    delay_free: bool
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
            data=np.concatenate([run.measured[run.kept] / run.sigma for run in self.runs]),
            records=[run.kept.size for run in self.runs],
            max_iterations=self.options.max_iterations,
            cost_tolerance=self.options.tolerance,
        )

    def residual(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        n = x.size
        steps = _STEP * np.maximum(np.abs(x), np.where(self.logs, 0.0, 1e-3))
        columns = np.repeat(x[:, None], 2 * n + 1, axis=1)
        columns[np.arange(n), 1 + np.arange(n)] += steps
        columns[np.arange(n), 1 + n + np.arange(n)] -= steps
        widths = columns[np.arange(n), 1 + np.arange(n)] - columns[np.arange(n), 1 + n + np.arange(n)]
        p, states, delay = self.columns(columns)
        values, slopes = [], []
        for run, state in zip(self.runs, states, strict=True):
            with np.errstate(all="ignore"):
                simulated = run_in_lockstep(self.derivative, self.output, run.drive, state, p, delay)[run.kept]
            if not np.isfinite(simulated).all():
                return None
            values.append((simulated[:, 0] - run.measured[run.kept]) / run.sigma)
            slopes.append((simulated[:, 1 : n + 1] - simulated[:, n + 1 :]) / widths / run.sigma[:, None])
        return np.concatenate(values), np.concatenate(slopes)

    def columns(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return parameters, shape (n, m), states, (records, n_states, m), and delay, (m,), of columns of unknowns."""
        m, first = x.shape[1], len(self.where)
        p = np.repeat(self.p0[:, None], m, axis=1)
        p[self.where] = x[:first]
        states = np.repeat(self.states[:, :, None], m, axis=2)
        for k in range(len(self.runs)):
            own = first + k * len(self.free_state)
            states[k, list(self.free_state)] = x[own : own + len(self.free_state)]
        return p, states, x[-1] if self.delay_free else np.full(m, self.delay)


def _delay_of(given: float | tuple[float, float]) -> tuple[float, tuple[float, float] | None]:
    ends = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if ends.shape not in ((1,), (2,)) or not np.isfinite(ends).all() or ends[0] < 0.0 or ends[-1] < ends[0]:
        raise ParameterError.of(_DELAY, shown(given), "a delay >= 0 [s], or its two bounds")
    if ends.size == 1 or ends[0] == ends[1]:
        return float(ends[0]), None
    return float(ends.mean()), (float(ends[0]), float(ends[1]))
