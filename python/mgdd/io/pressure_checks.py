"""Is this a cylinder pressure trace, in this unit? Every refusal names the place, the value and the remedy."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd._arguments import as_floats
from mgdd.errors import DataError, ShapeError, argument
from mgdd.io.column_names import check_choice
from mgdd.io.table import Place
from mgdd.signals.even_grid import wide_steps

CONVENTION = "crank angle is in °CA aTDC: firing TDC = 0, compression negative"
# An exact integer keeps the value in bar correctly rounded: units per bar here, bar per unit below.
_PER_BAR = {"bar": 1.0, "mbar": 1000.0, "kPa": 100.0, "Pa": 100000.0}
# 1 psi = 1 lbf/in² with 1 lbf = 0.45359237 kg of 9.80665 m/s² and 1 in = 0.0254 m, all exact.
# 1 kgf = 9.80665 N, 1 atm = 101325 Pa = 760 torr, exact as well.
_BAR_PER = {
    "MPa": 10.0, "psi": 4.4482216152605 / 0.0254**2 / 1e5,
    "kgf/cm2": 0.980665, "atm": 1.01325, "torr": 1.01325 / 760.0,
}  # fmt: skip
PRESSURE_UNITS = (*_PER_BAR, *_BAR_PER)
# That a remedy names: the others are too near to one of these to be told apart by a number.
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
MIN_SAMPLES = 20
# A four-stroke cycle is 4 pi = 12.57 rad.
RADIAN_SPAN = 13.0
# No encoder is as coarse as this: degrees that were taken for radians have such a step.
MAX_STEP_DEG = 5.0
# Below this [rad] no trace is worth an analysis: it is a time in seconds.
MIN_RADIANS = 2.0
# At firing TDC even a strongly boosted compression has reached this share of any peak.
TDC_SHARE = 0.15


def pair(angle: ArrayLike, pressure: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return new float64 arrays: the angle, and the pressure over it or (cycle, angle); or raise ShapeError."""
    first, second = as_floats(angle), as_floats(pressure)
    if (
        first.ndim != 1
        or second.ndim not in (1, 2)
        or second.shape[-1:] != first.shape
        or second.shape[0] == 0 < first.size
    ):
        remedy = "give two one-dimensional arrays of one length, or one row of pressures per cycle"
        if second.ndim == 2 and second.shape[:1] == first.shape:
            remedy = "one row per cycle is needed: pass the transpose"
        raise ShapeError(f"crank angle has shape {first.shape} and pressure {second.shape}: {remedy}")
    return first, second


