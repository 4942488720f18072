"""First-principle identification of a throttle log, in groups that duty and angle determine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from mgdd import _core
from mgdd.errors import ParameterError
from mgdd.identify.throttle.first_principle_model import GROUP_NAMES, FirstPrincipleModel, whole_shift
from mgdd.identify.throttle.first_principle_problem import group_starts, groups_problem
from mgdd.identify.throttle.free_run import as_log, below_ceiling, draw_free_run, free_run, quality_of, source_of
from mgdd.identify.throttle.nuisances import SHARE, TYPICAL_SHARE, with_nuisances
from mgdd.optimize.least_squares import FitOptions, fit_options
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.parallel.pool import threads_of
from mgdd.results import Fit
from mgdd.results.fit_report import FitReport

STATIC = (*GROUP_NAMES[2:7], "limp_home_deg")
SUBSTEPS = 4  # 0.25 ms at 1 kHz: the lag is then met within 5 %


def fit_first_principle(
    log: Any,
    *,
    start_values: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    options: FitOptions | None = None,
) -> Fit:
    """Fit the groups tau = J/b, G = g/J, T_pt/g, k_s/g and T_d/g, g the stall torque per duty, in a structure given.

    A regression on the torque balance of the moving samples gives the start; the free run is then fitted in stages
    (dynamics, static groups, all), from several starts. A side of limp-home the log does not visit keeps its start
    values and is named. `mgdd.identify.identify_throttle` chooses the structure, and covers delays.

    Parameters
    ----------
    log : Dataset, DataFrame or mapping of columns
        ``duty`` [-] and ``angle_deg`` [deg] over ``time_s`` [s], evenly sampled.
    start_values, fixed : mapping of str to float, optional
        Start values of some groups, taken as they are instead of the regression; groups that are not estimated.
    free : sequence of str, optional
        Further groups to estimate: ``electrical_s ramp_deg stribeck_drop stribeck_deg_per_s presliding_deg
        presliding_damping half_gap_deg delay_samples viscous_share``. Otherwise they keep their start values; with a
        lag ``viscous_share`` is 0.25 where it is not given, and its range counts in the errors.
    options : FitOptions, optional
        4 starts, within a factor of 2 around the first, with seed 0, 60 trial steps per stage and a tolerance of 1e-10
        of the last stage by default.

    Raises
    ------
    Interrupted
        Ctrl-C; ``partial`` is the best fit of what was searched until then, None where nothing was.

    References
    ----------
    Nielsen (1999) for the damping; Bates and Watts (1988), section 2.2, for the uncertainty.
    """
    log = as_log(log)
    chosen = fit_options(options, n_starts=4, seed=0, max_iterations=60, tolerance=1e-10)
    share_known = any(SHARE in given for given in (start_values or {}, fixed or {}, free))
    problem = groups_problem(log, free=free, start_values=start_values, fixed=fixed)
    if not share_known and ("electrical_s" in problem.free or problem.values["electrical_s"] > 0.0):
        problem = dataclasses.replace(problem, values={**problem.values, SHARE: TYPICAL_SHARE})
    if whole_shift(problem.values["delay_samples"]):
        text = "within [0, 5] here; identify_throttle(log, 'first_principle') covers delays of up to 20 samples"
        raise ParameterError.of("delay_samples", problem.values["delay_samples"], text)
    index = {name: i for i, name in enumerate(GROUP_NAMES)}
    static = [index[name] for name in problem.free if name in STATIC]
    dynamics = [index[name] for name in problem.free if name in ("tau_s", "gain_deg_per_s2_per_duty")]
    everything = [index[name] for name in problem.free]
    stages: list[tuple[list[int], list[int], float, float, int]] = [
        (part, [], fraction, tolerance, chosen.max_iterations)
        for part, fraction, tolerance in (
            (dynamics, 0.1, 1e-3),
            (static, 0.1, 1e-3),
            (everything, 0.25, 1e-4),
            (everything, 1.0, chosen.tolerance),
        )
        if part and (fraction == 1.0 or fraction * problem.angle.size >= 200)
    ]
    starts = group_starts(problem.values, list(problem.free), chosen.n_starts, chosen.seed)
    how: dict[str, Any] = {"records": [problem.record()], "stages": stages, "closed_deg": 0.0, "open_deg": 90.0}
    search = partial(_core.identify.fit_throttle_groups, starts=starts, substeps=SUBSTEPS, n_threads=threads_of(None))
    result, stop = or_partial(lambda: search(**how))
    report = FitReport.from_core(result["reports"][result["best"]], problem.angle)
    groups = dict(zip(GROUP_NAMES, result["values"], strict=True))
    model = FirstPrincipleModel(parameters=groups, substeps=SUBSTEPS, sample_s=problem.step_s)
    findings = (*problem.findings, *report.findings)
    report = with_nuisances(problem, model.parameters, report, substeps=SUBSTEPS, share_known=share_known)
    run = free_run(model, log)
    train = quality_of([run])
    fit = Fit(
        report=report,
        model=model,
        kind=model.kind,
        train=train,
        unidentifiable=(*problem.unvisited, *report.unidentifiable),
        findings=(*findings, *below_ceiling([log], train)),
        source=source_of(log),
        start_rmse=tuple(sorted(float(start_report.rmse) for start_report in result["reports"])),
        n_best=int(result["n_reached"]),
        run=run,
        draw=draw_free_run,
    )
    return hand_over(fit, stop)
