"""First-principle identification of a throttle log, in groups that duty and angle determine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, argument, hand_over, or_partial
from mgdd.identify.throttle.first_principle_model import GROUP_NAMES, TYPICAL, FirstPrincipleModel
from mgdd.identify.throttle.first_principle_start import (
    SIDE_DEG,
    group_starts,
    regression_start,
    rest_angle,
)
from mgdd.identify.throttle.free_run import LOG_COLUMNS, draw_free_run, free_run, quality_of, source_of
from mgdd.optimize.fit_options import FitOptions, fit_options
from mgdd.results import Finding, Fit, FitReport
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import columns_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["fit_first_principle"]

ABOVE = ("beta_above_duty", "kappa_above_duty_per_deg")
BELOW = ("beta_below_duty", "kappa_below_duty_per_deg")
SIDE_S = 0.3  # shorter visits cannot settle a side's two parameters


def fit_first_principle(
    log: xr.Dataset,
    *,
    test: xr.Dataset | None = None,
    start_values: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    electrical: bool = False,
    closed_deg: float = 0.0,
    open_deg: float = 90.0,
    options: FitOptions | None = None,
    threads: int = 1,
    resistance_ohm: float | None = None,
    supply_v: float | None = None,
    inertia_kgm2: float | None = None,
    torque_constant_nm_per_a: float | None = None,
) -> Fit:
    """Identify the first-principle throttle from duty and angle.

    Duty and angle determine torques only in units of duty and inertia only as an acceleration per duty, so the
    unknowns are groups: tau = J/b, G = g/J, preload T_pt/g, stiffness k_s/g and friction T_d/g with g the stall torque
    per unit duty and b all viscous damping. A regression on the torque balance of the moving samples gives the start;
    the free run is then fitted in stages (dynamics, static groups, all), from several starts. A side of limp-home
    the log does not visit keeps its start values and is named. With a resistance, a supply and one of inertia or
    torque constant the physical numbers are computed back (`FirstPrincipleModel.physical_parameters`) and said in
    `findings`.

    Parameters
    ----------
    log : xarray.Dataset
        ``duty`` [-] and ``angle_deg`` [deg] over ``time_s`` [s], evenly sampled.
    test : xarray.Dataset, optional
        Another log; gives the quality ``test``.
    start_values : mapping of str to float, optional
        Start values of some groups; taken as they are instead of the regression.
    fixed : mapping of str to float, optional
        Groups that are known and not estimated.
    electrical : bool
        Also estimate ``electrical_s`` (L/R).
    closed_deg, open_deg : float
        Mechanical stops [deg].
    options : FitOptions, optional
        4 starts, within a factor of 2 around the first, with seed 0, 60 trial steps per stage and a tolerance of 1e-10
        of the last stage where nothing else is said.
    threads : int
        Threads over starts.
    resistance_ohm, supply_v, inertia_kgm2, torque_constant_nm_per_a : float, optional
        Known numbers, for `FirstPrincipleModel.physical_parameters`; their absence is said in `findings`.

    Returns
    -------
    mgdd.results.Fit
        ``kind`` is ``first_principle``.

    Raises
    ------
    DataError
        A log that is not evenly sampled or too short, or whose plate hardly moves.
    ParameterError
        Unknown group names, or a value outside its bounds.

    References
    ----------
    Nielsen (1999) for the damping; Bates and Watts (1988), section 2.2, for the uncertainty.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import FirstPrincipleModel, fit_first_principle
    >>> from mgdd.optimize import FitOptions
    >>> time = 1e-3 * np.arange(4000)
    >>> duty = 0.12 + 0.2 * np.sin(2 * np.pi * time * (0.5 + time))
    >>> log = FirstPrincipleModel().simulate({"time_s": time, "duty": duty}, initial_state={"angle_deg": 30.0})
    >>> fit = fit_first_principle(log, options=FitOptions(n_starts=1))
    >>> fit.train.nrmse_fit_percent > 99.0
    True
    """
    chosen = fit_options(options, n_starts=4, seed=0, max_iterations=60, tolerance=1e-10)
    n_starts = chosen.n_starts
    time, duty, angle = _columns(log)
    if test is not None:
        _columns(test)
    step_s = even_step(time, remedy=f"read_throttle_log(..., {argument('step_s', '{step:g}')}) resamples")
    for name in [*(start_values or {}), *(fixed or {})]:
        if name not in GROUP_NAMES:
            raise ParameterError(f"{name!r}: no throttle group; they are {', '.join(GROUP_NAMES)}")
    if threads < 1:
        raise ParameterError.of("threads", threads, ">= 1")
    if np.ptp(angle) < 1.0:
        raise DataError(f"angle_deg moves by {np.ptp(angle):.3g} deg: drive the plate, mgdd.identify.design_excitation")
    values = dict(TYPICAL)
    values["limp_home_deg"] = rest_angle(step_s, duty, angle, values["limp_home_deg"])
    values |= {name: float(value) for name, value in {**(start_values or {}), **(fixed or {})}.items()}
    findings: list[Finding] = []
    unvisited: list[str] = []
    free = [name for name in GROUP_NAMES if name not in (fixed or {})]
    if not electrical and "electrical_s" in free:
        free.remove("electrical_s")
    sides = {
        "above": (angle > values["limp_home_deg"] + SIDE_DEG, ABOVE),
        "below": (angle < values["limp_home_deg"] - SIDE_DEG, BELOW),
    }
    for side, (visited, names) in sides.items():
        if np.count_nonzero(visited) * step_s < SIDE_S:
            gone = [name for name in (*names, "limp_home_deg") if name in free]
            free = [name for name in free if name not in gone]
            unvisited += gone
            findings.append(
                Finding(
                    "start_value_kept",
                    tuple(gone),
                    f"the plate spends less than {SIDE_S:g} s {side} limp-home ({values['limp_home_deg']:.3g} deg): "
                    f"{', '.join(gone) or 'that side'} kept at the start value",
                    "use an excitation across limp-home",
                )
            )
    if start_values is None:
        values |= regression_start(step_s, duty, angle, values, free, closed_deg, open_deg)
    bounds = {parameter.name: parameter for parameter in _core.identify.throttle_group_bounds()}
    for name, value in values.items():
        low, high = bounds[name].lower, bounds[name].upper
        if (name in (start_values or {}) or name in (fixed or {})) and not low <= value <= high:
            raise ParameterError.of(name, value, f"within [{low:g}, {high:g}]")
        values[name] = min(max(value, low), high)
    index = {name: i for i, name in enumerate(GROUP_NAMES)}
    static = [index[name] for name in free if name not in ("tau_s", "gain_deg_per_s2_per_duty", "electrical_s")]
    dynamics = [index[name] for name in free if name in ("tau_s", "gain_deg_per_s2_per_duty")]
    everything = [index[name] for name in free]
    if not everything:
        raise ParameterError("fixed: nothing is left to estimate")
    stages: list[tuple[list[int], list[int], float, float, int]] = [
        (part, [], fraction, tolerance, chosen.max_iterations)
        for part, fraction, tolerance in (
            (dynamics, 0.1, 1e-3),
            (static, 0.1, 1e-3),
            (everything, 0.25, 1e-4),
            (everything, 1.0, chosen.tolerance),
        )
        if part and (fraction == 1.0 or fraction * time.size >= 200)
    ]
    found, stop = or_partial(
        lambda: _core.identify.fit_throttle_groups(
            [(step_s, np.clip(duty, -1.0, 1.0), angle, [float(angle[0]), 0.0, 0.0], 0, False)],
            stages=stages,
            starts=group_starts(values, free, bounds, n_starts, chosen.seed),
            closed_deg=closed_deg,
            open_deg=open_deg,
            ramp_deg=0.25,
            substeps=2,
            n_threads=threads,
        )
    )
    report = FitReport.from_core(found["reports"][found["best"]], angle)
    model = FirstPrincipleModel(
        parameters=dict(zip(GROUP_NAMES, found["values"], strict=True)), closed_deg=closed_deg, open_deg=open_deg
    )
    findings += report.findings
    if supply_v is None or resistance_ohm is None or (inertia_kgm2 is None) == (torque_constant_nm_per_a is None):
        findings.append(
            Finding(
                "groups_only",
                (),
                "groups only: duty and angle cannot separate inertia, torque constant, resistance and damping",
                "give resistance_ohm, supply_v and one of inertia_kgm2 and torque_constant_nm_per_a",
            )
        )
    else:
        physical = model.physical_parameters(
            resistance_ohm=resistance_ohm,
            supply_v=supply_v,
            inertia_kgm2=inertia_kgm2,
            torque_constant_nm_per_a=torque_constant_nm_per_a,
        )
        text = "physical numbers: " + ", ".join(f"{name} {value:.4g}" for name, value in physical.items())
        findings.append(Finding("physical_parameters", tuple(physical), text))
    run = free_run(model, log)
    fit = Fit(
        report=report,
        model=model,
        kind=model.kind,
        train=quality_of([run]),
        test=None if test is None else quality_of([free_run(model, test)]),
        unidentifiable=(*unvisited, *report.unidentifiable),
        findings=tuple(findings),
        source=source_of(log),
        start_rmse=tuple(sorted(float(one.rmse) for one in found["reports"])),
        n_best=int(found["n_reached"]),
        run=run,
        draw=draw_free_run,
    )
    return hand_over(fit, stop)


def _columns(log: xr.Dataset) -> list[NDArray[np.float64]]:
    columns = columns_of(log, LOG_COLUMNS)
    if columns[0].size < 100:
        raise DataError(f"log has {columns[0].size} samples: at least 100 are needed")
    return columns