def to_bar(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Return pressures in bar."""
    return values / _PER_BAR[unit] if unit in _PER_BAR else values * _BAR_PER[unit]


def _level_bar(degrees: NDArray[np.float64], bar: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return angle and pressure that say how high the intake pressure is; None for traces that start too late.

    It is the mean within 5° of intake bottom dead centre, or the first sample of a trace that starts behind it.
    """
    if degrees[0] > _EARLY_CAD:
        return None
    near = np.abs(degrees + 180.0) <= 5.0
    if degrees[0] <= -180.0 and near.any():
        return -180.0, float(bar[..., near].mean())
    return float(degrees[0]), float(bar[..., 0].mean())


def check_magnitude(
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
        if other != unit and _peak_fits(peak, other, low) and _level_fits(_level_bar(degrees, to_bar(values, other)))
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
    level = _level_bar(degrees, values)
    level = None if level is None else (level[0], float(to_bar(np.array(level[1]), unit)))
    if level is None or _level_fits(level):
        return []
    angle, bar = level
    peak, low = float(values.max()), _low(degrees)
    fitting = []
    for other in _USUAL:
        there = _level_bar(degrees, to_bar(values, other))
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


def check_trace(
    angle: ArrayLike,
    pressure: ArrayLike,
    *,
    unit: str = "bar",
    angle_unit: str = "deg",
    source: str = "trace",
    rows: Sequence[int] | NDArray[np.int64] | None = None,
    unit_of_file: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Check a pressure trace and return it in °CA aTDC and bar; the caller's arrays stay as they are.

    Pressure relative to an unknown offset (a piezo signal before pegging) is accepted, so single values may
    be negative; the unit is judged by the highest value.

    The angle [`angle_unit`] rises strictly in even steps; the pressure [`unit`] stands over it or (cycle, angle).
    Messages call the trace `source`, a sample by its line in `rows` or else by its index, and a unit that cannot be
    is to be corrected in the file where the `unit_of_file` says it.
    """
    check_choice("pressure_unit", unit, PRESSURE_UNITS)
    check_choice("angle_unit", angle_unit, ("deg", "rad"))
    degrees, values = pair(angle, pressure)
    place = Place(source, rows)
    if degrees.size < MIN_SAMPLES:
        raise DataError(f"{source}: {degrees.size} samples; at least {MIN_SAMPLES} are needed")
    for name, rows_of in (("crank angle", degrees[None]), ("pressure", np.atleast_2d(values))):
        finite = np.isfinite(rows_of)
        if not finite.all():
            bad = np.argwhere(~finite)
            where, value = place.row(int(bad[0, 1])), rows_of[tuple(bad[0])]
            raise DataError(f"{where}: {name} = {value}: must be finite; remove or repair it")
    if angle_unit == "rad":
        degrees = np.rad2deg(degrees)
    check_span(degrees, angle_unit, source)
    _check_order(degrees, place)
    first, last = float(degrees[0]), float(degrees[-1])
    whole = first < 30.0 - 360.0 and last > 360.0 - 30.0  # a whole cycle may begin a little off, or be shifted
    reach = 390.0 if whole else 360.5
    if first < -reach or last > reach:
        raise DataError(
            f"{source}: crank angles run from {first:g} to {last:g}: this looks like a 0..720 record; "
            f"{CONVENTION}; {_remedy_0_720()}"
        )
    wide, median = wide_steps(degrees)
    if wide:
        index = wide[0]
        raise DataError(
            f"{place.row(index)}: gap in the crank angle from {degrees[index - 1]:g} to {degrees[index]:g}: "
            f"the usual step is {median:g}; fill it or cut the trace there"
        )
    bar = to_bar(values, unit)
    check_magnitude(degrees, values, unit, source, unit_of_file)
    if bar.ndim == 2:
        low = _low(degrees)
        odd = (cycle for cycle, peak in enumerate(values.max(axis=1)) if not _peak_fits(float(peak), unit, low))
        if (cycle := next(odd, None)) is not None:
            check_magnitude(degrees, values[cycle], unit, f"{source}, cycle {cycle + 1}", unit_of_file)
    mean = bar if bar.ndim == 1 else bar.mean(axis=0)
    top = int(np.argmax(mean))
    inside = mean[np.abs(degrees) <= 90.0]
    near = float(inside.max()) if inside.size else 0.0
    if np.ptp(degrees) >= 180.0 and mean[top] > 2.0 * near:
        raise DataError(
            f"{source}: the highest pressure {mean[top]:g} bar is at {degrees[top]:g}, far from firing "
            f"TDC: {CONVENTION}; {_remedy_0_720()}"
        )
    _check_tdc(degrees, mean, source)
    return degrees, bar


def check_span(degrees: NDArray[np.float64], angle_unit: str, source: str, *, several: bool = False) -> None:
    """Refuse angles whose range belongs to radians, to seconds, or to degrees; `several` cycles may run on."""
    span = float(np.ptp(degrees))
    if angle_unit == "deg" and 0.0 < span < RADIAN_SPAN:
        likely = [f"radians; pass {argument('angle_unit', repr('rad'))}"] if span > MIN_RADIANS else []
        if degrees[0] >= 0.0 or span <= MIN_RADIANS:
            likely.append(
                f"seconds; pass {argument('angle_unit', repr('s'))} and {argument('speed_rpm', '')} to turn them into "
                "degrees"
            )
        raise DataError(
            f"{source}: crank angles span only {span:g} degrees: this looks like {', or like '.join(likely)}"
        )
    coarse = degrees.size > 1 and float(np.median(np.abs(np.diff(degrees)))) > MAX_STEP_DEG
    if angle_unit == "rad" and (coarse or (span > math.degrees(RADIAN_SPAN) and not several)):
        raise DataError(
            f"{source}: crank angles span {math.radians(span):g} rad: this looks like degrees; pass "
            f"{argument('angle_unit', repr('deg'))}"
        )


def _remedy_0_720() -> str:
    return f"pass {argument('firing_tdc_deg', '')} with the angle of firing TDC"


def _check_order(degrees: NDArray[np.float64], place: Place) -> None:
    step = np.diff(degrees)
    if np.all(step > 0.0):
        return
    if np.all(step < 0.0):
        raise DataError(
            f"{place.row(0)}: crank angles fall from {degrees[0]:g} to {degrees[-1]:g}: this looks like °bTDC; "
            f"{CONVENTION}; pass {argument('before_tdc', 'True')}"
        )
    if np.mean(step < 0.0) > 0.9:
        raise DataError(
            f"{place.row(0)}: crank angles fall, and jump back: this looks like °bTDC in several cycles; {CONVENTION}; "
            f"pass {argument('before_tdc', 'True')}"
        )
    index = int(np.argmin(step > 0.0)) + 1
    before, here = degrees[index - 1], degrees[index]
    if here == before:
        raise DataError(f"{place.row(index)}: crank angle {here:g} is repeated: keep one sample per angle")
    remedy = "sort the rows by crank angle"
    if before - here > 300.0:
        remedy = "this looks like the start of another cycle; mgdd.io.pressure_trace cuts cycles"
    raise DataError(f"{place.row(index)}: crank angle {here:g} follows {before:g}: angles must rise; {remedy}")


def _check_tdc(degrees: NDArray[np.float64], bar: NDArray[np.float64], source: str) -> None:
    """Refuse a trace that has hardly begun to compress where firing TDC should be."""
    if degrees[0] > 0.0 or degrees[-1] < 0.0:
        return
    # A peak holds for five samples; a spike is judged elsewhere.
    sustained = np.lib.stride_tricks.sliding_window_view(bar, 5).min(axis=1)
    low, peak, here = float(bar.min()), float(sustained.max()), float(np.interp(0.0, degrees, bar))
    if here - low < TDC_SHARE * (peak - low):
        at = degrees[int(np.argmax(sustained)) + 2]
        milliseconds = f"{argument('angle_unit', repr('ms'))} and {argument('speed_rpm', '')}"
        raise DataError(
            f"{source}: the pressure at angle 0 is {here:.3g} bar, the peak of {peak:.3g} bar is at {at:g}: 0 "
            f"cannot be firing TDC; {_remedy_0_720()}; a column of milliseconds needs {milliseconds}"
        )
