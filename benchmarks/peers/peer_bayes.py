"""Bayesian optimisation of noisy inputs as engineers run it, for the benchmarks of seeking.

Contenders as in `peer_seekers.py`, of one input or several. What is called defaults ends after 40 evaluations at the
best reading it has seen: that is what both packages hand back. By hand: the noise is told; the start and one reading
in every part of each input come first; the answer is the best of the model's mean; hyperparameters are fitted for 40
evaluations and kept from then on. Those settings were found by trying on the maps of the benchmark, and the trying is
not counted.
"""

from __future__ import annotations

import contextlib
import io
import math
import warnings
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from peers.peer_seekers import like, stay

if TYPE_CHECKING:
    from peers.peer_seekers import Contender, Plant, Point

PACKAGES = {"bayes_opt": "bayesian-optimization", "skopt": "scikit-optimize"}
EVALUATIONS, RANDOM_FIRST, SPREAD_FIRST = 40, 5, 2
GRID = {1: 161, 2: 17, 3: 7}  # points along each input, by the number of inputs


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Without warnings of length scales at their bound, and without printed remarks on a repeated input."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield


def edges(lower: Point, upper: Point) -> np.ndarray:
    """Return lower and upper bounds, shape (inputs, 2)."""
    return np.column_stack([np.atleast_1d(lower), np.atleast_1d(upper)]).astype(float)


def spread_points(rng: np.random.RandomState, bounds: np.ndarray, count: int) -> np.ndarray:
    """Draw a Latin hypercube, shape (count, inputs)."""
    return np.column_stack(
        [low + (high - low) * (rng.permutation(count) + rng.uniform(size=count)) / count for low, high in bounds]
    )


def mesh(bounds: np.ndarray) -> np.ndarray:
    """Return the points of the grid, shape (points, inputs)."""
    axes = [np.linspace(low, high, GRID[len(bounds)]) for low, high in bounds]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(bounds))


