"""The fit of a pseudo-Wiener model to throttle logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError
from mgdd.identify.throttle.free_run import as_log, below_ceiling, draw_free_run, free_run, quality_of, source_of
from mgdd.identify.throttle.whole_delay import delay_at_end
from mgdd.optimize.least_squares import FitOptions, fit_options
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.results import Fit
from mgdd.results.finding import Finding
from mgdd.results.fit_report import FitReport
from mgdd.signals.even_grid import common_step
from mgdd.throttle import PseudoWiener

if TYPE_CHECKING:
    import xarray as xr

# Enough that the best of PW-W and PW-P is found more than once on the records of the study.
_STARTS = MappingProxyType({"pw_r": 9, "pw_w": 16, "pw_p": 16})


def fit_pseudo_wiener(
    log: Any,
    kind: str = "pw_r",
    *,
    limp_home_deg: float | None = None,
    sides: str = "shared",
    free: Sequence[str] = (),
    delay_samples: float | Sequence[float] = 0,
    start_values: PseudoWiener | None = None,
    settings: Mapping[str, float] | None = None,
    lag_start: str = "best",
    options: FitOptions | None = None,
) -> Fit:
    """Fit a pseudo-Wiener model in free run, from several starts.

    Parameters
    ----------
    log : Dataset, DataFrame or mapping of columns, or a sequence of them
        ``duty`` [-] and ``angle_deg`` [deg] over an even ``time_s`` [s].
    limp_home_deg : float, optional
        Limp-home angle [deg]; the first angle of the first log if left out, which must then start at rest there.
    sides : {"shared", "above", "below", "both"}
        PW-R: one set of values for both sides of limp-home, only one side, or a set each.
    free : sequence of str, optional
        Parameters to fit, for PW-R without the side: ``tau_s gain_deg_per_s2_per_duty preload_duty spring_duty_per_deg
        coulomb_duty`` without, further ``square_per_deg cube_per_deg2 limp_home_deg``; for the others all.
    delay_samples : float or sequence of float
        Delay of the duty, 0 to 5 samples; of several the best is kept.
    start_values : PseudoWiener, optional
        A single search from here, instead of many.
    settings : mapping of str to float, optional
        Settings and held parameters of the model by name.
    lag_start : {"best", "rest", "map"}
        PW-W and PW-P: what the lags hold when a free run starts. ``rest``: no duty, as of a throttle that waits at
        limp-home; ``map``: what the static map turns into the first angle; ``best``: whichever fits better.
    options : FitOptions, optional
        9 searches per delay of PW-R and 16 of the others (per delay and start rule of the lags), seed 1 of their Latin
        hypercube, and 150 trial steps per search by default.

    Notes
    -----
    Output error with exact forward sensitivities on Levenberg-Marquardt. Only groups of the physical parameters can be
    identified from duty and angle: tau = J/b, G = g/J, and preload, spring and friction over the stall torque g.
    """
    chosen = fit_options(options, n_starts=_STARTS.get(kind, 1), seed=1, max_iterations=150)
    logs = [as_log(record) for record in ([log] if isinstance(log, Mapping) or hasattr(log, "columns") else list(log))]
    if not logs:
        raise DataError("no logs: a fit needs at least one")
    sample_s = _sample(logs)
    columns = [(record["duty"].to_numpy(), record["angle_deg"].to_numpy()) for record in logs]
    limp_home = float(columns[0][1][0]) if limp_home_deg is None else float(limp_home_deg)
    base = PseudoWiener(kind) if start_values is None else start_values
    if base.kind != kind:
        raise ParameterError(f"start_values is a {base.kind}: must be a {kind}")
    values: dict[str, float] = {**base.at_sample(sample_s).parameters, "limp_home_deg": limp_home}
    ParameterError.unless(lag_start in ("best", "rest", "map"), "lag_start", lag_start, "one of best, rest, map")
    if lag_start != "best" and "map_start" in values:
        values["map_start"] = float(lag_start == "map")
    values |= {name: float(value) for name, value in (settings or {}).items()}
    delays = [delay_samples] if isinstance(delay_samples, int | float) else list(delay_samples)
    (parameters, report, errors, n_best), stop = or_partial(
        lambda: _core.identify.fit_pseudo_wiener(
            kind=kind,
            records=columns,
            parameters=values,
            sides=sides,
            free=list(free),
            delays=delays,
            starts=chosen.n_starts,
            seed=chosen.seed,
            only_given_start=start_values is not None,
            try_map_start=lag_start == "best",
            max_iterations=chosen.max_iterations,
        )
    )
    wrapped = FitReport.from_core(report, np.concatenate([angle for _, angle in columns]))
    model = PseudoWiener(kind, parameters)
    runs = [free_run(model, record) for record in logs]
    findings = [*wrapped.findings]
    findings += delay_at_end(parameters["delay_samples"], delays, 5.0)
    if errors.size > 1 and n_best < 2:
        text = "the best fit was found once only: a better one may exist"
        findings.append(Finding("found_once", (), text, "raise n_starts"))
    if kind == "pw_r" and sides == "shared":
        text = "one set of values serves both sides of limp-home"
        findings.append(Finding("shared_sides", (), text, "sides='both' fits a set each"))
    train = quality_of(runs)
    fit = Fit(
        report=wrapped,
        model=model,
        kind=kind,
        train=train,
        unidentifiable=wrapped.unidentifiable,
        findings=(*findings, *below_ceiling(logs, train)),
        source=source_of(logs[0]),
        start_rmse=tuple(errors.tolist()),
        n_best=int(n_best),
        run=runs[0],
        draw=draw_free_run,
    )
    return hand_over(fit, stop)


def _sample(logs: Sequence[xr.Dataset]) -> float:
    names = [f"log {k}" for k in range(1, len(logs) + 1)]
    return common_step([record["time_s"].to_numpy() for record in logs], names)
