"""Where a first-principle fit of a throttle log starts: rest angle, torque balance, spread starts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.identify.starts import spread_starts
from mgdd.identify.throttle.first_principle_model import GROUP_NAMES

if TYPE_CHECKING:
    from numpy.typing import NDArray

IDLE_DUTY = 0.03  # less than any plate needs to move
SIDE_DEG = 1.0  # beyond it a sample belongs to one side of limp-home


def rest_angle(step_s: float, duty: NDArray[np.float64], angle: NDArray[np.float64], otherwise: float) -> float:
    """Angle at the end of the longest rest without duty, if it lasts half a second.

    Failing that, the first angle of a record that starts at rest and either without duty or never to cross it; failing
    that, `otherwise`.
    """
    first = slice(0, max(2, round(0.01 / step_s)))
    home = float(np.median(angle[first]))
    idle = bool((np.abs(duty[first]) < IDLE_DUTY).all())
    if np.ptp(angle[first]) < 0.5 and (idle or angle.min() > home - SIDE_DEG or angle.max() < home + SIDE_DEG):
        otherwise = home
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (np.abs(duty) < 0.01).astype(int), [0]])))
    begins, ends = edges[::2], edges[1::2]
    if begins.size == 0:
        return otherwise
    longest = int(np.argmax(ends - begins))
    tail = angle[max(begins[longest], ends[longest] - round(0.1 / step_s)) : ends[longest]]
    at_rest = (ends[longest] - begins[longest]) * step_s >= 0.5 and np.ptp(tail) < 0.5
    return float(np.median(tail)) if at_rest else otherwise


def regression_start(
    step_s: float,
    duty: NDArray[np.float64],
    angle: NDArray[np.float64],
    values: Mapping[str, float],
    free: list[str],
    closed_deg: float,
    open_deg: float,
) -> dict[str, float]:
    """Torque balance of the moving samples: u = +-beta + kappa x + delta sign(w) + w/(G tau) + dw/dt/G."""
    from scipy.signal import savgol_filter

    half = max(3, round(0.010 / step_s))
    if angle.size < 10 * half:
        return {}
    smooth, speed, push = (
        np.asarray(savgol_filter(angle, 2 * half + 1, 3, deriv=order, delta=step_s)[half:-half]) for order in range(3)
    )
    u = np.convolve(duty, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    x = smooth - values["limp_home_deg"]
    inside = (smooth > closed_deg + 1.0) & (smooth < open_deg - 1.0) & (np.abs(x) > SIDE_DEG)
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


def group_starts(
    values: Mapping[str, float],
    free: list[str],
    n_starts: int,
    seed: int,
) -> list[list[float]]:
    """Spread the free groups that are searched as logarithms from half to twice their first value."""
    bounds = {parameter.name: parameter for parameter in _core.identify.throttle_group_bounds()}
    box = [
        _core.optimize.Parameter(
            name=name,
            lower=max(bounds[name].lower, 0.5 * values[name]),
            upper=min(bounds[name].upper, 2.0 * values[name]),
            log_scaled=True,
        )
        for name in free
        if bounds[name].log_scaled
    ]
    return [[start[name] for name in GROUP_NAMES] for start in spread_starts(values, box, n_starts, seed)]
