"""Duty signals: designed for a throttle, and judged before they are sent: what the plate would do, and show."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import ConvergenceError, ParameterError, argument
from mgdd.identify.throttle.prior import DutyGroups, prior_of
from mgdd.identify.throttle.record_content import RecordContent, open_questions, record_content
from mgdd.results.finding import Finding
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import Result
from mgdd.signals.even_grid import even_step
from mgdd.signals.excitation import amplitude_random_steps, chirp, multisine, prbs, staircase, triangle
from mgdd.signals.model import as_signal

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True, repr=False)
class ExcitationCheck(Result):
    """What the prior model does under an excitation, and the verdict.

    Parameters
    ----------
    passed : bool
        Whether every limit holds.
    findings : tuple of Finding
        Each limit that is passed, with the remedy.
    unanswered : tuple of Finding
        Parameters that a log of this excitation would not identify, and which one would.
    content : RecordContent
        Range, speeds, directions, crossings and stops of the predicted angle.
    peak_current_a, rms_current_a : float
        Predicted motor current [A]; NaN if the prior model has none.
    prediction : xarray.Dataset
        ``duty``, ``angle_deg`` and, where the model has it, ``current_a`` over ``time_s``.
    """

    passed: bool
    findings: tuple[Finding, ...]
    unanswered: tuple[Finding, ...]
    content: RecordContent
    peak_current_a: float
    rms_current_a: float
    prediction: xr.Dataset = field(repr=False)

    @property
    def dataset(self) -> xr.Dataset:
        """The prediction."""
        return self.prediction

    def _draw(self, ax: Any) -> Any:
        from mgdd.plot import throttle_run

        return throttle_run(self.prediction, ax=ax)

    def summary(self) -> str:
        """Return a short summary."""
        c = self.content
        lines = [
            "inside the limits" if self.passed else "outside the limits",
            f"angle {c.angle_low_deg:.1f} to {c.angle_high_deg:.1f} deg, at most {c.peak_speed_deg_per_s:.0f} deg/s",
            f"{c.limp_home_crossings} limp-home crossing(s), {c.time_at_stops_s:.2f} s at the stops",
        ]
        if not math.isnan(self.peak_current_a):
            lines.append(f"current up to {self.peak_current_a:.2f} A, {self.rms_current_a:.2f} A RMS")
        lines += [f"  {text}" for text in self.findings]
        if self.unanswered:
            lines += ["a log of it would leave open:", *(f"  {text}" for text in self.unanswered)]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Give the figures and sentences as a dict, without the prediction."""
        figures = {name: getattr(self, name) for name in ("passed", "peak_current_a", "rms_current_a")}
        words = {name: [str(finding) for finding in getattr(self, name)] for name in ("findings", "unanswered")}
        return figures | {name: getattr(self.content, name) for name in RecordContent.__dataclass_fields__} | words


def check_excitation(
    excitation: Any,
    prior: Any,
    *,
    angle_window_deg: tuple[float, float] | None = None,
    max_rate_deg_per_s: float | None = None,
    max_current_a: float | None = None,
    start_deg: float | None = None,
) -> ExcitationCheck:
    """Simulate an excitation on a prior model before it is sent.

    Parameters
    ----------
    excitation : Dataset, DataFrame, mapping of columns, DataArray or Series
        ``duty`` over ``time_s``, as `chirp` and its sisters make it.
    prior : Throttle, Preset, str or path-like, Model, Fit or callable
        What is known of the throttle: its parameters, a preset or its name, or a fitted model. A callable gets
        ``(time_s, duty, start_deg)`` and gives the angle [deg], or a mapping with ``angle_deg`` and ``current_a``.
    angle_window_deg : (float, float), optional
        Where the plate may go [deg]; None keeps it 1 deg away from its stops.
    max_rate_deg_per_s : float, optional
        Highest speed [deg/s].
    max_current_a : float, optional
        Highest motor current [A].
    start_deg : float, optional
        Where the plate starts [deg]; None: at limp-home, without which in the middle of the window.

    Returns
    -------
    ExcitationCheck
        Figures, verdict, remedies, and what a log of it would leave open.

    Raises
    ------
    ParameterError
        A window that is upside down, a start outside it, a limit that is not positive, a current limit for a model
        without current.
    DataError
        An excitation without ``duty`` over ``time_s``.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import check_excitation
    >>> from mgdd.signals import triangle
    >>> def lazy(time_s, duty, start_deg):
    ...     return 30.0 + 100.0 * np.asarray(duty)
    >>> check_excitation(triangle(offset=0.0, amplitude=0.2), lazy).passed
    True
    """
    excitation = as_signal(excitation, ("time_s", "duty"), what="excitation")
    time, duty = _signal_of(excitation)
    throttle = prior_of(prior)
    window = throttle.window_deg if angle_window_deg is None else angle_window_deg
    low, high = window
    if not low < high:
        named = argument("angle_window_deg")
        raise ParameterError(f"{named} = ({low:g}, {high:g}): the first must be below the second")
    for name, value in (("max_rate_deg_per_s", max_rate_deg_per_s), ("max_current_a", max_current_a)):
        ParameterError.unless(value is None or value > 0.0, name, value, "> 0")
    start = start_deg
    if start is None:
        start = 0.5 * (window[0] + window[1]) if throttle.limp_home_deg is None else throttle.limp_home_deg
    answer = throttle.simulate(time, duty, start)
    angle, current = answer["angle_deg"], answer.get("current_a")
    if max_current_a is not None and current is None:
        raise ParameterError(f"max_current_a = {max_current_a:g}: the prior model has no current; leave the limit out")
    content = record_content(time, angle, limp_home_deg=throttle.limp_home_deg, stops_deg=throttle.stops_deg)
    peak = math.nan if current is None else float(np.abs(current).max())
    findings = _violations(content, peak, window, max_rate_deg_per_s, max_current_a)
    variables: dict[str, Any] = {"time_s": ("time_s", time), "duty": ("time_s", duty), "angle_deg": ("time_s", angle)}
    if current is not None:
        variables["current_a"] = ("time_s", current)
    return ExcitationCheck(
        passed=not findings,
        findings=findings,
        unanswered=open_questions(content, swing=throttle.swing),
        content=content,
        peak_current_a=peak,
        rms_current_a=math.nan if current is None else float(np.sqrt(np.mean(current**2))),
        prediction=labelled_dataset(variables, attrs=dict(excitation.attrs)),
    )


