"""Bayesian optimisation of one noisy input as engineers run it, for `guided_seeking.py`.

Contenders as in `peer_seekers.py`. What is called defaults ends after 40 evaluations at the best reading it has seen:
that is what both packages hand back. By hand: the noise is told, the length scale bounded; the start and one reading
in either half come first; the answer is the best of the model's mean. Those settings were found by trying on the maps
of the benchmark, and the trying is not counted.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from peers.peer_seekers import Contender, Plant

PACKAGES = {"bayes_opt": "bayesian-optimization", "skopt": "scikit-optimize"}
EVALUATIONS, RANDOM_FIRST, SPREAD_FIRST = 40, 5, 2
GRID = 161


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Without warnings of length scales at their bound, and without printed remarks on a repeated input."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield


def stay(plant: Plant) -> None:
    while True:
        plant(plant.estimate)


def bayes_opt(lower: float, upper: float) -> Contender:
    """`BayesianOptimization` as it comes: five random readings, upper confidence bound, the best reading."""
    from bayes_opt import BayesianOptimization

    def run(plant: Plant, start: float, seed: int) -> None:
        rng = np.random.default_rng([seed, 2])
        search = BayesianOptimization(
            None, {"x": (lower, upper)}, random_state=seed, verbose=0, allow_duplicate_points=True
        )
        x = start
        for count in range(1, EVALUATIONS + 1):
            j = plant(x)
            with quietly():
                search.register({"x": x}, j)
                plant.estimate = float(search.max["params"]["x"])
                x = rng.uniform(lower, upper) if count < RANDOM_FIRST else float(search.suggest()["x"])
        stay(plant)

    return run


def bayes_opt_by_hand(
    lower: float,
    upper: float,
    noise_sd: float,
    *,
    goes_on: bool = False,
    kappa: float = 1.0,
    scale: tuple[float, float] = (8.0, 40.0),
) -> Contender:
    """Tell it the noise; hyperparameters are fitted for 40 evaluations and kept from then on."""
    from bayes_opt import BayesianOptimization, acquisition
    from sklearn.gaussian_process.kernels import Matern

    grid = np.linspace(lower, upper, GRID)

    def run(plant: Plant, start: float, seed: int) -> None:
        rng = np.random.RandomState(seed)
        bound = acquisition.UpperConfidenceBound(kappa=kappa)
        search = BayesianOptimization(
            None, {"x": (lower, upper)}, bound, random_state=seed, verbose=0, allow_duplicate_points=True
        )
        search.set_gp_params(kernel=Matern(nu=2.5, length_scale=10.0, length_scale_bounds=scale))
        search.set_gp_params(n_restarts_optimizer=0)
        model = search._gp  # the package offers no other way to its model
        spread = (
            lower + (upper - lower) * (rng.permutation(SPREAD_FIRST) + rng.uniform(size=SPREAD_FIRST)) / SPREAD_FIRST
        )
        count, x = 0, start
        while True:
            j = plant(x)
            with quietly():
                search.register({"x": x}, j)
            count += 1
            if count <= SPREAD_FIRST:
                x = float(spread[count - 1])
                continue
            told = (noise_sd / float(np.std(search.space.target))) ** 2  # the model sees readings scaled to one
            search.set_gp_params(alpha=told)
            if count == EVALUATIONS:
                search.set_gp_params(kernel=model.kernel_, optimizer=None)
            with quietly():
                suggested = bound.suggest(model, search.space, n_random=400, n_smart=2, random_state=rng)
            plant.estimate = float(grid[int(np.argmax(model.predict(grid[:, None])))])
            if count >= EVALUATIONS and not goes_on:
                stay(plant)
            x = float(suggested[0])

    return run


def skopt(lower: float, upper: float) -> Contender:
    """`Optimizer` as it comes: ten random readings, three acquisitions by turns, the noise fitted, the best reading."""
    from skopt import Optimizer

    def run(plant: Plant, start: float, seed: int) -> None:
        search = Optimizer([(lower, upper)], random_state=seed)
        x, best = start, -np.inf
        for _ in range(EVALUATIONS):
            j = plant(x)
            if j > best:
                best, plant.estimate = j, x
            with quietly():
                search.tell([x], -j)
                x = float(search.ask()[0])
        stay(plant)

    return run