def highest(mean: Callable[[np.ndarray], np.ndarray], points: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return the input of the highest mean: of the grid of one input, of several by a search from its best point."""
    best = points[int(np.argmax(mean(points)))]
    if len(bounds) == 1:
        return best
    from scipy.optimize import minimize

    low, high = bounds.T

    def below(share: np.ndarray) -> float:
        return -float(mean((low + share * (high - low))[None])[0])

    found = minimize(below, (best - low) / (high - low), method="L-BFGS-B", bounds=[(0.0, 1.0)] * len(bounds))
    return low + found.x * (high - low)


def bayes_opt(lower: Point, upper: Point) -> Contender:
    """`BayesianOptimization` as it comes: five random readings, upper confidence bound, the best reading."""
    from bayes_opt import BayesianOptimization

    bounds = edges(lower, upper)
    names = [f"x{k}" for k in range(len(bounds))]

    def run(plant: Plant, start: Point, seed: int) -> None:
        rng = np.random.default_rng([seed, 2])
        search = BayesianOptimization(
            None, dict(zip(names, bounds, strict=True)), random_state=seed, verbose=0, allow_duplicate_points=True
        )
        x = np.atleast_1d(start)
        for count in range(1, EVALUATIONS + 1):
            j = plant(like(start, x))
            with quietly():
                search.register(x, j)
                plant.estimate = like(start, np.array([search.max["params"][name] for name in names]))
                x = rng.uniform(*bounds.T) if count < RANDOM_FIRST else np.array(list(search.suggest().values()))
        stay(plant)

    return run


def bayes_opt_by_hand(
    lower: Point,
    upper: Point,
    noise_sd: float,
    *,
    goes_on: bool = False,
    kappa: float = 1.0,
    scale: tuple[float, float] = (8.0, 40.0),
    spread_first: int = SPREAD_FIRST,
    searches: int = 2,
) -> Contender:
    """Length scales are bounded, one for each input, in the unit of the inputs: let several be alike."""
    from bayes_opt import BayesianOptimization, acquisition
    from sklearn.gaussian_process.kernels import Matern

    bounds = edges(lower, upper)
    names = [f"x{k}" for k in range(len(bounds))]
    points = mesh(bounds)

    def run(plant: Plant, start: Point, seed: int) -> None:
        rng = np.random.RandomState(seed)
        bound = acquisition.UpperConfidenceBound(kappa=kappa)
        search = BayesianOptimization(
            None,
            dict(zip(names, bounds, strict=True)),
            bound,
            random_state=seed,
            verbose=0,
            allow_duplicate_points=True,
        )
        lengths = np.full(len(bounds), 10.0)
        search.set_gp_params(kernel=Matern(nu=2.5, length_scale=lengths, length_scale_bounds=scale))
        search.set_gp_params(n_restarts_optimizer=0)
        model = search._gp  # the package offers no other way to its model
        spread = spread_points(rng, bounds, spread_first)
        count, x = 0, np.atleast_1d(start)
        while True:
            j = plant(like(start, x))
            with quietly():
                search.register(x, j)
            count += 1
            if count <= spread_first:
                x = spread[count - 1]
                continue
            told = (noise_sd / float(np.std(search.space.target))) ** 2  # the model sees readings scaled to one
            search.set_gp_params(alpha=told)
            if count == EVALUATIONS:
                search.set_gp_params(kernel=model.kernel_, optimizer=None)
            with quietly():
                suggested = bound.suggest(model, search.space, n_random=400, n_smart=searches, random_state=rng)
            plant.estimate = like(start, highest(model.predict, points, bounds))
            if count >= EVALUATIONS and not goes_on:
                stay(plant)
            x = np.asarray(suggested, float)

    return run


def skopt(lower: Point, upper: Point) -> Contender:
    """`Optimizer` as it comes: ten random readings, three acquisitions by turns, the noise fitted, the best reading."""
    from skopt import Optimizer

    bounds = edges(lower, upper)

    def run(plant: Plant, start: Point, seed: int) -> None:
        search = Optimizer([(low, high) for low, high in bounds], random_state=seed)
        x, best = np.atleast_1d(start), -np.inf
        for _ in range(EVALUATIONS):
            j = plant(like(start, x))
            if j > best:
                best, plant.estimate = j, like(start, x)
            with quietly():
                search.tell(x.tolist(), -j)
                x = np.array(search.ask(), float)
        stay(plant)

    return run


def skopt_by_hand(
    lower: Point,
    upper: Point,
    noise_sd: float,
    *,
    goes_on: bool = False,
    acquisition: str = "EI",
    spread_first: int = SPREAD_FIRST,
    scale: tuple[float, float] | None = None,
    **acquisition_settings: float,
) -> Contender:
    """Search an acquisition once, from 300 random points, not five times from 10 000; the package scales inputs.

    Length scales are those of the package, or bounded, as shares of the bounds of an input.
    """
    from skopt import Optimizer
    from skopt.learning.gaussian_process.kernels import ConstantKernel, Matern

    bounds = edges(lower, upper)
    points = mesh(bounds)

    def run(plant: Plant, start: Point, seed: int) -> None:
        search = Optimizer(
            [(low, high) for low, high in bounds],
            n_initial_points=spread_first + 1,
            acq_func=acquisition,
            acq_func_kwargs=acquisition_settings,
            acq_optimizer_kwargs={"n_points": 300, "n_restarts_optimizer": 1},
            model_queue_size=1,
            random_state=seed,
        )
        gp = search.base_estimator_
        gp.set_params(n_restarts_optimizer=0)
        if scale is not None:
            lengths = np.full(len(bounds), math.sqrt(scale[0] * scale[1]))
            amplitude = ConstantKernel(1.0, (0.01, 1000.0))  # as the package has it
            gp.set_params(kernel=amplitude * Matern(nu=2.5, length_scale=lengths, length_scale_bounds=scale))
        spread = spread_points(np.random.RandomState(seed), bounds, spread_first)
        readings: list[float] = []
        x = np.atleast_1d(start)

        def mean(at: np.ndarray) -> np.ndarray:
            return -search.models[-1].predict((at - bounds[:, 0]) / (bounds[:, 1] - bounds[:, 0]))

        while True:
            readings.append(plant(like(start, x)))
            count = len(readings)
            if count > spread_first:
                gp.set_params(noise=(noise_sd / float(np.std(readings))) ** 2)  # it sees readings scaled to one
            if count == EVALUATIONS:
                gp.set_params(kernel=search.models[-1].kernel_.k1, optimizer=None)  # k2 is the noise
            with quietly():
                search.tell(x.tolist(), -readings[-1])
            if count <= spread_first:
                x = spread[count - 1]
                continue
            with quietly():
                plant.estimate = like(start, highest(mean, points, bounds))
                x = np.array(search.ask(), float)
            if count >= EVALUATIONS and not goes_on:
                stay(plant)

    return run
