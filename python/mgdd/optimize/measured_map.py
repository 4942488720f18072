"""Noise, curvature and optimum of a measured map: what a tuner has to know."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ShapeError
from mgdd.results.finding import Finding
from mgdd.results.result import NumbersResult

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["MeasuredMap", "measure_map"]

_FEWEST_POINTS, _FEWEST_INPUTS = 5, 3
_SIGNIFICANCE = 0.01  # of the test of lack of fit
_FEWEST_REPEATS = 3  # degrees of freedom of a noise that the test believes


@dataclass(frozen=True, kw_only=True, repr=False)
class MeasuredMap(NumbersResult):
    """Noise, curvature and optimum of a measured map J(theta), each with its standard error.

    Attributes
    ----------
    noise_sd, noise_sd_stderr : float
        Standard deviation of J about the parabola; between repeats alone where the parabola does not fit [unit of J].
    curvature, curvature_stderr : float
        J'' [unit of J per squared unit of the input].
    optimum, optimum_stderr : float
        Vertex of the parabola [unit of the input].
    points : int
        Measurements behind curvature and optimum.
    findings : tuple of Finding
        ``lack_of_fit`` where J over all inputs is not a parabola: curvature and optimum are those of the inputs nearest
        to the best one, and their standard errors hold the difference to twice that range.

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
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class _Parabola:
    variance: float  # of one measurement about it
    freedom: int
    curvature: float
    curvature_variance: float  # per unit of `variance`
    optimum: float
    optimum_variance: float


def _parabola(x: NDArray[np.float64], y: NDArray[np.float64], *, maximize: bool, where: str = "") -> _Parabola:
    middle, half = 0.5 * (x.min() + x.max()), 0.5 * (x.max() - x.min())
    design = np.vander((x - middle) / half, 3, increasing=True)
    if np.linalg.cond(design) > 1e8:
        raise DataError("theta: its distinct inputs are too close to each other to show a curvature; spread them")
    level = y.mean()
    c, *_ = np.linalg.lstsq(design, y - level, rcond=None)
    if not (c[2] < 0.0 if maximize else c[2] > 0.0):
        raise DataError(
            f"J bends {'up' if maximize else 'down'} over theta{where} (curvature {2.0 * c[2] / half**2:.4g}): "
            f"there is no {'maximum' if maximize else 'minimum'}; widen the range of theta or repeat more often"
        )
    freedom = x.size - 3
    residual = y - level - design @ c
    spread = np.linalg.inv(design.T @ design)
    lever = np.array([0.0, -0.5 / c[2], 0.5 * c[1] / c[2] ** 2])
    return _Parabola(
        variance=float(residual @ residual) / max(freedom, 1),
        freedom=freedom,
        curvature=float(2.0 * c[2] / half**2),
        curvature_variance=float(4.0 * spread[2, 2] / half**4),
        optimum=float(middle - 0.5 * c[1] / c[2] * half),
        optimum_variance=float(lever @ spread @ lever) * half**2,
    )


def _richer(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], int] | None:
    """Values of a model that bends more freely, and its degrees of freedom: means of repeats, else a quartic."""
    _, group = np.unique(x, return_inverse=True)
    count = np.bincount(group)
    if x.size - count.size >= _FEWEST_REPEATS:
        centred = y - y.mean()
        return y.mean() + (np.bincount(group, centred) / count)[group], x.size - count.size
    if count.size < 5 or x.size - 5 < _FEWEST_REPEATS:
        return None
    middle, half = 0.5 * (x.min() + x.max()), 0.5 * (x.max() - x.min())
    design = np.polynomial.chebyshev.chebvander((x - middle) / half, 4)
    return y.mean() + design @ np.linalg.lstsq(design, y - y.mean(), rcond=None)[0], x.size - 5


