"""Offset and amplitude of an excitation from what is known of the throttle, until the prior model stays inside."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mgdd.errors import ConvergenceError, ParameterError
from mgdd.identify.throttle.excitation_check import ExcitationCheck, check_excitation
from mgdd.identify.throttle.prior import DutyGroups, prior_of
from mgdd.signals.excitation import amplitude_random_steps, chirp, multisine, prbs, staircase, triangle

if TYPE_CHECKING:
    import xarray as xr

EXCITATIONS = ("chirp", "multisine", "prbs", "amplitude_random_steps", "staircase", "triangle")
_LENGTHS = {"chirp": 12.0, "multisine": 20.0, "amplitude_random_steps": 10.0, "triangle": 40.0}
_QUASI_STATIC = ("staircase", "triangle")
# Amplitude over dry friction, from the largest that is useful down to where the plate barely moves.
_OVER_FRICTION = (2.2, 2.0, 1.8, 1.65, 1.5, 1.4, 1.3, 1.2, 1.1)
_RECENTRE = 0.002  # duty per deg by which the middle of the run misses the middle of the window
_CORRECTIONS = 8
_STOP_DEG = 0.5  # overrun of a stop at the speed of an excitation


def design_excitation(
    kind: str,
    prior: Any,
    *,
    side: str = "above",
    duration_s: float | None = None,
    sample_s: float = 1e-3,
    angle_window_deg: tuple[float, float] | None = None,
    max_rate_deg_per_s: float | None = None,
    max_current_a: float | None = None,
    start_deg: float | None = None,
) -> tuple[xr.Dataset, ExcitationCheck]:
    """Choose offset and amplitude of an excitation and prove them on the prior model.

    Above or below limp-home the offset carries preload and spring in the middle of the window, and the amplitude is
    1.1 to 2.2 times the dry friction, the largest that passes; friction and a weak spring let the plate drift, so the
    offset is moved until the run is centred. Across limp-home the offset is zero and the amplitude covers preload,
    spring and friction. Staircase and triangle cover them too, on their side.

    Parameters
    ----------
    kind : {"chirp", "multisine", "prbs", "amplitude_random_steps", "staircase", "triangle"}
        The signal; its other parameters keep their defaults, except a chirp below limp-home: 0.5 to 8 Hz.
    prior : Throttle or Model
        What is known of the throttle; it must know limp-home and friction.
    side : {"above", "below", "both"}
        Side of limp-home to be identified.
    duration_s : float, optional
        Length [s]; None takes the default of the signal.
    sample_s : float
        Sample time [s].
    angle_window_deg : (float, float), optional
        Where the plate may go [deg]. None keeps it 1 deg off its stops above limp-home; below it, across it, and for
        slow signals, which run through the whole travel of a weak spring, the stops may be touched.
    max_rate_deg_per_s, max_current_a : float, optional
        Highest speed [deg/s] and current [A].
    start_deg : float, optional
        Where the plate starts [deg]; None: at limp-home.

    Returns
    -------
    xarray.Dataset
        ``duty`` over ``time_s``.
    ExcitationCheck
        The check it has passed.

    Raises
    ------
    ParameterError
        An unknown kind or side, a prior that knows no limp-home or friction, and all of `check_excitation`.
    ConvergenceError
        Nothing useful stays inside the limits; the message says what the smallest one still violates.

    Examples
    --------
    >>> from mgdd.throttle import Throttle
    >>> from mgdd.identify import design_excitation
    >>> signal, check = design_excitation("chirp", Throttle(), duration_s=4.0)
    >>> check.passed, 0.1 < signal.attrs["offset"] < 0.2
    (True, True)
    """
    if kind not in EXCITATIONS:
        raise ParameterError.of("kind", kind, f"one of {', '.join(map(repr, EXCITATIONS))}")
    if side not in ("above", "below", "both"):
        raise ParameterError.of("side", side, "one of 'above', 'below', 'both'")
    known = prior_of(prior)
    if known.groups is None or known.limp_home_deg is None:
        raise ParameterError("prior: knows no limp-home angle and friction; pass a Throttle, for example a preset")
    window = angle_window_deg
    if window is None:
        low, high = known.stops_deg
        window = known.window_deg
        if side != "above" or kind in _QUASI_STATIC:
            window = (low - _STOP_DEG, window[1])
        if kind in _QUASI_STATIC:
            window = (window[0], high + _STOP_DEG)
    make = _maker(kind, side, duration_s, sample_s)
    check: ExcitationCheck | None = None
    for factor in _OVER_FRICTION:
        offset, amplitude = _rule(known.groups, known.limp_home_deg, window, side, factor, slow=kind in _QUASI_STATIC)
        for _ in range(_CORRECTIONS):
            amplitude = min(amplitude, 1.0 - abs(offset))
            signal = make(offset, amplitude)
            check = check_excitation(
                signal,
                prior,
                angle_window_deg=window,
                max_rate_deg_per_s=max_rate_deg_per_s,
                max_current_a=max_current_a,
                start_deg=start_deg,
            )
            if check.passed:
                return signal, check
            miss = 0.5 * (check.content.angle_low_deg + check.content.angle_high_deg) - 0.5 * (window[0] + window[1])
            if side == "both" or kind in _QUASI_STATIC or abs(miss) < 1.0:
                break
            offset = max(min(offset - _RECENTRE * miss, 0.99), -0.99)
    last = "; ".join(map(str, check.findings)) if check is not None else "nothing was tried"
    raise ConvergenceError(
        f"no {kind} {'across' if side == 'both' else side} limp-home stays inside: with amplitude "
        f"{amplitude:.3g} around "
        f"{offset:.3g}, {last}"
    )


def _rule(
    groups: DutyGroups, limp_home_deg: float, window: tuple[float, float], side: str, factor: float, *, slow: bool
) -> tuple[float, float]:
    """Return offset and amplitude."""
    reach_up, reach_down = max(window[1] - limp_home_deg, 0.0), max(limp_home_deg - window[0], 0.0)
    up = groups.preload_above + groups.spring_above_per_deg * (reach_up if slow else 0.5 * reach_up)
    down = groups.preload_below + groups.spring_below_per_deg * (reach_down if slow else 0.5 * reach_down)
    friction = factor * groups.coulomb
    if side == "both":
        extra = (0.5 * factor if slow else factor) * groups.coulomb
        return 0.5 * (up - down), 0.5 * (up + down) + max(extra, 1.1 * groups.coulomb)
    sign, hold = (1.0, up) if side == "above" else (-1.0, down)
    if slow:
        # From where the spring wins over friction to where the duty wins over both.
        top = hold + max(0.5 * factor, 1.05) * groups.coulomb
        bottom = (groups.preload_above if side == "above" else groups.preload_below) - 1.1 * groups.coulomb
        return sign * 0.5 * (top + bottom), 0.5 * (top - bottom)
    return sign * hold, friction


def _maker(kind: str, side: str, duration_s: float | None, sample_s: float) -> Callable[[float, float], xr.Dataset]:
    def make(offset: float, amplitude: float) -> xr.Dataset:
        if kind == "staircase":
            if duration_s is not None:
                raise ParameterError("duration_s: a staircase lasts as long as its steps; leave it out")
            return staircase(offset=offset, amplitude=amplitude, sample_s=sample_s)
        if kind == "prbs":
            return prbs(duration_s, offset=offset, amplitude=amplitude, sample_s=sample_s)
        length = _LENGTHS[kind] if duration_s is None else duration_s
        if kind == "chirp":
            low, high = (0.5, 8.0) if side == "below" else (0.2, 6.0)
            return chirp(length, offset=offset, amplitude=amplitude, low_hz=low, high_hz=high, sample_s=sample_s)
        if kind == "multisine":
            return multisine(length, offset=offset, amplitude=amplitude, sample_s=sample_s)
        if kind == "triangle":
            return triangle(length, offset=offset, amplitude=amplitude, sample_s=sample_s)
        return amplitude_random_steps(length, offset=offset, amplitude=amplitude, sample_s=sample_s)

    return make
