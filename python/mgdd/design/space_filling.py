"""Points that fill the unit cube: low-discrepancy sequences, Latin hypercubes, and points far from each other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError

Sampler = Callable[[int], "NDArray[np.float64]"]

_MOST_PER_POINT, _MOST_FIRST = 200, 10_000  # draws until a region counts as too small
_MANY = 2000  # points beyond which distances are not compared between tries


def sampler_of(method: str, factors: int, generator: np.random.Generator) -> Sampler:
    """Return a function that draws the next n rows of the unit cube."""
    from scipy.stats import qmc

    if method == "lhs":
        return lambda n: np.asarray(qmc.LatinHypercube(factors, seed=generator).random(n), dtype=np.float64)
    engine: Any = {"halton": qmc.Halton, "sobol": qmc.Sobol}[method](factors, seed=generator)
    if method == "halton":
        return lambda n: np.asarray(engine.random(n), dtype=np.float64)

    def of_sequence(n: int) -> NDArray[np.float64]:
        # A first block of a power of two keeps the sequence balanced; what follows continues it.
        if engine.num_generated:
            return np.asarray(engine.random(n), dtype=np.float64)
        return np.asarray(engine.random_base2(max(0, int(np.ceil(np.log2(n))))), dtype=np.float64)

    return of_sequence


def draw_inside(
    sample: Sampler, n: int, *, inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]], what: str
) -> tuple[NDArray[np.float64], int, int]:
    """Draw points until n of them are feasible: those, and how many of how many were."""
    parts: list[NDArray[np.float64]] = []
    count = drawn = 0
    most = _MOST_FIRST + _MOST_PER_POINT * n
    while count < n and drawn < most:
        share = max(count / drawn, 0.02) if drawn else 1.0
        points = sample(min(max(16, int(np.ceil(1.1 * (n - count) / share))), most) if drawn else n)
        good = inside(points)
        parts.append(points[good])
        count, drawn = count + int(good.sum()), drawn + len(points)
    if count < n:
        raise DataError(
            f"feasible: {count} of {drawn} points drawn by {what} are feasible ({100.0 * count / drawn:.2g} %), {n} "
            "are needed: widen the limits or the region, or narrow the factors around what is feasible"
        )
    return np.concatenate(parts)[:n], count, drawn


def far_points(pool: NDArray[np.float64], n: int, *, existing: NDArray[np.float64]) -> NDArray[np.intp]:
    """Choose n rows of a pool one by one, each as far as possible from those before and the existing ones.

    Kennard and Stone (1969), Computer aided design of experiments.
    """
    rows: list[int] = []
    if len(existing):
        nearest = np.min([np.sum((pool - row) ** 2, axis=1) for row in existing], axis=0)
    else:
        nearest = np.sum((pool - pool.mean(axis=0)) ** 2, axis=1)
    for count in range(n):
        rows.append(int(np.argmax(nearest)))
        away = np.sum((pool - pool[rows[-1]]) ** 2, axis=1)
        nearest = away if not len(existing) and count == 0 else np.minimum(nearest, away)
        nearest[rows[-1]] = -1.0  # taken
    return np.array(rows, dtype=np.intp)


def extend_hypercube(
    existing: NDArray[np.float64], n: int, generator: np.random.Generator, *, n_starts: int
) -> NDArray[np.float64]:
    """Return n rows in strata that the existing ones leave free, of k + n strata per column; the best of many tries.

    Wang (2003), Adaptive response surface method using inherited Latin hypercube design points.
    """
    k, m = existing.shape
    strata = k + n

    def one() -> NDArray[np.float64]:
        out = np.empty((n, m))
        for column in range(m):
            taken = np.minimum((existing[:, column] * strata).astype(np.intp), strata - 1)
            free = np.setdiff1d(np.arange(strata), taken)
            out[:, column] = (generator.permutation(free)[:n] + generator.random(n)) / strata
        return out

    return best_of(one, existing, n_starts)


def best_of(draw: Callable[[], NDArray[np.float64]], existing: NDArray[np.float64], tries: int) -> NDArray[np.float64]:
    """Return the draw whose two nearest points are farthest apart."""
    first = draw()
    if len(first) + len(existing) > _MANY:
        return first
    trials = [first, *(draw() for _ in range(tries - 1))]
    return max(trials, key=lambda points: least_distance(np.vstack([existing, points])))


def least_distance(points: NDArray[np.float64]) -> float:
    """Return the distance of the two nearest points, NaN of fewer than two."""
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return float("nan")
    return float(cKDTree(points).query(points, k=2)[0][:, 1].min())
