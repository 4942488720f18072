"""Noise, curvature and optimum of a measured map: what a tuner has to know."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ShapeError
from mgdd.results.describe import described

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["MeasuredMap", "measure_map"]

_FEWEST_POINTS, _FEWEST_INPUTS = 5, 3


@described
@dataclass(frozen=True, kw_only=True)
class MeasuredMap:
    """Noise, curvature and optimum of a measured map J(theta), each with its standard error.

    Attributes
    ----------
    noise_sd, noise_sd_stderr : float
        Standard deviation of J about the parabola [unit of J].
    curvature, curvature_stderr : float
        J'' [unit of J per squared unit of the input].
    optimum, optimum_stderr : float
        Vertex of the parabola [unit of the input].
    points : int
        Measurements behind it.

    See Also
    --------
    measure_map : makes one.

    Examples
    --------
    >>> from mgdd.optimize import measure_map
    >>> found = measure_map([-2, -1, 0, 1, 2], [-4.0, -1.1, 0.0, -0.9, -4.0])
    >>> round(found.curvature, 3), round(found.optimum, 3)
    (-2.0, 0.01)
    """

    noise_sd: float
    noise_sd_stderr: float
    curvature: float
    curvature_stderr: float
    optimum: float
    optimum_stderr: float
    points: int


def measure_map(theta: ArrayLike, J: ArrayLike, *, maximize: bool = True) -> MeasuredMap:  # noqa: N803
    """Read noise, curvature and optimum off measurements of J, by a least-squares parabola.

    Parameters
    ----------
    theta : array_like, shape (n,)
        Applied inputs, at least three distinct ones; repeat them.
    J : array_like, shape (n,)
        What was measured there, one cycle each, n >= 5.
    maximize : bool
        Whether the optimum is a maximum.

    Returns
    -------
    MeasuredMap
        Standard errors from the scatter about the parabola.

    Raises
    ------
    DataError
        Too few points or inputs, values that are not finite, or no curvature towards an optimum.
    ShapeError
        Not one J per input.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> soi = np.repeat([-16.0, -10.0, -4.0, 2.0], 20)
    >>> found = measure_map(soi, 56.0 - 0.0255 * (soi + 5.6) ** 2 + rng.normal(0.0, 0.25, soi.size))
    >>> abs(found.optimum + 5.6) < 3.0 * found.optimum_stderr
    True
    """
    x = np.asarray(theta, dtype=np.float64)
    y = np.asarray(J, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape:
        raise ShapeError(f"theta has shape {x.shape}, J {y.shape}: must be one J for every theta, in one dimension")
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise DataError("theta and J: must be finite; leave misfired cycles out")
    distinct = np.unique(x).size
    if x.size < _FEWEST_POINTS or distinct < _FEWEST_INPUTS:
        raise DataError(
            f"{x.size} points at {distinct} distinct inputs: must be at least {_FEWEST_POINTS} at {_FEWEST_INPUTS}"
        )
    middle, half = 0.5 * (x.min() + x.max()), 0.5 * (x.max() - x.min())
    design = np.vander((x - middle) / half, 3, increasing=True)
    if np.linalg.cond(design) > 1e8:
        raise DataError("theta: its distinct inputs are too close to each other to show a curvature; spread them")
    level = y.mean()
    c, *_ = np.linalg.lstsq(design, y - level, rcond=None)
    if not (c[2] < 0.0 if maximize else c[2] > 0.0):
        raise DataError(
            f"J bends {'up' if maximize else 'down'} over theta (curvature {2.0 * c[2] / half**2:.4g}): "
            f"there is no {'maximum' if maximize else 'minimum'}; widen the range of theta or repeat more often"
        )
    freedom = x.size - 3
    residual = y - level - design @ c
    variance = float(residual @ residual) / max(freedom, 1)
    covariance = variance * np.linalg.inv(design.T @ design)
    vertex = -0.5 * c[1] / c[2]
    lever = np.array([0.0, -0.5 / c[2], 0.5 * c[1] / c[2] ** 2])
    return MeasuredMap(
        noise_sd=math.sqrt(variance),
        noise_sd_stderr=math.sqrt(variance / (2.0 * freedom)),
        curvature=float(2.0 * c[2] / half**2),
        curvature_stderr=float(2.0 * math.sqrt(covariance[2, 2]) / half**2),
        optimum=float(middle + vertex * half),
        optimum_stderr=float(math.sqrt(lever @ covariance @ lever) * half),
        points=int(x.size),
    )
