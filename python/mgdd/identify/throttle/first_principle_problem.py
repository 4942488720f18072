"""A throttle log prepared for fits of the groups: which are free, where they begin, one search from given values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, argument
from mgdd.identify.throttle.first_principle_model import (
    GROUP_NAMES,
    LONGEST_DELAY,
    REFINEMENTS,
    TYPICAL,
    shifted,
    whole_shift,
)
from mgdd.identify.throttle.free_run import LOG_COLUMNS
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.results.finding import Finding
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import columns_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

ABOVE = ("beta_above_duty", "kappa_above_duty_per_deg")
BELOW = ("beta_below_duty", "kappa_below_duty_per_deg")
SIDE_S = 0.1  # shorter visits cannot settle a side's two parameters
# Where a group begins that is searched and was not there before.
_FIRST = {
    "electrical_s": 1e-3,
    "stribeck_drop": 0.25,
    "delay_samples": 1.0,
    "presliding_deg": 0.1,
    "half_gap_deg": 0.15,
    "viscous_share": 0.3,
    "stop_duty_per_deg": 30.0,
}
_DELAY, _ROOM = "delay_samples", 2.0
_REST_S, _REST_DEG = 0.01, 0.5
_FIRST_SAMPLES = 5


class Search(NamedTuple):
    """Where one search ended."""

    rmse: float
    values: dict[str, float]
    report: _core.optimize.FitReport


@dataclass(frozen=True, kw_only=True)
class GroupsProblem:
    """A log, the stops, start values and the groups that the log can settle."""

    step_s: float
    duty: NDArray[np.float64]
    angle: NDArray[np.float64]
    stops_deg: tuple[float, float]
    values: Mapping[str, float]
    free: tuple[str, ...]
    unvisited: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def both_sides(self) -> bool:
        """Whether the log settles the groups of both sides of limp-home."""
        return not self.unvisited

    def record(
        self, shift: int = 0
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64], list[float], int, list[int]]:
        """Return the log for the core, the duty `shift` samples later; not begun at rest its speed is free, too."""
        first = self.angle[: max(2, round(_REST_S / self.step_s))]
        start = float(self.angle[:_FIRST_SAMPLES].mean())
        moving = float(np.ptp(first)) > _REST_DEG
        speed = float(first[-1] - first[0]) / ((first.size - 1) * self.step_s) if moving else 0.0
        # A moving plate has left the mean of its first samples behind.
        begin = float(self.angle[0]) if moving else start
        state = [begin, speed, float(np.clip(self.duty[0], -1.0, 1.0))]
        duty = shifted(np.clip(self.duty, -1.0, 1.0), shift, state[2])
        return self.step_s, duty, self.angle, state, 0, [0, 1] if moving else [0]

    def search(
        self, values: Mapping[str, float], free: Sequence[str], *, substeps: int, tolerance: float, max_iterations: int
    ) -> Search:
        """Search the groups `free` from `values`, all others kept; Interrupted carries what it had."""
        # A search needs room for a delay that is free; the rest of a long one is taken off the duty.
        shift = whole_shift(values["delay_samples"], _ROOM if _DELAY in free else 0.0)
        begin = {**values, _DELAY: values[_DELAY] - shift}
        start = within_bounds({**begin, **{name: begin[name] or _FIRST.get(name, 0.0) for name in free}}, free)
        stage: tuple[list[int], list[int], float, float, int] = (
            [GROUP_NAMES.index(name) for name in free], [], 1.0, tolerance, max_iterations,
        )  # fmt: skip
        result, stop = or_partial(
            lambda: _core.identify.fit_throttle_groups(
                [self.record(shift)],
                stages=[stage],
                starts=[[start[name] for name in GROUP_NAMES]],
                closed_deg=self.stops_deg[0],
                open_deg=self.stops_deg[1],
                substeps=substeps,
                n_threads=1,
            )
        )
        report = result["reports"][0]
        ended = dict(zip(GROUP_NAMES, result["values"], strict=True))
        return hand_over(
            Search(report.rmse, {**ended, _DELAY: min(ended[_DELAY] + shift, LONGEST_DELAY)}, report), stop
        )


def groups_problem(
    log: xr.Dataset,
    *,
    start_values: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    stops_deg: tuple[float, float] = (0.0, 90.0),
) -> GroupsProblem:
    """Read a log, check names and values, and start from the torque balance of its moving samples."""
    time, duty, angle = log_columns(log)
    step_s = even_step(time, remedy=f"read_throttle_log(..., {argument('sample_s', '{step:g}')}) resamples")
    given = {name: float(value) for name, value in {**(start_values or {}), **(fixed or {})}.items()}
    for name in given:
        if name not in GROUP_NAMES:
            raise ParameterError(f"{name!r}: no throttle group; they are {', '.join(GROUP_NAMES)}")
    if np.ptp(angle) < 1.0:
        raise DataError(f"angle_deg moves by {np.ptp(angle):.3g} deg: drive the plate, mgdd.identify.design_excitation")
    values = dict(TYPICAL)
    values["limp_home_deg"] = rest_angle(step_s, duty, angle, values["limp_home_deg"])
    values |= given
    searched = [name for name in GROUP_NAMES if name not in (*(fixed or {}), *REFINEMENTS, "electrical_s")]
    findings: list[Finding] = []
    unvisited: list[str] = []
    home = values["limp_home_deg"]
    for side, visited, names in (("above", angle > home + SIDE_DEG, ABOVE), ("below", angle < home - SIDE_DEG, BELOW)):
        if np.count_nonzero(visited) * step_s >= SIDE_S:
            continue
        gone = [name for name in (*names, "limp_home_deg") if name in searched]
        searched = [name for name in searched if name not in gone]
        unvisited += gone
        text = (
            f"the plate spends less than {SIDE_S:g} s {side} limp-home ({home:.3g} deg): "
            f"{', '.join(gone) or 'that side'} kept at the start value"
        )
        findings.append(Finding("start_value_kept", tuple(gone), text, "use an excitation across limp-home"))
    if not searched:
        raise ParameterError("fixed: nothing is left to estimate")
    if start_values is None:
        values |= regression_start(step_s, duty, angle, values, searched, *stops_deg)
    bounds = {parameter.name: parameter for parameter in _core.identify.throttle_group_bounds()}
    for name, value in given.items():
        low, high = bounds[name].lower, LONGEST_DELAY if name == _DELAY else bounds[name].upper
        if not (low <= value <= high or value == REFINEMENTS.get(name)):
            raise ParameterError.of(name, value, f"within [{low:g}, {high:g}]")
    return GroupsProblem(
        step_s=step_s,
        duty=duty,
        angle=angle,
        stops_deg=stops_deg,
        values=within_bounds(values, searched),
        free=tuple(searched),
        unvisited=tuple(unvisited),
        findings=tuple(findings),
    )


def shows_limp_home(log: xr.Dataset) -> bool:
    """Whether a log has been on both sides of where it seems to rest, long enough to settle both."""
    time, duty, angle = log_columns(log)
    step_s = even_step(time)
    home = rest_angle(step_s, duty, angle, TYPICAL["limp_home_deg"])
    sides = (angle > home + SIDE_DEG, angle < home - SIDE_DEG)
    return all(np.count_nonzero(side) * step_s >= SIDE_S for side in sides)


def within_bounds(values: Mapping[str, float], free: Sequence[str]) -> dict[str, float]:
    """Clip what is searched, and of the rest what has no value that stands for absence."""
    bounds = {parameter.name: parameter for parameter in _core.identify.throttle_group_bounds()}
    return {
        name: value
        if name not in free and value == REFINEMENTS.get(name)
        else min(max(value, bounds[name].lower), bounds[name].upper)
        for name, value in values.items()
    }


def log_columns(log: xr.Dataset) -> list[NDArray[np.float64]]:
    """Return time, duty and angle of a log that is long enough to fit."""
    columns = columns_of(log, LOG_COLUMNS)
    if columns[0].size < 100:
        raise DataError(f"log has {columns[0].size} samples: at least 100 are needed")
    return columns


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
    positive = {name: value for name, value in solution.items() if value > 0.0}
    if inertia > 0.0 and "gain_deg_per_s2_per_duty" in free:
        positive["gain_deg_per_s2_per_duty"] = 1.0 / inertia
        if damping > 0.0 and "tau_s" in free:
            positive["tau_s"] = inertia / damping
    return positive
