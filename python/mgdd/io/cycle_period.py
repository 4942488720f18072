"""After how many degrees a record that runs on repeats: its cycles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mgdd.io.cycle_phase import COMPRESSION_CAD, DRIFT_CAD, SIGNIFICANT, phases

CYCLE_DEG = 720.0
# Repetitions are sought from here on [deg]: above the width of one pressure peak, below a speed stated as half.
_SHORTEST_DEG = 200.0
_ALIKE, _WHOLE_ALIKE = 0.9, 0.6


class Period(NamedTuple):
    """After how many degrees a record repeats, over how many cycles, and whether that is not 720."""

    degrees: float
    cycles: int
    differs: bool


def repetition(degrees: NDArray[np.float64], pressure: NDArray[np.float64], firing_tdc_deg: float) -> Period | None:
    """Find after how many degrees a record that runs on repeats; None where it has less than two cycles.

    Autocorrelation finds it roughly, the compressions of the cycles so cut make it exact.
    """
    first, span = float(degrees[0]), float(degrees[-1] - degrees[0])
    step = max(float(np.median(np.diff(degrees))), 0.1)
    if span < 1.9 * CYCLE_DEG:
        return None
    even = np.interp(np.arange(0.0, span, step), degrees - first, pressure)
    rough = _rough_period(even, step)
    if rough is None:
        return None
    period, differs = rough, abs(rough / CYCLE_DEG - 1.0) > 0.005
    grid = np.arange(COMPRESSION_CAD[0], COMPRESSION_CAD[1] + 1e-9, max(step, 0.25))
    count = 0
    for _ in range(8):
        scale = period / CYCLE_DEG
        centre = first + ((firing_tdc_deg - first) % CYCLE_DEG) * scale
        at = centre + period * np.arange(-1, int(span / period) + 2)[:, None] + grid * scale
        at = at[(at[:, 0] >= first) & (at[:, -1] <= degrees[-1])]
        count = len(at)
        placed = phases(grid, np.interp(at, degrees, pressure))
        if placed is None:
            break
        drift, stderr = placed.drift_cad
        period += scale * drift / (count - 1)
        off = (period - CYCLE_DEG) * (count - 1)
        blurred = 0.5 * step if count < 3 else 0.0  # two cycles hardly show their scatter
        differs = abs(off) > max(DRIFT_CAD, SIGNIFICANT * stderr * scale, blurred)
        if abs(drift) < 0.01:
            break
    return Period(period, max(count, int(span / period)), differs)


def _rough_period(even: NDArray[np.float64], step: float) -> float | None:
    """First lag at which the record is as much like itself as it ever is."""
    n = even.size
    wave = even - even.mean()
    size = 1 << (2 * n - 1).bit_length()
    raw = np.fft.irfft(np.abs(np.fft.rfft(wave, size)) ** 2, size)[:n]
    power = np.concatenate([[0.0], np.cumsum(wave**2)])
    lags = np.arange(n)
    both = np.sqrt(power[n - lags] * (power[n] - power[lags]))
    alike = raw / np.where(both > 0.0, both, np.inf)
    low, high = int(_SHORTEST_DEG / step), int(0.6 * n)
    inner = np.arange(max(low, 1), high)
    tops = inner[(alike[inner] >= alike[inner - 1]) & (alike[inner] > alike[inner + 1])]
    if not tops.size or alike[tops].max() < 0.5:
        return None
    top = tops[alike[tops] >= _ALIKE * alike[tops].max()][0]
    # Burns that scatter make a cycle unlike the next: a part of that lag which repeats clearly is the cycle.
    for parts in range(int(top * step / _SHORTEST_DEG), 1, -1):
        near = tops[np.abs(tops - top / parts) <= 0.02 * top / parts]
        if near.size and alike[near].max() >= _WHOLE_ALIKE * alike[top]:
            top = near[alike[near].argmax()]
            break
    a, b, c = alike[top - 1 : top + 2]
    return float((top + 0.5 * (a - c) / (a - 2.0 * b + c)) * step)
