"""From noise, curvature and sensor delay to a tuned seeker, and why a specification is infeasible, where it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError
from mgdd.optimize.direct_seekers import ExtremumSeeking, Spsa
from mgdd.optimize.inputs import SEVERAL_ONLY, InputNumbers, bounds_pair, inputs_of, named_values
from mgdd.optimize.optimum import limits_of
from mgdd.optimize.tuning_forms import check_wish, coupling_of, hessian_of, of_each, per_input, tuned

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    PerInput = float | ArrayLike | Mapping[str, float]

_COUPLED = 0.5  # of the curvature of the flattest direction beside that of the inputs


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Tuning(InputNumbers):
    """Settings of a seeker, what averaging theory predicts for them, and whether that meets the specification.

    Where it says "per input", a float for one input and an array for several.

    Attributes
    ----------
    method : str
        ``"batch"``, ``"moving_average"`` or ``"spsa"``.
    amplitude : float or numpy.ndarray
        Of the dither, or perturbation c of SPSA, per input [unit of the input].
    period : int
        Cycles per period, or measurements per iteration of SPSA.
    gain : float or numpy.ndarray
        Adaptation gain, per input [unit of the input per unit of J; SPSA: squared].
    rate : float or numpy.ndarray
        Largest change of the estimate per cycle (SPSA: per iteration), per input [unit of the input].
    time_constant_cycles : float
        Of the approach near the optimum, in the slowest direction [cycles].
    rms : float or numpy.ndarray
        Predicted error of the estimate once arrived, per input [unit of the input].
    cycles : float
        Predicted cycles from `distance` to `arrival` of the specification, of all inputs.
    dither_cost, jitter_cost : float
        Mean loss of J by the perturbation and by that error [unit of J].
    sensor_gain, sensor_phase_deg : float or numpy.ndarray
        What delay and lag leave of the dither's echo [-], and how far they turn it [deg], per input.
    delay_uncertainty : float
        Error of the delay that the period allows for [cycles].
    met : bool
        Whether the specification is met.
    reasons : tuple of str
        Why not, with the figures that would do.
    noise_sd : float
        What it was made from.
    curvature : float or numpy.ndarray, shape (inputs, inputs)
        What it was made from, for several inputs as a matrix.
    delay_cycles, lag_cycles : float
        Between the plant and J [cycles].
    compensated : bool
        Whether the seeker turns its demodulation back by that phase.
    inputs : tuple of str
        Names of the inputs; empty where they have none.
    harmonics : numpy.ndarray of int, shape (inputs,)
        Oscillations of each input per period; None for one input and for SPSA.

    See Also
    --------
    tune : makes one.
    """

    method: str
    amplitude: Any
    period: int
    gain: Any
    rate: Any
    time_constant_cycles: float
    rms: Any
    cycles: float
    dither_cost: float
    jitter_cost: float
    sensor_gain: Any
    sensor_phase_deg: Any
    delay_uncertainty: float
    met: bool
    reasons: tuple[str, ...]
    noise_sd: float
    curvature: Any
    delay_cycles: float
    lag_cycles: float
    compensated: bool
    inputs: tuple[str, ...] = field(default=(), metadata=SEVERAL_ONLY)
    harmonics: NDArray[np.int64] | None = field(default=None, metadata=SEVERAL_ONLY)

    def summary(self) -> str:
        """Say settings, prediction and verdict as text."""
        spsa = self.method == "spsa"
        period = f"{self.period} measurements per iteration" if spsa else f"period {self.period} cycles"
        if self.harmonics is not None:
            period += f" at {_joined(self.harmonics)} oscillations"
        size, unit = ("perturbation", "iteration") if spsa else ("amplitude", "cycle")
        of = f" of {' and '.join(self.inputs)}" if self.inputs else ""
        lines = [
            f"{self.method}{of}: {size} {_joined(self.amplitude)}, {period}",
            f"gain {_joined(self.gain)}, at most {_joined(self.rate)} per {unit}",
            f"expect an rms error of {_joined(self.rms, 3)}, and arrival after {self.cycles:.0f} cycles",
            f"cost in J: {self.dither_cost:.3g} by the perturbation, {self.jitter_cost:.3g} by the error",
        ]
        if self.delay_cycles > 0.0 or self.lag_cycles > 0.0:
            state = "turned back" if self.compensated else "not compensated"
            shares = " and ".join(f"{100.0 * share:.0f} %" for share in np.ravel(self.sensor_gain))
            turns = " and ".join(f"{phase:.0f} deg" for phase in np.ravel(self.sensor_phase_deg))
            lines.append(f"the sensor leaves {shares} of the echo and turns it by {turns} ({state})")
        if np.ndim(self.curvature) and (flattest := coupling_of(self.curvature)[0][0]) < _COUPLED:
            lines.append(
                f"the inputs are coupled: in the flattest direction J has {flattest:.2g} of its curvature along the "
                f"inputs, and the approach takes {1.0 / flattest:.2g} times as long"
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
        start: PerInput,
        bounds: tuple[Any, Any] | Mapping[str, tuple[float, float]] | None = None,
        inputs: Mapping[str, tuple[float, float]] | Sequence[_core.optimize.Input] | None = None,
        maximize: bool = True,
        limits: Mapping[str, float] | Sequence[_core.optimize.Limit] = (),
        hold_cycles: int | None = None,
        seed: int = 0,
    ) -> ExtremumSeeking | Spsa:
        """Make the tuned seeker.

        Parameters
        ----------
        start : float, array_like or mapping of str to float
            First estimate, in the unit of the input and the order of this tuning.
        bounds : pair of float or array_like, or mapping of str to (float, float), optional
            Least and largest applied input, per input; the start must lie inside by `amplitude`. By name where this
            tuning has names.
        inputs : mapping of str to (float, float), or sequence of Input, optional
            Names and bounds, in place of `bounds`; in any order where this tuning has names. Without, inputs have the
            names of this tuning.
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

        Examples
        --------
        >>> from mgdd.optimize import tune
        >>> tune(0.25, -0.051).seeker(start=-15.0, bounds=(-30.0, 10.0))
        <ExtremumSeeking cycle 0, estimate [-15.]>
        >>> tuning = tune(0.25, {"soc_cad": -0.06, "egr": -600.0})
        >>> tuning.seeker(start={"soc_cad": -12.0, "egr": 0.3}, inputs={"egr": (0.0, 0.4), "soc_cad": (-25.0, 15.0)})
        <ExtremumSeeking cycle 0, estimate egr 0.3, soc_cad -12>
        """
        given = inputs_of(inputs)
        names = tuple(one.name for one in given)
        if self.inputs and not given:
            names = self.inputs
            sides = np.broadcast_arrays(*bounds_pair(bounds, names), np.zeros(len(names)))[:2]
            given = tuple(_core.optimize.Input(*one) for one in zip(names, *np.asarray(sides).tolist(), strict=True))
        elif given and bounds is not None:
            raise ParameterError("bounds: inputs hold them: leave these out")
        if self.inputs and set(names) != set(self.inputs):
            raise ParameterError(f"inputs are {', '.join(names)}: this was tuned for {', '.join(self.inputs)}")
        own = [self.inputs.index(name) for name in names] if self.inputs else slice(None)

        def each(value: Any) -> Any:
            return np.asarray(value)[own].tolist() if np.ndim(value) else value

        space: dict[str, Any] = {"start": start, "bounds": bounds}
        if given:
            space = {"start": start if isinstance(start, Mapping) else each(start), "inputs": list(given)}
        one = not np.ndim(self.curvature)
        if self.method == "spsa":
            return Spsa(
                **space,
                schedule="constant",
                gain=each(self.gain),
                perturbation=each(self.amplitude),
                step_max=each(self.rate),
                noise_sd=self.noise_sd,
                seed=seed,
                maximize=maximize,
                limits=list(limits_of(limits)),
                curvature=self.curvature if one else None,
            )
        lag = _core.optimize.ComponentLag()
        seen = self.curvature if one else None
        if self.compensated:
            lag = _core.optimize.ComponentLag(delay_cycles=self.delay_cycles, lag_cycles=self.lag_cycles)
        elif one:  # the demodulation sees what the sensor leaves in phase
            seen *= self.sensor_gain * math.cos(math.radians(self.sensor_phase_deg))
        return ExtremumSeeking(
            **space,
            form=self.method,
            amplitude=each(self.amplitude),
            period=self.period,
            gain=each(self.gain),
            rate=each(self.rate),
            components=[lag],
            hold_cycles=hold_cycles,
            maximize=maximize,
            limits=list(limits_of(limits)),
            curvature=seen,
            **({} if self.harmonics is None else {"harmonics": each(self.harmonics)}),
        )


def _joined(numbers: Any, digits: int = 4) -> str:
    return " and ".join(f"{number:.{digits}g}" for number in np.ravel(numbers))


def tune(
    noise_sd: float,
    curvature: PerInput,
    *,
    inputs: Sequence[str] = (),
    method: str = "batch",
    delay_cycles: float = 0.0,
    lag_cycles: float = 0.0,
    compensated: bool = True,
    delay_uncertainty: float | None = None,
    rms: PerInput | None = None,
    cycles: float | None = None,
    distance: PerInput | None = None,
    arrival: PerInput | None = None,
    amplitude_max: PerInput | None = None,
) -> Tuning:
    """Choose amplitude, period and gain of a seeker from noise, curvature and sensor delay.

    What is left open scales with L = sqrt(noise_sd/abs(curvature)), the distance from the optimum at which J
    has fallen by half a standard deviation of its noise.

    Several inputs share one period on harmonics that do not mix, or the perturbations of SPSA; `curvature` is then one
    number per input, or the matrix that `measure_map` finds. In its flattest direction, if all inputs are scaled to a
    curvature of one, coupled inputs approach more slowly, by the smallest eigenvalue, and scatter more; the
    predictions hold that. Without the cross terms they are too good where the coupling is strong.

    Parameters
    ----------
    noise_sd : float
        Standard deviation of J from cycle to cycle, > 0 [unit of J].
    curvature : float, array_like or mapping of str to float
        J'' at the optimum; the sign is not used [unit of J per squared unit of the input]. For several inputs one
        number each, also by name, or a matrix of shape (inputs, inputs).
    inputs : sequence of str
        Names of the inputs, where `curvature` has none.
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
    rms : float, array_like or mapping of str to float, optional
        Specified error of the estimate after arrival [unit of the input]; 0.2 L.
    cycles : float, optional
        Specified cycles to arrive; 50, more where a lag asks for it.
    distance, arrival : float, array_like or mapping of str to float, optional
        Error at the start, and what counts as arrived [unit of the input]; 5 L and 0.45 L.
    amplitude_max : float, array_like or mapping of str to float, optional
        Largest perturbation that may be applied [unit of the input]; 1.8 L. As `rms`, `distance` and `arrival`, one
        number per input.

    Returns
    -------
    Tuning
        Settings and prediction; `met` and `reasons` say whether the specification is met.

    Raises
    ------
    ParameterError
        Noise, curvature or a specification that is not positive; a negative uncertainty; SPSA behind a delayed sensor;
        a matrix of curvatures that is neither that of a maximum nor of a minimum.
    ShapeError
        Not one number per input.

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
    >>> tuning = tune(0.25, {"soc_cad": -0.06, "egr": -600.0})
    >>> tuning.inputs, tuning.period, tuning.harmonics.tolist(), tuning.rms.round(4).tolist()
    (('soc_cad', 'egr'), 8, [1, 3], [0.4082, 0.0041])
    """
    hessian, names = hessian_of(curvature, inputs)
    lengths = {"rms": rms, "distance": distance, "arrival": arrival, "amplitude_max": amplitude_max}
    lag: dict[str, Any] = {"delay_cycles": delay_cycles, "lag_cycles": lag_cycles, "compensated": compensated}
    check_wish(noise_sd, method, delay_uncertainty, cycles)
    several, of = np.ndim(hessian) > 0, of_each(np.atleast_2d(hessian), names)
    each = {name: per_input(name, named_values(name, value, names), of) for name, value in lengths.items()}
    options: dict[str, Any] = {"method": method, "delay_uncertainty": delay_uncertainty, "cycles": cycles}
    values = tuned(noise_sd, np.atleast_2d(hessian), of, lengths=each, **options, **lag)
    if not several:
        del values["harmonics"]
        values = {name: value.item() if isinstance(value, np.ndarray) else value for name, value in values.items()}
    return Tuning(**values, **lag, noise_sd=noise_sd, curvature=hessian, inputs=names)
