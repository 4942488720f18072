"""The whole delay of a throttle log: every candidate fitted with fine steps, and compared block by block."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.identify.throttle.hunt import BRISTLES, FLOOR_DEG, WORTH, Hunt, best_of, names_of
from mgdd.identify.throttle.local_weights import SPREAD, certainly_less

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.identify.throttle.first_principle_problem import Search

__all__ = ["Delays", "whole_delay"]

_MOTOR_LAG_S = 1e-3  # L/R of throttle motors, which decides between delays that the log does not separate


@dataclass(frozen=True, kw_only=True)
class Delays:
    """The delay that was taken, what its rivals reach, and which of them the log does not separate from the best."""

    found: Search
    rmse: Mapping[float, float]
    ties: tuple[float, ...]


def whole_delay(hunt: Hunt, rough: Sequence[Search], delays: Sequence[float], held: Sequence[str] = ()) -> Delays:
    """Fit with fine steps at the delays about the rough one; of equals take the one whose lag a motor would have.

    Equals are delays whose losses, block by block of the log, differ from those of the best by less than twice the
    standard error of their mean (Diebold and Mariano 1995). The loss of a block is its mean square, cut off where the
    model at its best does not describe the plate: such blocks have no vote. Groups in `held` keep their rough
    values.
    """
    at = rough[0].values["delay_samples"]
    free = [name for name in names_of(rough[0]) if name not in ("delay_samples", *held)]
    near = [d for d in delays if math.floor(at) - 1 <= d <= math.ceil(at)] or [min(delays, key=lambda d: abs(d - at))]
    found: dict[float, Search] = {}
    while missing := [delay for delay in near if delay not in found]:
        for delay in missing:
            starts = [_at_delay(one, delay, hunt.problem.step_s, free) for one in rough]
            looks = [hunt.search(start, free, BRISTLES, 15) for start in starts]
            found[delay] = hunt.fine(best_of(looks).values, free)
        best = min(near, key=lambda delay: found[delay].rmse)
        at = list(delays).index(best)  # never the last of those looked at, while there are others
        near = [d for d in delays if d in found or d in delays[max(at - 1, 0) : at + 2]]
    for k, delay in enumerate(near):  # each also from where its neighbours ended
        for other in near[max(k - 1, 0) : k] + near[k + 1 : k + 2]:
            again = hunt.fine(_at_delay(found[other], delay, hunt.problem.step_s, free), free)
            if again.rmse < found[delay].rmse:
                found[delay] = again
    residual = {delay: hunt.raw(one) for delay, one in found.items()}
    weight: dict[float, NDArray[np.float64] | None] = dict.fromkeys(near, hunt.weight)
    if hunt.weight is not None:  # what a delay misses it may miss elsewhere than another
        for delay in near:
            weight[delay] = hunt.blocks.weights(residual[delay], hunt.floor)
            hunt.weigh(weight[delay])
            found[delay] = hunt.fine(found[delay].values, free)
            residual[delay] = hunt.raw(found[delay])
    usual = min(hunt.blocks.usual(hunt.blocks.errors(one), hunt.floor) for one in residual.values())
    most = SPREAD * usual if hunt.weight is not None else math.inf
    loss = {delay: hunt.blocks.losses(one, most) for delay, one in residual.items()}
    ties = _equals(loss, by_block=math.isfinite(most))
    lag = {delay: found[delay].values["electrical_s"] for delay in ties}
    kept = min(ties, key=lambda delay: abs(math.log(max(lag[delay], 1e-5) / _MOTOR_LAG_S)))
    hunt.weigh(weight[kept])
    hunt.keep(found[kept])
    rmse = {delay: max(float(np.sqrt(one.mean())), FLOOR_DEG) for delay, one in loss.items()}
    return Delays(found=found[kept], rmse=rmse | dict.fromkeys(ties, min(rmse.values())), ties=tuple(ties))


def _equals(loss: Mapping[float, NDArray[np.float64]], *, by_block: bool) -> list[float]:
    """Return the delays within a hundredth of the best error or, by block, not certainly worse."""
    best = min(loss, key=lambda delay: float(loss[delay].mean()))
    floor = FLOOR_DEG**2
    least = max(float(loss[best].mean()), floor)
    return [
        delay
        for delay, own in sorted(loss.items())
        if max(float(own.mean()), floor) * WORTH**2 <= least or (by_block and not certainly_less(loss[best], own))
    ]


def _at_delay(found: Search, delay: float, step_s: float, free: Sequence[str]) -> dict[str, float]:
    """Move a part of the latency between delay and lag."""
    values = {**found.values, "delay_samples": float(delay)}
    if "electrical_s" in free:
        lag = found.values["electrical_s"] + step_s * (found.values["delay_samples"] - delay)
        values["electrical_s"] = min(max(lag, 1e-4), 0.015)
    return values
