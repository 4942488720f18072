"""Top dead centre: what a degree of error costs, and where a motored trace has it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError

Array = NDArray[np.float64]

# Distances from TDC that are compared: nearer ones hold the peak alone, farther ones the flows of the valves.
_FROM_CAD, _TO_CAD, _ROUNDS = 5.0, 60.0, 5
_PEAK_CAD, _START_CAD, _FARTHEST_CAD = 8.0, 20.0, 5.0
_LEAST_BAR = 0.05  # a level below zero is found elsewhere
# Of the motored gas, which is air: gamma within 0.003 from 400 to 950 K.
_GAS_J_PER_KGK, _GAMMA_300K, _GAMMA_SLOPE_PER_K = 287.0, 1.40, 9.5e-5
# What is not stated, and how far it may be off: the charge at IVC over the intake [K], which no burned gas heats; the
# wall of a motored engine, colder than that of a fired one [K]; a crevice over the clearance volume; and a gap at the
# rings of a bore of 90 mm [m2] with its discharge.
_WARMED_K, _CHARGE_K, _WALL_K = 20.0, 25.0, 50.0
_CREVICE = 0.012
_GAP_M2, _DISCHARGE = 0.15e-6, 0.62
_CHARGES_K = (270.0, 430.0)  # a stated mass that gives another temperature belongs to another record
# Of the scatter over four laws, of a standard error, and what the balance itself leaves on engines whose law,
# temperatures, gap and crevice are known [°CA].
_LAWS_FACTOR, _NOISE_FACTOR, _REST_CAD = 2.0, 2.5, 0.1
_ALIKE = 0.95
_HOHENBERG = 1  # of the laws
# Wall heat over Hohenberg's, and the peak before TDC [°CA], of sound engines.
_SOUND_SCALES, _SOUND_LOSS_CAD = (0.1, 2.5), 1.3


class DegreeCost(NamedTuple):
    """Closed IMEP of a trace [bar], and by how much more it reads with angles that are 1 °CA too large [bar]."""

    imep_bar: float
    error_bar: float

    @classmethod
    def of_many(cls, costs: Sequence[Self]) -> Self:
        """Give the mean of several traces."""
        return cls(*map(float, np.mean(costs, axis=0)))

    @property
    def error_percent(self) -> float:
        """The same over the IMEP [%]; NaN where it is less than the error, as of a motored trace."""
        return 100.0 * self.error_bar / self.imep_bar if self.error_bar < self.imep_bar else math.nan

    def __str__(self) -> str:
        share = "" if math.isnan(self.error_percent) else f" ({self.error_percent:.2g} %)"
        return f"1 °CA moves the closed IMEP by {self.error_bar:.2g} bar{share}"

    def of_fired(self) -> str:
        """Report what a fired trace leaves open."""
        return f"a fired trace hardly shows an error of TDC, and {self}"


def degree_cost(angle_cad: Array, pressure_bar: Array, cylinder: Cylinder) -> DegreeCost:
    """Give what an error of TDC of one degree costs, of one cycle or of the mean of many: work is linear in pressure.

    The samples from IVC to EVO are put on the volumes half a degree earlier and later.
    """
    closed = (angle_cad >= cylinder.ivc_cad) & (angle_cad <= cylinder.evo_cad)
    angle, bar = angle_cad[closed], pressure_bar[closed]

    def imep(error: float) -> float:
        return float(np.trapezoid(bar, _core.engine.volume_l(cylinder, angle + error)) / cylinder.swept_volume_l)

    return DegreeCost(imep(0.0), imep(0.5) - imep(-0.5))


class MotoredTdc(NamedTuple):
    """What motored strokes show: by how much the angles are too large, and what no sound engine has.

    The half is how far the offset may be off to each side; the wall heat is over Hohenberg's, the loss angle that of
    the peak before TDC.
    """

    offset_cad: float
    offset_half_cad: float
    wall_heat_scale: float
    loss_angle_cad: float
    findings: tuple[str, ...]

    @classmethod
    def of_many(cls, strokes: Sequence[Self]) -> Self:
        """Combine several records of one encoder: their mean, with twice their scatter."""
        numbers = np.array([each[:4] for each in strokes])
        offset, half, wall, loss = map(float, numbers.mean(axis=0))
        half = math.hypot(half, 2.0 * float(numbers[:, 0].std()))
        findings = dict.fromkeys(text for each in strokes for text in each.findings)
        return cls(offset, half, wall, loss, tuple(findings))

    def doubts(self) -> tuple[str, ...]:
        """Report that the angles are outside the range, and what no sound engine has."""
        if abs(self.offset_cad) <= self.offset_half_cad:
            return self.findings
        shown = f"{self.offset_cad:+.2f} ± {self.offset_half_cad:.2f}"
        return (f"the two strokes have the angles {shown} °CA too large", *self.findings)


class _Strokes(NamedTuple):
    """At each distance d, from -d to d: the loss of ln p + ∫ gamma d ln V, and what makes it, weighted by p(d)."""

    loss: Array
    walls: Array  # (law, distance)
    gap: Array
    crevice: Array
    degree: Array

    def solved(self, gap: float = 1.0, crevice: float = 1.0) -> Array:
        """Give the scale of the wall heat and the error of the angle by each law."""
        left = self.loss - gap * self.gap - crevice * self.crevice
        return np.array([np.linalg.lstsq(self.design(law), left)[0] for law in range(len(self.walls))])

    def design(self, law: int) -> Array:
        """Give the two columns that are fitted."""
        return np.column_stack([self.walls[law], -self.degree])


def motored_tdc(angle_cad: Array, pressure_bar: Array, cylinder: Cylinder, point: OperatingPoint) -> MotoredTdc:
    """Find TDC by the heat balance of the two strokes of one motored cycle, which reaches 80 degrees to each side.

    From d degrees before to d after TDC, ln p + ∫ gamma d ln V falls by what the walls, a gap at the rings and a
    crevice take, and rises by 2 gamma d ln V/d phi for each degree that the angles are too large: near TDC the one is
    flat and the other steep. The heat follows from the measured pressure by the laws of Woschni, Hohenberg, Eichelberg
    and Annand, each with a scale of its own. The range holds the spread of the laws, and what the temperatures, the gap
    and the crevice, which nobody states, move.
    """
    pressure_bar = np.maximum(pressure_bar, _LEAST_BAR)
    distance = np.arange(_FROM_CAD, _TO_CAD, max(float(np.median(np.diff(angle_cad))), 0.1))
    charge_k = _charge_k(angle_cad, pressure_bar, cylinder, point)

    def strokes(offset: float, warmer_k: float = 0.0, wall_k: float = 0.0) -> _Strokes:
        wall_k += cylinder.wall_temperature_k
        angle = angle_cad - offset
        return _balance(angle, pressure_bar, distance, cylinder, point.speed_rpm, charge_k + warmer_k, wall_k)

    peak, peak_stderr = _peak_cad(angle_cad, pressure_bar)
    offset = peak
    for _ in range(_ROUNDS):  # the step is linear in a small offset only
        offset += float(strokes(offset).solved()[:, 1].mean())
        offset = min(max(offset, peak - _FARTHEST_CAD), peak + _FARTHEST_CAD)
    pair = strokes(offset)
    solution = pair.solved()
    moved = [
        pair.solved(gap=0.0),
        pair.solved(crevice=0.0),
        strokes(offset, warmer_k=_CHARGE_K).solved(),
        strokes(offset, wall_k=_WALL_K).solved(),
    ]
    off = [(each - solution).mean(axis=0) for each in moved]
    noise, scatter = _noise(pair, solution)
    laws = _LAWS_FACTOR * float(solution[:, 1].std(ddof=1))
    offset_half = math.hypot(*(each[1] for each in off), noise[1], laws, _REST_CAD)
    scale = float(solution[_HOHENBERG, 0])
    loss = offset - peak
    low, high = _SOUND_SCALES
    findings = []
    # The highest sound scale holds what temperatures move; the lowest has neither gap nor crevice.
    if scale - scatter[0] > high or scale + off[0][0] + off[1][0] + noise[0] < low:
        findings.append(
            f"the two strokes need {scale:.2g} times Hohenberg's wall heat, sound engines {low:g} to {high:g}: suspect "
            "blow-by, compression ratio, speed, thermal shock or a burn; such a record does not show TDC"
        )
    if loss - math.hypot(scatter[1], _NOISE_FACTOR * peak_stderr) > _SOUND_LOSS_CAD:
        findings.append(
            f"the peak stands {loss:.2f} °CA before TDC, in sound engines at most {_SOUND_LOSS_CAD:g}: suspect blow-by "
            "and TDC"
        )
    return MotoredTdc(offset, offset_half, scale, loss, tuple(findings))


def _charge_k(angle: Array, bar: Array, cylinder: Cylinder, point: OperatingPoint) -> float:
    """Give the temperature at the first angle: stated, by the stated mass, or by the intake."""
    if point.ivc_temperature_k is not None:
        return point.ivc_temperature_k
    if point.trapped_mass_g is not None:
        litre = float(_core.engine.volume_l(cylinder, angle[0]))
        by_mass = 1e5 * _start_bar(angle, bar, cylinder) * litre / (point.trapped_mass_g * _GAS_J_PER_KGK)
        if _CHARGES_K[0] < by_mass < _CHARGES_K[1]:
            return by_mass
    return point.intake_temperature_k + _WARMED_K


def _start_bar(angle: Array, bar: Array, cylinder: Cylinder) -> float:
    """Give the pressure at the first angle without its noise."""
    first = angle <= angle[0] + _START_CAD
    volume = np.asarray(_core.engine.volume_l(cylinder, angle[first]))
    return float(np.median(bar[first] * (volume / volume[0]) ** _GAMMA_300K))


def _balance(
    angle: Array, bar: Array, distance: Array, cylinder: Cylinder, speed_rpm: float, charge_k: float, wall_k: float
) -> _Strokes:
    volume = 1e-3 * np.asarray(_core.engine.volume_l(cylinder, angle))
    start = 1e5 * _start_bar(angle, bar, cylinder) * volume[0]  # m R T
    energy = 1e5 * bar * volume
    kelvin = charge_k * energy / start
    gamma = _GAMMA_300K - _GAMMA_SLOPE_PER_K * (kelvin - 300.0)
    rise = np.gradient(np.log(volume), angle)
    seconds = 1.0 / (6.0 * speed_rpm)
    heat = seconds * (gamma - 1.0) / energy * np.asarray(_core.engine.wall_area_m2(cylinder, angle)) * (kelvin - wall_k)
    gap_m2 = _GAP_M2 * (cylinder.bore_mm / 90.0) ** 2
    flow = seconds * _DISCHARGE * gap_m2 * 1e5 * bar * np.sqrt(_GAS_J_PER_KGK / kelvin) * charge_k / start
    hollow = _CREVICE * 1e-3 * cylinder.clearance_volume_l / volume
    # Gas enters the crevice at its own temperature and comes back at that of the wall.
    exchanged = hollow * np.where(rise < 0.0, kelvin / wall_k, 1.0) * -gamma * rise

    def between(rate: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(angle))])
        return np.asarray(np.interp(distance, angle, total) - np.interp(-distance, angle, total))

    log = np.log(bar)
    weight = np.interp(distance, angle, bar)  # noise is that of the pressure, not of its logarithm
    loss = np.interp(-distance, angle, log) - np.interp(distance, angle, log) - between(gamma * rise)
    return _Strokes(
        loss=weight * loss,
        walls=np.array([weight * between(film * heat) for film in _films(cylinder, speed_rpm, bar, kelvin, volume)]),
        gap=weight * between(gamma * flow),
        crevice=weight * between(gamma * exchanged),
        degree=weight * 2.0 * np.interp(distance, angle, gamma * rise),
    )


def _films(cylinder: Cylinder, speed_rpm: float, bar: Array, kelvin: Array, volume: Array) -> list[Array]:
    """Give the film coefficients of a motored gas [W/(m2 K)] by Woschni, Hohenberg, Eichelberg and Annand."""
    bore, speed = 1e-3 * cylinder.bore_mm, 1e-3 * cylinder.stroke_mm * speed_rpm / 30.0
    conductivity, viscosity = 0.0263 * (kelvin / 300.0) ** 0.75, 1.85e-5 * (kelvin / 300.0) ** 0.67  # of air
    reynolds = 1e5 * bar / (_GAS_J_PER_KGK * kelvin) * speed * bore / viscosity
    core, c1 = _core.engine, _core.engine.woschni_c1_bar_m
    return [
        np.asarray(core.woschni_coefficient(c1, bore, bar, kelvin, cylinder.woschni_c2 * speed)),
        np.asarray(core.hohenberg_coefficient(130.0, volume, bar, kelvin, speed)),
        7.67 * np.cbrt(speed) * np.sqrt(0.1 * bar * kelvin),
        conductivity / bore * reynolds**0.7,
    ]


def _noise(strokes: _Strokes, solution: Array) -> tuple[Array, Array]:
    """Give what may move the scale and the angle by Hohenberg's law: what the balance leaves, and its scatter alone.

    What is left is alike nearby where the balance does not hold, and then counts for less samples.
    """
    design = strokes.design(_HOHENBERG)
    left = strokes.loss - strokes.gap - strokes.crevice - design @ solution[_HOHENBERG]
    square = float(left @ left)
    alike = min(max(float(left[1:] @ left[:-1]) / square, 0.0), _ALIKE)
    whole = square / (left.size - 2) * (1.0 + alike) / (1.0 - alike)
    alone = 0.5 * float(np.mean(np.diff(left) ** 2))
    unit = _NOISE_FACTOR * np.sqrt(np.diag(np.linalg.pinv(design.T @ design)))
    return np.sqrt(whole) * unit, np.sqrt(alone) * unit


def _peak_cad(angle: Array, bar: Array) -> tuple[float, float]:
    """Give the peak by a parabola, and its standard error."""
    at = float(angle[int(np.argmax(bar))])
    near = np.abs(angle - at) <= _PEAK_CAD
    if near.sum() < 5 or at - angle[0] < _PEAK_CAD or angle[-1] - at < _PEAK_CAD:
        raise DataError(f"the peak at {at:g} °CA aTDC has too few samples within {_PEAK_CAD:g} CAD around it")
    (bend, slope, _), covariance = np.polyfit(angle[near] - at, bar[near], 2, cov=True)
    return at - float(slope / (2.0 * bend)), float(np.sqrt(covariance[1, 1]) / abs(2.0 * bend))
