"""What is doubted of a record: copies, samples that stand still, an amplifier at its end, and a late heat."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mgdd._core.engine import Cylinder
from mgdd.signals.repeats import copies, noise_of, still

# Compression from where the valves are shut to before any burn [°CA aTDC]: smooth, so that its third differences are
# the noise.
_QUIET_CAD = (-140.0, -60.0)
_NEAR_CAD = 3.0
# A parabola spends 0.29 of the time within 6 % of its top within 0.5 % of it. Sound tops by spark or of two burns spend
# at most 0.46 in a cycle, 0.41 in the median of many; one cut at 0.93 of the peak, with noise behind, at least 0.5.
# Fewer than _FEWEST samples within 6 % show nothing.
_NEAR_TOP, _BELOW, _FLAT, _FEWEST = 0.005, 0.06, 0.48, 8
# Where noise is more, within as many of its deviations; cycles whose top lies within twice that share a level.
_TOP_NOISE, _SHARERS = 1.8, (3, 0.1)
# Widths at 3 % and 12 % below the top, for a gain that falls off: sound Wiebe burns by spark have 0.45 to 0.504, an
# amplifier that bends from 0.7 of the peak on 0.53 to 0.57. The two burns of a diesel have 0.37 to 0.56.
_SOFT_CHORDS, _SOFT, _SOFT_CYCLES = (0.03, 0.12), 0.512, 10


class Top(NamedTuple):
    """The form of the highest cycles: time at the top, ratio of chords, and whether they stop at a level [bar]."""

    ratio: float
    soft_ratio: float
    level_bar: float
    cut: bool
    soft: bool


def sample_doubts(angle: NDArray[np.float64], bar: NDArray[np.float64], first: int = 1) -> list[tuple[str, str]]:
    """Doubt the samples of cycles (cycle, angle), counted from `first`: what stands still, and a peak cut off."""
    rows, noise, step = np.atleast_2d(bar), _noise(angle, bar), float(np.median(np.diff(angle)))
    many = len(rows) > 1
    doubts = []
    top = top_of(angle, rows, noise)
    if top.cut:
        text = (
            f"the highest cycles stop at {top.level_bar:.4g} bar: of the time within 6 % of the top they spend "
            f"{100.0 * top.ratio:.0f} % at it, a peak 30 %: a saturated amplifier or the end of its range; peak, work "
            "and heat are not those of the gas"
        )
        doubts.append(("clipped", text))
    stands = still(rows, noise, max(1, round(_NEAR_CAD / step)))
    on_top = stands is not None and top.cut and rows[stands.cycle, stands.first] > 0.97 * top.level_bar
    if stands is not None and not on_top:
        where = f"from {round(angle[stands.first], 3):g} to {round(angle[stands.last], 3):g} °CA aTDC"
        who = f"{len(stands.cycles)} of {len(rows)} cycles: " if many else ""
        which = f" (cycle {first + stands.cycle})" if many else ""
        text = (
            f"{who}the pressure stands still at {rows[stands.cycle, stands.first]:.4g} bar {where}, "
            f"{stands.last - stands.first + 1} equal samples: a stuck sensor, lost samples or a channel that froze; "
            f"work and heat are not those of the gas{which}"
        )
        doubts.append(("stuck", text))
    return doubts


def copy_doubts(angle: NDArray[np.float64], bar: NDArray[np.float64]) -> list[tuple[str, str]]:
    """Doubt a record (cycle, angle) in which samples stand twice, as where a buffer is written again."""
    copy = copies(np.atleast_2d(bar))
    if copy is None:
        return []
    (old, at), (new, there) = copy.first, copy.again
    again, before = round(angle[there], 3), round(angle[at], 3)
    text = (
        f"{copy.samples} samples in {len(copy.cycles)} of {len(bar)} cycles are bit for bit those of others: from "
        f"{again:g} °CA of cycle {new + 1} on those from {before:g} °CA of cycle {old + 1} on; scatter and means are "
        "not those of the engine"
    )
    return [("copies", text)]


def top_of(angle: NDArray[np.float64], rows: NDArray[np.float64], noise: float) -> Top:
    """Judge the form of the top of the highest cycles: only they reach the end of an amplifier."""
    step = float(np.median(np.diff(angle)))
    width = max(1, round(1.0 / step))
    middle = np.abs(angle) <= 90.0
    at, mean = angle[middle], rows[:, middle]
    if width > 1 and at.size > 2 * width:  # running means over a degree
        sums = np.concatenate([np.zeros((len(mean), 1)), np.cumsum(mean, axis=1)], axis=1)
        mean, at = (sums[:, width:] - sums[:, :-width]) / width, at[: at.size - width + 1] + 0.5 * step * (width - 1)
    n = len(rows)
    top = mean.max(axis=1) if at.size else rows.max(axis=1)
    highest = float(top.max())
    nothing = Top(np.nan, np.nan, highest, False, False)
    if at.size < 5:
        return nothing
    close = max(_NEAR_TOP * highest, _TOP_NOISE * noise * float(np.sqrt(min(step, 1.0))))
    share = top > highest - 2.0 * close
    chosen = share if share.sum() >= max(_SHARERS[0], _SHARERS[1] * n) else top >= np.quantile(top, 0.75)
    near = _count(mean, top - _BELOW * np.abs(top))[chosen]
    flat = float(np.median(_count(mean, top - close)[chosen] / near)) if near.min() >= _FEWEST else np.nan
    peak = mean.argmax(axis=1)
    chords = [_chord(at, mean, top, peak, below) for below in _SOFT_CHORDS]
    soft = chords[0] / chords[1]
    bent = float(np.median(soft[np.isfinite(soft)])) if np.isfinite(soft).any() else np.nan
    cut = flat > _FLAT
    return Top(flat, bent, highest, bool(cut), bool(not cut and n >= _SOFT_CYCLES and bent > _SOFT))


def _count(rows: NDArray[np.float64], level: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.asarray((rows >= level[:, None]).sum(axis=1))


def _chord(
    angle: NDArray[np.float64],
    rows: NDArray[np.float64],
    top: NDArray[np.float64],
    peak: NDArray[np.intp],
    below: float,
) -> NDArray[np.float64]:
    """Measure how wide each cycle is, so far below its top, between samples; NaN where it does not fall so far."""
    level, index, each = top * (1.0 - below), np.arange(angle.size), np.arange(len(rows))
    under = rows < level[:, None]
    left = np.where(under & (index < peak[:, None]), index, -1).max(axis=1)
    right = np.where(under & (index > peak[:, None]), index, angle.size).min(axis=1)
    inside = (left >= 0) & (right < angle.size)
    left, right = np.where(inside, left, 0), np.where(inside, right, 1)

    def crossing(outer: NDArray[np.intp], inner: NDArray[np.intp]) -> NDArray[np.float64]:
        low, high = rows[each, outer], rows[each, inner]
        share = np.divide(level - low, high - low, out=np.zeros_like(low), where=high != low)
        return np.asarray(angle[outer] + share * (angle[inner] - angle[outer]))

    return np.where(inside, crossing(right, right - 1) - crossing(left, left + 1), np.nan)


def _noise(angle: NDArray[np.float64], bar: NDArray[np.float64]) -> float:
    quiet = (angle >= _QUIET_CAD[0]) & (angle <= _QUIET_CAD[1])
    return noise_of(np.atleast_2d(bar)[:, quiet]) if quiet.sum() >= 8 else 0.0


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
    target = np.log(bar[inside]) * bar[inside]
    terms = np.asarray(np.linalg.lstsq(design, target)[0], dtype=np.float64)
    left = target - design @ terms
    variance = float(left @ left) / (inside.sum() - _DEGREE - 1) * np.linalg.inv(design.T @ design)
    estimate = ratio(terms)
    slope = np.array([(ratio(terms + 1e-4 * unit) - estimate) / 1e-4 for unit in np.eye(_DEGREE + 1)])
    return estimate, float(np.sqrt(slope @ variance @ slope))


def expansion_doubts(
    angle: NDArray[np.float64],
    bar: NDArray[np.float64],
    volume_l: NDArray[np.float64],
    mass_g: float,
    cylinder: Cylinder,
    speed_rpm: float,
) -> list[tuple[str, str]]:
    """Doubt one fired cycle, mean of many or single, by the heat that late expansion loses."""
    estimate = lost_heat(angle, bar, volume_l, mass_g, cylinder, speed_rpm)
    if estimate is None:
        return []
    lost, error = estimate
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
