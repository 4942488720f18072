"""Units of cylinder pressure: what they are in bar, and which of them a trace can be in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, argument

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["PRESSURE_UNITS", "check_unit", "level_bar", "level_warning", "steep_warning", "to_bar"]

# An exact integer keeps the value in bar correctly rounded: units per bar here, bar per unit below.
_PER_BAR = {"bar": 1.0, "mbar": 1000.0, "kPa": 100.0, "Pa": 100000.0}
# 1 psi = 1 lbf/in² with 1 lbf = 0.45359237 kg of 9.80665 m/s² and 1 in = 0.0254 m, all exact.
# 1 kgf = 9.80665 N, 1 atm = 101325 Pa = 760 torr, exact as well.
_BAR_PER = {
    "MPa": 10.0, "psi": 4.4482216152605 / 0.0254**2 / 1e5,
    "kgf/cm2": 0.980665, "atm": 1.01325, "torr": 1.01325 / 760.0,
}  # fmt: skip
PRESSURE_UNITS = (*_PER_BAR, *_BAR_PER)
# That a remedy names: the others are too near to one of these to be told by a number.
_USUAL = PRESSURE_UNITS[:6]
# Peak pressure from a throttled motored engine to twice today's diesels; traces without TDC get a floor.
PEAK_BAR = (4.0, 500.0)
FLOOR_BAR = 0.2
# Absolute pressure early in compression, from a throttled spark-ignition engine to two-stage charging.
LEVEL_BAR = (0.25, 6.0)
# Later than this [°CA aTDC] compression has raised the pressure too far to judge the unit by it.
_EARLY_CAD = -120.0
# Combustion before TDC raises the pressure by less than this factor; a pressure below this [bar] may be an offset.
_BURNT, _PRESSED_BAR = 3.0, 0.5


def to_bar(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Return pressures in bar."""
    return values / _PER_BAR[unit] if unit in _PER_BAR else values * _BAR_PER[unit]


def level_bar(degrees: NDArray[np.float64], bar: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return angle and pressure that say how high the intake pressure is; None for traces that start too late.

    It is the mean within 5° of intake bottom dead centre, or the first sample of a trace that starts behind it.
    """
    if degrees[0] > _EARLY_CAD:
        return None
    near = np.abs(degrees + 180.0) <= 5.0
    if degrees[0] <= -180.0 and near.any():
        return -180.0, float(bar[..., near].mean())
    return float(degrees[0]), float(bar[..., 0].mean())


def check_unit(
    degrees: NDArray[np.float64], values: NDArray[np.float64], unit: str, source: str, unit_of_file: bool
) -> None:
    """Refuse a unit that the highest pressure excludes, and name those that peak and intake level allow."""
    low = _low(degrees)
    peak = float(values.max())
    if _peak_fits(peak, unit, low):
        return
    likely = [
        other
        for other in _USUAL
        if other != unit and _peak_fits(peak, other, low) and _level_fits(level_bar(degrees, to_bar(values, other)))
    ]
    if likely:
        hint = " or ".join(argument("pressure_unit", repr(other)) for other in likely)
        remedy = f"this looks like {' or '.join(likely)}; "
        remedy += f"the file says {unit}: correct it there" if unit_of_file else f"pass {hint}"
    else:
        remedy = f"no unit of {', '.join(_USUAL)} fits a cylinder pressure; check column and scale"
    raise DataError(
        f"{source}: the highest pressure {peak:g} {unit} is outside {low:g} to {PEAK_BAR[1]:g} bar: {remedy}"
    )


def level_warning(degrees: NDArray[np.float64], values: NDArray[np.float64], unit: str) -> list[str]:
    """Doubt a unit that the peak allows and the intake level does not; one line, or none."""
    level = level_bar(degrees, to_bar(values, unit))
    if level is None or _level_fits(level):
        return []
    angle, bar = level
    peak, low = float(values.max()), _low(degrees)
    fitting = []
    for other in _USUAL:
        there = level_bar(degrees, to_bar(values, other))
        if other != unit and there and _peak_fits(peak, other, low) and _level_fits(there):
            fitting.append(f"{argument('pressure_unit', repr(other))} would make it {there[1]:.3g} bar")
    remedy = f"; {' or '.join(fitting)}" if fitting else ": check unit and offset"
    usual = f"{LEVEL_BAR[0]:g} to {LEVEL_BAR[1]:g} bar"
    return [f"the pressure at {angle:g} °CA aTDC is {bar:.3g} bar, an intake pressure of {usual} is usual{remedy}"]


def steep_warning(degrees: NDArray[np.float64], bar: NDArray[np.float64]) -> list[str]:
    """Doubt an angle over which a short trace rises more than any compression; one line, or none."""
    first, start = float(np.atleast_2d(bar).mean(axis=0)[0]), float(degrees[0])
    if not -60.0 <= start <= -5.0 or degrees[-1] < 0.0 or first < _PRESSED_BAR:
        return []
    rise = float(np.interp(0.0, degrees, np.atleast_2d(bar).mean(axis=0))) / first
    # Volume over clearance volume is at most 1 + (r - 1)/2 (1 + 1/R) (1 - cos), here with r = 25 and R = 3.3.
    volumes = 1.0 + 12.0 * 1.3 * (1.0 - np.cos(np.deg2rad(start)))
    if rise <= _BURNT * volumes**1.4:
        return []
    remedy = f"pass {argument('angle_unit', repr('ms'))} and {argument('speed_rpm', '')}"
    what = f"the pressure rises {rise:.3g} times from {start:g} to 0 °CA aTDC, more than compression can"
    return [f"{what}: if the column is a time, {remedy}"]


def _low(degrees: NDArray[np.float64]) -> float:
    return PEAK_BAR[0] if degrees[0] <= -5.0 and degrees[-1] >= 5.0 else FLOOR_BAR


def _peak_fits(peak: float, unit: str, low: float) -> bool:
    return low <= float(to_bar(np.float64(peak), unit)) <= PEAK_BAR[1]  # type: ignore[arg-type]


def _level_fits(level: tuple[float, float] | None) -> bool:
    """Return whether an intake level is possible; a relative pressure below zero says nothing."""
    return level is None or level[1] <= 0.0 or LEVEL_BAR[0] <= level[1] <= LEVEL_BAR[1]
