"""What expansion says of sensor and amplifier: the heat that it loses, and what the whole cycle gave for its fuel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd._core.engine import Cylinder

# Late expansion [°CA aTDC]: most burns have ended, and the valve is shut.
_FROM_CAD, _TO_CAD, _BEFORE_EVO_CAD, _MARGIN_CAD, _LEAST_CAD = 60.0, 90.0, 10.0, 5.0, 20.0
_DEGREE, _WALL_K, _GAS_J_PER_KG_K = 4, 440.0, 287.0
# Heat that the gas loses there over Hohenberg's (1979): engines of four wall-heat laws, with crevice and blow-by, that
# give up to a quarter of their fuel to the walls have 0.3 to 2.0 by spark, 0 to 1.2 as diesels, which burn on there.
_SPARK_RATIO, _MOST_SPARK, _MOST_DIESEL, _LEAST = 14.0, 2.05, 1.6, -1.6
_STDERRS = 3.0


def lost_heat(
    angle: NDArray[np.float64],
    bar: NDArray[np.float64],
    volume_l: NDArray[np.float64],
    mass_g: float,
    cylinder: Cylinder,
    speed_rpm: float,
) -> tuple[float, float] | None:
    """Give the heat lost in late expansion over that of Hohenberg's law, and its standard error; None if too short.

    The pressure is taken from a polynomial of its logarithm; the gas has a gamma that falls with temperature.
    """
    end = min(_TO_CAD, cylinder.evo_cad - _BEFORE_EVO_CAD, float(angle[-1]) - _MARGIN_CAD)
    middle, half = 0.5 * (_FROM_CAD + end), 0.5 * (end - _FROM_CAD) + _MARGIN_CAD
    inside = np.abs(angle - middle) <= half
    if end - _FROM_CAD < _LEAST_CAD or inside.sum() < 3 * _DEGREE or not (bar[inside] > 0.0).all():
        return None
    grid = np.linspace(_FROM_CAD, end, 61)
    volume = np.interp(grid, angle, volume_l) * 1e-3
    gas = mass_g * 1e-3 * _GAS_J_PER_KG_K
    bore, stroke = cylinder.bore_mm * 1e-3, cylinder.stroke_mm * 1e-3
    mid = 0.5 * (volume[1:] + volume[:-1])
    area = 0.5 * np.pi * bore**2 + 4.0 * mid / bore
    seconds = np.diff(grid) / (6.0 * speed_rpm)
    film = 130.0 * mid**-0.06 * (2.0 * stroke * speed_rpm / 60.0 + 1.4) ** 0.8

    def ratio(terms: NDArray[np.float64]) -> float:
        p = np.exp(np.vander((grid - middle) / half, _DEGREE + 1) @ terms) * 1e5
        q = 0.5 * (p[1:] + p[:-1])
        t = q * mid / gas
        gamma = 1.392 - 7.4e-5 * (t - 300.0)
        gained = (gamma * q * np.diff(volume) + mid * np.diff(p)) / (gamma - 1.0)
        walls = film * (q * 1e-5) ** 0.8 * t**-0.4 * area * np.maximum(t - _WALL_K, 50.0) * seconds
        return float(-gained.sum() / walls.sum())

    design = np.vander((angle[inside] - middle) / half, _DEGREE + 1) * bar[inside, None]
    wanted = np.log(bar[inside]) * bar[inside]
    terms = np.asarray(np.linalg.lstsq(design, wanted)[0], dtype=np.float64)
    left = wanted - design @ terms
    variance = float(left @ left) / (inside.sum() - _DEGREE - 1) * np.linalg.inv(design.T @ design)
    found = ratio(terms)
    slope = np.array([(ratio(terms + 1e-4 * unit) - found) / 1e-4 for unit in np.eye(_DEGREE + 1)])
    return found, float(np.sqrt(slope @ variance @ slope))


def expansion_doubts(
    angle: NDArray[np.float64],
    bar: NDArray[np.float64],
    volume_l: NDArray[np.float64],
    mass_g: float,
    cylinder: Cylinder,
    speed_rpm: float,
) -> list[tuple[str, str]]:
    """Doubt one fired cycle, mean of many or single, by the heat that late expansion loses."""
    found = lost_heat(angle, bar, volume_l, mass_g, cylinder, speed_rpm)
    if found is None:
        return []
    lost, error = found
    most = _MOST_SPARK if cylinder.compression_ratio < _SPARK_RATIO else _MOST_DIESEL
    what = f"late expansion loses {lost:.2f} ±{error:.2f} times the wall heat of Hohenberg's law"
    if lost - _STDERRS * error > most:
        text = (
            f"{what}, where sound traces lose at most {most:g}: suspect "
            "thermal shock of the sensor, then pegging, then TDC"
        )
        return [("expansion", text)]
    if lost + _STDERRS * error < _LEAST:
        text = f"{what}: it gains heat after the burn: suspect an early TDC, then pegging too high, then a long burn"
        return [("expansion", text)]
    return []
