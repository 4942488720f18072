"""Gaussian process of a response: its prediction between its points, and its fit by scikit-learn."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError
from mgdd.io.extras import import_extra
from mgdd.results.finding import Finding
from mgdd.results.fit_report import FitReport

_NUGGET = 1e-10  # of the signal variance: keeps a noise-free covariance positive


def matern(
    one: NDArray[np.float64], other: NDArray[np.float64], length_scales: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the Matérn correlation of smoothness 5/2, shape (n, k)."""
    from scipy.spatial.distance import cdist

    r = np.sqrt(5.0) * cdist(one / length_scales, other / length_scales)
    return np.asarray((1.0 + r + r**2 / 3.0) * np.exp(-r), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProcessSurface:
    """Prediction of a Gaussian process between its points.

    Length scales in the units of the factors; offset, signal and noise in that of the response. Needs no scikit-learn.

    References
    ----------
    Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, equations 2.25, 2.26 and 5.12.
    """

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    offset: float
    signal_sd: float
    length_scales: NDArray[np.float64]
    noise_sd: float

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the noise: counted as known, which flatters small sets."""
        return float("inf")

    def predict(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the mean and its standard deviation, noise not included, at points of shape (n, m)."""
        from scipy.linalg import solve_triangular

        across = self.signal_sd**2 * matern(points, self.points, self.length_scales)
        explained = solve_triangular(self._root, across.T, lower=True)
        variance = self.signal_sd**2 - np.sum(explained**2, axis=0)
        return self.offset + across @ self._weights, np.sqrt(np.maximum(variance, 0.0))

    def supports(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return True: the hull alone bounds the points."""
        return np.ones(len(points), dtype=np.bool_)

    def fitted(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the mean at the points, and the weight of each point in its own."""
        return self.predict(self.points)[0], 1.0 - (self.noise_sd**2 + self._jitter) * np.diag(self._inverse)

    def left_out(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the prediction of each point from the others, noise included, and the residual over its deviation."""
        inverse = np.diag(self._inverse)
        error = self._weights / inverse
        return self.values - error, error * np.sqrt(inverse)

    @cached_property
    def _jitter(self) -> float:
        return _NUGGET * self.signal_sd**2

    @cached_property
    def _root(self) -> NDArray[np.float64]:
        covariance = self.signal_sd**2 * matern(self.points, self.points, self.length_scales)
        full = covariance + (self.noise_sd**2 + self._jitter) * np.eye(len(covariance))
        return np.asarray(np.linalg.cholesky(full), dtype=np.float64)

    @cached_property
    def _inverse(self) -> NDArray[np.float64]:
        from scipy.linalg import cho_solve

        return np.asarray(cho_solve((self._root, True), np.eye(len(self._root))), dtype=np.float64)

    @cached_property
    def _weights(self) -> NDArray[np.float64]:
        from scipy.linalg import cho_solve

        return np.asarray(cho_solve((self._root, True), self.values - self.offset), dtype=np.float64)


MOST_POINTS = 3000  # the covariance is factorised in every step
_ONE_THREAD = 500  # points below which threads of the matrix library only wait for each other
_LENGTH = (0.05, 50.0)  # in half ranges of a factor
_SIGNAL, _NOISE = (1e-2, 1e4), (1e-8, 1e1)  # variances over that of the response
_AT_BOUND = 1e-4  # of the logarithms
_STEP = 1e-4  # of the logarithms, for the curvature of the likelihood


@dataclass
class _Search:
    """L-BFGS-B as the optimiser of scikit-learn, which else keeps neither counts nor whether it arrived."""

    results: list[Any] = field(default_factory=list)

    def __call__(
        self, negative: Callable[[NDArray[np.float64]], Any], start: NDArray[np.float64], bounds: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float]:
        from scipy.optimize import minimize

        result = minimize(negative, start, method="L-BFGS-B", jac=True, bounds=bounds)
        self.results.append(result)
        return result.x, float(result.fun)


def fit_process(
    points: NDArray[np.float64], values: NDArray[np.float64], names: Sequence[str], *, n_starts: int, seed: int
) -> tuple[ProcessSurface, FitReport]:
    """Fit signal, length scales and noise by maximum likelihood."""
    if len(values) > MOST_POINTS:
        raise DataError(
            f"{len(values)} points: a Gaussian process takes at most {MOST_POINTS}; thin them or use a polynomial"
        )
    purpose = "a Gaussian process"
    kernels: Any = import_extra("sklearn.gaussian_process.kernels", "gp", purpose)
    process: Any = import_extra("sklearn.gaussian_process", "gp", purpose)
    half, offset, spread = 0.5 * np.ptp(points, axis=0), float(values.mean()), float(values.std())
    m = points.shape[1]
    kernel = kernels.ConstantKernel(1.0, _SIGNAL) * kernels.Matern(np.ones(m), _LENGTH, nu=2.5)
    search = _Search()
    regressor = process.GaussianProcessRegressor(
        kernel + kernels.WhiteKernel(0.05, _NOISE),
        optimizer=search,
        n_restarts_optimizer=n_starts - 1,
        random_state=seed,
    )
    few = 1 if len(values) <= _ONE_THREAD else None
    threads: Any = import_extra("threadpoolctl", "gp", purpose)
    with threads.threadpool_limits(few), warnings.catch_warnings():
        # A parameter at its bound is reported as a finding.
        warnings.simplefilter("ignore", import_extra("sklearn.exceptions", "gp", purpose).ConvergenceWarning)
        regressor.fit((points - points.mean(axis=0)) / half, (values - offset) / spread)
    logs = np.asarray(regressor.kernel_.theta, dtype=np.float64)  # of the variances and lengths: signal, lengths, noise
    surface = ProcessSurface(
        points=points,
        values=values,
        offset=offset,
        signal_sd=spread * float(np.exp(0.5 * logs[0])),
        length_scales=half * np.exp(logs[1:-1]),
        noise_sd=spread * float(np.exp(0.5 * logs[-1])),
    )
    with threads.threadpool_limits(few):
        return surface, _report(surface, regressor, search, logs, names, half=half, spread=spread)


def _report(
    surface: ProcessSurface,
    regressor: Any,
    search: _Search,
    logs: NDArray[np.float64],
    names: Sequence[str],
    *,
    half: NDArray[np.float64],
    spread: float,
) -> FitReport:
    bounds = np.asarray(regressor.kernel_.bounds, dtype=np.float64)
    at_bound = (logs > bounds[:, 1] - _AT_BOUND).astype(np.int_) - (logs < bounds[:, 0] + _AT_BOUND)
    parameters = ("signal_sd", *(f"length_scale_{name}" for name in names), "noise_sd")
    values = np.r_[surface.signal_sd, surface.length_scales, surface.noise_sd]
    # d value/d log: 1/2 of a variance, 1 of a length.
    slope = values * np.r_[0.5, np.ones(len(names)), 0.5]
    covariance = np.full((logs.size, logs.size), np.nan)
    free = np.flatnonzero(at_bound == 0)
    covariance[np.ix_(free, free)] = _covariance(regressor, logs, free) * np.outer(slope[free], slope[free])
    stderr = np.sqrt(np.diag(covariance))
    best = min(search.results, key=lambda result: float(result.fun))
    with np.errstate(invalid="ignore"):  # a flat likelihood has infinite errors, and no correlation
        correlation = covariance / np.outer(stderr, stderr)
    edges = np.exp(bounds)
    edges[[0, -1]] = spread * np.sqrt(edges[[0, -1]])
    edges[1:-1] *= half[:, None]
    residual = surface.fitted()[0] - surface.values
    size = float(np.linalg.norm(surface.values - surface.values.mean()))
    near = sum(float(result.fun) < float(best.fun) + 0.05 for result in search.results)
    return FitReport(
        names=parameters,
        values=values,
        stderr=stderr,
        lower=edges[:, 0],
        upper=edges[:, 1],
        bounds_active=at_bound,
        covariance=covariance,
        correlation=correlation,
        unidentifiable=tuple(name for name, side in zip(parameters, at_bound, strict=True) if side),
        findings=tuple(_at_bound(name, int(side)) for name, side in zip(parameters, at_bound, strict=True) if side),
        null_directions=np.zeros((logs.size, 0)),
        rmse=float(np.sqrt(np.mean(residual**2))),
        cost=0.5 * float(np.sum(residual**2)),
        nrmse_fit_percent=100.0 * (1.0 - float(np.linalg.norm(residual)) / size),
        residual=residual,
        nfev=sum(int(result.nfev) for result in search.results),
        njev=sum(int(result.nfev) for result in search.results),
        nit=int(best.nit),
        history={},
        status="cost_converged" if best.success else "stalled",
        message=f"log marginal likelihood {-float(best.fun):.4g}, found by {near} of {len(search.results)} searches",
        success=bool(best.success),
    )


def _covariance(regressor: Any, logs: NDArray[np.float64], free: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the inverse curvature of the log likelihood over the free logarithms, infinite where it is flat."""

    def slope(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(regressor.log_marginal_likelihood(at, eval_gradient=True)[1])[free]

    steps = _STEP * np.eye(logs.size)[free]
    curvature = np.array([(slope(logs - step) - slope(logs + step)) / (2.0 * _STEP) for step in steps])
    curvature = 0.5 * (curvature + curvature.T).reshape(free.size, free.size)
    if free.size and np.linalg.eigvalsh(curvature).min() <= 1e-9:
        return np.full(curvature.shape, np.inf)
    return np.linalg.inv(curvature)


def _at_bound(name: str, side: int) -> Finding:
    end = f"{name} stands at its {'upper' if side > 0 else 'lower'} bound"
    if not name.startswith("length_scale_"):
        return Finding("at_bound", (name,), end)
    factor = name.removeprefix("length_scale_")
    if side > 0:
        remedy = f"look at the cut along {factor}: leave it out where that is flat"
        return Finding("at_bound", (name,), f"{end}: the response is flat or straight along {factor}", remedy)
    remedy = f"add points between those of {factor}, or record with less noise"
    return Finding("at_bound", (name,), f"{end}: the response jumps from point to point of {factor}", remedy)
