"""Extremum seeking, and seekers that compare readings at chosen inputs: SPSA, two-sided differences, golden section."""

from __future__ import annotations

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
    bounds : pair of float or array_like
        Least and largest applied input, per input, where `inputs` does not hold them; none without. The start must lie
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
    inputs, maximize, limits
        As of every `Seeker`.
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
    >>> seeker = ExtremumSeeking(start=-18.0, bounds=(-30.0, 10.0))
    >>> for _ in range(400):
    ...     soi = seeker.ask()[0]
    ...     seeker.tell(56.0 - 0.0255 * (soi + 6.0) ** 2)
    >>> abs(seeker.estimate[0] + 6.0) < 0.01
    np.True_
    >>> seeker.history["applied"].sizes["cycle"]
    400
    """


class Spsa(Seeker, _core.optimize.Spsa):
    """Simultaneous perturbation: the slope in every direction from two measurements.

    Each iteration measures J at estimate +- c Delta, with random signs Delta, one cycle each, whatever the
    number of inputs. Gains: a_k = gain/(k + 1 + stability)^gain_exponent and c_k = perturbation/(k +
    1)^perturbation_exponent, or both constant. All arguments are keywords.

    Parameters
    ----------
    start : float or array_like, shape (inputs,), or mapping
        First estimate, in the unit of the input; one to eight inputs.
    bounds : pair of float or array_like
        Least and largest applied input, per input, where `inputs` does not hold them; none without. The start must lie
        inside by the perturbation (twice that in the second-order form).
    form : {"first_order", "second_order"}
        Two measurements per gradient, or four, with the Hessian.
    schedule : {"decreasing", "constant"}
        Decreasing gains settle; constant gains go on tracking.
    gain : float or array_like, optional
        a, per input [squared unit of the input per unit of J]: without, 1/abs(J'') by `curvature` or by first readings
        as those of `ExtremumSeeking`. Dimensionless, 3, in the second-order form. `tune` gives a better one.
    stability : float
        A, iterations, >= 0; a tenth of the expected number is usual.
    gain_exponent, perturbation_exponent : float
        alpha and gamma; they must differ by more than 0.5 where gains decrease [-].
    perturbation : float or array_like, optional
        c, per input, in its unit, > 0; 1.5 times its scale.
    step_max : float or array_like, optional
        Largest change of the estimate per iteration, per input; 4/3 perturbation without.
    averaging : int
        Gradients per iteration.
    blocking : bool
        Measure once more at the new estimate and refuse it where J is worse by more than 2 `noise_sd`.
    noise_sd : float
        Standard deviation of one measurement of J, for blocking.
    initial_hessian : float or array_like, optional
        Second order: diagonal of the curvature to begin with, < 0 [unit of J per squared unit of the input]; without,
        `curvature`, or that of first readings.
    hessian_prior : float
        Second order: iterations that `initial_hessian` counts for.
    limit_amplitude : float
        Share of the perturbation while a limit holds the estimate back [-].
    seed : int
        Of the random signs: the same seed gives the same run.
    inputs, maximize, limits
        As of every `Seeker`.
    curvature : float, optional
        J'' if known: makes the gain; a first step factor gain abs(J'') above 1 gives a UserWarning.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, or bounds that exclude the start.
    mgdd.errors.ShapeError
        Entries that are not one per input.

    References
    ----------
    Spall (1992), Multivariate stochastic approximation using a simultaneous perturbation gradient
    approximation; (1998), implementation; (2000), second-order form.

    Examples
    --------
    >>> from mgdd.optimize import Spsa
    >>> seeker = Spsa(start=[8.0, -6.0], seed=4)
    >>> for _ in range(600):
    ...     x = seeker.ask()
    ...     seeker.tell(-0.02 * x[0] ** 2 - 0.03 * x[1] ** 2)
    >>> bool(abs(seeker.estimate).max() < 0.5)
    True
    """


class GradientDescent(Seeker, _core.optimize.GradientDescent):
    """Gradient steps by two-sided differences, two cycles per input and step.

    Converges on a noise-free J for 0 < step_size < 2/abs(J''), fastest near 1/abs(J''). All arguments are
    keywords.

    Parameters
    ----------
    start : float or array_like, shape (inputs,), or mapping
        First estimate, in the unit of the input; one to eight inputs.
    bounds : pair of float or array_like
        Least and largest applied input, per input, where `inputs` does not hold them; none without. The start must lie
        inside by `difference`.
    step_size : float or array_like, optional
        lambda_c, per input, > 0 [squared unit of the input per unit of J]; 1/abs(J'') is fastest. Without, half of that
        by `curvature` or by first readings as those of `ExtremumSeeking`.
    difference : float or array_like, optional
        c, half the distance of the two measurements, per input, in its unit, > 0; its scale.
    rate : float or array_like, optional
        Largest change per step, per input; without, none, or four differences where `step_size` is left out too.
    tolerance : float or array_like, optional
        Converged once every entry of a step is smaller, per input, in its unit; a fiftieth of its scale.
    iterations : int
        Steps within which `converged_at` is looked for; the search goes on all the same.
    inputs, maximize, limits
        As of every `Seeker`.
    curvature : float, optional
        J'' if known: makes the step size; one given that cannot converge gives a UserWarning with the bound.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, or bounds that exclude the start.
    mgdd.errors.ShapeError
        Entries that are not one per input.

    References
    ----------
    Kiefer and Wolfowitz (1952), Stochastic estimation of the maximum of a regression function.
    Tan (2018), Model-guided data-driven optimization and control for internal combustion engine systems.

    Examples
    --------
    >>> from mgdd.optimize import GradientDescent
    >>> seeker = GradientDescent(start=-9.0, step_size=18.0)
    >>> while seeker.converged_at is None:
    ...     seeker.tell(-0.0255 * (seeker.ask()[0] + 5.0) ** 2)
    >>> seeker.converged_at, round(float(seeker.estimate[0]), 3)
    (4, -5.0)
    """


class GoldenSection(Seeker, _core.optimize.GoldenSection):
    """Golden-section search of one input that trusts a comparison only beyond the noise.

    Two inner points are measured in turns until their means differ by more than noise; if inconclusive, both ends are
    trimmed. When the bracket is as small as the noise allows, the search goes on as triples around the vertex of a
    parabola and keeps tracking. All arguments are keywords.

    Parameters
    ----------
    start : float or mapping
        Estimate before the first decision.
    bounds : pair of float
        The bracket, finite, where `inputs` does not hold it; also the bounds of the applied input.
    noise_sd : float
        Standard deviation of one measurement of J; 0 trusts every comparison.
    significance : float
        Standard errors that decide a comparison.
    samples_max : int
        Measurements of each inner point before it counts as inconclusive.
    tolerance : float, optional
        Width of the bracket at which a noise-free search ends, in the unit of the input, > 0; a fiftieth of its scale.
    inputs, maximize
        As of every `Seeker`.
    limits : sequence of Limit, or mapping of str to float
        Measured quantities to keep. Points on both sides of a limit are tried until the bracket is small, so it is
        broken during the search; behind a delay each point is measured for as long as the limits take to show it.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, an infinite bound, or bounds that exclude the start.
    mgdd.errors.ShapeError
        More than one input.

    References
    ----------
    Kiefer (1953), Sequential minimax search for a maximum.

    Examples
    --------
    >>> from mgdd.optimize import GoldenSection
    >>> seeker = GoldenSection(start=-15.0, bounds=(-30.0, 10.0))
    >>> while not seeker.converged:
    ...     seeker.tell(-0.0255 * (seeker.ask()[0] + 5.6) ** 2)
    >>> seeker.cycle, round(float(seeker.estimate[0]), 2)
    (17, -5.6)
    """
