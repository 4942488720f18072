"""How points are chosen: D-optimal by exchange, filling the space, and by their distances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError

_LEAST_GAIN = 1e-8  # relative gain in det that is worth an exchange; below it rounding decides
_SWEEPS = 200
_RIDGE = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Exchange:
    """The best of several searches: rows of the candidates, and log det of X'X after each exchange."""

    rows: NDArray[np.intp]
    log_det: float
    history: tuple[float, ...]
    log_det_starts: tuple[float, ...]


def d_optimal(
    candidates: NDArray[np.float64],
    n: int,
    *,
    fixed: NDArray[np.float64],
    n_starts: int,
    generator: np.random.Generator,
) -> Exchange:
    """Choose `n` candidates, repeats allowed, that with the fixed rows maximise det X'X.

    Fedorov's exchange in the form of Cook and Nachtsheim: each point in turn gives way to the candidate that raises
    the determinant most, until none does. A local optimum, hence several random starts. Rows, shape (c, p) and (k, p),
    hold the p terms of the model at points that may be chosen and that stay; a DataError reports that they do not
    determine the terms.

    Fedorov (1972), Theory of Optimal Experiments.
    Cook and Nachtsheim (1980), A comparison of algorithms for constructing exact D-optimal designs.
    """
    p = candidates.shape[1]
    rank = int(np.linalg.matrix_rank(np.vstack([candidates, fixed])))
    if rank < p:
        raise DataError(
            f"{len(candidates)} feasible candidates determine {rank} of the {p} terms of the model: choose a smaller "
            "model, more levels or a wider region"
        )
    searches = [_search(candidates, _start(candidates, n, fixed, generator), fixed) for _ in range(n_starts)]
    best = max(searches, key=lambda each: each[1][-1])
    if not np.isfinite(best[1][-1]):
        raise DataError(f"none of {n_starts} starts determines the {p} terms of the model: add points or starts")
    return Exchange(
        rows=best[0],
        log_det=best[1][-1],
        history=tuple(best[1]),
        log_det_starts=tuple(history[-1] for _, history in searches),
    )


def d_efficiency_percent(log_det: float, *, n: int, terms: int) -> float:
    """Return 100 det(X'X)^(1/p)/n: 100 % is an orthogonal design at the ends of all ranges, which may not exist."""
    return float(100.0 * np.exp(log_det / terms) / n)


def _start(
    candidates: NDArray[np.float64], n: int, fixed: NDArray[np.float64], generator: np.random.Generator
) -> NDArray[np.intp]:
    """Return a third of the rows at random, the others where the prediction is worst."""
    rows = generator.integers(len(candidates), size=max(1, n // 3)).tolist()
    rows_of_all = np.vstack([fixed, candidates[rows]])
    spread = np.linalg.inv(rows_of_all.T @ rows_of_all + _RIDGE * np.eye(rows_of_all.shape[1]))
    variance = np.sum((candidates @ spread) * candidates, axis=1)
    while len(rows) < n:
        row = int(np.argmax(variance))
        rows.append(row)
        spread, variance = _changed(candidates, spread, variance, candidates[row], 1.0)
    return np.array(rows, dtype=np.intp)


def _search(
    candidates: NDArray[np.float64], start: NDArray[np.intp], fixed: NDArray[np.float64]
) -> tuple[NDArray[np.intp], list[float]]:
    rows = start.copy()
    history = [_log_det(candidates[rows], fixed)]
    for _ in range(_SWEEPS if np.isfinite(history[0]) else 0):
        rows_of_all = np.vstack([fixed, candidates[rows]])
        spread = np.linalg.inv(rows_of_all.T @ rows_of_all)
        variance = np.sum((candidates @ spread) * candidates, axis=1)
        before = rows.copy()
        for place in range(rows.size):
            old = candidates[rows[place]]
            across, at = candidates @ (spread @ old), variance[rows[place]]
            gain = variance - at - (variance * at - across**2)  # Fedorov's delta
            best = int(np.argmax(gain))
            if gain[best] > _LEAST_GAIN:
                rows[place] = best
                spread, variance = _changed(candidates, spread, variance, candidates[best], 1.0)
                spread, variance = _changed(candidates, spread, variance, old, -1.0)
                history.append(_log_det(candidates[rows], fixed))
        if np.array_equal(rows, before):
            break
    return rows, history


def _changed(
    candidates: NDArray[np.float64],
    spread: NDArray[np.float64],
    variance: NDArray[np.float64],
    row: NDArray[np.float64],
    sign: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Add (1) or remove (-1) a row: the rank-one update of the inverse, and of x' (X'X)^-1 x."""
    along = spread @ row
    weight = sign / (1.0 + sign * float(row @ along))
    return spread - weight * np.outer(along, along), variance - weight * (candidates @ along) ** 2


def _log_det(rows: NDArray[np.float64], fixed: NDArray[np.float64]) -> float:
    rows_of_all = np.vstack([fixed, rows])
    sign, value = np.linalg.slogdet(rows_of_all.T @ rows_of_all)
    return float(value) if sign > 0.0 else float("-inf")


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
