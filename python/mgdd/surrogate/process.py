"""Gaussian process of a response: a smooth function with a length scale per factor, and white noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ProcessSurface", "matern"]

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
    """What a Gaussian process says between its points.

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
        known = solve_triangular(self._root, across.T, lower=True)
        variance = self.signal_sd**2 - np.sum(known**2, axis=0)
        return self.offset + across @ self._weights, np.sqrt(np.maximum(variance, 0.0))

    def supports(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return True: the hull alone says where the points end."""
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
        own = self.signal_sd**2 * matern(self.points, self.points, self.length_scales)
        full = own + (self.noise_sd**2 + self._jitter) * np.eye(len(own))
        return np.asarray(np.linalg.cholesky(full), dtype=np.float64)

    @cached_property
    def _inverse(self) -> NDArray[np.float64]:
        from scipy.linalg import cho_solve

        return np.asarray(cho_solve((self._root, True), np.eye(len(self._root))), dtype=np.float64)

    @cached_property
    def _weights(self) -> NDArray[np.float64]:
        from scipy.linalg import cho_solve

        return np.asarray(cho_solve((self._root, True), self.values - self.offset), dtype=np.float64)
