"""Whether the cycles of one record lie at the same crank angles: the place of each compression."""

from __future__ import annotations

from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from mgdd.errors import DataError

# Compression before any burn, a spark-ignited one too [°CA aTDC]: cycles differ there by level and factor alone. It is
# drawn out towards TDC, where the shift is separable from the factor, while what is left stays noise.
_FROM_CAD, _TO_CAD, _LEAST_CAD = -110.0, -60.0, 40.0
_LATER_CAD, _AS_QUIET = (-50.0, -40.0, -30.0, -20.0, -10.0), 1.05
# The median cycle is known so far beyond: within it a cycle may be shifted without leaving it.
_MARGIN_CAD = 4.0
COMPRESSION_CAD = _FROM_CAD - _MARGIN_CAD, _LATER_CAD[-1] + _MARGIN_CAD  # all that `phases` looks at
# 0.2 °CA from first to last is 0.1 °CA in the mean and 1 % of the work; less is not separable from the exponent.
DRIFT_CAD = 0.2
_JUMP_CAD, _REFUSED_CAD = 0.75, 2.0
SIGNIFICANT = 4.0  # standard errors
# A step of the place: its t, its height over the scatter, and the least that matters [samples, °CA].
_STEP_T, _STEP_SCATTERS, _STEP_SAMPLES, _STEP_CAD = 6.0, 5.0, 0.7, 0.15
# Share of the standard error of a place that is noise of its own; the rest is the doubt about the charge.
_OWN = 0.5
_DEGREE = 7
_MEAN_CAD = 2.0  # compression bends by less than .1 % within, in all cycles alike
_TURNS, _SETTLED_CAD = 4, 0.02  # of Gauss-Newton: a step so small leaves some thousandths of it
# The charge scatters by this share; what a cycle shows beyond is its place or its level.
_CHARGE, _CHARGE_SCATTERS = (1e-3, 1e-2), 1.2
_QUIETEST_BAR = 1e-3  # no sensor is quieter; without noise the shift and the factor cannot be parted
_UNKNOWN_CHARGE = 3e-2  # of two or three, which do not show how they scatter
# Logarithm of the pressure at firing TDC over that at gas exchange: sound cycles 2.3, misfires 1.8, another turn -2.3.
_TURN = 0.5


class Jump(NamedTuple):
    """From which cycle on (from 0) compression lies so much later [°CA]."""

    cycle: int
    cad: float


def odd_bound(looks: int, probability: float = 1e-3) -> float:
    """Give the deviations from the median that one of so many cycles passes by `probability`: 4.9 of 10, 5.8 of 300.

    A quarter more than of a normal law, for the heavy tails of a burn.
    """
    return 1.25 * NormalDist().inv_cdf(1.0 - 0.5 * probability / max(looks, 1))


class Phases(NamedTuple):
    """By how much each cycle's compression comes later than the median one [°CA], and its standard error."""

    late_cad: NDArray[np.float64]
    stderr_cad: float

    @property
    def scatter_cad(self) -> float:
        """Robust deviation of the cycles, at least the standard error of one."""
        off = np.abs(self.late_cad - np.median(self.late_cad))
        return max(1.4826 * float(np.median(off)), self.stderr_cad)

    @property
    def visible_cad(self) -> float:
        """The shift of a single cycle that would be seen."""
        return max(_JUMP_CAD, odd_bound(self.late_cad.size) * self.scatter_cad)

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
        return abs(drift) > max(DRIFT_CAD, SIGNIFICANT * stderr)

    def jump(self, step_cad: float) -> Jump | None:
        """Find from which cycle on all lie elsewhere, beside a drift, as where samples are lost."""
        n = self.late_cad.size
        if n < 6:
            return None
        late = self._without_odd()
        count = np.arange(n)
        line, _ = np.linalg.qr(np.column_stack([np.ones(n), count]))
        later = (count[:, None] >= np.arange(2, n - 1)).astype(np.float64)  # a column for each cycle where it may begin
        later -= line @ (line.T @ later)
        rest = late - line @ (line.T @ late)
        norms, along = (later**2).sum(axis=0), later.T @ rest
        best = int(np.argmax(along**2 / norms))
        k, height, unit = best + 2, float(along[best] / norms[best]), float(1.0 / np.sqrt(norms[best]))
        left = rest - height * later[:, best]
        robust = 1.4826 * float(np.median(np.abs(left - np.median(left)))) * np.sqrt(n / (n - 4.0))
        robust = max(robust, _OWN * self.stderr_cad)
        level = robust * np.sqrt(1.0 / k + 1.0 / (n - k))
        enough = abs(height) >= max(_STEP_SAMPLES * step_cad, _STEP_CAD)
        if enough and abs(height) > _STEP_T * robust * unit and abs(height) > _STEP_SCATTERS * level:
            return Jump(k, height)
        return None

    def _without_odd(self) -> NDArray[np.float64]:
        """Give the places with cycles that stand apart from their neighbours put among them: they are no step."""
        padded = np.pad(self.late_cad, 2, mode="reflect")
        local = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
        off = np.abs(self.late_cad - local)
        usual = max(1.4826 * float(np.median(off)), _OWN * self.stderr_cad)
        return np.where(off > odd_bound(off.size) * usual, local, self.late_cad)


