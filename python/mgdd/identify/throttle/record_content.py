"""What a record of duty and angle contains: sides, directions, speeds, stops; and what it does not identify."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mgdd.results.finding import Finding
from mgdd.results.result import NumbersResult
from mgdd.signals.even_grid import even_step

# Speed and travel are taken over 20 ms, travel with a play of 0.1 deg: beyond the noise of a 12-bit sensor.
_SPEED_WINDOW_S = 0.02
_PLAY_DEG = 0.1
_LEAST_TRAVEL_DEG = 1.0
_CROSSING_DEG = 0.5
_STOP_DEG = 0.5
_LEAST_SHARE = 0.05
_LEAST_SIDE_S = 0.1
# Below this the inertia adds less than a tenth of the friction of known throttles.
_FAST_DEG_PER_S = 60.0
_TRIANGLE_HZ = 0.05
_AGAINST = 0.3  # of 66 sound records it is 0.48 to 0.99, of those against it less that
_FEWEST = 50  # samples between the stops


@dataclass(frozen=True, kw_only=True, repr=False)
class RecordContent(NumbersResult):
    """Sides, directions, speeds and stops of one record.

    Parameters
    ----------
    angle_low_deg, angle_high_deg : float
        Range of the angle [deg].
    peak_speed_deg_per_s : float
        Highest speed, over 20 ms [deg/s].
    travel_open_deg, travel_closed_deg : float
        Way that the plate went in each direction, noise left out [deg].
    time_above_s, time_below_s : float
        Time more than 0.5 deg above and below limp-home [s]; NaN if limp-home is unknown.
    limp_home_crossings : int
        Crossings from 0.5 deg on one side to 0.5 deg on the other.
    time_at_stops_s : float
        Time within 0.5 deg of an end stop [s]; 0 if the stops are unknown.
    duration_s : float
        Length [s].
    limp_home_deg : float
        As given, or NaN [deg].
    """

    angle_low_deg: float
    angle_high_deg: float
    peak_speed_deg_per_s: float
    travel_open_deg: float
    travel_closed_deg: float
    time_above_s: float
    time_below_s: float
    limp_home_crossings: int
    time_at_stops_s: float
    duration_s: float
    limp_home_deg: float


def record_content(
    time: NDArray[np.float64],
    angle: NDArray[np.float64],
    *,
    limp_home_deg: float | None = None,
    stops_deg: tuple[float, float] | None = None,
) -> RecordContent:
    """Describe a record; `stops_deg` are the ends of the travel [deg]."""
    step = even_step(time)
    lag = max(1, min(round(_SPEED_WINDOW_S / step), time.size - 1))
    speed = (angle[lag:] - angle[:-lag]) / (lag * step)
    opened, closed = _travel(angle, lag)
    above = below = math.nan
    crossings = 0
    if limp_home_deg is not None:
        side = np.where(angle > limp_home_deg + _CROSSING_DEG, 1, 0) - np.where(
            angle < limp_home_deg - _CROSSING_DEG, 1, 0
        )
        above, below = float((side > 0).sum()) * step, float((side < 0).sum()) * step
        crossings = int(np.count_nonzero(np.diff(side[side != 0])))
    at_stops = 0.0
    if stops_deg is not None:
        at_stops = float(((angle < stops_deg[0] + _STOP_DEG) | (angle > stops_deg[1] - _STOP_DEG)).sum()) * step
    return RecordContent(
        angle_low_deg=float(angle.min()),
        angle_high_deg=float(angle.max()),
        peak_speed_deg_per_s=float(np.abs(speed).max()),
        travel_open_deg=opened,
        travel_closed_deg=closed,
        time_above_s=above,
        time_below_s=below,
        limp_home_crossings=crossings,
        time_at_stops_s=at_stops,
        duration_s=float(time[-1] - time[0]) + step,
        limp_home_deg=math.nan if limp_home_deg is None else limp_home_deg,
    )


def moves_against(
    time: NDArray[np.float64], duty: NDArray[np.float64], angle: NDArray[np.float64], stops_deg: tuple[float, float]
) -> tuple[Finding, ...]:
    """Name a plate that closes where the duty rises: what is left of speed and duty at the same angle, correlated."""
    step = even_step(time)
    lag = max(1, min(round(_SPEED_WINDOW_S / step), time.size // 4))
    speed = (angle[lag:] - angle[:-lag]) / (lag * step)
    mean_duty = (np.cumsum(np.r_[0.0, duty])[lag:] - np.cumsum(np.r_[0.0, duty])[:-lag])[: speed.size] / lag
    middle = 0.5 * (angle[lag:] + angle[:-lag])
    free = (middle > stops_deg[0] + _STOP_DEG) & (middle < stops_deg[1] - _STOP_DEG)
    strongest = 0.0
    for delay in range(0, min(4 * lag, speed.size // 2), max(1, lag // 4)):
        taken = free[delay:]
        if taken.sum() < _FEWEST:
            continue
        columns = np.column_stack([middle[delay:][taken], np.ones(int(taken.sum()))])
        both = np.column_stack([speed[delay:][taken], mean_duty[: speed.size - delay][taken]])
        left = both - columns @ np.linalg.lstsq(columns, both, rcond=None)[0]
        size = float(np.sqrt((left**2).sum(axis=0)).prod())
        own = float((left[:, 0] * left[:, 1]).sum()) / size if size > 0.0 else 0.0
        strongest = own if abs(own) > abs(strongest) else strongest
    if strongest > -_AGAINST:
        return ()
    text = f"the plate moves against the duty (correlation {strongest:.2f} at the same angle)"
    remedy = "negate the duty, or count the angle from closed to open"
    return (Finding("moves_against_duty", (), text, remedy),)


def _travel(angle: NDArray[np.float64], window: int) -> tuple[float, float]:
    """Return the way up and the way down of the means over `window` samples, seen through a play."""
    blocks = angle[: angle.size // window * window].reshape(-1, window).mean(axis=1).tolist()
    held, up, down = blocks[0], 0.0, 0.0
    for value in blocks:
        moved = max(value - _PLAY_DEG, min(held, value + _PLAY_DEG)) - held
        up, down = up + max(moved, 0.0), down - min(moved, 0.0)
        held += moved
    return up, down


def open_questions(
    content: RecordContent, *, swing: float, pairs: Iterable[tuple[str, str, float]] = ()
) -> tuple[Finding, ...]:
    """Return what the record leaves open, each with the excitation that would settle it.

    `swing` is the duty amplitude that moves the plate across limp-home [-]; `pairs` are correlated parameters of a fit.
    """
    lh = content.limp_home_deg
    where = "" if math.isnan(lh) else f" ({lh:.3g} deg)"
    ramp = f"a triangle of ±{swing:.2g} duty at {_TRIANGLE_HZ:g} Hz across limp-home{where}"
    findings: list[Finding] = []

    def add(code: str, text: str, remedy: str, *names: str) -> None:
        findings.append(Finding(code, names, text, remedy))

    if content.travel_open_deg + content.travel_closed_deg < _LEAST_TRAVEL_DEG:
        text = "the plate hardly moves: nothing but a lower bound of the breakaway duty can be learned"
        return (Finding("no_motion", (), text, f"drive it with {ramp}"),)
    up, down = content.travel_open_deg, content.travel_closed_deg
    one_way = min(up, down) < _LEAST_SHARE * max(up, down)
    if one_way:
        way = "opens" if up > down else "closes"
        add(
            "one_way",
            f"the plate only {way}: Coulomb torque and preload push the same way and are indistinguishable in this log",
            f"add {ramp}, which moves it both ways",
        )
    for first, second, value in pairs:
        if not (one_way and {_kind(first), _kind(second)} == {"Coulomb", "preload"}):
            add(
                "indistinguishable",
                f"{first} and {second} are indistinguishable in this log (correlation {value:+.3f})",
                _remedy(first, second, ramp),
                first,
                second,
            )
    if not math.isnan(lh):
        for side, spent, sign in (("below", content.time_below_s, -1.0), ("above", content.time_above_s, 1.0)):
            if spent < _LEAST_SIDE_S:
                extreme = content.angle_low_deg if sign < 0.0 else content.angle_high_deg
                add(
                    "side_not_visited",
                    f"the plate never goes {side} limp-home{where}, the {'lowest' if sign < 0.0 else 'highest'} angle "
                    f"is {extreme:.1f} deg: spring and preload {side} it stay unknown",
                    f"add {ramp}",
                    side,
                )
    if content.peak_speed_deg_per_s < _FAST_DEG_PER_S:
        add(
            "too_slow",
            f"the plate moves at most {content.peak_speed_deg_per_s:.0f} deg/s: inertia, damping and delay hardly act",
            f"add a chirp to 6 Hz or steps of ±{swing:.2g} duty",
        )
    if content.time_at_stops_s > 0.3 * content.duration_s:
        share = 100.0 * content.time_at_stops_s / content.duration_s
        add(
            "on_stop",
            f"the plate rests on an end stop {share:.0f} % of the time, which identifies nothing",
            "lower offset or amplitude",
        )
    return tuple(findings)


def _kind(name: str) -> str:
    for word, kind in (("coulomb", "Coulomb"), ("delta", "Coulomb"), ("preload", "preload"), ("beta", "preload")):
        if word in name:
            return kind
    return "tau" if "tau" in name or "damping" in name or "inertia" in name else "other"


def _remedy(first: str, second: str, ramp: str) -> str:
    kinds = {_kind(first), _kind(second)}
    if "tau" in kinds and not kinds & {"Coulomb", "preload"}:
        return "add a chirp to 6 Hz, fast enough for the inertia to show against the damping"
    return f"add {ramp}"
