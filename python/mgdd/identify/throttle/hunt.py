"""Searches of one throttle log: what they compared, and the best of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mgdd import _core
from mgdd.errors import Interrupted
from mgdd.identify.throttle.first_principle_problem import GroupsProblem, Search

# Steps per sample of the look at bristles, and of what is handed over.
BRISTLES, FINE = 4, 8
# What a wrong time constant spoils at once: searched first, as the rest would make up for it.
MOVING = ("tau_s", "gain_deg_per_s2_per_duty", "electrical_s")
AT_NOISE = 1.05  # a residual that small leaves nothing to explain
WORTH = 0.99  # what explains less than a hundredth of the error is left out, however certain it is
# What a search has found absent begins here in the next, not where one begins that was never searched.
_ABSENT = {"electrical_s": 1e-4, "stribeck_drop": 1e-3, "delay_samples": 1e-3, "half_gap_deg": 1e-3}
FLOOR_DEG = 5e-3  # a 14-bit converter steps by as much: a residual below it is as good as any


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
            found = self.problem.search(
                start, free, substeps=substeps, tolerance=tolerance,
                max_iterations=min(iterations, self.max_iterations),
            )  # fmt: skip
        except Interrupted as stop:
            if isinstance(stop.partial, Search):
                self.keep(stop.partial)
            raise
        return self.keep(found)

    def keep(self, found: Search) -> Search:
        """Count a search in."""
        self.done.append(found)
        if self.best is None or found.rmse < self.best.rmse:
            self.best = found
        return found

    def fine(self, values: Mapping[str, float], free: Sequence[str]) -> Search:
        """Search with the steps and the tolerance of what is handed over."""
        return self.search(values, free, FINE, self.max_iterations, self.tolerance)


def independent_samples(found: Search) -> float:
    """Return how many independent samples the residual is worth: samples over its integrated correlation time."""
    residual = np.asarray(found.report.residual)
    return residual.size / _core.optimize.autocorrelation_time(residual)


def missed(smaller: Search, larger: Search, size: int, n: float) -> bool:
    """Whether the log needs the `size` numbers that the larger model has beyond the smaller."""
    low, high = max(larger.rmse, FLOOR_DEG), max(smaller.rmse, FLOOR_DEG)
    return low < WORTH * high and 2.0 * n * math.log(high / low) > size * math.log(n)


def names_of(found: Search) -> list[str]:
    """Return the groups that a search estimated."""
    return [name for name in found.report.names if name in found.values]


def best_of(searches: Iterable[Search]) -> Search:
    """Return the search with the lowest error."""
    return min(searches, key=lambda one: one.rmse)