def _fits(x: NDArray[np.float64], y: NDArray[np.float64], fit: _Parabola, noise: tuple[float, int]) -> bool:
    """F test of the parabola against the richer model, with the variance of the noise and its degrees of freedom."""
    from scipy.special import fdtrc

    richer = _richer(x, y)
    if richer is None:
        return True
    more = fit.freedom - richer[1]
    # Rounding of exact readings is not noise.
    if more < 1 or fit.variance <= (1e-9 * float(np.abs(y).max())) ** 2:
        return True
    residual = y - richer[0]
    lack = max(fit.variance * fit.freedom - float(residual @ residual), 0.0) / more
    return bool(noise[0] > 0.0 and fdtrc(more, noise[1], lack / noise[0]) > _SIGNIFICANCE)


def _narrowed(
    x: NDArray[np.float64], y: NDArray[np.float64], wide: _Parabola, *, maximize: bool
) -> tuple[_Parabola, NDArray[np.bool_], tuple[float, int]]:
    """Return the parabola of the inputs nearest to the best that it fits, which those are, and the noise."""
    kept = np.ones(x.size, dtype=np.bool_)
    narrow, noise = wide, (wide.variance, wide.freedom)
    richer = _richer(x, y)
    if richer is None:
        return narrow, kept, noise
    free = (float((y - richer[0]) @ (y - richer[0])) / richer[1], richer[1])
    best = x[np.argmax(richer[0] if maximize else -richer[0])]
    while not _fits(x[kept], y[kept], narrow, free):
        noise = free
        at = np.unique(x[kept])
        fewer = kept & (x != (at[0] if best - at[0] > at[-1] - best else at[-1]))
        if at.size <= _FEWEST_INPUTS or np.count_nonzero(fewer) < _FEWEST_POINTS:
            break
        kept = fewer
        where = f" in [{x[kept].min():.4g}, {x[kept].max():.4g}], over the whole of it J is not a parabola"
        narrow = _parabola(x[kept], y[kept], maximize=maximize, where=where)
    return narrow, kept, noise


def _twice_as_wide(x: NDArray[np.float64], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    low, high = x[kept].min(), x[kept].max()
    around: NDArray[np.bool_] = np.abs(x - 0.5 * (low + high)) <= high - low
    return around


def measure_map(theta: ArrayLike, J: ArrayLike, *, maximize: bool = True) -> MeasuredMap:  # noqa: N803
    """Read noise, curvature and optimum off measurements of J, by a least-squares parabola.

    Where repeats (or, without them, a polynomial of fourth order) show at 1 % that J is not a parabola over all inputs,
    those farthest from the best are left out until it is, and `findings` says so.

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
        Standard errors from the scatter about the parabola, with findings also from the difference to twice the range.

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
    wide = _parabola(x, y, maximize=maximize)
    narrow, kept, noise = _narrowed(x, y, wide, maximize=maximize)
    wider = wide
    findings: tuple[Finding, ...] = ()
    if noise[1] != wide.freedom:  # the parabola of all inputs does not fit
        # Halving the range takes half of the bias of an optimum away at least, so what it changes bounds what is left.
        around = _twice_as_wide(x, kept)
        wider = _parabola(x[around], y[around], maximize=maximize)
        findings = (
            Finding(
                "lack_of_fit",
                ("J",),
                f"J over theta in [{x.min():.4g}, {x.max():.4g}] is not a parabola (residual {wide.variance**0.5:.3g}, "
                f"noise {noise[0] ** 0.5:.3g}): curvature and optimum are those of theta in "
                f"[{x[kept].min():.4g}, {x[kept].max():.4g}]",
                "measure more inputs nearer to the optimum",
            ),
        )
    return MeasuredMap(
        noise_sd=math.sqrt(noise[0]),
        noise_sd_stderr=math.sqrt(noise[0] / (2.0 * noise[1])),
        curvature=narrow.curvature,
        curvature_stderr=math.hypot(
            math.sqrt(noise[0] * narrow.curvature_variance), narrow.curvature - wider.curvature
        ),
        optimum=narrow.optimum,
        optimum_stderr=math.hypot(math.sqrt(noise[0] * narrow.optimum_variance), narrow.optimum - wider.optimum),
        points=int(np.count_nonzero(kept)),
        findings=findings,
    )
