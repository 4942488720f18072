"""Figures of merit between a measured and a modelled signal, and tests on what is left."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import Result

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

_LIMIT = 1.96
_SHARE = 0.95


def nrmse_fit_percent(measured: ArrayLike, model: ArrayLike) -> float:
    """Return ``100 (1 - |y - yh| / |y - mean y|)``: 100 is perfect, 0 as good as the mean.

    Parameters
    ----------
    measured, model : array_like
        y and yh in one unit.

    Returns
    -------
    float
        Fit [%]; negative for a model worse than the mean.

    Raises
    ------
    DataError
        Values that are not finite, a constant measurement.
    ShapeError
        Arrays of different shape, or empty ones.

    Examples
    --------
    >>> from mgdd.signals import nrmse_fit_percent
    >>> nrmse_fit_percent([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), nrmse_fit_percent([1.0, 2.0, 3.0], [2.0, 2.0, 2.0])
    (100.0, 0.0)
    """
    y, yh = _pair(measured, model)
    return 100.0 * (1.0 - float(np.linalg.norm(y - yh)) / _spread(y))


def vaf_percent(measured: ArrayLike, model: ArrayLike) -> float:
    """Return 100 (1 - var(y - yh) / var(y)), which a constant offset does not change."""
    y, yh = _pair(measured, model)
    error = y - yh
    return 100.0 * (1.0 - float(np.linalg.norm(error - error.mean()) / _spread(y)) ** 2)


def mse(measured: ArrayLike, model: ArrayLike) -> float:
    """Return the mean squared error, in the square of the unit."""
    y, yh = _pair(measured, model)
    return float(np.mean((y - yh) ** 2))


def rmse(measured: ArrayLike, model: ArrayLike) -> float:
    """Return the root of the mean squared error, in the unit."""
    return float(np.sqrt(mse(measured, model)))


@dataclass(frozen=True, kw_only=True, repr=False)
class ResidualTests(Result):
    """Correlations that a residual should not have.

    Parameters
    ----------
    white : bool
        Whether 95 % of the autocorrelations lie within the limit.
    independent : bool
        The same of the correlations with the input.
    share_white, share_independent : float
        Those shares [-].
    limit : float
        1.96 / sqrt(N) [-].
    correlations : xarray.Dataset
        ``autocorrelation`` and ``cross_correlation`` over ``lag``.

    Notes
    -----
    With 25 lags the rule forgives one: a residual that is white passes it in 64 of 100 records, so a failure by two
    lags means little. Near stiction a failure is the rule and no reason to reject a model.
    """

    white: bool
    independent: bool
    share_white: float
    share_independent: float
    limit: float
    correlations: xr.Dataset = field(repr=False)

    @property
    def dataset(self) -> xr.Dataset:
        """The correlations."""
        return self.correlations


def residual_tests(residual: ArrayLike, duty: ArrayLike, *, lags: int = 25) -> ResidualTests:
    """Test a residual for memory and for what the input still explains, over lags 1 to `lags`.

    A prediction that starts from the last noisy sample carries its noise: the residual then has -0.5 at lag 1.
    """
    ParameterError.unless(lags >= 1, "lags", lags, ">= 1")
    e, u = _pair(residual, duty)
    if e.ndim != 1 or e.size < 4 * lags:
        raise DataError(f"residual has shape {e.shape}: {4 * lags} samples in one dimension are needed for {lags} lags")
    e, u = e - e.mean(), u - u.mean()
    norm_e, norm_u = float(np.linalg.norm(e)), float(np.linalg.norm(u))
    if not norm_e > 0.0 or not norm_u > 0.0:
        raise DataError(f"{'duty' if norm_e > 0.0 else 'residual'} is constant: it has no correlation")
    auto = np.array([e[k:] @ e[:-k] for k in range(1, lags + 1)]) / norm_e**2
    cross = np.array([e[k:] @ u[:-k] for k in range(1, lags + 1)]) / (norm_e * norm_u)
    limit = _LIMIT / float(np.sqrt(e.size))
    shares = [float(np.mean(np.abs(values) <= limit)) for values in (auto, cross)]
    correlations = labelled_dataset(
        {
            "lag": ("lag", np.arange(1, lags + 1), "samples", "lag"),
            "autocorrelation": ("lag", auto, "-", "autocorrelation of the residual"),
            "cross_correlation": ("lag", cross, "-", "correlation of residual and earlier duty"),
            "limit": ((), limit, "-", "95 % limit"),
        }
    )
    return ResidualTests(
        white=shares[0] >= _SHARE,
        independent=shares[1] >= _SHARE,
        share_white=shares[0],
        share_independent=shares[1],
        limit=limit,
        correlations=correlations,
    )


def _pair(measured: ArrayLike, model: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    y, yh = np.asarray(measured, dtype=np.float64), np.asarray(model, dtype=np.float64)
    if y.shape != yh.shape or y.size == 0:
        raise ShapeError(f"shapes {y.shape} and {yh.shape}: must be equal and not empty")
    for name, values in (("first", y), ("second", yh)):
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise DataError(f"{name} signal, sample {int(bad[0])}: {values.flat[bad[0]]} is not finite")
    return y, yh


def _spread(y: NDArray[np.float64]) -> float:
    spread = float(np.linalg.norm(y - y.mean()))
    if not spread > 0.0:
        raise DataError("the measured signal is constant: a fit in percent has no meaning")
    return spread
