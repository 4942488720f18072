"""Is this a cylinder pressure trace? Every refusal names the place, the value and the remedy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.angles import CONVENTION, pair
from mgdd.io.pressure_units import PRESSURE_UNITS, check_unit, to_bar
from mgdd.signals.even_grid import wide_steps

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["MIN_SAMPLES", "check_choice", "check_span", "check_trace"]

MIN_SAMPLES = 20
# A four-stroke cycle is 4 pi = 12.57 rad.
RADIAN_SPAN = 13.0
# No encoder is as coarse as this: degrees that were taken for radians have such a step.
MAX_STEP_DEG = 5.0
# Below this [rad] no trace is worth an analysis: it is a time in seconds.
MIN_RADIANS = 2.0
# At firing TDC even a strongly boosted compression has reached this share of any peak.
TDC_SHARE = 0.15


def check_trace(
    angle: ArrayLike,
    pressure: ArrayLike,
    *,
    unit: str = "bar",
    angle_unit: str = "deg",
    source: str = "trace",
    rows: Sequence[int] | None = None,
    unit_of_file: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Check a pressure trace and return it in °CA aTDC and bar; the caller's arrays stay as they are.

    Pressure relative to an unknown offset (a piezo signal before pegging) is accepted, so single values may
    be negative; the unit is judged by the highest value.

    Parameters
    ----------
    angle : array_like
        Crank angle, firing TDC = 0 and compression negative, strictly rising in even steps [`angle_unit`].
    pressure : array_like
        Cylinder pressure [`unit`], over angle or (cycle, angle).
    unit : {"bar", "mbar", "kPa", "Pa", "MPa", "psi", "kgf/cm2", "atm", "torr"}
        Unit of `pressure`.
    angle_unit : {"deg", "rad"}
        Unit of `angle`.
    source : str
        Name for the messages, for example the file.
    rows : sequence of int, optional
        Line number of each sample for the messages; without it they give the array index.
    unit_of_file : bool
        The file says `unit`: where it cannot be, the file is to be corrected.

    Returns
    -------
    tuple of ndarray
        Crank angle [°CA aTDC] and pressure [bar], new float64 arrays.

    Raises
    ------
    DataError
        Fewer than 20 samples, NaN or infinity, unsorted or repeated angles, a step above 1.5 times the median
        step, angles in another convention or unit, a pressure that cannot be in the unit said.
    ShapeError
        Arrays that are not equally long.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.io.checks import check_trace
    >>> angle = np.arange(-30.0, 31.0)
    >>> _, pressure = check_trace(angle, 6e6 - 1000.0 * angle**2, unit="Pa")
    >>> float(pressure.max())
    60.0
    """
    check_choice("pressure_unit", unit, PRESSURE_UNITS)
    check_choice("angle_unit", angle_unit, ("deg", "rad"))
    degrees, values = pair(angle, pressure)

    def place(index: int) -> str:
        return f"{source}, line {rows[index]}" if rows is not None else f"{source}, sample {index}"

    if degrees.size < MIN_SAMPLES:
        raise DataError(f"{source}: {degrees.size} samples; at least {MIN_SAMPLES} are needed")
    for name, column in (("crank angle", degrees), *(("pressure", row) for row in np.atleast_2d(values))):
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            where, value = place(int(bad[0])), column[bad[0]]
            raise DataError(f"{where}: {name} = {value}: must be finite; remove or repair it")
    if angle_unit == "rad":
        degrees = np.rad2deg(degrees)
    check_span(degrees, angle_unit, source)
    _check_order(degrees, place)
    _check_convention(degrees, source)
    _check_gap(degrees, place)
    bar = to_bar(values, unit)
    check_unit(degrees, values, unit, source, unit_of_file)
    if bar.ndim == 2:
        for cycle, row in enumerate(values, start=1):
            check_unit(degrees, row, unit, f"{source}, cycle {cycle}", unit_of_file)
    mean = bar if bar.ndim == 1 else bar.mean(axis=0)
    _check_peak(degrees, mean, source)
    _check_tdc(degrees, mean, source)
    return degrees, bar


def _remedy_0_720() -> str:
    return f"pass {argument('firing_tdc_deg', '')} with the angle of firing TDC"


def check_choice(name: str, value: object, allowed: tuple[str, ...]) -> None:
    """Refuse a keyword value outside its list, naming both."""
    if value not in allowed:
        raise DataError.of(name, value, f"one of {', '.join(map(repr, allowed))}")


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


def _check_order(degrees: NDArray[np.float64], place: Callable[[int], str]) -> None:
    step = np.diff(degrees)
    if np.all(step > 0.0):
        return
    if np.all(step < 0.0):
        raise DataError(
            f"{place(0)}: crank angles fall from {degrees[0]:g} to {degrees[-1]:g}: this looks like °bTDC; "
            f"{CONVENTION}; pass {argument('before_tdc', 'True')}"
        )
    if np.mean(step < 0.0) > 0.9:
        raise DataError(
            f"{place(0)}: crank angles fall, and jump back: this looks like °bTDC in several cycles; {CONVENTION}; "
            f"pass {argument('before_tdc', 'True')}"
        )
    index = int(np.argmin(step > 0.0)) + 1
    before, here = degrees[index - 1], degrees[index]
    if here == before:
        raise DataError(f"{place(index)}: crank angle {here:g} is repeated: keep one sample per angle")
    remedy = "sort the rows by crank angle"
    if before - here > 300.0:
        remedy = "this looks like the start of another cycle; mgdd.io.pressure_trace cuts cycles"
    raise DataError(f"{place(index)}: crank angle {here:g} follows {before:g}: angles must rise; {remedy}")


def _check_convention(degrees: NDArray[np.float64], source: str) -> None:
    first, last = float(degrees[0]), float(degrees[-1])
    whole = first < 30.0 - 360.0 and last > 360.0 - 30.0  # a whole cycle may begin a little off, or be shifted
    reach = 390.0 if whole else 360.5
    if first < -reach or last > reach:
        raise DataError(
            f"{source}: crank angles run from {first:g} to {last:g}: this looks like a 0..720 record; "
            f"{CONVENTION}; {_remedy_0_720()}"
        )


def _check_gap(degrees: NDArray[np.float64], place: Callable[[int], str]) -> None:
    wide, median = wide_steps(degrees)
    if wide:
        index = wide[0]
        raise DataError(
            f"{place(index)}: gap in the crank angle from {degrees[index - 1]:g} to {degrees[index]:g}: "
            f"the usual step is {median:g}; fill it or cut the trace there"
        )


def _check_peak(degrees: NDArray[np.float64], bar: NDArray[np.float64], source: str) -> None:
    top = int(np.argmax(bar))
    inside = bar[np.abs(degrees) <= 90.0]
    near = float(inside.max()) if inside.size else 0.0
    if np.ptp(degrees) >= 180.0 and bar[top] > 2.0 * near:
        raise DataError(
            f"{source}: the highest pressure {bar[top]:g} bar stands at {degrees[top]:g}, far from firing "
            f"TDC: {CONVENTION}; {_remedy_0_720()}"
        )


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
            f"{source}: the pressure at angle 0 is {here:.3g} bar, the peak of {peak:.3g} bar stands at {at:g}: 0 "
            f"cannot be firing TDC; {_remedy_0_720()}; a column of milliseconds needs {milliseconds}"
        )