def lost_turn(cad: NDArray[np.float64], pressure: NDArray[np.float64]) -> int | None:
    """Give the first cycle (rows) whose firing TDC stands at gas exchange, where others have it at 0; or None."""
    near, far = np.abs(cad) < 40.0, np.abs(cad) > 320.0
    if len(pressure) < 2 or near.sum() < 8 or far.sum() < 8:
        return None
    low = float(pressure.min())
    lift = max(low, 0.3) - low  # a relative pressure may be below zero
    share = np.log((pressure[:, near].mean(axis=1) + lift) / (pressure[:, far].mean(axis=1) + lift))
    right, wrong = share > _TURN, share < -_TURN
    if not (right.any() and wrong.any()):
        return None
    return int(np.argmax(wrong if right[0] else right))


def phases(cad: NDArray[np.float64], pressure: NDArray[np.float64]) -> Phases | None:
    """Place the compression of each cycle (rows of `pressure`) against their median; None where a trace has too little.

    A cycle is level + (1 + factor) times the median one, shifted; the level is free, and the factor has the scatter of
    the charge, without which it is nearly the shift. By Gauss-Newton.
    """
    early = cad[(cad >= _FROM_CAD) & (cad <= _TO_CAD)]
    if len(pressure) < 2 or early.size < 20 or np.ptp(early) < _LEAST_CAD:
        return None
    cad, pressure = _thinned(cad, pressure)
    usual = np.median(pressure, axis=0)
    fit = _placed(cad, pressure, usual, _TO_CAD)
    if fit is None:
        return None
    for end in _LATER_CAD:
        longer = _placed(cad, pressure, usual, end, fit.change)
        if longer is None or (longer.left > _AS_QUIET * fit.left).any() or not _agree(fit.phases, longer.phases):
            break
        fit = longer
    return fit.phases


