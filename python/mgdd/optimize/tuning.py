"""From noise, curvature and sensor delay to a tuned seeker, and why a specification is infeasible, where it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mgdd import _core
from mgdd.optimize.direct_seekers import Spsa
from mgdd.optimize.dither_seekers import ExtremumSeeking
from mgdd.optimize.optimum import limits_of
from mgdd.results.result import NumbersResult

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["Tuning", "tune"]


@dataclass(frozen=True, kw_only=True, repr=False)
class Tuning(NumbersResult):
    """Settings of a seeker, what averaging theory predicts for them, and whether that meets the specification.

    Attributes
    ----------
    method : str
        ``"batch"``, ``"moving_average"`` or ``"spsa"``.
    amplitude : float
        Of the dither, or perturbation c of SPSA [unit of the input].
    period : int
        Cycles per period, or measurements per iteration of SPSA.
    gain : float
        Adaptation gain [unit of the input per unit of J; SPSA: squared].
    rate : float
        Largest change of the estimate per cycle (SPSA: per iteration) [unit of the input].
    time_constant_cycles : float
        Of the approach near the optimum [cycles].
    rms : float
        Predicted error of the estimate once arrived [unit of the input].
    cycles : float
        Predicted cycles from `distance` to `arrival` of the specification.
    dither_cost, jitter_cost : float
        Mean loss of J by the perturbation and by that error [unit of J].
    sensor_gain, sensor_phase_deg : float
        What delay and lag leave of the dither's echo [-], and how far they turn it [deg].
    delay_uncertainty : float
        Error of the delay that the period allows for [cycles].
    met : bool
        Whether the specification is met.
    reasons : tuple of str
        Why not, with the figures that would do.
    noise_sd, curvature : float
        What it was made from.
    delay_cycles, lag_cycles : float
        Between the plant and J [cycles].
    compensated : bool
        Whether the seeker turns its demodulation back by that phase.

    See Also
    --------
    tune : makes one.

    Examples
    --------
    >>> from mgdd.optimize import tune
    >>> tuning = tune(0.25, -0.051, distance=12.0, arrival=1.0)
    >>> tuning.met, tuning.period
    (True, 6)
    """

    method: str
    amplitude: float
    period: int
    gain: float
    rate: float
    time_constant_cycles: float
    rms: float
    cycles: float
    dither_cost: float
    jitter_cost: float
    sensor_gain: float
    sensor_phase_deg: float
    delay_uncertainty: float
    met: bool
    reasons: tuple[str, ...]
    noise_sd: float
    curvature: float
    delay_cycles: float
    lag_cycles: float
    compensated: bool

    def summary(self) -> str:
        """Say settings, prediction and verdict as text.

        Returns
        -------
        str
            A few lines; the last ones say why the specification is infeasible.

        Examples
        --------
        >>> from mgdd.optimize import tune
        >>> print(tune(0.25, -0.051, cycles=10.0).summary().splitlines()[-2])
        The specification cannot be met:
        """
        spsa = self.method == "spsa"
        period = f"{self.period} measurements per iteration" if spsa else f"period {self.period} cycles"
        size, unit = ("perturbation", "iteration") if spsa else ("amplitude", "cycle")
        lines = [
            f"{self.method}: {size} {self.amplitude:.4g}, {period}",
            f"gain {self.gain:.4g}, at most {self.rate:.4g} per {unit}",
            f"expect an rms error of {self.rms:.3g}, and arrival after {self.cycles:.0f} cycles",
            f"cost in J: {self.dither_cost:.3g} by the perturbation, {self.jitter_cost:.3g} by the error",
        ]
        if self.delay_cycles > 0.0 or self.lag_cycles > 0.0:
            known = "turned back" if self.compensated else "not compensated"
            lines.append(
                f"the sensor leaves {100.0 * self.sensor_gain:.0f} % of the echo and turns it by "
                f"{self.sensor_phase_deg:.0f} deg ({known})"
            )
        if self.delay_uncertainty > 0.0:
            lines.append(f"the delay may be wrong by {self.delay_uncertainty:.3g} cycles either way")
        if self.met:
            lines.append("The specification is met.")
        else:
            lines += ["The specification cannot be met:", *(f"  {reason}" for reason in self.reasons)]
        return "\n".join(lines)

    def seeker(
        self,
        *,
        start: float,
        lower: float = -math.inf,
        upper: float = math.inf,
        maximize: bool = True,
        limits: Mapping[str, float] | Sequence[_core.optimize.Limit] = (),
        hold_cycles: int | None = None,
        seed: int = 0,
    ) -> ExtremumSeeking | Spsa:
        """Make the tuned seeker of one input.

        Parameters
        ----------
        start : float
            First estimate, in the unit of the input.
        lower, upper : float
            Bounds of the applied input; the start must lie inside by `amplitude`.
        maximize : bool
            False to minimise J.
        limits : mapping of str to float, or sequence of Limit
            Measured quantities to keep.
        hold_cycles : int, optional
            Cycles that the estimate is held at the start; one period without. Not for SPSA.
        seed : int
            Of the random signs of SPSA; extremum seeking has none.

        Returns
        -------
        ExtremumSeeking or Spsa
            Extremum seeking of the tuned form, or SPSA with constant gains.

        Raises
        ------
        ParameterError
            Bounds that exclude the start.

        Examples
        --------
        >>> from mgdd.optimize import tune
        >>> tune(0.25, -0.051).seeker(start=-15.0, lower=-30.0, upper=10.0)
        <ExtremumSeeking cycle 0, estimate [-15.]>
        """
        if self.method == "spsa":
            return Spsa(
                start=start,
                lower=lower,
                upper=upper,
                schedule="constant",
                gain=self.gain,
                perturbation=self.amplitude,
                step_max=self.rate,
                noise_sd=self.noise_sd,
                seed=seed,
                maximize=maximize,
                limits=list(limits_of(limits)),
                curvature=self.curvature,
            )
        lag = _core.optimize.ComponentLag()
        seen = self.curvature
        if self.compensated:
            lag = _core.optimize.ComponentLag(delay_cycles=self.delay_cycles, lag_cycles=self.lag_cycles)
        else:  # the demodulation sees what the sensor leaves in phase
            seen *= self.sensor_gain * math.cos(math.radians(self.sensor_phase_deg))
        return ExtremumSeeking(
            start=start,
            lower=lower,
            upper=upper,
            form=self.method,
            amplitude=self.amplitude,
            period=self.period,
            gain=self.gain,
            rate=self.rate,
            components=[lag],
            hold_cycles=hold_cycles,
            maximize=maximize,
            limits=list(limits_of(limits)),
            curvature=seen,
        )


def tune(
    noise_sd: float,
    curvature: float,
    *,
    method: str = "batch",
    delay_cycles: float = 0.0,
    lag_cycles: float = 0.0,
    compensated: bool = True,
    delay_uncertainty: float | None = None,
    rms: float | None = None,
    cycles: float | None = None,
    distance: float | None = None,
    arrival: float | None = None,
    amplitude_max: float | None = None,
) -> Tuning:
    """Choose amplitude, period and gain of a seeker from noise, curvature and sensor delay.

    What is left open scales with L = sqrt(noise_sd/abs(curvature)), the distance from the optimum at which J
    has fallen by half a standard deviation of its noise.

    Parameters
    ----------
    noise_sd : float
        Standard deviation of J from cycle to cycle, > 0 [unit of J].
    curvature : float
        J'' at the optimum; the sign is not used [unit of J per squared unit of the input].
    method : {"batch", "moving_average", "spsa"}
        Extremum seeking in one of two forms, or SPSA with constant gains.
    delay_cycles, lag_cycles : float
        Transport delay and time constant between the plant and J [cycles].
    compensated : bool
        Whether the seeker knows them; without, the dither is slowed until they turn it little.
    delay_uncertainty : float, optional
        How far delay and lag may be from the truth, >= 0 [cycles]: the period is long enough that such an error turns
        the echo by at most 60 deg. A fifth of their sum and 2 at least where there is one, else 0. 0 asks for the
        shortest period; then an error of a quarter of the period makes the seeker run away.
    rms : float, optional
        Specified error of the estimate after arrival [unit of the input]; 0.2 L.
    cycles : float, optional
        Specified cycles to arrive; 50, more where a lag asks for it.
    distance, arrival : float, optional
        Error at the start, and what counts as arrived [unit of the input]; 5 L and 0.45 L.
    amplitude_max : float, optional
        Largest perturbation that may be applied [unit of the input]; 1.8 L.

    Returns
    -------
    Tuning
        Settings and prediction; `met` and `reasons` say whether the specification is met.

    Raises
    ------
    ParameterError
        Noise, curvature or a specification that is not positive; a negative uncertainty; SPSA behind a delayed sensor.

    References
    ----------
    Tan, Nesic and Mareels (2006), On non-local stability properties of extremum seeking control.
    Spall (1998), Implementation of the simultaneous perturbation algorithm.

    Examples
    --------
    >>> from mgdd.optimize import tune
    >>> tuning = tune(0.25, -0.051, distance=12.0, arrival=1.0, cycles=80.0)
    >>> print(tuning.summary().splitlines()[-1])
    The specification is met.
    >>> [tune(0.25, -0.051, delay_cycles=20.0, delay_uncertainty=u).period for u in (None, 0.0)]
    [24, 6]
    """
    found = _core.optimize.tune(
        noise_sd=noise_sd,
        curvature=curvature,
        method=method,
        delay_cycles=delay_cycles,
        lag_cycles=lag_cycles,
        compensated=compensated,
        delay_uncertainty=delay_uncertainty,
        rms=rms,
        cycles=cycles,
        distance=distance,
        arrival=arrival,
        amplitude_max=amplitude_max,
    )
    values: dict[str, Any] = dict(found)
    values["reasons"] = tuple(values["reasons"])
    return Tuning(
        **values,
        noise_sd=noise_sd,
        curvature=curvature,
        delay_cycles=delay_cycles,
        lag_cycles=lag_cycles,
        compensated=compensated,
    )
