"""One question: how much of the front of two objectives is found in 100 noisy cycles, and at which cost on the way.

    python benchmarks/seeking_front.py [--seeds 20] [--cycles 100]

Share of the hypervolume of the true front, of the true objectives at the inputs that a contender calls its front; the
reference point lies a tenth of the ranges beyond the ends of the true front. Beside it how far below the true front
each applied input was, in shares of these ranges, mean over the cycles. Means over seeds with their 95 % interval.

Maps of timing (-20 to 20) and EGR (0 to 0.4), counted in fortieths: two quadratics with other axes, whose front is
known in closed form, and two skewed maps, whose front is taken from a grid of 801 by 801 inputs. Optima 14 to 18 apart,
start 12 beside the middle between them, noise 0.3. The third is the virtual bench over its timing, efficiency [%] and
NOx of the soft sensor [ppm], whose front is taken from its steady map.

Random inputs and SPSA have the same cycles. SPSA has five weights, one after the other from the estimate of the last,
and is given noise, curvature and ranges. "Fits" is the front of the models that `seek_front` makes, on their readings.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mgdd.loop import VirtualEngine, seek_front
from mgdd.loop.front_result import front_of, undominated
from mgdd.optimize import Input, tune

BOUNDS = {"soc_cad": (-20.0, 20.0), "egr": (0.0, 0.4)}
NOISE, WEIGHTS = 0.3, 5
SIGNS = {"efficiency": 1.0, "nox": -1.0}
FIRST, SECOND = 0.06 * np.array([[1.0, 0.5], [0.5, 1.0]]), 0.04 * np.array([[1.0, -0.3], [-0.3, 0.6]])
Array = np.ndarray


@dataclass(frozen=True)
class Problem:
    """Two objectives, both to be maximised here, over inputs; their true front, and one noisy reading."""

    inputs: tuple[Input, ...]
    start: Array
    true: Callable[[Array], Array]
    front: Array
    read: Callable[[Array], Array]
    curvatures: tuple[Array, Array] | None = None  # per unit of the inputs

    @property
    def names(self) -> list[str]:
        """Of the inputs."""
        return [one.name for one in self.inputs]

    @property
    def ends(self) -> tuple[Array, Array]:
        """Worst and best of each objective along the true front."""
        return self.front.min(axis=0), self.front.max(axis=0)


def pair(seed: int, skewed: bool) -> Problem:
    rng = np.random.default_rng(seed)
    low, high = (np.array([bounds[k] for bounds in BOUNDS.values()]) for k in (0, 1))
    unit, middle = (high - low) / 40.0, (low + high) / 2.0
    best = [middle + (np.array(at) + rng.uniform(-1.0, 1.0, 2)) * unit for at in ((-6.0, -5.0), (8.0, 6.0))]

    def drop(x: Array, about: Array, bend: Array) -> Array:
        d = (np.atleast_2d(x) - about) / unit
        if skewed:
            u, v = 0.82 * d[:, 0] + 0.57 * d[:, 1], 0.82 * d[:, 1] - 0.57 * d[:, 0]
            return -bend[0, 0] * (100.0 * (np.exp(0.1 * u) - 1.0 - 0.1 * u) + 0.5 * v * v)
        return -0.5 * np.einsum("ij,jk,ik->i", d, bend, d)

    def true(x: Array) -> Array:
        return np.stack([drop(x, best[0], FIRST), drop(x, best[1], SECOND)], axis=1)

    if skewed:
        grid = np.stack(np.meshgrid(*(np.linspace(a, b, 801) for a, b in zip(low, high, strict=True))), -1)
        known = true(grid.reshape(-1, 2))
        front = known[undominated(known)]
    else:
        shares = np.linspace(0.0, 1.0, 2001)
        bends = [w * FIRST + (1.0 - w) * SECOND for w in shares]
        pulls = [w * FIRST @ (best[0] / unit) + (1.0 - w) * SECOND @ (best[1] / unit) for w in shares]
        front = true(np.array([np.linalg.solve(a, b) * unit for a, b in zip(bends, pulls, strict=True)]))
    start = np.clip((best[0] + best[1]) / 2.0 + np.array([8.5, -8.5]) * unit, low + 3.0 * unit, high - 3.0 * unit)
    curves = tuple(bend / np.outer(unit, unit) for bend in (FIRST, SECOND))
    inputs = tuple(Input(name, *bounds) for name, bounds in BOUNDS.items())
    return Problem(inputs, start, true, front, lambda x: true(x)[0] + NOISE * rng.standard_normal(2), curves)


def engine(seed: int) -> Problem:
    bench, steady = VirtualEngine(seed=seed), VirtualEngine().steady_map(np.linspace(-25.0, 5.0, 3001))
    at = steady["soc_cad"].to_numpy()
    table = np.stack([100.0 * steady["efficiency_gross"].to_numpy(), -steady["nox_soft_ppm"].to_numpy()], axis=1)

    def true(x: Array) -> Array:
        return np.stack([np.interp(np.atleast_2d(x)[:, 0], at, table[:, k]) for k in (0, 1)], axis=1)

    def read(x: Array) -> Array:
        bench.apply({"soc_cad": float(x[0])})
        values = bench.measure().values
        return np.array([100.0 * values["efficiency_gross"], -values["nox_soft_ppm"]])

    return Problem((Input("soc_cad", -25.0, 5.0),), np.array([-20.0]), true, table[undominated(table)], read)


def volume(values: Array, reference: Array) -> float:
    """Hypervolume of rows to be maximised above a reference point."""
    found = values[np.all(values > reference, axis=1)]
    if not len(found):
        return 0.0
    found = found[undominated(found)]
    found = found[np.argsort(-found[:, 0])]
    up = np.diff(np.r_[reference[1], found[:, 1]])
    return float(np.sum((found[:, 0] - reference[0]) * up))


def share(problem: Problem, inputs: Array) -> float:
    low, high = problem.ends
    reference = low - 0.1 * (high - low)
    return volume(problem.true(inputs), reference) / volume(problem.front, reference)


def below(problem: Problem, applied: Array) -> float:
    """Mean of how far the applied inputs are below the front, in shares of its ranges."""
    low, high = problem.ends
    front = problem.front[:: max(len(problem.front) // 500, 1)] / (high - low)
    gap = front[None] - problem.true(applied)[:, None] / (high - low)
    return float(np.mean(np.maximum(np.min(np.max(gap, axis=2), axis=1), 0.0)))


def by_fits(problem: Problem, applied: Array, read: Array) -> Array:
    made = front_of(
        problem.inputs, SIGNS, (), applied=applied, measured=read * [1.0, -1.0], points=21, late=0, seed=0,
        measured_limits=np.empty((len(read), 0)), weight=np.zeros(len(read)), void=np.zeros(len(read), bool),
        interrupted=False,
    )  # fmt: skip
    return made.dataset["inputs"].to_numpy()


def ours(problem: Problem, cycles: int, seed: int) -> dict[str, tuple[Array, Array]]:
    def plant(x: dict[str, float]) -> dict[str, float]:
        one, other = problem.read(np.array([x[name] for name in problem.names]))
        return {"efficiency": one, "nox": -other}

    front = seek_front(
        plant, problem.inputs, {"efficiency": "max", "nox": "min"}, cycles=cycles, seed=seed,
        start=dict(zip(problem.names, problem.start.tolist(), strict=True)),
    )  # fmt: skip
    return {"seek_front": (front.dataset["inputs"].to_numpy(), front.dataset["applied"].to_numpy())}


def at_random(problem: Problem, cycles: int, seed: int) -> dict[str, tuple[Array, Array]]:
    rng = np.random.default_rng(seed + 500)
    tried = np.stack([rng.uniform(one.lower, one.upper, cycles) for one in problem.inputs], axis=1)
    read = np.array([problem.read(x) for x in tried])
    return {
        "random, best readings": (tried[undominated(read)], tried),
        "random, fits": (by_fits(problem, tried, read), tried),
    }


def spsa(problem: Problem, cycles: int, seed: int) -> dict[str, tuple[Array, Array]]:
    if problem.curvatures is None:
        return {}
    low, high = problem.ends
    lower, upper = (np.array([getattr(one, side) for one in problem.inputs]) for side in ("lower", "upper"))
    room = 3.0 * (upper - lower) / 40.0
    tried, read, ends, start = [], [], [], problem.start
    for weight in np.linspace(0.0, 1.0, WEIGHTS):
        shares = np.array([weight, 1.0 - weight]) / (high - low)
        bend = -sum(own * curve for own, curve in zip(shares, problem.curvatures, strict=True))
        noise = NOISE * float(np.linalg.norm(shares))
        tuned = tune(noise, bend, inputs=problem.names, method="spsa", amplitude_max=0.99 * room)
        begin = dict(zip(problem.names, np.clip(start, lower + room, upper - room).tolist(), strict=True))
        seeker = tuned.seeker(start=begin, inputs=list(problem.inputs), seed=seed)
        for _ in range(cycles // WEIGHTS):
            asked = seeker.ask()
            tried.append([asked[name] for name in problem.names])
            read.append(problem.read(np.array(tried[-1])))
            seeker.tell(float(shares @ read[-1]))
        start = seeker.estimate
        ends.append(start)
    applied = np.array(tried)
    return {
        "SPSA of weighted sums, estimates": (np.array(ends), applied),
        "SPSA of weighted sums, fits": (by_fits(problem, applied, np.array(read)), applied),
    }


def along(front: Array) -> Array:
    return front[np.argsort(-front[:, 0], kind="stable")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--cycles", type=int, default=100)
    options = parser.parse_args()
    problems: dict[str, Callable[[int], Problem]] = {
        "quadratic": lambda seed: pair(seed, skewed=False),
        "skewed": lambda seed: pair(seed, skewed=True),
        "engine": engine,
    }
    for name, make in problems.items():
        found: dict[str, list[tuple[float, float]]] = {}
        for seed in range(options.seeds):
            for contender in (ours, at_random, spsa):
                problem = make(seed)
                for row, (inputs, applied) in contender(problem, options.cycles, seed).items():
                    found.setdefault(row, []).append((share(problem, inputs), below(problem, applied)))
            low, high = problem.ends
            way = np.cumsum(np.r_[0.0, np.linalg.norm(np.diff(along(problem.front) / (high - low), axis=0), axis=1)])
            even = along(problem.front)[[np.argmin(np.abs(way - s)) for s in np.linspace(0.0, way[-1], 21)]]
            reference = low - 0.1 * (high - low)
            whole = volume(even, reference) / volume(problem.front, reference)
            found.setdefault("21 points of the true front", []).append((whole, 0.0))
        print(f"\n{name}: share of the hypervolume, worst of the seeds; below the front on the way")
        for row, figures in found.items():
            table = np.array(figures)
            wide = 1.96 * table.std(axis=0, ddof=1) / math.sqrt(len(table))
            mean = table.mean(axis=0)
            print(f"  {row:34s} {mean[0]:.3f} ± {wide[0]:.3f}, {table[:, 0].min():.3f}; {mean[1]:.3f} ± {wide[1]:.3f}")


if __name__ == "__main__":
    main()
