"""Searches of one throttle log, and its whole delay: each candidate fitted with fine steps, compared by blocks."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd.errors import Interrupted
from mgdd.identify.throttle.first_principle_problem import GroupsProblem, Search
from mgdd.identify.throttle.free_run import noise_of
from mgdd.results.finding import Finding
from mgdd.results.fit_report import FitReport

# Steps per sample of the look at bristles, and of what is handed over, at samples of 1 ms or more.
BRISTLES, FINE = 4, 8
# What a wrong time constant spoils at once: searched first, as the rest would make up for it.
MOVING = ("tau_s", "gain_deg_per_s2_per_duty", "electrical_s")
AT_NOISE = 1.05  # a residual that small leaves nothing to explain
WORTH = 0.99  # what explains less than a hundredth of the error is left out, however certain it is
# What a search has found absent begins here in the next, not where one begins that was never searched.
_ABSENT = {"electrical_s": 1e-4, "stribeck_drop": 1e-3, "delay_samples": 1e-3, "half_gap_deg": 1e-3}
FLOOR_DEG = 5e-3  # a 14-bit converter steps by as much: a residual below it is as good as any


def steps_of(substeps: int, step_s: float) -> int:
    """Return the steps per sample that are as long in shorter samples: never longer ones."""
    return max(math.ceil(substeps * min(step_s / 1e-3, 1.0) - 1e-9), 1)


@dataclass(kw_only=True)
class Hunt:
    """Searches of one log, what they compared, and the best of them so far."""

    problem: GroupsProblem
    max_iterations: int
    tolerance: float
    best: Search | None = None
    done: list[Search] = field(default_factory=list)

    def search(
        self, values: Mapping[str, float], free: Sequence[str], substeps: int, iterations: int, tolerance: float = 1e-4
    ) -> Search:
        """Search once; an interrupt hands over what it has."""
        start = {name: value or (_ABSENT.get(name, 0.0) if name in free else 0.0) for name, value in values.items()}
        try:
            search = self.problem.search(
                start, free, substeps=steps_of(substeps, self.problem.step_s), tolerance=tolerance,
                max_iterations=min(iterations, self.max_iterations),
            )  # fmt: skip
        except Interrupted as stop:
            if isinstance(stop.partial, Search):
                self.keep(stop.partial)
            raise
        return self.keep(search)

    def keep(self, search: Search) -> Search:
        """Count a search in."""
        self.done.append(search)
        if self.best is None or search.rmse < self.best.rmse:
            self.best = search
        return search

    def fine(self, values: Mapping[str, float], free: Sequence[str]) -> Search:
        """Search with the steps and the tolerance of what is handed over."""
        return self.search(values, free, FINE, self.max_iterations, self.tolerance)


def independent_samples(search: Search) -> float:
    """Return how many independent samples the residual is worth: samples over its integrated correlation time."""
    residual = np.asarray(search.report.residual)
    return residual.size / _core.optimize.autocorrelation_time(residual)


def missed(smaller: Search, larger: Search, size: int, n: float) -> bool:
    """Whether the log needs the `size` numbers that the larger model has beyond the smaller."""
    low, high = max(larger.rmse, FLOOR_DEG), max(smaller.rmse, FLOOR_DEG)
    return low < WORTH * high and 2.0 * n * math.log(high / low) > size * math.log(n)


def names_of(search: Search) -> list[str]:
    """Return the groups that a search estimated."""
    return [name for name in search.report.names if name in search.values]


def best_of(searches: Iterable[Search]) -> Search:
    """Return the search with the lowest error."""
    return min(searches, key=lambda one: one.rmse)


_BLOCK_S, _FEWEST = 0.1, 10
_MOVED_DEG = 1.0
_SPREAD = 1.25  # of the errors of blocks that differ by noise alone
_CERTAIN = 2.0  # standard errors


def block_losses(
    residual: Mapping[float, NDArray[np.float64]], angle: NDArray[np.float64], step_s: float, floor_deg: float
) -> dict[float, NDArray[np.float64]]:
    """Return the mean square of blocks of 0.1 s in which the plate moves, cut off where no model describes the plate.

    A free run leaves the plate where the model is wrong (where it crosses a gap, rebounds from a stop), and those few
    blocks would decide. A loss is therefore cut off a quarter above the usual error of the best model.
    """
    size = max(round(_BLOCK_S / step_s), _FEWEST)
    of_sample = np.minimum(np.arange(angle.size) // size, max(angle.size // size - 1, 0))
    samples = np.bincount(of_sample)
    moving = np.array([np.ptp(angle[of_sample == k]) > _MOVED_DEG for k in range(samples.size)])
    moving = moving if moving.any() else np.ones(samples.size, dtype=bool)
    square = {key: (np.bincount(of_sample, weights=error**2) / samples)[moving] for key, error in residual.items()}
    usual = max(min(float(np.median(error)) for error in square.values()), floor_deg**2)
    return {key: np.minimum(error, _SPREAD**2 * usual) for key, error in square.items()}


def certainly_less(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> bool:
    """Whether one model loses less than another by more than twice the standard error of the mean over blocks.

    The comparison of Diebold and Mariano (1995) with blocks long enough to be independent.
    """
    apart = theirs - ours
    error = float(apart.std(ddof=1)) / np.sqrt(apart.size) if apart.size > 1 else np.inf
    return bool(apart.mean() > _CERTAIN * error)


RAMPS = (0.1, 0.4)  # where searches begin [deg]: ramp and limp-home have valleys of their own
_MOVED = 0.25  # samples by which a delay may differ before the time constant is searched anew
_RIVAL = 1.5  # a delay whose coarse search ends that far above the best is not fitted finely
_ALIKE = 1.25  # delays whose errors differ by more are not treated as equal, whatever their blocks show
_MOTOR_LAGS_S = (3e-4, 3e-3)  # L/R of throttle motors, which decides between delays that the log does not separate


@dataclass(frozen=True, kw_only=True)
class Delays:
    """The delay that was taken, what its rivals reach, and which of them the log does not separate from the best."""

    best: Search
    rmse: Mapping[float, float]
    ties: tuple[float, ...]

    @property
    def rivals(self) -> dict[float, float]:
        """Errors by delay [deg], equals with that of the delay taken."""
        return {**self.rmse, **dict.fromkeys(self.ties, self.rmse[self.best.values["delay_samples"]])}


def whole_delay(hunt: Hunt, rough: Sequence[Search], delays: Sequence[float]) -> Delays:
    """Fit with fine steps at the delays about the rough one; of equals take the shortest whose lag a motor would have.

    The shortest, since what a model lacks (a gear that bends, a gap) makes the plate come later, never sooner; where it
    lacks nothing, down to the noise, the one with the least error.

    Equals are delays whose losses, block by block of the log, differ from those of the best by less than twice the
    standard error of their mean (Diebold and Mariano 1995). The loss of a block is its mean square, cut off where the
    model at its best does not describe the plate: such blocks do not decide.
    """
    at = rough[0].values["delay_samples"]
    free = [name for name in names_of(rough[0]) if name != "delay_samples"]
    moving = [name for name in MOVING if name in free]
    near = [d for d in delays if math.floor(at) - 1 <= d <= math.ceil(at)] or [min(delays, key=lambda d: abs(d - at))]
    ramps = [{"ramp_deg": ramp} for ramp in RAMPS if "ramp_deg" in free]
    begin = [*rough, *(rough[0]._replace(values={**rough[0].values, **ramp}) for ramp in ramps)]
    looks: dict[float, Search] = {}
    fits: dict[float, Search] = {}

    def look(start: Search, delay: float) -> Search:
        values = _at_delay(start, delay, hunt.problem.step_s, free)
        moved = abs(start.values["delay_samples"] - delay) > _MOVED
        first = hunt.search(values, moving, BRISTLES, 8).values if moving and moved else values
        return hunt.search(first, free, BRISTLES, 15)

    while missing := [delay for delay in near if delay not in looks]:
        looks |= {delay: best_of([look(start, delay) for start in begin]) for delay in missing}
        for delay, other in [*pairwise(near), *pairwise(near[::-1])]:  # each also from where its neighbours ended
            if delay in missing or other in missing:
                looks[delay] = best_of([looks[delay], look(looks[other], delay)])
        enough = _RIVAL * max(best_of(looks.values()).rmse, FLOOR_DEG)
        for delay in near:
            if looks[delay].rmse <= enough and delay not in fits:
                fits[delay] = hunt.search(looks[delay].values, free, FINE, 25, 1e-6)
        best = min(fits, key=lambda delay: fits[delay].rmse)
        at = list(delays).index(best)  # never the last of those looked at, while there are others
        near = [d for d in delays if d in looks or d in delays[max(at - 1, 0) : at + 2]]
    problem = hunt.problem
    residual = {delay: np.asarray(fit.report.residual) for delay, fit in fits.items()}
    floor = max(noise_of(problem.angle), FLOOR_DEG)
    alike = _ALIKE * max(best_of(fits.values()).rmse, FLOOR_DEG)
    equals = _equals(block_losses(residual, problem.angle, problem.step_s, floor))
    ties = [delay for delay in equals if fits[delay].rmse <= alike] or equals
    complete = best_of(fits.values()).rmse < AT_NOISE * floor  # nothing is missed that could make the plate come later
    best_delay = min(
        ties,
        key=lambda delay: (_unlike_a_motor(fits[delay].values["electrical_s"]), complete and fits[delay].rmse, delay),
    )
    rmse = {delay: max(fit.rmse, FLOOR_DEG) for delay, fit in {**looks, **fits}.items()}
    return Delays(best=fits[best_delay], rmse=rmse, ties=tuple(ties))


def _equals(loss: Mapping[float, NDArray[np.float64]]) -> list[float]:
    """Return the delays within a hundredth of the best error, and those not certainly worse."""
    best = min(loss, key=lambda delay: float(loss[delay].mean()))
    least = max(float(loss[best].mean()), FLOOR_DEG**2)
    return [
        delay
        for delay, losses in sorted(loss.items())
        if max(float(losses.mean()), FLOOR_DEG**2) * WORTH**2 <= least or not certainly_less(loss[best], losses)
    ]


def _unlike_a_motor(lag_s: float) -> float:
    """Return by which factor a lag is outside of those of motors, as a logarithm."""
    low, high = _MOTOR_LAGS_S
    lag = max(lag_s, 1e-5)
    return math.log(max(low / lag, lag / high, 1.0))


def _at_delay(search: Search, delay: float, step_s: float, free: Sequence[str]) -> dict[str, float]:
    """Move a part of the latency between delay and lag."""
    values = {**search.values, "delay_samples": float(delay)}
    if "electrical_s" in free:
        lag = search.values["electrical_s"] + step_s * (search.values["delay_samples"] - delay)
        values["electrical_s"] = min(max(lag, 1e-4), 0.015)
    return values


_NAME = "delay_samples"
_STAND_IN = ("electrical_s", "tau_s")


def with_delay(
    report: FitReport, delay: float, rmse: Mapping[float, float], n: float, tried: Sequence[float] | None = None
) -> FitReport:
    """Add the chosen delay, with the error of the flattest parabola through the costs of the others.

    A delay that fits as well as the chosen one leaves a whole sample open. At the end of what may be the error is NaN:
    the search did not go further; those of lag and time constant, too.
    """
    curvature = min(
        2.0 * n * math.log(other / rmse[delay]) / (at - delay) ** 2 for at, other in rmse.items() if at != delay
    )
    low, high = min(tried or rmse), max(tried or rmse)
    side = 1 if delay == high else -1 if delay == low > 0.0 else 0  # less than no delay there is not
    error = math.nan if side else 1.0 / math.sqrt(max(curvature, 1.0))
    stderr, covariance = report.stderr, report.covariance
    if side:  # they stand for the rest of the delay, however well they are known at this one
        gone = [report.names.index(name) for name in _STAND_IN if name in report.names]
        stderr, covariance = stderr.copy(), covariance.copy()
        stderr[gone] = covariance[gone, :] = covariance[:, gone] = math.nan
    null = np.vstack([report.null_directions, np.zeros((1, report.null_directions.shape[1]))])
    null.flags.writeable = False
    return dataclasses.replace(
        report,
        names=(*report.names, _NAME),
        values=_longer(report.values, delay),
        stderr=_longer(stderr, error),
        lower=_longer(report.lower, low),
        upper=_longer(report.upper, high),
        bounds_active=_longer(report.bounds_active, side),
        covariance=_wider(covariance, error**2),
        correlation=_wider(report.correlation, 1.0),
        null_directions=null,
    )


def delay_at_end(delay: float, tried: Sequence[float], longest_known: float) -> list[Finding]:
    """Report that the chosen delay is an end of those tried."""
    longest = delay == max(tried)
    if len(tried) < 2 or not (longest or delay == min(tried) > 0.0):
        return []
    most, more = ("longest", "longer") if longest else ("shortest", "shorter")
    text = f"a delay of {delay:g} samples is the {most} that was tried: the true one may be {more}, and then"
    text += " lag and time constant stand for the rest"
    remedy = "log at a longer sample time, of which a delay is fewer"
    if delay < longest_known:
        remedy = f"give {more} delay_samples" + (f", or {remedy}" if longest else "")
    return [Finding("delay_at_end", (_NAME, *_STAND_IN), text, remedy)]


def _longer(array: NDArray[Any], value: float) -> NDArray[Any]:
    out = np.append(array, array.dtype.type(value))
    out.flags.writeable = False
    return out


def _wider(matrix: NDArray[np.float64], corner: float) -> NDArray[np.float64]:
    out = np.full((matrix.shape[0] + 1, matrix.shape[1] + 1), np.nan)
    out[:-1, :-1], out[-1, -1] = matrix, corner
    out.flags.writeable = False
    return out
