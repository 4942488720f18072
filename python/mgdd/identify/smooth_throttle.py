"""Fit of the smooth throttle's ten parameters, from one or many starts at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import ShapeError, hand_over, or_partial
from mgdd.optimize import FitReport

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["SmoothThrottleFit", "fit_smooth_throttle", "simulate_smooth_throttle"]


@dataclass(frozen=True, kw_only=True)
class SmoothThrottleFit:
    """Fits of one record from several starts.

    Parameters
    ----------
    reports : tuple of mgdd.optimize.FitReport
        One per start, in order; rmse in deg, without the residual itself.
    best : int
        Index of the lowest cost.
    n_reached : int
        Starts whose rmse is within 0.5 % of the best.
    n_sweeps : int
        Passes over the whole record, all starts together.

    Examples
    --------
    >>> from mgdd.identify import SmoothThrottleFit
    >>> SmoothThrottleFit(reports=(), best=0, n_reached=0, n_sweeps=0).n_reached
    0
    """

    reports: tuple[FitReport, ...]
    best: int
    n_reached: int
    n_sweeps: int

    @property
    def report(self) -> FitReport:
        """Report of the best start."""
        return self.reports[self.best]


def simulate_smooth_throttle(
    duty: ArrayLike,
    *,
    parameters: ArrayLike | None = None,
    step_s: float = 1e-3,
    start: tuple[float, float, float] = (0.14, 0.0, 0.0),
    inertia_kgm2: float = 2e-3,
    gear_ratio: float = 20.0,
    inductance_h: float = 1e-3,
    supply_v: float = 12.0,
) -> NDArray[np.float64]:
    """Simulate the smooth throttle: RK4, one step per sample, duty held.

    Parameters
    ----------
    duty : array_like, shape (n,)
        Duty [-].
    parameters : array_like, shape (10,), optional
        In the order of ``mgdd._core.smooth_throttle_names``; an example throttle without.
    step_s : float
        Sample time [s].
    start : tuple of float
        Angle [rad], speed [rad/s] and current [A] at the first sample.
    inertia_kgm2, gear_ratio, inductance_h, supply_v : float
        Constants [kg m², -, H, V].

    Returns
    -------
    ndarray, shape (n,)
        Angle [deg].

    Raises
    ------
    ParameterError
        A constant that is not positive.

    Examples
    --------
    >>> from mgdd.identify import simulate_smooth_throttle
    >>> simulate_smooth_throttle([0.0] * 5).round(3).tolist()
    [8.021, 8.021, 8.021, 8.021, 8.021]
    """
    values = _core.smooth_throttle_example if parameters is None else parameters
    return _core.simulate_smooth_throttle(
        _ten(values, "parameters"),
        np.asarray(duty, dtype=np.float64),
        step_s=step_s,
        start=list(start),
        inertia_kgm2=inertia_kgm2,
        gear_ratio=gear_ratio,
        inductance_h=inductance_h,
        supply_v=supply_v,
    )


def fit_smooth_throttle(
    duty: ArrayLike,
    angle_deg: ArrayLike,
    *,
    starts: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    step_s: float = 1e-3,
    start: tuple[float, float, float] = (0.14, 0.0, 0.0),
    inertia_kgm2: float = 2e-3,
    gear_ratio: float = 20.0,
    inductance_h: float = 1e-3,
    supply_v: float = 12.0,
    cost_tolerance: float = 1e-9,
    lanes: bool = True,
) -> SmoothThrottleFit:
    """Fit the ten parameters of the smooth throttle to a record of duty and angle.

    Levenberg-Marquardt on the output error of the free run with exact sensitivities, in four stages: a twentieth of
    the record without and with the two smoothing widths, a quarter, then all of it with all ten parameters. Several
    starts run side by side in SIMD lanes. A smoothing width that the record does not determine is named.

    Parameters
    ----------
    duty, angle_deg : array_like, shape (n,)
        Record on a constant sample time [-, deg].
    starts : array_like, shape (n_starts, 10) or (10,)
        In the order of ``mgdd._core.smooth_throttle_names`` (SI, rad).
    lower, upper : array_like, shape (10,)
        Bounds, positive.
    step_s : float
        Sample time [s].
    start : tuple of float
        Known angle [rad], speed [rad/s] and current [A] at the first sample.
    inertia_kgm2, gear_ratio, inductance_h, supply_v : float
        Known constants [kg m², -, H, V].
    cost_tolerance : float
        Relative decrease of the cost that ends the last stage [-].
    lanes : bool
        Several starts at once; False takes one after the other and gives the same numbers.

    Returns
    -------
    SmoothThrottleFit
        Reports of all starts.

    Raises
    ------
    ShapeError
        Arrays that do not belong together.
    ParameterError
        A start outside its bounds, or a constant that is not positive.
    DataError
        A record that is not finite.

    References
    ----------
    Nielsen (1999) for the damping; Moré (1978) for the scaling; Griewank and Walther (2008) for the sensitivities.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd import _core
    >>> from mgdd.identify import fit_smooth_throttle, simulate_smooth_throttle
    >>> levels = 0.7 * np.random.default_rng(1).random(100) - 0.35
    >>> duty = np.repeat(levels, 80)
    >>> truth = np.array(_core.smooth_throttle_example)
    >>> angle = simulate_smooth_throttle(duty) + np.random.default_rng(2).normal(0.0, 0.05, duty.size)
    >>> fit = fit_smooth_throttle(duty, angle, starts=1.1 * truth, lower=0.1 * truth, upper=10 * truth)
    >>> bool(fit.report.rmse < 0.051)
    True
    """
    table = np.atleast_2d(np.asarray(starts, dtype=np.float64))
    if table.ndim != 2 or table.shape[1] != 10:
        raise ShapeError(f"starts has shape {table.shape}: must be (n_starts, 10)")
    found, stop = or_partial(
        lambda: _core.fit_smooth_throttle(
            np.asarray(duty, dtype=np.float64),
            np.asarray(angle_deg, dtype=np.float64),
            starts=table.tolist(),
            lower=_ten(lower, "lower"),
            upper=_ten(upper, "upper"),
            step_s=step_s,
            start=list(start),
            inertia_kgm2=inertia_kgm2,
            gear_ratio=gear_ratio,
            inductance_h=inductance_h,
            supply_v=supply_v,
            cost_tolerance=cost_tolerance,
            lanes=lanes,
        )
    )
    fit = SmoothThrottleFit(
        reports=tuple(FitReport.from_core(report) for report in found["reports"]),
        best=found["best"],
        n_reached=found["n_reached"],
        n_sweeps=found["n_sweeps"],
    )
    return hand_over(fit, stop)


def _ten(values: ArrayLike, name: str) -> list[float]:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (10,):
        raise ShapeError(f"{name} has shape {vector.shape}: must be (10,)")
    return [float(value) for value in vector]
