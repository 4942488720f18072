"""The fit of the user's own models to records: output error, ahead or free, of one record or several."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mgdd import _core
from mgdd._arguments import shown
from mgdd.errors import ParameterError
from mgdd.identify.grey_box.model import GreyBoxModel
from mgdd.identify.grey_box.models import at_estimates
from mgdd.identify.grey_box.records import records_of, states_of
from mgdd.identify.grey_box.search import Search, Unknowns, check_shooting, shoot
from mgdd.optimize.least_squares import FitOptions, fit_of, fit_options, fit_run, quality_of, spread_starts
from mgdd.parallel.finished import hand_over, keep_finished
from mgdd.results import Fit
from mgdd.results.fit_report import FitReport

_DELAY = "input_delay_s"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GreyBoxFit(Fit):
    """A fit of a grey-box model; `profile_likelihood` takes it.

    Parameters
    ----------
    search : Search
        Residual and records of the search.
    """

    search: Search


def fit_model(
    model: GreyBoxModel,
    record: Any,
    *,
    initial_state: ArrayLike | None = None,
    free: Collection[str] | None = None,
    free_state: Sequence[int] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    log_scaled: Collection[str] = (),
    input_delay_s: float | tuple[float, float] | None = None,
    skip: int = 0,
    sigma: Any = 1.0,
    horizon: int | None = None,
    shooting_samples: int | None = None,
    options: FitOptions | None = None,
) -> Fit:
    """Fit parameters and start of a model of the user's own functions to records.

    The residual is the output error of the free run: the model starts once and is never corrected. All central
    differences of a simulation run beside it, as columns.

    Parameters
    ----------
    model : OdeModel, DiscreteModel or SimulatorModel
        Functions, names of the columns, and where the search starts: `parameters` and `initial_state`.
    record : xarray.Dataset, DataFrame or mapping of columns, or a list of them
        ``time_s`` [s], evenly spaced, the inputs, and the measured outputs; a sample of those which is NaN is missing.
    initial_state : array_like, shape (n_states,) or (n_records, n_states), optional
        State at the first sample of every record, that of the model without; for the free ones where the search starts.
    free : collection of str, optional
        Parameters that are estimated; all without.
    free_state : sequence of int
        States whose value at the first sample is estimated; reported as ``state_0``, ..., of several records as
        ``state_0_of_1``, ...
    bounds : mapping of str to (float, float), optional
        Per parameter, also for ``state_0``, which holds for all records. The model is evaluated inside of them only.
    log_scaled : collection of str
        Parameters searched as logarithms; they need a positive lower bound.
    input_delay_s : float or (float, float), optional
        By which the inputs act later than they are sampled, >= 0 [s], that of the model without; between two bounds it
        is estimated, and reported as ``input_delay_s``. It need not be whole samples.
    skip : int
        First samples without a residual.
    sigma : float, array_like with one per sample, mapping of these by output, or a list of all these, one per record
        Noise level in the unit of the output; the residual is divided by it. Of several outputs it is their weight.
    horizon : int, optional
        Residual of the output predicted so many samples ahead, as `predict` of the model does: the measured output plus
        the change of the free run. What drifts, as the end of an integration, then does not count.
    shooting_samples : int, optional
        Before the search cut the records into stretches of so many samples, whose starts are free and whose gaps are
        closed in three stages: multiple shooting, for models whose free run from poor parameters loses the record.
        A good length is a fraction of an oscillation, or a few time constants.
    options : FitOptions, optional
        1 start, 100 trial steps and a tolerance of 1e-9 by default; more starts come from a Latin
        hypercube (seed 0) between the bounds, which must then be finite.

    Returns
    -------
    mgdd.results.Fit
        Report, model with the start of the first record and its free run of the first output, and the reports of all
        starts. Standard errors count blocks of a residual that is correlated in time (Kuensch 1989).

    Raises
    ------
    ParameterError
        Unknown names, bounds that do not hold the start, functions that do not take columns, or a model that is not
        finite at the start or beside it.
    ShapeError
        Arrays that do not belong together, functions that return another shape.
    DataError
        A record that is not finite or not evenly sampled; records of unlike sampling for a model in discrete time.
    Interrupted
        Ctrl-C; ``partial`` is the best fit of the starts that were finished.

    See Also
    --------
    mgdd.identify.profile_likelihood : an interval that does not take the model as linear.
    mgdd.optimize.least_squares : the search.

    References
    ----------
    Nielsen (1999) for the damping; Bates and Watts (1988), section 2.2, for the uncertainty; Kuensch (1989), The
    jackknife and the bootstrap for general stationary observations. Bock (1983), Recent advances in parameter
    identification techniques for ODE, for the stretches.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import DiscreteModel, fit_model
    >>> def logistic(x, u, p):
    ...     return x + p[0] * x * (1.0 - x / p[1]) - u[0] * x
    >>> truth = DiscreteModel(step=logistic, parameters={"growth": 0.3, "capacity": 8.0}, initial_state=(1.0,))
    >>> record = truth.simulate({"time_s": np.arange(60.0), "u": np.where(np.arange(60) > 30, 0.1, 0.0)})
    >>> start = DiscreteModel(step=logistic, parameters={"growth": 0.2, "capacity": 5.0}, initial_state=(1.0,))
    >>> fit_model(start, record).report.values.round(6).tolist()
    [0.3, 8.0]
    """
    chosen_options = fit_options(options, n_starts=1, seed=0, max_iterations=100, tolerance=1e-9)
    n_starts = chosen_options.n_starts
    runs = records_of(record, model, skip=skip, horizon=horizon, sigma=sigma)
    states = states_of(
        model.initial_state if initial_state is None else initial_state, len(model.initial_state), len(runs)
    )
    delay, delay_bounds = _delay_of(model.input_delay_s if input_delay_s is None else input_delay_s)
    names = list(model.parameters)
    chosen = names if free is None else [name for name in names if name in set(free)]
    free_states = [f"state_{i}" for i in free_state]
    starts_of = {f"{own}_of_{k}": own for k in range(len(runs)) for own in free_states}
    if len(runs) == 1:
        starts_of = {own: own for own in free_states}
    unknowns = [*chosen, *([_DELAY] if delay_bounds else []), *starts_of]
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
    known = {_DELAY: delay_bounds or (0.0, 0.0), **(bounds or {})}
    limits = [known.get(name, known.get(starts_of.get(name, name), (-np.inf, np.inf))) for name in unknowns]
    lower, upper = (np.array([ends[side] for ends in limits], dtype=np.float64) for side in (0, 1))
    search = Search(
        model=at_estimates(model, model.parameters, states[0], delay, runs[0].drive.step_s),
        records=runs,
        states=states,
        unknowns=Unknowns(
            names=tuple(unknowns),
            lower=lower,
            upper=upper,
            logs=tuple(not {name, starts_of.get(name, name)}.isdisjoint(log_scaled) for name in unknowns),
            where=tuple(names.index(name) for name in chosen),
            delay_free=delay_bounds is not None,
            free_state=tuple(free_state),
        ),
        options=chosen_options,
    )
    started = [*(model.parameters[name] for name in chosen), *([delay] if delay_bounds else [])]
    started += states[:, list(free_state)].ravel().tolist()
    first = dict(zip(unknowns, started, strict=True))
    box = [
        _core.optimize.Parameter(name=name, lower=low, upper=high, log_scaled=log)
        for name, low, high, log in zip(unknowns, lower.tolist(), upper.tolist(), search.unknowns.logs, strict=True)
    ]
    starts = spread_starts(first, box, n_starts, chosen_options.seed)
    if shooting_samples is not None:
        check_shooting(search, shooting_samples)
    search.check(np.array(started))

    def one(start: Mapping[str, float]) -> FitReport:
        near = start if shooting_samples is None else shoot(search, start, shooting_samples)
        return search.solve(list(near.values()))

    reports: list[FitReport] = []
    stop = keep_finished(one, starts, reports)
    if reports[0].status == "evaluation_failed" and n_starts == 1:
        search.explain(reports[0].values)
    best = min(reports, key=lambda report: report.cost if np.isfinite(report.cost) else np.inf)
    return hand_over(_fit(search, best, reports), stop)


def _fit(search: Search, best: FitReport, reports: Sequence[FitReport]) -> GreyBoxFit:
    p, delay = (array[..., 0] for array in search.shared_columns(best.values[: search.unknowns.shared, None]))
    first, name = search.records[0], search.model.output_names[0]
    values = dict(zip(search.model.parameters, p.tolist(), strict=True))
    model = at_estimates(search.model, values, search.start_of(best.values, 0), float(delay), first.drive.step_s)
    run, quality = None, None
    if np.isfinite(best.rmse):
        measured = first.outputs[0]
        simulated = model.simulate(first.table)[name].to_numpy()
        run = fit_run(first.drive.time_s, measured.values, simulated, model._label(name))
        quality = quality_of(run.isel(time_s=measured.kept))
    errors = [report.rmse if np.isfinite(report.rmse) else np.inf for report in reports]
    fit = fit_of(best, model, run, errors, train=quality, start_reports=tuple(reports))
    return GreyBoxFit(**vars(fit), search=search)


def _delay_of(given: float | tuple[float, float]) -> tuple[float, tuple[float, float] | None]:
    ends = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if ends.shape not in ((1,), (2,)) or not np.isfinite(ends).all() or ends[0] < 0.0 or ends[-1] < ends[0]:
        raise ParameterError.of(_DELAY, shown(given), "a delay >= 0 [s], or its two bounds")
    if ends.size == 1 or ends[0] == ends[1]:
        return float(ends[0]), None
    return float(ends.mean()), (float(ends[0]), float(ends[1]))
