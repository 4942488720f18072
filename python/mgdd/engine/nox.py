"""NOx: proxies of measured sweeps, thermal NO of cycles, and what turns ppm into grams and takes humidity off."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd import _core
from mgdd._core.engine import NoxFit
from mgdd.errors import ParameterError

_NO2_G_PER_MOL = 46.0055
# 40 CFR 1065.670: factor = slope times the water of the intake air [mol/mol] + constant.
_HUMIDITY = {"compression": (9.953, 0.832), "spark": (18.840, 0.68094)}


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


def nox_g_per_kwh(
    nox_ppm: ArrayLike, *, exhaust_kg_per_h: ArrayLike, power_kw: ArrayLike, molar_mass_g_per_mol: float = 28.9
) -> NDArray[np.float64]:
    """Turn a concentration into grams of NO2 per kilowatt-hour.

    Parameters
    ----------
    nox_ppm : array_like
        NOx [ppm by volume], of the same gas as the flow: wet for the whole exhaust.
    exhaust_kg_per_h : array_like
        Mass flow of the exhaust, air and fuel [kg/h].
    power_kw : array_like
        Power that the grams are over [kW].
    molar_mass_g_per_mol : float
        Of the exhaust [g/mol]; that of lean diesel exhaust is 28.8 to 29.0.

    Returns
    -------
    numpy.ndarray
        NOx [g/kWh], counted as NO2 (46.0055 g/mol).

    Raises
    ------
    mgdd.errors.ParameterError
        A value that is not finite, a flow or power that is not > 0, a concentration below 0.

    Examples
    --------
    >>> from mgdd.engine import nox_g_per_kwh
    >>> float(nox_g_per_kwh(500.0, exhaust_kg_per_h=300.0, power_kw=50.0).round(3))
    4.776
    """
    ppm = _checked("nox_ppm", nox_ppm, least=0.0)
    flow, power = _checked("exhaust_kg_per_h", exhaust_kg_per_h), _checked("power_kw", power_kw)
    molar = float(_checked("molar_mass_g_per_mol", molar_mass_g_per_mol))
    return np.asarray(ppm * 1e-6 * 1e3 * flow / molar * _NO2_G_PER_MOL / power)


def nox_at_reference_humidity(
    nox_ppm: ArrayLike, intake_water_fraction: ArrayLike, *, ignition: str = "compression"
) -> NDArray[np.float64]:
    """Correct measured NOx for the humidity of the intake air (40 CFR 1065.670).

    Parameters
    ----------
    nox_ppm : array_like
        Measured NOx [ppm], or in any other unit.
    intake_water_fraction : array_like
        Water in the intake air [mol/mol]; 0.0169 leaves compression-ignition NOx as it is.
    ignition : {"compression", "spark"}
        Kind of engine.

    Returns
    -------
    numpy.ndarray
        NOx at the reference humidity.

    Raises
    ------
    mgdd.errors.ParameterError
        Another ignition, a value below 0 or not finite, water above 0.1 mol/mol.

    Examples
    --------
    >>> from mgdd.engine import nox_at_reference_humidity
    >>> float(nox_at_reference_humidity(700.5, 0.022).round(1))
    736.2
    """
    ParameterError.unless(ignition in _HUMIDITY, "ignition", ignition, f"one of {', '.join(_HUMIDITY)}")
    slope, constant = _HUMIDITY[ignition]
    water = _checked("intake_water_fraction", intake_water_fraction, least=0.0, most=0.1)
    return np.asarray(_checked("nox_ppm", nox_ppm, least=0.0) * (slope * water + constant))


def _checked(name: str, given: ArrayLike, *, least: float | None = None, most: float = math.inf) -> NDArray[np.float64]:
    values = np.asarray(given, dtype=np.float64)
    good = np.isfinite(values) & (values > 0.0 if least is None else values >= least) & (values <= most)
    if not good.all():
        bound = "> 0" if least is None else f">= {least:g}"
        bound += f" and <= {most:g}" if math.isfinite(most) else " and finite"
        raise ParameterError.of(name, float(values[~good].flat[0]) if values.ndim else float(values), bound)
    return values
