"""Ringing of a record of cycles: the spectrum of its pressure, the frequency that stands out, and who knocks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A peak must stand so many times above both its shoulders, and above what noise of a known level hardly reaches.
_ABOVE, _BY_NOISE = 4.0, 0.001
_SHOULDERS = ((0.75, 0.9), (1.1, 1.25))  # of its frequency
_SHOWN = (0.5, 1.25)  # spectrum beyond the ends of the band
_TAPER = 0.5  # of the window, half at each end: of the combustion 0.01 bar is left at 4 kHz
_TOGETHER = 256  # cycles, for the memory of a long record
_TANGENTIAL, _GAMMA, _J_PER_KGK = 1.841, 1.3, 287.05


class Spectrum(NamedTuple):
    """Frequencies [kHz], density summed over the cycles [bar²/kHz], length of the window [ms], and each density."""

    khz: NDArray[np.float64]
    total: NDArray[np.float64]
    span_ms: float
    density: NDArray[np.float64]


def ringing(
    spectrum: Spectrum | None,
    scalars: dict[str, NDArray[np.float64]],
    options: dict[str, Any],
    *,
    bore_mm: float,
    threshold_bar: float | None,
    spectra: bool,
) -> tuple[dict[str, tuple[Any, ...]], dict[str, tuple[Any, ...]]]:
    """Give figures of a record by name, and the spectrum of each cycle; neither where MAPO is not known."""
    mapo = scalars["mapo_bar"]
    figures: dict[str, tuple[Any, ...]] = {
        "ringing_frequency_khz": ((), math.nan),
        "tangential_mode_khz": ((), _tangential_khz(bore_mm, float(np.median(scalars["t_max_k"])))),
    }
    known = np.isfinite(mapo)
    if threshold_bar is not None:
        share = 100.0 * float(np.mean(mapo[known] > threshold_bar)) if known.any() else math.nan
        figures["knock_share_percent"] = ((), share)
    if spectrum is None:
        return figures, {}
    low, high = 1e-3 * options["knock_low_hz"], 1e-3 * options["knock_high_hz"]
    khz, mean = spectrum.khz, spectrum.total / mapo.size
    figures["ringing_frequency_khz"] = ((), _peak_khz(khz, mean, (low, high), spectrum.span_ms, mapo.size))
    if not spectra:
        return figures, {}
    shown = (khz >= _SHOWN[0] * low) & (khz <= _SHOWN[1] * high)
    name = "frequency_khz"
    density = spectrum.density[:, shown]
    return figures, {name: (name, khz[shown]), "pressure_psd_bar2_per_khz": (("cycle", name), density)}


def _tangential_khz(bore_mm: float, kelvin: float) -> float:
    """First tangential mode of a cylinder of gas (Draper 1938), of the air that the ringing intensity takes."""
    return _TANGENTIAL * math.sqrt(_GAMMA * _J_PER_KGK * kelvin) / (math.pi * bore_mm)


def spectrum_of(
    angle_cad: NDArray[np.float64], bar: NDArray[np.float64], options: dict[str, Any], speed_rpm: float, *, keep: bool
) -> Spectrum:
    """Take the spectrum of each cycle in the window of knock."""
    from scipy.signal import periodogram

    low, high = options["knock_from_cad"], options["knock_to_cad"]
    inside = (angle_cad >= low - 1e-9) & (angle_cad <= high + 1e-9)
    per_ms = 6e-3 * speed_rpm / float(np.median(np.diff(angle_cad)))
    count = int(np.count_nonzero(inside))
    size = 2 ** math.ceil(math.log2(2 * count))
    total = np.zeros(size // 2 + 1)
    khz = np.arange(total.size) * (per_ms / size)
    kept = np.empty((len(bar) if keep else 0, khz.size))
    for at in range(0, len(bar), _TOGETHER):
        window = bar[at : at + _TOGETHER, inside]
        _, density = periodogram(window, per_ms, window=("tukey", _TAPER), nfft=size, detrend="linear")
        total += density.sum(axis=0)
        if keep:
            kept[at : at + _TOGETHER] = density
    return Spectrum(khz, total, count / per_ms, kept)


def _peak_khz(
    khz: NDArray[np.float64], mean: NDArray[np.float64], band_khz: tuple[float, float], span_ms: float, n: int
) -> float:
    """Highest peak in the band of the mean spectrum of n cycles that stands out of both shoulders; NaN if none does."""
    from scipy.special import gammaincinv

    apart = max((band_khz[1] - band_khz[0]) * span_ms, 1.0)  # frequencies that the window tells apart
    above = max(_ABOVE, gammaincinv(n, 1.0 - _BY_NOISE / apart) / gammaincinv(n, 0.5))
    peaks = 1 + np.flatnonzero((mean[1:-1] >= mean[:-2]) & (mean[1:-1] > mean[2:]))
    peaks = peaks[(khz[peaks] > band_khz[0]) & (khz[peaks] < band_khz[1])]
    for k in peaks[np.argsort(-mean[peaks])]:
        shoulders = [mean[(khz >= low * khz[k]) & (khz <= high * khz[k])] for low, high in _SHOULDERS]
        if all(side.size and mean[k] > above * np.median(side) for side in shoulders):
            left, top, right = np.log(mean[k - 1 : k + 2])
            return float(khz[k] + 0.5 * (left - right) / (left - 2.0 * top + right) * (khz[1] - khz[0]))
    return math.nan
