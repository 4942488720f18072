"""What a fit of the groups holds fixed or lacks, counted in the errors of what it estimates."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd.identify.throttle.first_principle_model import GROUP_NAMES, LONGEST_DELAY, whole_shift
from mgdd.identify.throttle.first_principle_problem import GroupsProblem
from mgdd.identify.throttle.free_run import noise_of
from mgdd.identify.throttle.whole_delay import AT_NOISE, FLOOR_DEG
from mgdd.results.fit_report import FitReport

SHARE, _DELAY = "viscous_share", "delay_samples"
# A shorted motor brakes more than its bearings: what is not back-EMF is anything from none to half of the damping.
_SHARES = (0.0, 0.5)
TYPICAL_SHARE = 0.5 * sum(_SHARES)
_START = ("start_angle_deg", "start_speed_deg_per_s")  # as the core names them in a report
_STEP = 5e-3  # of a difference, over the value or what is usual
_USUAL = {
    "limp_home_deg": 5.0, "electrical_s": 5e-4, "stribeck_drop": 0.05, "presliding_damping": 0.3, "half_gap_deg": 0.1,
    SHARE: 0.3, _DELAY: 1.0, "start_angle_deg": 5.0, "start_speed_deg_per_s": 10.0,
}  # fmt: skip
_MISFIT_BLOCK_S, _LEAST_BLOCKS = 1.0, 6.0
_RIDGE = 0.02  # a block that holds nearly all that is known of a group must not leave it without bound


def with_nuisances(
    problem: GroupsProblem,
    values: Mapping[str, float],
    report: FitReport,
    *,
    substeps: int,
    share_known: bool,
    delays: Mapping[float, float] | None = None,
) -> FitReport:
    """Add to the errors of a fit what would change if that were otherwise which it holds fixed or lacks.

    Considered, not estimated (Schmidt 1966), each through the change of all estimates to first order: the share of the
    damping that is not back-EMF (evenly spread over 0 to 0.5; while the plate slides, lag, time constant and gain take
    up whatever it is), the steps of the simulation (what finer ones would give), and the whole delay (its rivals, with
    their likelihood, Buckland et al. 1997). A residual above the noise has a cause that the model lacks, which acts for
    longer than the residual is correlated: errors are then also those of a jackknife over blocks of a second
    (Kuensch 1989), where that is larger.
    """
    finite = np.flatnonzero(np.isfinite(report.stderr))
    if finite.size == 0:
        return report
    about = _Slopes.of(problem, values, report, finite, substeps)
    changes = [2.0 * about.answer(substeps=2 * substeps)]  # half a step takes away half of the error
    if values["electrical_s"] > 0.0 and not share_known:
        low, high = (about.answer({SHARE: share}) for share in _SHARES)
        changes += [0.5 * (high - low) / math.sqrt(3.0), 0.5 * (high + low) / math.sqrt(5.0)]
    if delays is not None:
        best_delay = values[_DELAY]
        spread = sum(weight * (delay - best_delay) ** 2 for delay, weight in delays.items()) / sum(delays.values())
        side = 1.0 if best_delay + 1.0 <= LONGEST_DELAY else -1.0
        changes.append(math.sqrt(spread) * about.answer({_DELAY: best_delay + side}))
    at = np.ix_(finite, finite)
    covariance = report.covariance.copy()
    blocks = report.residual_blocks
    if _misses(problem, report.rmse):
        blocks = independent_values(problem, report)
        longer = about.jackknife(report.residual, math.ceil(report.residual.size / blocks))
        wider = np.sqrt(np.maximum(longer / np.diag(covariance)[finite], 1.0))
        covariance[at] *= np.outer(wider, wider)
    covariance[at] += sum(np.outer(change, change) for change in changes)
    stderr = report.stderr.copy()
    stderr[finite] = np.sqrt(np.diag(covariance)[finite])
    for array in (covariance, stderr):
        array.flags.writeable = False
    return dataclasses.replace(report, covariance=covariance, stderr=stderr, residual_blocks=blocks)


def independent_values(problem: GroupsProblem, report: FitReport) -> float:
    """Return how many independent values the residual is worth: with what the model misses, blocks of a second."""
    residual = report.residual
    time = _core.optimize.autocorrelation_time(residual)
    if not _misses(problem, report.rmse):
        return float(residual.size / time)
    rows = max(_MISFIT_BLOCK_S / problem.step_s, 3.0 * time)
    return max(residual.size / rows, _LEAST_BLOCKS)


def delay_weights(rmse: Mapping[float, float], best_delay: float, n: float) -> dict[float, float]:
    """Return the likelihood of each delay over that of the one kept, at most 1, from `n` independent values."""
    return {delay: min(1.0, math.exp(-n * math.log(error / rmse[best_delay]))) for delay, error in rmse.items()}


def _misses(problem: GroupsProblem, rmse: float) -> bool:
    return rmse > AT_NOISE * max(noise_of(problem.angle), FLOOR_DEG)


@dataclass(frozen=True, kw_only=True)
class _Slopes:
    """A free run about the fit: its slopes by the estimates, each over its norm."""

    problem: GroupsProblem
    values: Mapping[str, float]
    substeps: int
    run: NDArray[np.float64]
    slopes: NDArray[np.float64]
    norms: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        problem: GroupsProblem,
        values: Mapping[str, float],
        report: FitReport,
        finite: NDArray[np.int_],
        substeps: int,
    ) -> _Slopes:
        """Take central differences: wide enough that a plate which sticks a sample sooner is not a slope."""
        begin = {**values, **dict(zip(report.names, report.values, strict=True))}
        columns = []
        for name in (report.names[index] for index in finite):
            ends = [begin[name] + way * _STEP * max(abs(begin[name]), _USUAL.get(name, 0.0)) for way in (1.0, -1.0)]
            if name not in ("limp_home_deg", *_START):
                ends[1] = max(ends[1], 0.0)
            up, down = (_angle(problem, {**begin, name: end}, substeps) for end in ends)
            columns.append((up - down) / (ends[0] - ends[1]))
        slopes = np.column_stack(columns)
        norms = np.linalg.norm(slopes, axis=0)
        norms[norms == 0.0] = 1.0
        run = _angle(problem, begin, substeps)
        return cls(problem=problem, values=begin, substeps=substeps, run=run, slopes=slopes / norms, norms=norms)

    def answer(self, other: Mapping[str, float] | None = None, *, substeps: int | None = None) -> NDArray[np.float64]:
        """Return what the estimates would become with other values or steps, less what they are, to first order."""
        run = _angle(self.problem, {**self.values, **(other or {})}, substeps or self.substeps)
        return np.asarray(-np.linalg.lstsq(self.slopes, run - self.run, rcond=1e-10)[0] / self.norms)

    def jackknife(self, residual: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
        """Return the variances of the estimates that lack one block each; mean of two partitions, half a block apart.

        As `block_sandwich` of the core does it for blocks that the correlation of the residual asks for.
        """
        whole = self.slopes.T @ self.slopes
        variances = np.zeros(self.norms.size)
        for shift in (0, rows // 2):
            for first in range(-shift, residual.size, rows):
                block = slice(max(first, 0), first + rows)
                slopes = self.slopes[block]
                left = (1.0 + _RIDGE) * whole - slopes.T @ slopes
                variances += 0.5 * np.linalg.lstsq(left, slopes.T @ residual[block], rcond=1e-12)[0] ** 2
        return np.asarray((1.0 - rows / residual.size) * variances / self.norms**2)


def _angle(problem: GroupsProblem, values: Mapping[str, float], substeps: int) -> NDArray[np.float64]:
    """Run the groups free over the log from the start that the values have, or that of the log."""
    shift = whole_shift(values[_DELAY])
    step_s, duty, _, start, _, _ = problem.record(shift=shift)
    begin = [values.get(name, given) for name, given in zip(_START, start, strict=False)]
    groups = {**values, _DELAY: values[_DELAY] - shift}
    return np.asarray(
        _core.identify.simulate_throttle_groups(
            [groups[name] for name in GROUP_NAMES], duty, step_s=step_s, start=[*begin, start[2]],
            closed_deg=problem.stops_deg[0], open_deg=problem.stops_deg[1], substeps=substeps,
        )
    )  # fmt: skip
