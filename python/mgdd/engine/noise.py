"""Third-octave levels of the pressure in the cylinder, and the noise that an engine's structure lets out of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CYCLE_DEG = 720.0
_REFERENCE_PA, _PA_PER_BAR = 20e-6, 1e5
# Of the audible range, by their number from 1 kHz on: 20 Hz to 20 kHz (IEC 61260-1, base-ten).
_FIRST, _LAST, _PER_DECADE = -17, 13, 10.0
_NOMINAL = 0.05  # of a band, by which a nominal frequency as 1.6 kHz is beside that of its band
_POLES_HZ = (20.598997, 107.65265, 737.86223, 12194.217)  # of A-weighting; the outer two are double


def pressure_levels(
    angle_cad: NDArray[np.float64], bar: NDArray[np.float64], speed_rpm: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the mid-band frequencies [Hz] and the level of each cycle (cycle, band) [dB re 20 µPa].

    A cycle has harmonics of half the engine speed, and a band those between its edges. Bands that are narrower than
    the harmonics are apart, or reach beyond half the sampling rate, are left out.
    """
    step = float(np.median(np.diff(angle_cad)))
    samples = round(_CYCLE_DEG / step)
    even = np.abs(np.diff(angle_cad) - step).max() <= 0.01 * step
    if not even or samples not in (angle_cad.size, angle_cad.size - 1):
        span = angle_cad[-1] - angle_cad[0] + step
        raise DataError(
            f"levels are of whole cycles in even steps, and the crank angles span {span:.4g} of {_CYCLE_DEG:g} degrees"
            f"{'' if even else ', in uneven steps'}: record whole cycles"
        )
    bar = bar[:, :samples]
    # A cycle ends where the next begins: the rise from one to the other is not sound, and is taken off along it.
    rise = np.append(np.diff(bar[:, 0]), 0.0)
    periodic = bar - rise[:, None] * (np.arange(samples) / samples)
    lines = np.fft.rfft(periodic, axis=1)[:, 1 : (samples + 1) // 2] / samples
    squares = 2.0 * np.abs(lines * _PA_PER_BAR) ** 2
    spacing = speed_rpm / 120.0
    number = np.arange(_FIRST, _LAST + 1)
    low, high = (1e3 * 10.0 ** ((number + side) / _PER_DECADE) for side in (-0.5, 0.5))
    kept = (high - low >= spacing) & (high <= spacing * samples / 2)
    edges = np.append(low[kept], high[kept][-1:])
    at = np.searchsorted(spacing * np.arange(1, lines.shape[1] + 1), edges)
    sums = np.concatenate([np.zeros((len(bar), 1)), np.cumsum(squares, axis=1)], axis=1)
    with np.errstate(divide="ignore"):
        levels = 10.0 * np.log10(np.diff(sums[:, at], axis=1) / _REFERENCE_PA**2)
    return 1e3 * 10.0 ** (number[kept] / _PER_DECADE), levels


def noise_levels(
    hz: NDArray[np.float64], level_db: NDArray[np.float64], attenuation_db: Mapping[float, float]
) -> NDArray[np.float64]:
    """Give the A-weighted level of each cycle behind a structure: the sum over the bands within its table [dB]."""
    table = {float(key): float(value) for key, value in attenuation_db.items()}
    if len(table) < 2 or not all(key > 0.0 and np.isfinite([key, value]).all() for key, value in table.items()):
        raise ParameterError.of("attenuation_db", attenuation_db, "two or more finite dB by their frequencies > 0 Hz")
    number = _PER_DECADE * np.log10(np.array(sorted(table)) / 1e3)
    number = np.where(np.abs(number - number.round()) < _NOMINAL, number.round(), number)
    band = (_PER_DECADE * np.log10(hz / 1e3)).round()
    inside = (band >= number[0]) & (band <= number[-1])
    if not inside.any():
        shown = f"{min(table):g} to {max(table):g} Hz"
        raise ParameterError.of("attenuation_db", shown, f"of the bands from {hz[0]:.4g} to {hz[-1]:.4g} Hz")
    loss = np.interp(band, number, [table[key] for key in sorted(table)])
    shares = 10.0 ** (0.1 * (level_db - loss + a_weighting_db(hz)))
    with np.errstate(divide="ignore"):
        found: NDArray[np.float64] = 10.0 * np.log10(shares[:, inside].sum(axis=1))
    return found


def a_weighting_db(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the A-weighting of frequencies [dB], 0 at 1 kHz (IEC 61672-1)."""
    made: NDArray[np.float64] = 20.0 * np.log10(_a_response(np.asarray(hz, np.float64)) / _a_response(np.float64(1e3)))
    return made


def _a_response(hz: NDArray[np.float64] | np.float64) -> NDArray[np.float64]:
    first, second, third, fourth = (hz**2 + pole**2 for pole in _POLES_HZ)
    made: NDArray[np.float64] = hz**4 / (first * np.sqrt(second * third) * fourth)
    return made
