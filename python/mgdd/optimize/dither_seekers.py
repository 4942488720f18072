"""Extremum seeking: a seeker that dithers its input."""

from __future__ import annotations

from typing import ClassVar

from mgdd import _core
from mgdd.optimize.seeker import Seeker


class ExtremumSeeking(Seeker, _core.optimize.ExtremumSeeking):
    """Extremum seeking by a sinusoidal dither, one measurement of J per engine cycle.

    ``ask()`` gives the input of the next cycle, ``tell(J)`` takes what was measured there. Near an optimum of
    curvature J'' the estimate approaches with the time constant 2/(gain amplitude abs(J'')) cycles. All
    arguments are keywords; "per input" means a number for all or one number for each.

    Parameters
    ----------
    start : float or array_like, shape (inputs,), or mapping
        First estimate, in the unit of the input; one to eight inputs.
    inputs : sequence of Input, or mapping of str to (float, float), optional
        Names, units, bounds and scales of the inputs; `ask` then gives a mapping.
    lower, upper : float or array_like
        Bounds of the applied input, per input, where `inputs` does not say them; infinite for none. The start must lie
        inside by `amplitude`.
    form : {"batch", "moving_average", "washout"}
        How the mean of J is removed: regression over one period with the estimate held, mean of the last
        period, or a first-order high-pass.
    amplitude : float or array_like, optional
        Of the dither, per input, in its unit, > 0; its scale.
    period : int
        Cycles of the window that all inputs share, >= 4.
    harmonics : sequence of int, optional
        Oscillations per window, one per input, that do not mix (4, 5, 7 on a period of 40); [1] for one input.
    gain : float or array_like, optional
        Adaptation gain, per input [unit of the input per unit of J]. Without, it is made of `curvature` or, where that
        is not given either, of first readings: start, above, start, below it by `amplitude`, per input, six times,
        before the search begins; so any unit of J does. The property `gain` shows it. `tune` gives a better one.
    rate : float or array_like, optional
        Largest change of the estimate per cycle, per input; amplitude/period in batches (once per period) and
        3 amplitude/period otherwise.
    recovery_rate : float or array_like, optional
        The same on the way back below a broken limit; `rate` where that is given, else one amplitude.
    washout_pole : float
        h of (z - 1)/(z - h) for the form ``"washout"`` [-].
    low_pass : float
        b of y += b (x - y) after demodulation, in (0, 1]; 1 for none [-].
    components : sequence of ComponentLag, optional
        Delay and lag of each component of J, whose phase is turned back; one immediate component without.
    hold_cycles : int, optional
        Cycles that the estimate is held at the start and after `restart`; one period without.
    amplitude_floor : float
        Vanishing dither: share of `amplitude` that is left where J is flat; 1 for a constant dither [-].
    full_gradient : float
        Slope of J at which the dither is full [unit of J per unit of the input]; > 0 with a floor below 1.
    limit_amplitude : float
        Share of the dither while a limit holds the estimate back [-].
    maximize : bool
        False to minimise J.
    limits : sequence of Limit, or mapping of str to float
        Measured quantities to keep; ``tell(J, limits)`` then takes their values.
    curvature : float, optional
        J'' if known: makes the gain (time constant of four periods), or, where a gain above the bound of averaging is
        given, a UserWarning with that bound.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, bounds that exclude the start, harmonics that mix.
    mgdd.errors.ShapeError
        Entries that are not one per input.

    See Also
    --------
    tune : amplitude, period and gain from noise, curvature and sensor delay.

    References
    ----------
    Tan, Nesic and Mareels (2006), On non-local stability properties of extremum seeking control.
    Choi, Krstic, Ariyur and Lee (2002), Extremum seeking control for discrete-time systems.
    Ghaffari, Krstic and Nesic (2012), Multivariable Newton-based extremum seeking.

    Examples
    --------
    >>> from mgdd.optimize import ExtremumSeeking
    >>> seeker = ExtremumSeeking(start=-18.0, lower=-30.0, upper=10.0)
    >>> for _ in range(400):
    ...     soi = seeker.ask()[0]
    ...     seeker.tell(56.0 - 0.0255 * (soi + 6.0) ** 2)
    >>> abs(seeker.estimate[0] + 6.0) < 0.01
    np.True_
    >>> seeker.history["applied"].sizes["cycle"]
    400
    """

    kind: ClassVar[str] = "ExtremumSeeking"
