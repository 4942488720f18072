"""Seekers that dither their input: extremum seeking, its Newton form and its bounded form."""

from __future__ import annotations

from typing import ClassVar

from mgdd import _core
from mgdd.optimize.seeker import Seeker

__all__ = ["BoundedSeeking", "ExtremumSeeking", "NewtonSeeking"]


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


class NewtonSeeking(Seeker, _core.optimize.NewtonSeeking):
    """Newton extremum seeking: the rate of approach does not depend on the curvature of J.

    Gradient and Hessian are demodulated from the same dither, and a Riccati filter tends to the inverse of the
    Hessian. The estimate is held until both have settled. All arguments are keywords.

    Parameters
    ----------
    start : float or array_like, shape (inputs,), or mapping
        First estimate, in the unit of the input; one to eight inputs.
    inputs : sequence of Input, or mapping of str to (float, float), optional
        Names, units, bounds and scales of the inputs; `ask` then gives a mapping.
    lower, upper : float or array_like
        Bounds of the applied input, per input, where `inputs` does not say them; infinite for none. The start must lie
        inside by `amplitude`.
    amplitude : float or array_like, optional
        Of the dither, per input, in its unit, > 0; twice its scale.
    period : int
        Cycles of the window that all inputs share, >= 4.
    harmonics : sequence of int, optional
        Oscillations per window, one per input; sums and differences must be distinct too.
    time_constant_cycles : float
        Of the approach [cycles].
    hessian_rate, riccati_rate : float
        Low-pass of the Hessian and rate of the Riccati filter, per cycle, in (0, 1] [-].
    initial_hessian : float or array_like, optional
        Diagonal to begin with, < 0 [unit of J per squared unit of the input]; without, of first readings as those of
        `ExtremumSeeking`.
    initial_inverse : float or array_like, optional
        Diagonal of the inverse to begin with, < 0 [squared unit of the input per unit of J]; that of the Hessian
        without.
    largest_inverse : float, optional
        Bound of the norm of the inverse, > 0, same unit; five times the largest to begin with.
    hold_cycles : int
        Cycles that the estimate is held at the start, at least one period; `restart` holds one period.
    rate : float or array_like, optional
        Largest change of the estimate per cycle; 3 amplitude/period without.
    components : sequence of ComponentLag, optional
        Delay and lag of each component of J; one immediate component without.
    limit_amplitude : float
        Share of the dither while a limit holds the estimate back [-].
    maximize : bool
        False to minimise J; Hessians here are those of the maximised objective.
    limits : sequence of Limit, or mapping of str to float
        Measured quantities to keep.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, bounds that exclude the start, harmonics that mix.
    mgdd.errors.ShapeError
        Entries that are not one per input.

    References
    ----------
    Ghaffari, Krstic and Nesic (2012), Multivariable Newton-based extremum seeking.

    Examples
    --------
    >>> from mgdd.optimize import NewtonSeeking
    >>> seeker = NewtonSeeking(start=6.0)
    >>> for _ in range(600):
    ...     seeker.tell(-0.5 * 0.02 * seeker.ask()[0] ** 2)
    >>> abs(seeker.hessian[0, 0] + 0.02) < 0.001, abs(seeker.estimate[0]) < 0.1
    (np.True_, np.True_)
    """

    kind: ClassVar[str] = "NewtonSeeking"


class BoundedSeeking(Seeker, _core.optimize.BoundedSeeking):
    """Bounded extremum seeking: J enters only the phase, so no step is larger than amplitude times omega.

    With omega = 2 pi harmonic/period the mean input drifts at kappa amplitude^2 omega/2 times the slope of J.
    All arguments are keywords.

    Parameters
    ----------
    start : float or array_like, shape (inputs,)
        First input, in its unit; one to eight inputs.
    inputs : sequence of Input, or mapping of str to (float, float), optional
        Names, units, bounds and scales of the inputs; `ask` then gives a mapping.
    lower, upper : float or array_like
        Bounds of the applied input, per input, where `inputs` does not say them; infinite for none.
    amplitude : float or array_like, optional
        Of the oscillation, per input, in its unit, > 0; its scale.
    period : int
        Cycles of the window that all inputs share, >= 4.
    harmonics : sequence of int, optional
        Oscillations per window, one per input; [1] for one input.
    kappa : float, optional
        Phase per unit of J, > 0 [rad per unit of J]; without, made of `curvature` or of first readings as the gain of
        `ExtremumSeeking`, for an approach in about ten periods.
    maximize : bool
        False to minimise J.
    limits : sequence of Limit, or mapping of str to float
        Measured quantities to keep. The oscillation is the search itself: single steps are held back, and while nothing
        is known of a late limit yet, the search goes on where other seekers wait.
    curvature : float, optional
        J'' if known: makes kappa, or, where a kappa above the bound of averaging is given, a UserWarning with that
        bound.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, bounds that exclude the start, harmonics that mix.
    mgdd.errors.ShapeError
        Entries that are not one per input.

    References
    ----------
    Scheinker and Krstic (2014), Extremum seeking with bounded update rates.

    Examples
    --------
    >>> from mgdd.optimize import BoundedSeeking
    >>> seeker = BoundedSeeking(start=8.0)
    >>> for _ in range(600):
    ...     seeker.tell(-0.0255 * seeker.ask()[0] ** 2)
    >>> abs(seeker.estimate[0]) < 0.2
    np.True_
    """

    kind: ClassVar[str] = "BoundedSeeking"