def _thinned(
    cad: NDArray[np.float64], pressure: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the means over as many whole samples as `_MEAN_CAD` holds."""
    step = float(np.median(np.diff(cad)))
    size = int(_MEAN_CAD / step + 1e-6) if step > 0.0 else 1
    if size < 2:
        return cad, pressure
    inner = (cad >= COMPRESSION_CAD[0]) & (cad <= COMPRESSION_CAD[1])
    whole = np.flatnonzero(inner)[: inner.sum() // size * size]
    return (
        cad[whole].reshape(-1, size).mean(axis=1),
        pressure[:, whole].reshape(len(pressure), -1, size).mean(axis=2),
    )


def _agree(one: Phases, better: Phases) -> bool:
    """Whether no cycle moves by more than noise from one fit to the other (after Hausman; a prior makes it rough)."""
    usual = np.sqrt(max(one.stderr_cad**2 - better.stderr_cad**2, (0.6 * one.stderr_cad) ** 2))
    off = better.late_cad - one.late_cad
    off = np.abs(off - _middle(off))
    return bool(off.max() <= odd_bound(off.size) * usual)


class _Fit(NamedTuple):
    """Places, what is left of most and of nearly all cycles [bar], and the change of each: level, factor, shift."""

    phases: Phases
    left: NDArray[np.float64]
    change: NDArray[np.float64]


def _placed(
    cad: NDArray[np.float64],
    pressure: NDArray[np.float64],
    median: NDArray[np.float64],
    end: float,
    start: NDArray[np.float64] | None = None,
) -> _Fit | None:
    """Fit the cycles from -110 to `end` to their median, beginning with the change that a shorter part has."""
    around = (cad >= _FROM_CAD - _MARGIN_CAD) & (cad <= end + _MARGIN_CAD)
    inside = (cad >= _FROM_CAD) & (cad <= end)
    angle, part = cad[inside], pressure[:, inside]
    usual = median[around]
    lift = max(0.0, 0.3 - float(usual.min()))  # a relative pressure may be below zero
    low, width = float(cad[around][0]), float(np.ptp(cad[around]))
    design = chebyshev.chebvander(2.0 * (cad[around] - low) / width - 1.0, _DEGREE)
    shape = np.linalg.lstsq(design, np.log(usual + lift), rcond=None)[0]
    slope = chebyshev.chebder(shape) * 2.0 / width
    head = max(3, int(5.0 / max(float(angle[-1] - angle[0]) / (angle.size - 1), 1e-3)))
    rise = part[:, -head:].mean(axis=1) - part[:, :head].mean(axis=1)
    usual_rise = _middle(rise)
    if not usual_rise > 0.0:
        return None
    charge = _UNKNOWN_CHARGE
    if len(part) > 3:
        charge = _CHARGE_SCATTERS * 1.4826 * _middle(np.abs(rise / usual_rise - 1.0))
        charge = float(np.clip(charge, *_CHARGE))
    n = len(part)
    change = np.zeros((n, 3)) if start is None else start
    for turn in range(_TURNS):
        level, factor, late = change.T[:, :, None]
        at = 2.0 * (angle - late - low) / width - 1.0
        model = np.exp(chebyshev.chebval(at, shape))
        rate = -(1.0 + factor) * model * chebyshev.chebval(at, slope)
        model -= lift
        left = part - (1.0 + factor) * model - level
        noise, known = 1.0, turn > 0 or start is not None
        if known:
            rest = left - (np.partition(left, n // 2, axis=0)[n // 2] if n > 2 else left.mean(axis=0))
            rest -= rest.mean(axis=1, keepdims=True)
            each = np.sqrt((rest**2).mean(axis=1) / (1.0 - 1.0 / n))
            spread = np.maximum(np.sort(each)[[n // 2, int(0.9 * n)]], _QUIETEST_BAR)
            noise = float(spread[0])
        design = np.stack([np.ones_like(model), model, rate], axis=1)
        normal = design @ design.transpose(0, 2, 1)
        right = (design @ left[:, :, None])[:, :, 0]
        weight = (noise / charge) ** 2
        normal[:, 1, 1] += weight
        right[:, 1] -= weight * factor[:, 0]
        step = np.linalg.solve(normal, right[..., None])[..., 0]
        change = change + step
        change[:, 2] = np.clip(change[:, 2], -20.0, 20.0)
        if known and np.abs(step[:, 2]).max() < _SETTLED_CAD:
            break
    error = noise * np.sqrt(np.linalg.inv(normal)[:, 2, 2])
    return _Fit(Phases(change[:, 2], _middle(error)), spread, change)


def _middle(values: NDArray[np.float64]) -> float:
    """Give the upper median, in a tenth of the time of NumPy's."""
    return float(np.partition(values, values.size // 2)[values.size // 2])


def phase_warnings(
    cad: NDArray[np.float64],
    pressure: NDArray[np.float64],
    *,
    over_time: bool,
    source: str,
    ends: tuple[str, str] | None = None,
) -> list[str]:
    """Doubt cycles that lack a turn, that slip from one to the next, or one that stands apart; one line, or none.

    Angles that are made of a time and one speed are refused where a cycle is more than 2 °CA off. `ends` is what the
    first and the last row are called.
    """
    turned = lost_turn(cad, pressure)
    if turned is not None:
        what = f"from cycle {turned + 1} on firing TDC is at gas exchange: a turn of the shaft is missing before it"
        return [f"{what}; cut the record there, each part with its own firing_tdc_deg"]
    fit = phases(cad, pressure)
    if fit is None:
        return []
    step = float(np.median(np.diff(cad)))
    off = fit.late_cad - np.median(fit.late_cad)
    odd = int(np.argmax(np.abs(off)))
    drift, _ = fit.drift_cad
    jump = None if over_time else fit.jump(step)
    # A clock has no slips of its own: what is beyond the noise is the speed, however many cycles share it.
    visible = max(_JUMP_CAD, odd_bound(off.size) * fit.stderr_cad) if over_time else fit.visible_cad
    stands_apart = len(pressure) > 2 and abs(off[odd]) > visible
    if jump is not None:
        what = f"from cycle {jump.cycle + 1} on compression lies {jump.cad:+.2g} °CA off"
    elif fit.drifts:
        first, last = ends or ("cycle 1", f"cycle {len(pressure)}")
        what = f"compression moves by {drift:+.2g} °CA from {first} to {last}"
    elif stands_apart:
        what = f"compression of cycle {odd + 1} lies {off[odd]:+.2g} °CA off the others (±{fit.stderr_cad:.1g})"
    else:
        return []
    causes = "the speed changes within the record" if over_time else "lost pulses, or cycles with clocks apart"
    text = f"the crank angle slips: {what}, and 1 °CA is some 9 % of the work: {causes}; take the angle of an encoder"
    if over_time and stands_apart and abs(off[odd]) > _REFUSED_CAD:
        raise DataError(f"{source}: {text}")
    return [text]