def _signal_of(excitation: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    from mgdd.errors import DataError

    for name in ("time_s", "duty"):
        if name not in excitation.variables or excitation[name].dims != ("time_s",):
            raise DataError(f"excitation has no {name}(time_s): mgdd.signals.chirp and its sisters make one")
    time, duty = (np.asarray(excitation[name].to_numpy(), dtype=np.float64) for name in ("time_s", "duty"))
    even_step(time)
    return time, duty


def _violations(
    content: RecordContent,
    peak_current_a: float,
    window: tuple[float, float],
    max_rate_deg_per_s: float | None,
    max_current_a: float | None,
) -> tuple[Finding, ...]:
    findings: list[Finding] = []

    def add(name: str, text: str, remedy: str) -> None:
        findings.append(Finding("limit_exceeded", (name,), text, remedy))

    if content.angle_high_deg > window[1]:
        add(
            "angle_window_deg",
            f"the plate opens to {content.angle_high_deg:.1f} deg, beyond {window[1]:g}",
            f"lower offset or amplitude, or widen {argument('angle_window_deg')} if it may",
        )
    if content.angle_low_deg < window[0]:
        add(
            "angle_window_deg",
            f"the plate closes to {content.angle_low_deg:.1f} deg, beyond {window[0]:g}",
            f"raise the offset or lower the amplitude, or widen {argument('angle_window_deg')} if it may",
        )
    if max_rate_deg_per_s is not None and content.peak_speed_deg_per_s > max_rate_deg_per_s:
        add(
            "max_rate_deg_per_s",
            f"the plate moves at {content.peak_speed_deg_per_s:.0f} deg/s, above {max_rate_deg_per_s:g}",
            "lower the amplitude",
        )
    if max_current_a is not None and peak_current_a > max_current_a:
        text = f"the motor takes {peak_current_a:.2f} A, above {max_current_a:g}"
        add("max_current_a", text, "lower the amplitude")
    return tuple(findings)


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
        What is known of the throttle; it must have limp-home and friction.
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
        An unknown kind or side, a prior without limp-home or friction, and all of `check_excitation`.
    ConvergenceError
        Nothing useful stays inside the limits; the message states what the smallest one still violates.

    Examples
    --------
    >>> from mgdd.throttle import Throttle
    >>> from mgdd.identify import design_excitation
    >>> signal, check = design_excitation("chirp", Throttle(), duration_s=4.0)
    >>> check.passed, 0.1 < signal.attrs["offset"] < 0.2
    (True, True)
    """
    ParameterError.unless(kind in EXCITATIONS, "kind", kind, f"one of {', '.join(map(repr, EXCITATIONS))}")
    ParameterError.unless(side in ("above", "below", "both"), "side", side, "one of 'above', 'below', 'both'")
    model = prior_of(prior)
    if model.groups is None or model.limp_home_deg is None:
        raise ParameterError("prior: has no limp-home angle and friction; pass a Throttle, for example a preset")
    window = angle_window_deg
    if window is None:
        low, high = model.stops_deg
        window = model.window_deg
        if side != "above" or kind in _QUASI_STATIC:
            window = (low - _STOP_DEG, window[1])
        if kind in _QUASI_STATIC:
            window = (window[0], high + _STOP_DEG)
    make = _maker(kind, side, duration_s, sample_s)
    check: ExcitationCheck | None = None
    for factor in _OVER_FRICTION:
        offset, amplitude = _rule(model.groups, model.limp_home_deg, window, side, factor, slow=kind in _QUASI_STATIC)
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
