"""Polynomial of a response: terms, coefficients, and what they say of new points and of left-out ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.surrogate.response_surface import Support
from mgdd.surrogate.stepwise import leverage_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["PolynomialSurface"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PolynomialSurface:
    """Coefficients of the terms of a support, in the unit of the response, and the noise about them.

    References
    ----------
    Cook and Weisberg (1982), Residuals and Influence in Regression, section 2.2.
    """

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    support: Support
    coefficients: NDArray[np.float64]
    noise_sd: float

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the noise: points less terms."""
        return float(self.values.size - self.coefficients.size)

    def predict(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the mean and its standard deviation, noise not included, at points of shape (n, m)."""
        terms = self.support.basis(points)
        return terms @ self.coefficients, self.noise_sd * np.sqrt(self.support.leverage(points))

    def supports(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points lie in the ranges of the fitted ones, with no higher leverage than these."""
        return self.support.contains(points)

    def fitted(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the mean at the points, and the weight of each point in its own (the leverage)."""
        terms = self.support.basis(self.points)
        return terms @ self.coefficients, leverage_of(terms)

    def left_out(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the prediction of each point from the others, and the externally studentised residual.

        NaN where the others do not determine it.
        """
        mean, leverage = self.fitted()
        residual, room = self.values - mean, 1.0 - leverage
        alone = room < 1e-9  # the polynomial passes through this point whatever is measured
        error = np.where(alone, np.nan, residual / np.where(alone, 1.0, room))
        others = self.freedom - 1.0
        if others < 1.0:
            return self.values - error, np.full(error.size, np.nan)
        without = np.maximum(np.sum(residual**2) - residual * error, 0.0) / others
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.values - error, error * np.sqrt(room) / np.sqrt(without)
