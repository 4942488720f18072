"""Whether the cycles of one record lie at the same crank angles: their period, and the place of each compression."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mgdd.errors import DataError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Period", "Phases", "phase_warnings", "phases", "repetition"]

CYCLE_DEG = 720.0
# Compression before any burn, a spark-ignited one too [°CA aTDC]: cycles differ there by level and factor alone. It is
# drawn out towards TDC, where the shift tells itself from the factor, once no cycle is more than this [°CA] off, and
# while what is left grows by less than the factor.
_FROM_CAD, _TO_CAD, _LEAST_CAD = -110.0, -30.0, 40.0
_LATER_CAD, _ALIGNED_CAD, _AS_QUIET = (-20.0, -10.0), 1.0, 1.05
# 0.2 °CA from first to last is 0.1 °CA in the mean and 1 % of the work; less is not told from the exponent.
DRIFT_CAD = 0.2
_JUMP_CAD, _REFUSED_CAD, _ODD = 0.5, 2.0, 6.0
_SIGNIFICANT = 4.0
_DEGREE = 7
# Repetitions are sought from here on [deg]: above the width of one pressure peak, below a speed told as half.
_SHORTEST_DEG = 200.0
_ALIKE = 0.9


class Phases(NamedTuple):
    """By how much each cycle's compression comes later than the mean one [°CA], and its standard error."""

    late_cad: NDArray[np.float64]
    stderr_cad: float

    @property
    def drift_cad(self) -> tuple[float, float]:
        """From the first cycle to the last on a straight line, and its standard error."""
        n = self.late_cad.size
        count = np.arange(n) - 0.5 * (n - 1)
        slope = float(count @ self.late_cad / (count @ count))
        rest = self.late_cad - self.late_cad.mean() - slope * count
        scatter = float(np.sqrt(rest @ rest / (n - 2))) if n > 3 else 0.0
        stderr = max(scatter, self.stderr_cad) / float(np.sqrt(count @ count))
        return slope * (n - 1), stderr * (n - 1)

    @property
    def drifts(self) -> bool:
        """Whether the drift is more than noise and matters."""
        drift, stderr = self.drift_cad
        return abs(drift) > max(DRIFT_CAD, _SIGNIFICANT * stderr)


class Period(NamedTuple):
    """After how many degrees a record repeats, over how many cycles, and whether that is not 720."""

    degrees: float
    cycles: int
    differs: bool


def phases(cad: NDArray[np.float64], pressure: NDArray[np.float64]) -> Phases | None:
    """Place the compression of each cycle (rows of `pressure`) against their mean; None where a trace has too little.

    A cycle is level + factor times the mean + slope of the mean times the shift, by least squares.
    """
    early = (cad >= _FROM_CAD) & (cad <= _TO_CAD)
    if len(pressure) < 2 or early.sum() < 20 or np.ptp(cad[early]) < _LEAST_CAD:
        return None
    best = _placed(cad[early], pressure[:, early])
    if best is None or np.abs(best[0].late_cad).max() >= _ALIGNED_CAD:
        return best and best[0]
    found, quiet = best
    for end in _LATER_CAD:
        inside = (cad >= _FROM_CAD) & (cad <= end)
        longer = _placed(cad[inside], pressure[:, inside])
        if longer is None or longer[1] > _AS_QUIET * quiet or not _agree(found, longer[0]):
            break
        found = longer[0]
    return found


def _agree(one: Phases, better: Phases) -> bool:
    """Whether two fits differ by no more than noise: the difference has the difference of their variances (Hausman)."""
    n = one.late_cad.size
    apart = float(np.sqrt(((one.late_cad - better.late_cad) ** 2).sum() / (n - 1)))
    usual = float(np.sqrt(max(one.stderr_cad**2 - better.stderr_cad**2, 0.0)))
    return bool(apart <= (1.0 + 3.0 / np.sqrt(2.0 * (n - 1))) * usual)


def _placed(angle: NDArray[np.float64], part: NDArray[np.float64]) -> tuple[Phases, float] | None:
    """Fit the cycles over one stretch; with the deviation of what is left [bar]."""
    shape = np.polynomial.Chebyshev.fit(angle, part.mean(axis=0), _DEGREE)
    mean, slope = shape(angle), shape.deriv()(angle)
    if not np.ptp(mean) > 0.0:
        return None
    design = np.column_stack([np.ones_like(angle), mean / np.ptp(mean), slope / np.abs(slope).max()])
    if np.linalg.cond(design) > 1e6:
        return None
    fitted, *_ = np.linalg.lstsq(design, part.T)
    factor = fitted[1] / np.ptp(mean)
    if not (factor > 0.0).all():
        return None
    scale = np.abs(slope).max() * factor
    # What the polynomial leaves of the mean is common to all cycles and no noise of theirs.
    rest = part - (design @ fitted).T
    rest -= rest.mean(axis=0)
    noise = float(np.sqrt((rest**2).sum() / (rest.size * (1.0 - 1.0 / len(part)))))
    unit = float(np.sqrt(np.linalg.inv(design.T @ design)[2, 2]))
    return Phases(-fitted[2] / scale, noise * unit / float(scale.mean())), noise


def phase_warnings(
    cad: NDArray[np.float64],
    pressure: NDArray[np.float64],
    *,
    over_time: bool,
    source: str,
    ends: tuple[str, str] | None = None,
) -> list[str]:
    """Doubt cycles whose angles slip from one to the next, or one that stands apart; one line, or none.

    Angles that are made of a time and one speed are refused where a cycle is more than 2 °CA off. `ends` is what the
    first and the last row are called.
    """
    found = phases(cad, pressure)
    if found is None:
        return []
    off = found.late_cad - np.median(found.late_cad)
    odd = int(np.argmax(np.abs(off)))
    drift, _ = found.drift_cad
    stands_apart = abs(off[odd]) > max(_JUMP_CAD, _ODD * found.stderr_cad)
    if found.drifts:
        first, last = ends or ("cycle 1", f"cycle {len(pressure)}")
        what = f"compression moves by {drift:+.2g} °CA from {first} to {last}"
    elif stands_apart:
        what = f"compression of cycle {odd + 1} lies {off[odd]:+.2g} °CA off the others"
    else:
        return []
    causes = "the speed changes within the record" if over_time else "lost pulses, or cycles with clocks apart"
    text = f"the crank angle slips: {what}, and 1 °CA is some 9 % of the work: {causes}; take the angle of an encoder"
    if over_time and stands_apart and abs(off[odd]) > _REFUSED_CAD:
        raise DataError(f"{source}: {text}")
    return [text]


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
    grid = np.arange(_FROM_CAD, _LATER_CAD[-1] + 1e-9, max(step, 0.25))
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
        differs = abs(off) > max(DRIFT_CAD, _SIGNIFICANT * stderr * scale, blurred)
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
    a, b, c = alike[top - 1 : top + 2]
    return float((top + 0.5 * (a - c) / (a - 2.0 * b + c)) * step)
