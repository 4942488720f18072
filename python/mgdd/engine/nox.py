"""NOx proxies from measured sweeps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd._core.engine import NoxFit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["fit_nox_proxy"]


def fit_nox_proxy(
    t_max_k: ArrayLike,
    nox_ppm: ArrayLike,
    *,
    map: str = "affine_log",  # noqa: A002
    reference_temperature_k: float = 1900.0,
) -> NoxFit:
    """Fit a NOx proxy to a sweep by least squares on ln NOx.

    Parameters
    ----------
    t_max_k : array_like
        Maximum bulk gas temperatures [K], at least five, at fixed oxygen, fuel and boost.
    nox_ppm : array_like
        Measured NOx [ppm], of the same length.
    map : {"affine_log", "arrhenius"}
        Form of the map.
    reference_temperature_k : float
        T0 of the proxy [K]; it is chosen, not fitted.

    Returns
    -------
    NoxFit
        Proxy, residual and standard errors.

    Raises
    ------
    mgdd.errors.DataError
        Fewer than five points, values that are not positive, equal temperatures, NOx that does not rise.
    mgdd.errors.ShapeError
        Columns of unequal length.
    mgdd.errors.ParameterError
        An unknown map, a reference that is not positive.

    Examples
    --------
    >>> from mgdd.engine import NoxProxy, fit_nox_proxy
    >>> t = [1834.0, 1881.0, 1959.0, 2026.0, 2126.0]
    >>> fit = fit_nox_proxy(t, NoxProxy().arrhenius_ppm(t), map="arrhenius")
    >>> round(fit.proxy.activation_temperature_k)
    16000
    """
    return _core.engine.fit_nox_proxy(
        np.asarray(t_max_k, float), np.asarray(nox_ppm, float), map, reference_temperature_k
    )
