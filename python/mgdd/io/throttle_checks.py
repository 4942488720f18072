"""Is this the log of a throttle? Every refusal names the row, the column and the remedy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, argument, taken
from mgdd.io.table import Place
from mgdd.results.labels import check_labels
from mgdd.signals.even_grid import even_step, wide_steps

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

MIN_SAMPLES = 50
_INFINITE = 1e100  # of differences and products something is left below it
MIN_DURATION_S = 0.5
# A plate needs 70 to 200 ms through its travel: slower logs miss it, and 10 µs is beyond any position sensor.
STEP_S = (1e-5, 0.1)
# Closed to wide open, with the overrun of a soft stop and a zero that is a little off.
ANGLE_DEG = (-10.0, 95.0)
RADIANS = 1.7
STILL_DEG = 0.3
STILL_DUTY = 1e-3
# Of the steps that are not zero: a file of two records falls once, a signal in place of the time half of the way.
MANY_FALLS = 0.1
GAP_WINDOW = 20
SIDE_DEG, SIDE_S = 0.5, 0.1


def check_throttle_log(log: xr.Dataset) -> xr.Dataset:
    """Refuse what no throttle can be identified from, of ``duty`` and ``angle_deg`` over ``time_s``; return the log."""
    for name in ("time_s", "duty", "angle_deg"):
        if name not in log.variables or log[name].dims != ("time_s",):
            raise DataError(f"log has no {name}(time_s): make one with mgdd.io.read_throttle_log or throttle_log")
    names = [name for name in ("duty", "angle_deg", "current_a", "supply_v") if name in log]
    signals = log[names]
    signals.attrs = {}  # what the user notes beside the log is not ours to judge
    check_labels(signals)
    place = _place_of(log)
    columns = {name: np.asarray(log[name].to_numpy(), dtype=np.float64) for name in ("time_s", *names)}
    with taken((), in_arrays):
        check_samples(columns, place)
        check_even(columns["time_s"], place)
        check_signals(columns["duty"], columns["angle_deg"], place=place)
    return log


def in_arrays(name: str, text: str | None) -> str:
    """Write what stands for an argument of `mgdd.io.read_throttle_log` where arrays are given."""
    value = (text or "").strip("'")
    units = {
        ("time_unit", "ms"): "time_s / 1000", ("time_unit", "s"): "time_s in seconds", ("duty_unit", "%"): "duty / 100",
        ("angle_unit", "rad"): "numpy.rad2deg(angle_deg)", ("angle_unit", "%"): "angle_deg * travel_deg / 100",
    }  # fmt: skip
    columns = {"time": "time_s", "angle": "angle_deg", "current": "current_a", "supply": "supply_v", "duty": "duty"}
    ends = {"start_s": "the samples from", "stop_s": "the samples up to"}
    if name in ends:
        return f"{ends[name]} {value or 'a time'}{' s' if value else ''}"
    if name == "sample_s":
        return f"mgdd.io.throttle_log(..., sample_s={value})"
    return units.get((name, value)) or columns.get(name) or f"mgdd.io.read_throttle_log(..., {name}={text or '...'})"


def _gaps(time: NDArray[np.float64]) -> tuple[list[int], float]:
    """Give the samples behind a gap, and the usual step."""
    wide, usual = wide_steps(time)
    return [k for k in wide if _shifts(time, k - 1, usual)], usual


def _place_of(log: xr.Dataset) -> Place:
    return Place(str(log.attrs.get("file", "log")))


def check_samples(columns: Mapping[str, NDArray[np.float64]], place: Place) -> None:
    """Refuse columns that are not finite, and a time that is none."""
    for name, values in columns.items():
        bad = np.flatnonzero(~(np.abs(values) < _INFINITE))
        if bad.size:
            at = int(bad[0])
            what = "beyond any measurement" if np.isfinite(values[at]) else "not finite"
            more = f" ({bad.size} such cells)" if bad.size > 1 else ""
            raise DataError(
                f"{place.cell(at, name)}: {values[at]} is {what}{more}: repair it or cut the log; keep one part with "
                f"{argument('start_s', '')} or {argument('stop_s', '')}"
            )
    _check_time(columns, place)


def _check_time(columns: Mapping[str, NDArray[np.float64]], place: Place) -> None:
    """Refuse time that does not rise, leaves gaps, cannot be in seconds, or is too short.

    The other columns show whether one of them is the time.
    """
    time = columns["time_s"]
    column = place.column("time_s")
    if time.size < MIN_SAMPLES:
        raise DataError(f"{place.source}, {column}: {time.size} samples; at least {MIN_SAMPLES} are needed: log longer")
    step = np.diff(time)
    if not np.all(step > 0.0):
        _check_time_exchanged(columns, place)
        at = int(np.argmin(step > 0.0)) + 1
        before, here = time[at - 1], time[at]
        if here == before:
            remedy = "keep one row per time, or export time with more digits"
            raise DataError(f"{place.cell(at, 'time_s')}: time {here:g} s is repeated: {remedy}")
        remedy = "sort the rows by time; if a second record starts here, give one record per file"
        raise DataError(f"{place.cell(at, 'time_s')}: time falls from {before:g} to {here:g} s: {remedy}")
    gaps, usual = _gaps(time)
    if not STEP_S[0] <= usual <= STEP_S[1]:
        milliseconds = usual > STEP_S[1]
        unit = argument("time_unit", "'ms'" if milliseconds else "'s'")
        looks = f"milliseconds; pass {unit}" if milliseconds else f"seconds already; pass {unit}"
        raise DataError(
            f"{place.source}, {column}: the usual step is {usual:g} s; a throttle needs {STEP_S[0]:g} to "
            f"{STEP_S[1]:g} s: this looks like {looks}"
        )
    if gaps:
        at = gaps[0]
        missing = round(step[at - 1] / usual) - 1
        raise DataError(
            f"{place.cell(at, 'time_s')}: gap from {time[at - 1]:.6g} to {time[at]:.6g} s where the usual step is "
            f"{usual:.3g} s, about {max(missing, 1)} sample(s) missing: pass "
            f"{argument('stop_s', f'{time[at - 1]:.6g}')} or {argument('start_s', f'{time[at]:.6g}')} to keep one side"
        )
    if time[-1] - time[0] < MIN_DURATION_S:
        raise DataError(
            f"{place.source}, {column}: {time[-1] - time[0]:.3g} s; at least {MIN_DURATION_S:g} s are needed: log more"
        )


def _shifts(time: NDArray[np.float64], at: int, usual: float) -> bool:
    """Whether what follows a wide step comes late: after jitter it comes when it should, and no sample is missing."""
    before = time[max(at + 1 - GAP_WINDOW, 0) : at + 1]
    after = time[at + 1 : at + 1 + GAP_WINDOW]
    due = np.median(before + usual * np.arange(before.size, 0, -1))
    return bool(np.median(after - usual * np.arange(after.size)) - due > 0.5 * usual)


def _check_time_exchanged(columns: Mapping[str, NDArray[np.float64]], place: Place) -> None:
    step = np.diff(columns["time_s"])
    falls = np.flatnonzero(step < 0.0)
    if falls.size <= MANY_FALLS * np.count_nonzero(step):
        return
    at = int(falls[0]) + 1
    what = f"{place.cell(at, 'time_s')}: time falls at {falls.size} of {step.size} steps"
    for name, values in columns.items():
        if name != "time_s" and np.all(np.diff(values) > 0.0):
            option = name.partition("_")[0]
            raise DataError(
                f"{what}, and {place.column(name)} rises throughout: the columns look exchanged; exchange "
                f"{argument('time', '')} and {argument(option, '')}"
            )
    raise DataError(
        f"{what}: columns exchanged? check {argument('time', '')}, {argument('duty', '')} and {argument('angle', '')}; "
        "if they are right, sort the rows by time"
    )


def check_even(time: NDArray[np.float64], place: Place) -> None:
    """Refuse uneven sampling: the models step evenly."""
    remedy = f"pass {argument('sample_s', '{step:g}')} to resample"
    even_step(time, where=lambda at: place.cell(at, "time_s"), remedy=remedy)


def check_signals(
    duty: NDArray[np.float64],
    angle: NDArray[np.float64],
    *,
    place: Place,
    duty_unit: str = "-",
    angle_unit: str = "deg",
    travel_deg: float = 90.0,
) -> None:
    """Refuse a duty or an angle that cannot be one, in the given units; both are converted already."""
    raw_duty = duty * 100.0 if duty_unit == "%" else duty
    raw_angle = {"rad": np.deg2rad(angle), "%": angle * 100.0 / travel_deg}.get(angle_unit, angle)
    _check_exchanged(raw_duty, raw_angle, duty_unit, place)
    _check_duty(raw_duty, duty_unit, place)
    if np.ptp(duty) < STILL_DUTY:
        raise DataError(
            f"{place.span(0, duty.size - 1)}, {place.column('duty')}: the duty stays at {raw_duty[0]:.4g}: check the "
            "column; a constant duty identifies nothing of the throttle: log a varied one "
            "(mgdd.identify.design_excitation)"
        )
    _check_angle(angle, raw_angle, angle_unit, place)


def _check_exchanged(duty: NDArray[np.float64], angle: NDArray[np.float64], duty_unit: str, place: Place) -> None:
    top = int(np.argmax(np.abs(duty)))
    like_angle = np.ptp(duty) > STILL_DEG and duty.min() > -5.0 and 3.0 < duty.max() <= 100.5
    like_duty = np.abs(angle).max() <= 1.0 and np.ptp(angle) > 1e-3
    if duty_unit == "-" and like_angle and like_duty:
        hint = _exchange()
        if angle.min() > -0.1:
            percent, radians = argument("duty_unit", "'%'"), argument("angle_unit", "'rad'")
            hint += f", or, if they are right, pass {percent} and {radians}"
        raise DataError(
            f"{place.cell(top, 'duty')}: {duty[top]:g} beside angles within {angle.min():.3g} to {angle.max():.3g}: "
            f"the columns look exchanged; {hint}"
        )
    lowest = int(np.argmin(angle))
    if duty_unit == "%" and angle.min() < ANGLE_DEG[0] and angle.max() <= 100.0 and duty.min() > -5.0:
        raise DataError(
            f"{place.cell(lowest, 'angle_deg')}: {angle[lowest]:g} is not an opening, and the duty never pulls closed: "
            f"the columns look exchanged; {_exchange()}"
        )


def _check_duty(duty: NDArray[np.float64], unit: str, place: Place) -> None:
    top = int(np.argmax(np.abs(duty)))
    largest = abs(float(duty[top]))
    if unit == "%":
        if 0.0 < largest <= 1.0:
            raise DataError(
                f"{place.cell(top, 'duty')}: the largest duty is {largest:g} %: this looks like a fraction; "
                f"pass {argument('duty_unit', repr('-'))}"
            )
        limit = 100.0
    else:
        limit = 1.0
    if largest <= limit * (1.0 + 1e-9):
        return
    at = int(np.argmax(np.abs(duty) > limit * (1.0 + 1e-9)))
    remedy = "convert it to -1 to 1 first (volts: divide by the supply)"
    if unit == "-" and 3.0 < largest <= 100.0:
        remedy = f"this looks like percent; pass {argument('duty_unit', repr('%'))}"
    elif largest <= 1.05 * limit:
        remedy = "the driver cuts there: clip it"
    raise DataError(f"{place.cell(at, 'duty')}: duty {duty[at]:g} is beyond ±{limit:g}: {remedy}")


def _check_angle(angle: NDArray[np.float64], raw: NDArray[np.float64], unit: str, place: Place) -> None:
    top, lowest = int(np.argmax(raw)), int(np.argmin(raw))
    span = float(np.ptp(angle))
    if unit == "deg" and np.ptp(raw) > 0.01 and np.abs(raw).max() <= RADIANS:
        remedy = f"this looks like radians; pass {argument('angle_unit', repr('rad'))}"
        if raw[lowest] >= -0.1 and raw[top] <= 1.1:
            percent = argument("angle_unit", "'%'")
            remedy += f"; or like a fraction of the travel; multiply it by 100 and pass {percent}"
        raise DataError(f"{place.cell(top, 'angle_deg')}: the highest angle is {raw[top]:.4g} deg: {remedy}")
    if unit == "rad" and raw[top] > RADIANS:
        raise DataError(
            f"{place.cell(top, 'angle_deg')}: the highest angle is {raw[top]:.4g} rad, "
            f"{math.degrees(raw[top]):.0f} deg: this looks like degrees; pass {argument('angle_unit', repr('deg'))}"
        )
    if angle[top] > ANGLE_DEG[1]:
        remedy = "convert it to degrees of the plate first"
        if unit == "deg" and raw[top] <= 105.0:
            remedy = f"this looks like percent of travel; pass {argument('angle_unit', repr('%'))}"
        raise DataError(
            f"{place.cell(top, 'angle_deg')}: the highest angle is {angle[top]:.4g} deg, beyond "
            f"{ANGLE_DEG[1]:g}: {remedy}"
        )
    if angle[lowest] < ANGLE_DEG[0]:
        raise DataError(
            f"{place.cell(lowest, 'angle_deg')}: the lowest angle is {angle[lowest]:.4g} deg, below {ANGLE_DEG[0]:g}: "
            f"count from the closed plate, opening positive; if this is the duty, {_exchange()}"
        )
    if span < STILL_DEG:
        raise DataError(
            f"{place.cell(0, 'angle_deg')}: the angle stays within {span:.2g} deg of {angle[0]:.4g}: check column and "
            "sensor; if the plate did stick, drive it beyond breakaway (mgdd.identify.design_excitation)"
        )


def _exchange() -> str:
    return f"exchange {argument('duty', '')} and {argument('angle', '')}"


def check_sides(log: xr.Dataset, limp_home_deg: float) -> None:
    """Refuse a log, checked already, whose plate was not on both sides of limp-home [deg]."""
    angle, place = log["angle_deg"].to_numpy(), _place_of(log)
    step = even_step(log["time_s"].to_numpy())
    for side, inside, extreme in (
        ("below", angle < limp_home_deg - SIDE_DEG, int(np.argmin(angle))),
        ("above", angle > limp_home_deg + SIDE_DEG, int(np.argmax(angle))),
    ):
        spent = float(inside.sum()) * step
        if spent < SIDE_S:
            end = "lowest" if side == "below" else "highest"
            sign = "negative" if side == "below" else "positive"
            raise DataError(
                f"{place.cell(extreme, 'angle_deg')}: {spent:.2g} s {side} limp-home ({limp_home_deg:g} deg; the {end} "
                f"angle is {angle[extreme]:.4g} deg): a two-sided fit needs both sides; add {sign} duty until "
                "the plate crosses (mgdd.identify.design_excitation), or fit one side with "
                f"{argument('two_sided', 'False')}"
            )
