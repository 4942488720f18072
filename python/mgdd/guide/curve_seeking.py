"""A model's whole curve as a guide: the curve gives the shape, the measurements give the place."""

from __future__ import annotations

from mgdd import _core
from mgdd.optimize.seeker import Seeker


class CurveSeeking(Seeker, _core.guide.CurveSeeking):
    """Seeking guided by a curve: a rough model gives the shape of J, the measurements give its place.

    The guide's curve may stand in the wrong place and have the wrong height; every reading of J says where it stands.
    After a few readings the estimate is near the plant's own best input, wherever the guide's lies. Curvature and
    noise of J are learnt, its level and the drift of that, the delay of the readings, and how fast the best input
    moves. A guide in another unit than J, or a hundred times too steep or too flat, still gives the shape; `trust`
    says so: it is 1 where the curve explains the readings at its own height, and falls with the ratio of the heights.
    Readings that the curve cannot explain raise a doubt, and what follows decides whether the optimum has moved; a
    guide that keeps failing is given up for plain extremum seeking. With ``Curve.parabola`` no model is needed at all.

    Parameters
    ----------
    start : float or mapping
        First input, in its unit; the guide's best input, ``curve.best``, where nothing speaks for another.
    inputs : sequence of Input, or mapping of str to (float, float), optional
        Name, unit, bounds and rate of the input; `ask` then gives a mapping.
    bounds : pair of float
        Least and largest applied input, finite, where `inputs` does not hold them.
    curve : Curve
        J of the guide over the input, to be maximised; it bends down at its best input, which lies in the bounds.
    prior_sd : float, optional
        How far the plant's best input may lie from the guide's, one standard deviation; a quarter of the bounds.
    scale_sd : float
        Standard deviation of the plant's curvature over the guide's, about 1 [-]; other powers of ten are thought of.
    discrepancy : float
        Error of the curve per unit of its drop: readings far from the best input count less [-].
    noise_sd : float, optional
        Standard deviation of one reading, > 0 [unit of J]; learnt without.
    memory_cycles : float
        Readings fade with this time constant; shorter follows a drift faster and costs more dither.
    amplitude_max : float, optional
        Largest distance from the estimate that is applied; 0.25 `prior_sd`.
    rate : float, optional
        Largest change of the applied input per cycle; none without.
    delay_cycles, lag_cycles : float
        Transport delay and time constant between the plant and J [cycles].
    delay_uncertainty : int
        Cycles by which the delay may be shorter or longer than given, at most 20; the property ``delay_cycles`` says
        which one the readings show. 0 takes the delay as given.
    hand_over : bool
        Whether a guide that keeps failing is given up for plain extremum seeking.
    maximize : bool
        False to minimise J; the curve is that of -J then.
    limits : sequence of Limit, or mapping of str to float
        Measured quantities to keep; ``tell(J, limits)`` then takes their values.
    limit_curves : sequence of Curve, optional
        The guide's curve of every limited quantity, which gives its shape; level and slope are learnt. Without, their
        slopes are learnt by trying, in small steps.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, infinite bounds, a curve without a maximum between the bounds.
    mgdd.errors.ShapeError
        More than one input.

    See Also
    --------
    Curve : holds what the model says.

    References
    ----------
    Wellstead and Zarrop (1991), Self-tuning systems: control and signal processing.
    Bucy and Senne (1971), Digital synthesis of non-linear filters.
    Raftery, Karny and Ettler (2010), Online prediction under model uncertainty via dynamic model averaging.
    Harvey (1989), Forecasting, structural time series models and the Kalman filter.

    Examples
    --------
    >>> from mgdd.guide import Curve, CurveSeeking
    >>> rough = Curve.parabola(curvature=-0.05, best=4.0, reach=40.0)  # 10 too late
    >>> seeker = CurveSeeking(start=rough.best, bounds=(-30.0, 10.0), curve=rough)
    >>> for _ in range(8):
    ...     soi = seeker.ask()[0]
    ...     seeker.tell(56.0 - 0.0255 * (soi + 6.0) ** 2)
    >>> abs(seeker.estimate[0] + 6.0) < 0.5
    np.True_
    """
