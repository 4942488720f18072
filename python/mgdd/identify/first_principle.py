"""First-principle identification of a throttle log, in groups that duty and angle determine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, hand_over, or_partial
from mgdd.identify.first_principle_model import GROUP_NAMES, FirstPrincipleModel, sample_step
from mgdd.identify.first_principle_start import SIDE_DEG, regression_start, rest_angle, spread_starts
from mgdd.identify.metrics import fit_percent
from mgdd.identify.physical_parameters import physical_parameters
from mgdd.identify.throttle_fit import ThrottleFit
from mgdd.optimize import FitReport

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["fit_throttle", "throttle_start"]

ABOVE = ("beta_above_duty", "kappa_above_duty_per_deg")
BELOW = ("beta_below_duty", "kappa_below_duty_per_deg")
SIDE_S = 0.3  # shorter visits cannot settle a side's two parameters


def throttle_start() -> dict[str, float]:
    """Return middle-of-the-road groups of a passenger-car throttle, a start for a fit.

    Returns
    -------
    dict of str to float
        By group name.

    Examples
    --------
    >>> from mgdd.identify import throttle_start
    >>> throttle_start()["tau_s"]
    0.03
    """
    values = (0.03, 5e4, 0.1, 1e-3, 0.05, 0.1, 1e-3, 8.0, 0.0)
    return dict(zip(GROUP_NAMES, values, strict=True))


def fit_throttle(
    log: xr.Dataset,
    *,
    test: xr.Dataset | None = None,
    start: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    electrical: bool = False,
    closed_deg: float = 0.0,
    open_deg: float = 90.0,
    n_starts: int = 4,
    seed: int = 0,
    threads: int = 1,
    max_iterations: int = 60,
    cost_tolerance: float = 1e-10,
    resistance_ohm: float | None = None,
    supply_v: float | None = None,
    inertia_kgm2: float | None = None,
    torque_constant_nm_per_a: float | None = None,
) -> ThrottleFit:
    """Identify the first-principle throttle from duty and angle.

    Duty and angle determine torques only in units of duty and inertia only as an acceleration per duty, so the
    unknowns are groups: tau = J/b, G = g/J, preload T_pt/g, stiffness k_s/g and friction T_d/g with g the stall torque
    per unit duty and b all viscous damping. A regression on the torque balance of the moving samples gives the start;
    the free run is then fitted in stages (dynamics, static groups, all), from `n_starts` starts. A side of limp-home
    the log does not visit keeps its start values and is named. With a resistance, a supply and one of inertia or
    torque constant the physical numbers are computed back (`physical_parameters`) and said in `findings`.

    Parameters
    ----------
    log : xarray.Dataset
        ``duty`` [-] and ``angle_deg`` [deg] over ``time_s`` [s], evenly sampled.
    test : xarray.Dataset, optional
        Another log; gives ``fit_percent_test``.
    start : mapping of str to float, optional
        Start values of some groups; taken as they are instead of the regression.
    fixed : mapping of str to float, optional
        Groups that are known and not estimated.
    electrical : bool
        Also estimate ``electrical_s`` (L/R).
    closed_deg, open_deg : float
        Mechanical stops [deg].
    n_starts : int
        1 for the first start alone; further ones within a factor of 2 around it.
    seed : int
        Of the further starts.
    threads : int
        Threads over starts.
    max_iterations : int
        Trial steps per stage.
    cost_tolerance : float
        Relative decrease of the cost that ends the last stage [-].
    resistance_ohm, supply_v, inertia_kgm2, torque_constant_nm_per_a : float, optional
        Known numbers, for `physical_parameters`; their absence is said in `findings`.

    Returns
    -------
    ThrottleFit
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
    >>> from mgdd.identify import FirstPrincipleModel, fit_throttle, throttle_start
    >>> from mgdd.io import throttle_log
    >>> time = 1e-3 * np.arange(4000)
    >>> duty = 0.12 + 0.2 * np.sin(2 * np.pi * time * (0.5 + time))
    >>> truth = FirstPrincipleModel(parameters=throttle_start())
    >>> log = throttle_log(time, duty, truth.simulate(time, duty, start_deg=30.0))
    >>> fit = fit_throttle(log, n_starts=1)
    >>> bool(fit.fit_percent_train > 99.0)
    True
    """
    time, duty, angle = log_columns(log)
    step_s = sample_step(time, time.size)
    for name in [*(start or {}), *(fixed or {})]:
        if name not in GROUP_NAMES:
            raise ParameterError(f"{name!r}: no throttle group; they are {', '.join(GROUP_NAMES)}")
    if n_starts < 1 or threads < 1:
        raise ParameterError(f"n_starts = {n_starts}, threads = {threads}: must be >= 1")
    if np.ptp(angle) < 1.0:
        raise DataError(f"angle_deg moves by {np.ptp(angle):.3g} deg: drive the plate, mgdd.identify.design_excitation")
    values = throttle_start()
    values["limp_home_deg"] = rest_angle(step_s, duty, angle, values["limp_home_deg"])
    values |= {name: float(value) for name, value in {**(start or {}), **(fixed or {})}.items()}
    findings: list[str] = []
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
                f"the plate spends less than {SIDE_S:g} s {side} limp-home ({values['limp_home_deg']:.3g} deg): "
                f"{', '.join(gone) or 'that side'} kept at the start value; an excitation across limp-home would tell"
            )
    if start is None:
        values |= regression_start(step_s, duty, angle, values, free, closed_deg, open_deg)
    bounds = {parameter.name: parameter for parameter in _core.throttle_group_bounds()}
    for name, value in values.items():
        low, high = bounds[name].lower, bounds[name].upper
        if (name in (start or {}) or name in (fixed or {})) and not low <= value <= high:
            raise ParameterError(f"{name} = {value!r}: must be within [{low:g}, {high:g}]")
        values[name] = min(max(value, low), high)
    index = {name: i for i, name in enumerate(GROUP_NAMES)}
    static = [index[name] for name in free if name not in ("tau_s", "gain_deg_per_s2_per_duty", "electrical_s")]
    dynamics = [index[name] for name in free if name in ("tau_s", "gain_deg_per_s2_per_duty")]
    everything = [index[name] for name in free]
    if not everything:
        raise ParameterError("fixed: nothing is left to estimate")
    stages: list[tuple[list[int], list[int], float, float, int]] = [
        (part, [], fraction, tolerance, max_iterations)
        for part, fraction, tolerance in (
            (dynamics, 0.1, 1e-3),
            (static, 0.1, 1e-3),
            (everything, 0.25, 1e-4),
            (everything, 1.0, cost_tolerance),
        )
        if part and (fraction == 1.0 or fraction * time.size >= 200)
    ]
    found, stop = or_partial(
        lambda: _core.fit_throttle_groups(
            [(step_s, np.clip(duty, -1.0, 1.0), angle, [float(angle[0]), 0.0, 0.0], 0, False)],
            stages=stages,
            starts=spread_starts(values, free, bounds, n_starts, seed),
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
    if n_starts > 1:
        findings.append(f"{found['n_reached']} of {n_starts} starts reached the best fit")
    if supply_v is None or resistance_ohm is None or (inertia_kgm2 is None) == (torque_constant_nm_per_a is None):
        findings.append(
            "groups only: duty and angle cannot separate inertia, torque constant, resistance and damping; give "
            "resistance_ohm, supply_v and one of inertia_kgm2 and torque_constant_nm_per_a"
        )
    else:
        physical = physical_parameters(
            model,
            resistance_ohm=resistance_ohm,
            supply_v=supply_v,
            inertia_kgm2=inertia_kgm2,
            torque_constant_nm_per_a=torque_constant_nm_per_a,
        )
        findings.append("physical numbers: " + ", ".join(f"{name} {value:.4g}" for name, value in physical.items()))
    fit_test, rmse_test = None, None
    if test is not None:
        test_time, test_duty, test_angle = log_columns(test)
        run = model.simulate(test_time, test_duty, start_deg=float(test_angle[0]))
        fit_test, rmse_test = fit_percent(test_angle, run), float(np.sqrt(np.mean((run - test_angle) ** 2)))
    run = model.simulate(time, duty, start_deg=float(angle[0]))
    fit = ThrottleFit(
        report=report,
        model=model,
        kind="first_principle",
        fit_percent_train=fit_percent(angle, run),
        fit_percent_test=fit_test,
        rmse_test_deg=rmse_test,
        parameters=dict(model.parameters),
        unidentifiable=(*unvisited, *report.unidentifiable),
        findings=tuple(findings),
        source=str(log.attrs.get("file", "log")),
    )
    return hand_over(fit, stop)


def log_columns(log: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    for name in ("time_s", "duty", "angle_deg"):
        if name not in log:
            raise DataError(f"log has no {name}: mgdd.io.read_throttle_log and throttle_log make one")
    time, duty, angle = (np.array(log[name], dtype=np.float64) for name in ("time_s", "duty", "angle_deg"))
    for name, column in (("time_s", time), ("duty", duty), ("angle_deg", angle)):
        if column.ndim != 1 or not np.isfinite(column).all():
            raise DataError(f"{name}: must be one column of finite numbers")
    if time.size < 100:
        raise DataError(f"log has {time.size} samples: at least 100 are needed")
    return time, duty, angle
