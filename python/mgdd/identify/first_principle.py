"""First-principle identification of a throttle log, in groups that duty and angle determine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify.metrics import fit_percent
from mgdd.identify.throttle_fit import FittedParameters, ThrottleFit
from mgdd.optimize import FitReport

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = ["FirstPrincipleModel", "fit_throttle", "physical_parameters", "throttle_start"]

_NAMES = tuple(_core.throttle_group_names)
_ABOVE = ("beta_above_duty", "kappa_above_duty_per_deg")
_BELOW = ("beta_below_duty", "kappa_below_duty_per_deg")
_SIDE_DEG = 1.0  # beyond it a sample belongs to one side of limp-home
_SIDE_S = 0.3  # shorter visits cannot settle a side's two parameters


@dataclass(frozen=True, kw_only=True)
class FirstPrincipleModel:
    """Throttle in groups: set-valued friction, springs with preload on both sides, motor as a torque source.

    Parameters
    ----------
    parameters : mapping of str to float
        ``tau_s``, ``gain_deg_per_s2_per_duty``, preload ``beta_above_duty`` / ``beta_below_duty``, stiffness
        ``kappa_above_duty_per_deg`` / ``kappa_below_duty_per_deg``, friction ``delta_duty``, ``limp_home_deg`` and
        ``electrical_s`` (L/R, 0 for none).
    closed_deg, open_deg : float
        Mechanical stops [deg].
    ramp_deg : float
        Half width of the preload's ramp at limp-home [deg].
    substeps : int
        Steps per sample.

    Examples
    --------
    >>> from mgdd.identify import FirstPrincipleModel, throttle_start
    >>> model = FirstPrincipleModel(parameters=throttle_start())
    >>> model.simulate([0.0, 0.001, 0.002], [0.0, 0.0, 0.0], start_deg=8.0).tolist()
    [8.0, 8.0, 8.0]
    """

    parameters: Mapping[str, float]
    closed_deg: float = 0.0
    open_deg: float = 90.0
    ramp_deg: float = 0.25
    substeps: int = 2

    def __post_init__(self) -> None:
        missing = set(_NAMES) - set(self.parameters)
        if missing:
            raise ParameterError(f"parameters: {', '.join(sorted(missing))} missing")
        ordered = {name: float(self.parameters[name]) for name in _NAMES}
        for name, value in ordered.items():
            if not math.isfinite(value):
                raise ParameterError(f"{name} = {value!r}: must be finite")
        object.__setattr__(self, "parameters", MappingProxyType(ordered))

    @property
    def kind(self) -> str:
        """``first_principle``."""
        return "first_principle"

    def simulate(self, time_s: ArrayLike, duty: ArrayLike, *, start_deg: float) -> NDArray[np.float64]:
        """Run free from rest.

        Parameters
        ----------
        time_s, duty : array_like, shape (n,)
            Constant sample time [s]; duty [-], held to the next sample.
        start_deg : float
            Angle at the first sample [deg].

        Returns
        -------
        ndarray, shape (n,)
            Angle [deg] at every sample.
        """
        u = np.asarray(duty, dtype=np.float64)
        return _core.simulate_throttle_groups(
            list(self.parameters.values()),
            np.clip(u, -1.0, 1.0),
            step_s=_step(time_s, u.size),
            start=[float(start_deg), 0.0, 0.0],
            closed_deg=self.closed_deg,
            open_deg=self.open_deg,
            ramp_deg=self.ramp_deg,
            substeps=self.substeps,
        )

    def predict(self, time_s: ArrayLike, duty: ArrayLike, angle_deg: ArrayLike, horizon: int) -> NDArray[np.float64]:
        """Predict `horizon` samples ahead: the measured angle plus the free run's change over the horizon.

        Parameters
        ----------
        time_s, duty, angle_deg : array_like, shape (n,)
            Log [s, -, deg].
        horizon : int
            Samples, at least 1.

        Returns
        -------
        ndarray, shape (n - horizon,)
            Entry k is the angle [deg] at sample k + horizon.
        """
        measured = np.asarray(angle_deg, dtype=np.float64)
        if not 1 <= horizon < measured.size:
            raise ParameterError(f"horizon = {horizon}: must be within [1, {measured.size - 1}] samples")
        run = self.simulate(time_s, duty, start_deg=float(measured[0]))
        return measured[:-horizon] + run[horizon:] - run[:-horizon]

    def to_toml(self) -> str:
        """Write the parameters as TOML with their units.

        Returns
        -------
        str
            TOML for `FittedParameters.from_toml`.
        """
        return FittedParameters(kind=self.kind, values=self.parameters, source="model").to_toml()


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
    return dict(zip(_NAMES, values, strict=True))


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
    time, duty, angle = _columns(log)
    step_s = _step(time, time.size)
    for name in [*(start or {}), *(fixed or {})]:
        if name not in _NAMES:
            raise ParameterError(f"{name!r}: no throttle group; they are {', '.join(_NAMES)}")
    if n_starts < 1 or threads < 1:
        raise ParameterError(f"n_starts = {n_starts}, threads = {threads}: must be >= 1")
    if np.ptp(angle) < 1.0:
        raise DataError(f"angle_deg moves by {np.ptp(angle):.3g} deg: drive the plate, mgdd.identify.design_excitation")
    values = throttle_start()
    values["limp_home_deg"] = _limp_home(step_s, duty, angle, values["limp_home_deg"])
    values |= {name: float(value) for name, value in {**(start or {}), **(fixed or {})}.items()}
    findings: list[str] = []
    unvisited: list[str] = []
    free = [name for name in _NAMES if name not in (fixed or {})]
    if not electrical and "electrical_s" in free:
        free.remove("electrical_s")
    sides = {
        "above": (angle > values["limp_home_deg"] + _SIDE_DEG, _ABOVE),
        "below": (angle < values["limp_home_deg"] - _SIDE_DEG, _BELOW),
    }
    for side, (visited, names) in sides.items():
        if np.count_nonzero(visited) * step_s < _SIDE_S:
            gone = [name for name in (*names, "limp_home_deg") if name in free]
            free = [name for name in free if name not in gone]
            unvisited += gone
            findings.append(
                f"the plate spends less than {_SIDE_S:g} s {side} limp-home ({values['limp_home_deg']:.3g} deg): "
                f"{', '.join(gone) or 'that side'} kept at the start value; an excitation across limp-home would tell"
            )
    if start is None:
        values |= _regression(step_s, duty, angle, values, free, closed_deg, open_deg)
    bounds = {parameter.name: parameter for parameter in _core.throttle_group_bounds()}
    for name, value in values.items():
        low, high = bounds[name].lower, bounds[name].upper
        if (name in (start or {}) or name in (fixed or {})) and not low <= value <= high:
            raise ParameterError(f"{name} = {value!r}: must be within [{low:g}, {high:g}]")
        values[name] = min(max(value, low), high)
    index = {name: i for i, name in enumerate(_NAMES)}
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
    found = _core.fit_throttle_groups(
        [(step_s, np.clip(duty, -1.0, 1.0), angle, [float(angle[0]), 0.0, 0.0], 0, False)],
        stages=stages,
        starts=_starts(values, free, bounds, n_starts, seed),
        closed_deg=closed_deg,
        open_deg=open_deg,
        ramp_deg=0.25,
        substeps=2,
        n_threads=threads,
    )
    report = FitReport.from_core(found["reports"][found["best"]], angle)
    model = FirstPrincipleModel(
        parameters=dict(zip(_NAMES, found["values"], strict=True)), closed_deg=closed_deg, open_deg=open_deg
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
        test_time, test_duty, test_angle = _columns(test)
        run = model.simulate(test_time, test_duty, start_deg=float(test_angle[0]))
        fit_test, rmse_test = fit_percent(test_angle, run), float(np.sqrt(np.mean((run - test_angle) ** 2)))
    run = model.simulate(time, duty, start_deg=float(angle[0]))
    return ThrottleFit(
        report=report,
        model=model,
        kind="first_principle",
        fit_percent_train=fit_percent(angle, run),
        fit_percent_test=fit_test,
        rmse_test_deg=rmse_test,
        parameters=dict(model.parameters),
        unidentifiable=(*unvisited, *report.unidentifiable),
        findings=tuple(findings),
        source=str(log.attrs.get("source", "log")),
    )


def physical_parameters(
    model: FirstPrincipleModel,
    *,
    resistance_ohm: float,
    supply_v: float,
    inertia_kgm2: float | None = None,
    torque_constant_nm_per_a: float | None = None,
) -> dict[str, float]:
    """Compute physical numbers back from groups: g = K V/R and G = g/J leave one number to be known.

    Parameters
    ----------
    model : FirstPrincipleModel
        Groups.
    resistance_ohm, supply_v : float
        Measured at the terminals [ohm, V].
    inertia_kgm2, torque_constant_nm_per_a : float
        Exactly one of them [kg m², N m/A at the plate].

    Returns
    -------
    dict of str to float
        Inertia, torque constant, viscous friction (without back-EMF), springs, preloads and Coulomb friction, all at
        the plate shaft.

    Raises
    ------
    ParameterError
        A number that is not positive, or none or both of the two.

    Examples
    --------
    >>> from mgdd.identify import FirstPrincipleModel, physical_parameters, throttle_start
    >>> model = FirstPrincipleModel(parameters=throttle_start())
    >>> found = physical_parameters(model, resistance_ohm=1.5, supply_v=12.0, inertia_kgm2=0.0021)
    >>> round(found["torque_constant_nm_per_a"], 4)
    0.2291
    """
    known = {
        "resistance_ohm": resistance_ohm,
        "supply_v": supply_v,
        "inertia_kgm2": inertia_kgm2,
        "torque_constant_nm_per_a": torque_constant_nm_per_a,
    }
    for name, value in known.items():
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ParameterError(f"{name} = {value!r}: must be > 0")
    if (inertia_kgm2 is None) == (torque_constant_nm_per_a is None):
        raise ParameterError("inertia_kgm2, torque_constant_nm_per_a: give exactly one of them")
    p = model.parameters
    gain = math.radians(p["gain_deg_per_s2_per_duty"])
    if torque_constant_nm_per_a is not None:
        stall = torque_constant_nm_per_a * supply_v / resistance_ohm
    else:
        stall = gain * float(inertia_kgm2 or math.nan)
    inertia = stall / gain
    constant = stall * resistance_ohm / supply_v
    return {
        "inertia_kgm2": inertia,
        "torque_constant_nm_per_a": constant,
        "viscous_nms_per_rad": inertia / p["tau_s"] - constant**2 / resistance_ohm,
        "spring_above_nm_per_rad": math.degrees(p["kappa_above_duty_per_deg"]) * stall,
        "spring_below_nm_per_rad": math.degrees(p["kappa_below_duty_per_deg"]) * stall,
        "preload_above_nm": p["beta_above_duty"] * stall,
        "preload_below_nm": p["beta_below_duty"] * stall,
        "coulomb_nm": p["delta_duty"] * stall,
    }


def _columns(log: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
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


def _step(time_s: ArrayLike, size: int) -> float:
    time = np.asarray(time_s, dtype=np.float64)
    if time.ndim != 1 or time.size != size or size < 2:
        raise ShapeError(f"time_s has shape {time.shape}, duty {size} values: must be equal and at least 2")
    steps = np.diff(time)
    if steps.min() <= 0.0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise DataError("time_s: must rise in equal steps; read_throttle_log(..., step_s=...) resamples")
    return float((time[-1] - time[0]) / (size - 1))


def _limp_home(step_s: float, duty: NDArray[np.float64], angle: NDArray[np.float64], otherwise: float) -> float:
    """Angle at the end of the longest rest without duty, if it lasts half a second."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (np.abs(duty) < 0.01).astype(int), [0]])))
    begins, ends = edges[::2], edges[1::2]
    if begins.size == 0:
        return otherwise
    longest = int(np.argmax(ends - begins))
    tail = angle[max(begins[longest], ends[longest] - round(0.1 / step_s)) : ends[longest]]
    at_rest = (ends[longest] - begins[longest]) * step_s >= 0.5 and np.ptp(tail) < 0.5
    return float(np.median(tail)) if at_rest else otherwise


def _regression(
    step_s: float,
    duty: NDArray[np.float64],
    angle: NDArray[np.float64],
    values: Mapping[str, float],
    free: list[str],
    closed_deg: float,
    open_deg: float,
) -> dict[str, float]:
    """Torque balance of the moving samples: u = +-beta + kappa x + delta sign(w) + w/(G tau) + dw/dt/G."""
    half = max(3, round(0.010 / step_s))
    if angle.size < 10 * half:
        return {}
    grid = step_s * np.arange(-half, half + 1)
    weights = np.linalg.pinv(np.vander(grid, 4, increasing=True))
    smooth, speed, push = (
        np.convolve(angle, scale * weights[order][::-1], mode="valid")
        for order, scale in ((0, 1.0), (1, 1.0), (2, 2.0))
    )
    u = np.convolve(duty, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    x = smooth - values["limp_home_deg"]
    inside = (smooth > closed_deg + 1.0) & (smooth < open_deg - 1.0) & (np.abs(x) > _SIDE_DEG)
    # A window that holds a reversal, or starts from rest, has no single friction sign.
    moving = np.minimum.reduce([np.abs(np.roll(speed, shift)) for shift in (-half, 0, half)]) > 5.0
    steady = np.sign(np.roll(speed, -half)) == np.sign(np.roll(speed, half))
    chosen = inside & moving & steady
    if np.count_nonzero(chosen) < 50:
        return {}
    above = x > 0.0
    columns = {
        "beta_above_duty": above * 1.0,
        "kappa_above_duty_per_deg": above * x,
        "beta_below_duty": ~above * -1.0,
        "kappa_below_duty_per_deg": ~above * x,
        "delta_duty": np.sign(speed),
        "damping": speed,
        "inertia": push,
    }
    names = [name for name in columns if name in free or name in ("damping", "inertia")]
    matrix = np.column_stack([columns[name][chosen] for name in names])
    target = u[chosen] - sum(
        values[name] * columns[name][chosen] for name in columns if name in values and name not in names
    )
    solution = dict(zip(names, np.linalg.lstsq(matrix, target, rcond=None)[0].tolist(), strict=True))
    inertia, damping = solution.pop("inertia"), solution.pop("damping")
    found = {name: value for name, value in solution.items() if value > 0.0}
    if inertia > 0.0 and "gain_deg_per_s2_per_duty" in free:
        found["gain_deg_per_s2_per_duty"] = 1.0 / inertia
        if damping > 0.0 and "tau_s" in free:
            found["tau_s"] = inertia / damping
    return found


def _starts(
    values: Mapping[str, float], free: list[str], bounds: Mapping[str, _core.Parameter], n_starts: int, seed: int
) -> list[list[float]]:
    first = [values[name] for name in _NAMES]
    if n_starts == 1:
        return [first]
    around = [name for name in free if bounds[name].log_scaled]
    box = [
        _core.Parameter(
            name=name,
            lower=max(bounds[name].lower, 0.5 * values[name]),
            upper=min(bounds[name].upper, 2.0 * values[name]),
            log_scaled=True,
        )
        for name in around
    ]
    starts = [first]
    for point in _core.latin_hypercube(box, n_starts - 1, seed):
        other = dict(values) | dict(zip(around, np.asarray(point).tolist(), strict=True))
        starts.append([other[name] for name in _NAMES])
    return starts
