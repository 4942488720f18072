"""
Fits, seekers and learners.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['ComponentLag', 'ExtremumSeeking', 'FitReport', 'GaussianProcessSeeking', 'GoldenSection', 'GradientDescent', 'Input', 'IterativeLearning', 'LeastSquaresOptions', 'Limit', 'MapSeeking', 'Parameter', 'Spsa', 'Surface', 'autocorrelation_time', 'latin_hypercube', 'least_squares']
class Parameter:
    """
    One unknown of a fit: name, bounds, and whether it is searched as its log.
    """
    @staticmethod
    def fields() -> dict:
        """
        Every field by name: unit, bounds or choices, meaning, default.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, name: str, lower: typing.SupportsFloat | typing.SupportsIndex = ..., upper: typing.SupportsFloat | typing.SupportsIndex = ..., log_scaled: bool = False) -> None:
        """
        name : in reports and messages
        lower : lower bound, -inf for none
        upper : upper bound, inf for none
        log_scaled : searched as log(p); needs lower > 0
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> Parameter:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def log_scaled(self) -> bool:
        """
        searched as log(p); needs lower > 0
        """
    @property
    def lower(self) -> float:
        """
        lower bound, -inf for none [-]
        """
    @property
    def name(self) -> str:
        """
        in reports and messages
        """
    @property
    def upper(self) -> float:
        """
        upper bound, inf for none [-]
        """
class LeastSquaresOptions:
    """
    When a least-squares search ends and what it reports.
    """
    @staticmethod
    def fields() -> dict:
        """
        Every field by name: unit, bounds or choices, meaning, default.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, max_iterations: typing.SupportsInt | typing.SupportsIndex = 200, cost_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-12, step_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-10, gradient_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-12, initial_damping: typing.SupportsFloat | typing.SupportsIndex = 0.001, correlation_limit: typing.SupportsFloat | typing.SupportsIndex = 0.98, rank_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-10, evaluate_together: bool = True) -> None:
        """
        max_iterations : trial steps
        cost_tolerance : relative decrease of the cost that ends a search
        step_tolerance : relative step that ends a search
        gradient_tolerance : cosine of the gradient that ends a search
        initial_damping : damping of the first step, of unit columns
        correlation_limit : correlation above which two are named
        rank_tolerance : singular value, over the largest, that counts as zero
        evaluate_together : residual and Jacobian in one call
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> LeastSquaresOptions:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def correlation_limit(self) -> float:
        """
        correlation above which two are named [-]
        """
    @property
    def cost_tolerance(self) -> float:
        """
        relative decrease of the cost that ends a search [-]
        """
    @property
    def evaluate_together(self) -> bool:
        """
        residual and Jacobian in one call
        """
    @property
    def gradient_tolerance(self) -> float:
        """
        cosine of the gradient that ends a search [-]
        """
    @property
    def initial_damping(self) -> float:
        """
        damping of the first step, of unit columns [-]
        """
    @property
    def max_iterations(self) -> int:
        """
        trial steps [-]
        """
    @property
    def rank_tolerance(self) -> float:
        """
        singular value, over the largest, that counts as zero [-]
        """
    @property
    def step_tolerance(self) -> float:
        """
        relative step that ends a search [-]
        """
class FitReport:
    """
    Result of a fit as the core gives it; `mgdd.optimize.FitReport` wraps it.
    """
    def __init__(self) -> None:
        """
        A fit that has not been run.
        """
    def __repr__(self) -> str:
        ...
    @property
    def bounds_active(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        -1 lower, +1 upper, 0 free.
        """
    @property
    def correlation(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Correlation of the estimates.
        """
    @property
    def cost(self) -> float:
        """
        Half the sum of squares.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Covariance of the estimates.
        """
    @property
    def findings(self) -> list[str]:
        """
        Reasons behind `unidentifiable`.
        """
    @property
    def history(self) -> dict:
        """
        Arrays cost, damping, step_norm, accepted per trial step.
        """
    @property
    def iterations(self) -> int:
        """
        Trial steps.
        """
    @property
    def lower(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Lower bounds.
        """
    @property
    def message(self) -> str:
        """
        The status as a sentence.
        """
    @property
    def n_residuals(self) -> int:
        """
        Number of residuals.
        """
    @property
    def names(self) -> list[str]:
        """
        Parameter names.
        """
    @property
    def nfev(self) -> int:
        """
        Residual evaluations.
        """
    @property
    def njev(self) -> int:
        """
        Jacobian evaluations.
        """
    @property
    def null_directions(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Columns: parameter changes that leave the residual as it is.
        """
    @property
    def residual(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Residual at the estimates.
        """
    @property
    def residual_blocks(self) -> float | None:
        """
        Blocks that the standard errors count as independent; None where they count every residual.
        """
    @property
    def rmse(self) -> float:
        """
        Root mean square residual.
        """
    @property
    def status(self) -> str:
        """
        Why the search ended.
        """
    @property
    def stderr(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Standard errors.
        """
    @property
    def success(self) -> bool:
        """
        Whether a tolerance was met.
        """
    @property
    def unidentifiable(self) -> list[str]:
        """
        Names the data leave open.
        """
    @property
    def upper(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Upper bounds.
        """
    @property
    def values(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Estimates.
        """
class Input:
    """
    One input of a plant: its name, unit and bounds, and what counts as a step of it.
    
    Parameters
    ----------
    name : str
        What is set, for example ``soc_cad``; plants with this input are steered by it.
    lower, upper : float
        What may be applied, in the unit of the input; infinite for none.
    unit : str
        Of the input; empty for the one that the name says.
    scale : float
        What dithers, perturbations and tolerances of a seeker count in where they are left open, in the unit of the input;
        0 for a fortieth of the bounds, or 1 where there are none.
    rate : float
        Largest change of the estimate per step of the seeker, in the unit of the input, > 0.
    step : float
        Resolution in which it is set, in the unit of the input: the lower bound and whole steps above it, or multiples
        where there is no lower bound; 0 where any value can be set. Every input that a seeker asks for is on a step; its
        estimate may be between two, `settable` of the seeker is not.
    
    Raises
    ------
    mgdd.errors.ParameterError
        An empty name, bounds that do not enclose anything, a negative scale, a rate that is not > 0, or a step that is
        negative or larger than the bounds are apart.
    
    Examples
    --------
    >>> from mgdd.optimize import Input, Spsa
    >>> seeker = Spsa(start={"soc_cad": -8.0, "egr": 0.1}, inputs=[Input("soc_cad", -20.0, 5.0), Input("egr", 0.0, 0.4)])
    >>> sorted(seeker.ask())
    ['egr', 'soc_cad']
    """
    @staticmethod
    def fields() -> dict:
        """
        Every field by name: unit, bounds or choices, meaning, default.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, name: str, lower: typing.SupportsFloat | typing.SupportsIndex = ..., upper: typing.SupportsFloat | typing.SupportsIndex = ..., *, unit: str = '', scale: typing.SupportsFloat | typing.SupportsIndex = 0.0, rate: typing.SupportsFloat | typing.SupportsIndex = ..., step: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        """
        name : what is set
        lower : least applied value
        upper : largest applied value
        unit : of the input
        scale : what steps are counted in; 0: a fortieth of the bounds, or 1
        rate : largest change of the estimate per step
        step : whole steps in which it is set; 0: any value
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def nearest(self, value: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        The nearest value that can be set.
        """
    def replace(self, **kwargs) -> Input:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def lower(self) -> float:
        """
        least applied value [-]
        """
    @property
    def name(self) -> str:
        """
        what is set
        """
    @property
    def rate(self) -> float:
        """
        largest change of the estimate per step [-]
        """
    @property
    def scale(self) -> float:
        """
        what steps are counted in; 0: a fortieth of the bounds, or 1 [-]
        """
    @property
    def step(self) -> float:
        """
        whole steps in which it is set; 0: any value [-]
        """
    @property
    def unit(self) -> str:
        """
        of the input
        """
    @property
    def upper(self) -> float:
        """
        largest applied value [-]
        """
class Limit:
    """
    An upper limit on a measured quantity, kept by a seeker.
    
    Parameters
    ----------
    name : str
        What is limited, for example ``p_max_bar``.
    upper : float
        The limit, in the unit of the quantity.
    margin : float
        Kept free below the limit, same unit.
    method : {"switching", "penalty", "barrier"}
        How J knows of the limit: not at all (the guard alone turns the steps), by a quadratic penalty on the excess, or
        by a logarithmic barrier. The guard acts in all three.
    weight : float
        Penalty: J units per squared scaled excess; barrier: J units times the logarithm of the scaled room.
    scale : float
        Unit of the excess; 0 stands for the limit itself.
    delay_cycles : float
        Transport delay of the reading [cycles].
    lag_cycles : float
        Time constant of its first-order lag [cycles], as in `ComponentLag`. Every reading is judged on the input that caused
        it: what was applied `delay_cycles` ago, passed through the same lag.
    margin_sd : float
        Added to `margin`: this many standard deviations of the reading about the local model that the seeker learns of it.
        Without any, an estimate at the limit is above it in 5 to 25 % of the cycles; with one in less than 1 %.
        Where more readings lie above than this margin lets expect, it grows by as much as five deviations more.
        `GaussianProcessSeeking` keeps a limit by its ``limit_probability`` instead.
    delay_uncertainty : int
        `delay_cycles` may be off by as many cycles to either side: the delay that foretells the readings clearly better is
        taken instead, and the ``findings`` of the seeker say so. 0: the stated one is exact.
    
    Raises
    ------
    mgdd.errors.ParameterError
        Limit not finite, negative margin, delay or lag, weight not > 0, ``margin_sd`` outside [0, 100],
        ``delay_uncertainty`` outside [0, 20].
    
    Examples
    --------
    >>> from mgdd.optimize import Limit
    >>> Limit("p_max_bar", 95.0, margin=1.0)
    Limit('p_max_bar', 95.0, margin=1.0)
    """
    @staticmethod
    def fields() -> dict:
        """
        Every field by name: unit, bounds or choices, meaning, default.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, name: str, upper: typing.SupportsFloat | typing.SupportsIndex, *, margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, method: str = 'switching', weight: typing.SupportsFloat | typing.SupportsIndex = 1.0, scale: typing.SupportsFloat | typing.SupportsIndex = 0.0, delay_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, lag_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, margin_sd: typing.SupportsFloat | typing.SupportsIndex = 1.0, delay_uncertainty: typing.SupportsInt | typing.SupportsIndex = 3) -> None:
        """
        name : what is limited
        upper : the limit
        margin : kept free below the limit
        method : how J knows of the limit
        weight : of penalty or barrier
        scale : unit of the excess; 0: the limit itself
        delay_cycles : transport delay of the reading
        lag_cycles : time constant of its lag
        margin_sd : margin in standard deviations of the reading
        delay_uncertainty : cycles that the delay may be off to either side
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> Limit:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def delay_cycles(self) -> float:
        """
        transport delay of the reading [-]
        """
    @property
    def delay_uncertainty(self) -> int:
        """
        cycles that the delay may be off to either side [-]
        """
    @property
    def lag_cycles(self) -> float:
        """
        time constant of its lag [-]
        """
    @property
    def margin(self) -> float:
        """
        kept free below the limit [-]
        """
    @property
    def margin_sd(self) -> float:
        """
        margin in standard deviations of the reading [-]
        """
    @property
    def method(self) -> str:
        """
        how J knows of the limit
        """
    @property
    def name(self) -> str:
        """
        what is limited
        """
    @property
    def scale(self) -> float:
        """
        unit of the excess; 0: the limit itself [-]
        """
    @property
    def upper(self) -> float:
        """
        the limit [-]
        """
    @property
    def weight(self) -> float:
        """
        of penalty or barrier [-]
        """
class ComponentLag:
    """
    What stands between the plant and one measured component of J.
    
    Parameters
    ----------
    delay_cycles : float
        Transport delay [cycles].
    lag_cycles : float
        Time constant of the first-order lag y += (1 - exp(-1/tau)) (x - y) [cycles]; 0 for none.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A negative delay or lag.
    
    Examples
    --------
    >>> from mgdd.optimize import ComponentLag
    >>> gain, phase_deg = ComponentLag(delay_cycles=42, lag_cycles=25).response(period=10)
    >>> round(gain, 4), round(phase_deg % 360.0, 1)
    (0.0646, 140.5)
    """
    @staticmethod
    def fields() -> dict:
        """
        Every field by name: unit, bounds or choices, meaning, default.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, delay_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, lag_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        """
        delay_cycles : transport delay in cycles
        lag_cycles : time constant of the lag in cycles
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> ComponentLag:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def response(self, *, period: typing.SupportsInt | typing.SupportsIndex, harmonic: typing.SupportsInt | typing.SupportsIndex = 1) -> tuple[float, float]:
        """
        Gain [-] and phase lag [deg] at `harmonic` oscillations per `period` cycles.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def delay_cycles(self) -> float:
        """
        transport delay in cycles [-]
        """
    @property
    def lag_cycles(self) -> float:
        """
        time constant of the lag in cycles [-]
        """
class ExtremumSeeking:
    """
    Extremum seeking; see mgdd.optimize.ExtremumSeeking.
    """
    def __init__(self, *, start: typing.Any, bounds: typing.Any = None, inputs: collections.abc.Sequence[Input] | None = None, form: str = 'batch', amplitude: typing.Any = None, period: typing.SupportsInt | typing.SupportsIndex = 10, harmonics: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] | None = None, gain: typing.Any = None, rate: typing.Any = None, recovery_rate: typing.Any = None, washout_pole: typing.SupportsFloat | typing.SupportsIndex = 0.9, low_pass: typing.SupportsFloat | typing.SupportsIndex = 1.0, components: collections.abc.Sequence[ComponentLag] | None = None, hold_cycles: typing.SupportsInt | typing.SupportsIndex | None = None, amplitude_floor: typing.SupportsFloat | typing.SupportsIndex = 1.0, full_gradient: typing.SupportsFloat | typing.SupportsIndex = 0.0, limit_amplitude: typing.SupportsFloat | typing.SupportsIndex = 0.5, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], curvature: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        start : first estimate, per input
        bounds : least and largest applied input, each a number or one per input; none without
        inputs : names, units, bounds and scales
        form : how the mean of J is removed
        amplitude : of the dither, per input
        period : cycles of the common window
        harmonics : oscillations per window, one per input
        gain : adaptation gain, per input
        rate : largest change of the estimate per cycle, per input
        recovery_rate : largest change on the way back below a limit, per input
        washout_pole : pole of the high-pass
        low_pass : share of the new value after demodulation
        components : delay and lag of each component of J
        hold_cycles : cycles that the estimate is held at the start
        amplitude_floor : share of the dither that is left where J is flat
        full_gradient : slope of J at which the dither is full
        limit_amplitude : share of the dither while a limit holds the estimate back
        maximize : False to minimise J
        limits : measured quantities to keep
        curvature : J'' where it is known
        """
    def __repr__(self) -> str:
        ...
    def _clear_history(self) -> None:
        """
        Forget the history, keep the state.
        """
    def _history_columns(self) -> dict:
        """
        Columns behind .history.
        """
    def _set_history_columns(self, columns: collections.abc.Mapping[str, typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]) -> None:
        """
        Columns behind .history, as _history_columns gave them.
        """
    def ask(self) -> typing.Any:
        """
        The input to apply in this cycle: an array of shape (inputs,), or a dict where inputs have names. Asking again
        before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False, applied: typing.Any = None) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its J and limits are not read;
        applied: what the plant really applied, one number per input or by name; None where it is what was asked for.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
        """
    @property
    def _watched(self) -> dict:
        """
        What the findings are made of.
        """
    @property
    def amplitude_share(self) -> float:
        """
        Amplitude now over that of the settings.
        """
    @property
    def component_count(self) -> int:
        """
        Components of J that tell takes.
        """
    @property
    def cycle(self) -> int:
        """
        Cycles told so far, misfires included.
        """
    @property
    def estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Present estimate of the optimum, shape (inputs,).
        """
    @property
    def failing_above(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The nearest input known to fail on the upper side, shape (inputs,); infinite: none. After four failures on
        one side (more where cycles fail by chance) no more is asked than what has worked, but for single cycles that
        try whether it still fails.
        """
    @property
    def failing_below(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The same on the lower side; minus infinity: none.
        """
    @property
    def failing_everywhere(self) -> bool:
        """
        True after twelve failures in a row: of several inputs, or of the start where nothing has worked yet.
        """
    @property
    def gain(self) -> list[float] | None:
        """
        Gain in use, per input; None while the first readings are taken.
        """
    @property
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last estimate of the slope of the maximised objective, shape (inputs,).
        """
    @property
    def input_names(self) -> list[str]:
        """
        Names of the inputs, in the order of the estimate; empty where they have none.
        """
    @property
    def limit_delays(self) -> dict:
        """
        The delay at which every limit is read, by name [cycles]: as stated, until its readings clearly fit another.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def limit_states(self) -> dict:
        """
        State of every limit by name: 'free' holds nothing back, 'active' turned the last step or is broken,
        'infeasible' cannot be met together with the other limits and the bounds, as far as the learnt slopes tell;
        the estimate goes to where the largest excess, counted in scales, is smallest.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
        """
    @property
    def settable(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The estimate in the steps in which its inputs are set, shape (inputs,).
        """
    @property
    def settings(self) -> dict:
        """
        Arguments that make this seeker again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What the run needs to go on bit for bit: named lists of numbers, JSON-able. Setting it restores the run;
        a state of another kind or size raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
class Spsa:
    """
    Simultaneous perturbation; see mgdd.optimize.Spsa.
    """
    def __init__(self, *, start: typing.Any, bounds: typing.Any = None, inputs: collections.abc.Sequence[Input] | None = None, form: str = 'first_order', schedule: str = 'decreasing', gain: typing.Any = None, stability: typing.SupportsFloat | typing.SupportsIndex = 50.0, gain_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.602, perturbation: typing.Any = None, perturbation_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.101, step_max: typing.Any = None, averaging: typing.SupportsInt | typing.SupportsIndex = 1, blocking: bool = False, noise_sd: typing.SupportsFloat | typing.SupportsIndex = 0.0, initial_hessian: typing.Any = None, hessian_prior: typing.SupportsFloat | typing.SupportsIndex = 20.0, limit_amplitude: typing.SupportsFloat | typing.SupportsIndex = 0.5, seed: typing.SupportsInt | typing.SupportsIndex = 0, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], curvature: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        start : first estimate, per input
        bounds : least and largest applied input, each a number or one per input; none without
        inputs : names, units, bounds and scales
        form : order of the step
        schedule : how gain and perturbation change
        gain : of the step, per input
        stability : iterations that the first gains count for
        gain_exponent : decay of the gain
        perturbation : of every input
        perturbation_exponent : decay of the perturbation
        step_max : largest change per iteration, per input
        averaging : gradients per iteration
        blocking : refuse steps that lose
        noise_sd : of one measurement of J
        initial_hessian : diagonal to begin with
        hessian_prior : iterations that it counts for
        limit_amplitude : share of the dither while a limit holds the estimate back
        seed : of the random signs
        maximize : False to minimise J
        limits : measured quantities to keep
        curvature : J'' where it is known
        """
    def __repr__(self) -> str:
        ...
    def _clear_history(self) -> None:
        """
        Forget the history, keep the state.
        """
    def _history_columns(self) -> dict:
        """
        Columns behind .history.
        """
    def _set_history_columns(self, columns: collections.abc.Mapping[str, typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]) -> None:
        """
        Columns behind .history, as _history_columns gave them.
        """
    def ask(self) -> typing.Any:
        """
        The input to apply in this cycle: an array of shape (inputs,), or a dict where inputs have names. Asking again
        before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False, applied: typing.Any = None) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its J and limits are not read;
        applied: what the plant really applied, one number per input or by name; None where it is what was asked for.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
        """
    @property
    def _watched(self) -> dict:
        """
        What the findings are made of.
        """
    @property
    def blocked(self) -> int:
        """
        Steps that blocking refused.
        """
    @property
    def component_count(self) -> int:
        """
        Components of J that tell takes.
        """
    @property
    def cycle(self) -> int:
        """
        Cycles told so far, misfires included.
        """
    @property
    def estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Present estimate of the optimum, shape (inputs,).
        """
    @property
    def failing_above(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The nearest input known to fail on the upper side, shape (inputs,); infinite: none. After four failures on
        one side (more where cycles fail by chance) no more is asked than what has worked, but for single cycles that
        try whether it still fails.
        """
    @property
    def failing_below(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The same on the lower side; minus infinity: none.
        """
    @property
    def failing_everywhere(self) -> bool:
        """
        True after twelve failures in a row: of several inputs, or of the start where nothing has worked yet.
        """
    @property
    def gain(self) -> list[float] | None:
        """
        Gain in use, per input; None while the first readings are taken.
        """
    @property
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last estimate of the slope of the maximised objective, shape (inputs,).
        """
    @property
    def hessian(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Averaged Hessian of the second-order form, shape (inputs, inputs).
        """
    @property
    def input_names(self) -> list[str]:
        """
        Names of the inputs, in the order of the estimate; empty where they have none.
        """
    @property
    def iteration(self) -> int:
        """
        Iterations since the start or restart.
        """
    @property
    def limit_delays(self) -> dict:
        """
        The delay at which every limit is read, by name [cycles]: as stated, until its readings clearly fit another.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def limit_states(self) -> dict:
        """
        State of every limit by name: 'free' holds nothing back, 'active' turned the last step or is broken,
        'infeasible' cannot be met together with the other limits and the bounds, as far as the learnt slopes tell;
        the estimate goes to where the largest excess, counted in scales, is smallest.
        """
    @property
    def measurements_per_iteration(self) -> int:
        """
        Cycles that one iteration takes.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
        """
    @property
    def settable(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The estimate in the steps in which its inputs are set, shape (inputs,).
        """
    @property
    def settings(self) -> dict:
        """
        Arguments that make this seeker again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What the run needs to go on bit for bit: named lists of numbers, JSON-able. Setting it restores the run;
        a state of another kind or size raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
class GradientDescent:
    """
    Two-sided differences; see mgdd.optimize.GradientDescent.
    """
    def __init__(self, *, start: typing.Any, bounds: typing.Any = None, inputs: collections.abc.Sequence[Input] | None = None, step_size: typing.Any = None, difference: typing.Any = None, rate: typing.Any = None, tolerance: typing.Any = None, iterations: typing.SupportsInt | typing.SupportsIndex = 60, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], curvature: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        start : first estimate, per input
        bounds : least and largest applied input, each a number or one per input; none without
        inputs : names, units, bounds and scales
        step_size : of the step, per input
        difference : of the two measurements to the estimate, per input
        rate : largest change per step, per input
        tolerance : converged once every entry of a step is below, per input
        iterations : steps after which a search that has not converged says so
        maximize : False to minimise J
        limits : measured quantities to keep
        curvature : J'' where it is known
        """
    def __repr__(self) -> str:
        ...
    def _clear_history(self) -> None:
        """
        Forget the history, keep the state.
        """
    def _history_columns(self) -> dict:
        """
        Columns behind .history.
        """
    def _set_history_columns(self, columns: collections.abc.Mapping[str, typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]) -> None:
        """
        Columns behind .history, as _history_columns gave them.
        """
    def ask(self) -> typing.Any:
        """
        The input to apply in this cycle: an array of shape (inputs,), or a dict where inputs have names. Asking again
        before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False, applied: typing.Any = None) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its J and limits are not read;
        applied: what the plant really applied, one number per input or by name; None where it is what was asked for.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
        """
    @property
    def _watched(self) -> dict:
        """
        What the findings are made of.
        """
    @property
    def component_count(self) -> int:
        """
        Components of J that tell takes.
        """
    @property
    def converged_at(self) -> int | None:
        """
        Step at which the tolerance was met first, or None.
        """
    @property
    def cycle(self) -> int:
        """
        Cycles told so far, misfires included.
        """
    @property
    def estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Present estimate of the optimum, shape (inputs,).
        """
    @property
    def failing_above(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The nearest input known to fail on the upper side, shape (inputs,); infinite: none. After four failures on
        one side (more where cycles fail by chance) no more is asked than what has worked, but for single cycles that
        try whether it still fails.
        """
    @property
    def failing_below(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The same on the lower side; minus infinity: none.
        """
    @property
    def failing_everywhere(self) -> bool:
        """
        True after twelve failures in a row: of several inputs, or of the start where nothing has worked yet.
        """
    @property
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last estimate of the slope of the maximised objective, shape (inputs,).
        """
    @property
    def input_names(self) -> list[str]:
        """
        Names of the inputs, in the order of the estimate; empty where they have none.
        """
    @property
    def iteration(self) -> int:
        """
        Steps made.
        """
    @property
    def limit_delays(self) -> dict:
        """
        The delay at which every limit is read, by name [cycles]: as stated, until its readings clearly fit another.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def limit_states(self) -> dict:
        """
        State of every limit by name: 'free' holds nothing back, 'active' turned the last step or is broken,
        'infeasible' cannot be met together with the other limits and the bounds, as far as the learnt slopes tell;
        the estimate goes to where the largest excess, counted in scales, is smallest.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
        """
    @property
    def settable(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The estimate in the steps in which its inputs are set, shape (inputs,).
        """
    @property
    def settings(self) -> dict:
        """
        Arguments that make this seeker again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What the run needs to go on bit for bit: named lists of numbers, JSON-able. Setting it restores the run;
        a state of another kind or size raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def step_size(self) -> list[float] | None:
        """
        Step size in use, per input; None while the first readings are taken.
        """
class GoldenSection:
    """
    Golden-section search; see mgdd.optimize.GoldenSection.
    """
    def __init__(self, *, start: typing.Any, bounds: typing.Any = None, inputs: collections.abc.Sequence[Input] | None = None, noise_sd: typing.SupportsFloat | typing.SupportsIndex = 0.0, significance: typing.SupportsFloat | typing.SupportsIndex = 2.0, samples_max: typing.SupportsInt | typing.SupportsIndex = 8, tolerance: typing.SupportsFloat | typing.SupportsIndex | None = None, maximize: bool = True, limits: collections.abc.Sequence[Limit] = []) -> None:
        """
        start : first estimate, per input
        bounds : least and largest applied input, each a number or one per input; none without
        inputs : names, units, bounds and scales
        noise_sd : of one measurement of J
        significance : standard errors that decide a comparison
        samples_max : measurements of each inner point
        tolerance : width of the bracket at which an exact search ends
        maximize : False to minimise J
        limits : measured quantities to keep
        """
    def __repr__(self) -> str:
        ...
    def _clear_history(self) -> None:
        """
        Forget the history, keep the state.
        """
    def _history_columns(self) -> dict:
        """
        Columns behind .history.
        """
    def _set_history_columns(self, columns: collections.abc.Mapping[str, typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]) -> None:
        """
        Columns behind .history, as _history_columns gave them.
        """
    def ask(self) -> typing.Any:
        """
        The input to apply in this cycle: an array of shape (inputs,), or a dict where inputs have names. Asking again
        before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False, applied: typing.Any = None) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its J and limits are not read;
        applied: what the plant really applied, one number per input or by name; None where it is what was asked for.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
        """
    @property
    def _watched(self) -> dict:
        """
        What the findings are made of.
        """
    @property
    def bracket(self) -> tuple[float, float]:
        """
        Present bracket, lower and upper end.
        """
    @property
    def component_count(self) -> int:
        """
        Components of J that tell takes.
        """
    @property
    def converged(self) -> bool:
        """
        Whether the bracket is as small as tolerance or noise allow.
        """
    @property
    def cycle(self) -> int:
        """
        Cycles told so far, misfires included.
        """
    @property
    def estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Present estimate of the optimum, shape (inputs,).
        """
    @property
    def failing_above(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The nearest input known to fail on the upper side, shape (inputs,); infinite: none. After four failures on
        one side (more where cycles fail by chance) no more is asked than what has worked, but for single cycles that
        try whether it still fails.
        """
    @property
    def failing_below(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The same on the lower side; minus infinity: none.
        """
    @property
    def failing_everywhere(self) -> bool:
        """
        True after twelve failures in a row: of several inputs, or of the start where nothing has worked yet.
        """
    @property
    def input_names(self) -> list[str]:
        """
        Names of the inputs, in the order of the estimate; empty where they have none.
        """
    @property
    def limit_delays(self) -> dict:
        """
        The delay at which every limit is read, by name [cycles]: as stated, until its readings clearly fit another.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def limit_states(self) -> dict:
        """
        State of every limit by name: 'free' holds nothing back, 'active' turned the last step or is broken,
        'infeasible' cannot be met together with the other limits and the bounds, as far as the learnt slopes tell;
        the estimate goes to where the largest excess, counted in scales, is smallest.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
        """
    @property
    def settable(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The estimate in the steps in which its inputs are set, shape (inputs,).
        """
    @property
    def settings(self) -> dict:
        """
        Arguments that make this seeker again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What the run needs to go on bit for bit: named lists of numbers, JSON-able. Setting it restores the run;
        a state of another kind or size raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
class Surface:
    """
    Behind guide= of mgdd.optimize.GaussianProcessSeeking: a table over a grid.
    """
    __hash__: typing.ClassVar[None] = None
    def __call__(self, at: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> float:
        """
        Value at one point; the edge holds outside of the grid.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, list[list[float]], list[float]]:
        ...
    def __init__(self, axes: collections.abc.Sequence, values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def axes(self) -> list[list[float]]:
        """
        Of the grid, one per input.
        """
    @property
    def values(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        At its nodes, shape of the axes.
        """
class GaussianProcessSeeking:
    """
    By Gaussian processes; see mgdd.optimize.GaussianProcessSeeking.
    """
    def __init__(self, *, start: typing.Any, bounds: typing.Any = None, inputs: collections.abc.Sequence[Input] | None = None, noise_sd: typing.SupportsFloat | typing.SupportsIndex | None = None, horizon: typing.SupportsFloat | typing.SupportsIndex = 60.0, memory_cycles: typing.SupportsFloat | typing.SupportsIndex = 143.0, kept: typing.SupportsInt | typing.SupportsIndex = 100, first_step: typing.SupportsFloat | typing.SupportsIndex = 0.1, limit_probability: typing.SupportsFloat | typing.SupportsIndex = 0.95, delay_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, lag_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, components: collections.abc.Sequence[ComponentLag] | None = None, delay_uncertainty: typing.SupportsInt | typing.SupportsIndex = 4, seed: typing.SupportsInt | typing.SupportsIndex = 0, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], guide: collections.abc.Sequence[Surface | None] | None = None, limit_guides: collections.abc.Sequence[Surface | None] | None = None) -> None:
        """
        start : first estimate, per input
        bounds : least and largest applied input, each a number or one per input; none without
        inputs : names, units, bounds and scales
        noise_sd : of one reading of J
        horizon : cycles for which what is learnt pays
        memory_cycles : in which level and place are expected to wander by what counts
        kept : readings at most
        first_step : of the first readings, share of the bounds
        limit_probability : with which a limit holds at the estimate, and in forty cycles
        delay_cycles : between the plant and J
        lag_cycles : the same
        components : delay and lag of each component of J
        delay_uncertainty : cycles by which a delay may be shorter or longer
        seed : of the inputs that are compared
        maximize : False to minimise J
        limits : measured quantities to keep
        guide : what a model says of J
        limit_guides : the same of every limit
        """
    def __repr__(self) -> str:
        ...
    def _clear_history(self) -> None:
        """
        Forget the history, keep the state.
        """
    def _history_columns(self) -> dict:
        """
        Columns behind .history.
        """
    def _set_history_columns(self, columns: collections.abc.Mapping[str, typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]) -> None:
        """
        Columns behind .history, as _history_columns gave them.
        """
    def ask(self) -> typing.Any:
        """
        The input to apply in this cycle: an array of shape (inputs,), or a dict where inputs have names. Asking again
        before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False, applied: typing.Any = None) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its J and limits are not read;
        applied: what the plant really applied, one number per input or by name; None where it is what was asked for.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
        """
    @property
    def _watched(self) -> dict:
        """
        What the findings are made of.
        """
    @property
    def component_count(self) -> int:
        """
        Components of J that tell takes.
        """
    @property
    def cycle(self) -> int:
        """
        Cycles told so far, misfires included.
        """
    @property
    def delay_cycles(self) -> typing.Any:
        """
        Cycles between input and reading of J that explain the readings best; of several components a list.
        """
    @property
    def doubts(self) -> int:
        """
        How often the readings were not what the process expects, and what was known was aged.
        """
    @property
    def estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Present estimate of the optimum, shape (inputs,).
        """
    @property
    def expected(self) -> float:
        """
        J that is expected at the estimate; 0 before there are readings enough.
        """
    @property
    def expected_sd(self) -> float:
        """
        Standard deviation of that expectation, without the noise of a reading.
        """
    @property
    def failing_above(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The nearest input known to fail on the upper side, shape (inputs,); infinite: none. After four failures on
        one side (more where cycles fail by chance) no more is asked than what has worked, but for single cycles that
        try whether it still fails.
        """
    @property
    def failing_below(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The same on the lower side; minus infinity: none.
        """
    @property
    def failing_everywhere(self) -> bool:
        """
        True after twelve failures in a row: of several inputs, or of the start where nothing has worked yet.
        """
    @property
    def guide_factor(self) -> list:
        """
        What the guide of each component is multiplied by, as learnt: about 1 where it is right, towards 0 where it says nothing.
        """
    @property
    def input_names(self) -> list[str]:
        """
        Names of the inputs, in the order of the estimate; empty where they have none.
        """
    @property
    def limit_delays(self) -> dict:
        """
        The delay at which every limit is read, by name [cycles]: as stated, until its readings clearly fit another.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def limit_states(self) -> dict:
        """
        State of every limit by name: 'free' holds nothing back, 'active' turned the last step or is broken,
        'infeasible' cannot be met together with the other limits and the bounds, as far as the learnt slopes tell;
        the estimate goes to where the largest excess, counted in scales, is smallest.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
        """
    @property
    def noise_sd(self) -> float:
        """
        Standard deviation of one reading of J, as learnt.
        """
    @property
    def settable(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The estimate in the steps in which its inputs are set, shape (inputs,).
        """
    @property
    def settings(self) -> dict:
        """
        Arguments that make this seeker again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What the run needs to go on bit for bit: named lists of numbers, JSON-able. Setting it restores the run;
        a state of another kind or size raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def trust(self) -> float:
        """
        Least share of the bends of J that a guide holds, as learnt: above 0.5 where it helps, towards 0 where it says nothing; 1 without a guide.
        """
class MapSeeking:
    """
    A map by Gaussian processes; see mgdd.optimize.MapSeeking.
    """
    def __init__(self, *, start: typing.Any, bounds: typing.Any = None, inputs: collections.abc.Sequence[Input] | None = None, context: collections.abc.Sequence[Input] | None = None, axes: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]] | None = None, noise_sd: typing.SupportsFloat | typing.SupportsIndex | None = None, horizon: typing.SupportsFloat | typing.SupportsIndex = 60.0, averaged: typing.SupportsFloat | typing.SupportsIndex = 1.0, moving_cost: typing.SupportsFloat | typing.SupportsIndex = 0.0, memory_readings: typing.SupportsFloat | typing.SupportsIndex = 1000.0, kept: typing.SupportsInt | typing.SupportsIndex = 200, smoothness: typing.SupportsFloat | typing.SupportsIndex = 0.0, reach: typing.SupportsFloat | typing.SupportsIndex = 0.1, limit_probability: typing.SupportsFloat | typing.SupportsIndex = 0.95, seed: typing.SupportsInt | typing.SupportsIndex = 0, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], guide: collections.abc.Sequence[Surface | None] | None = None, limit_guides: collections.abc.Sequence[Surface | None] | None = None) -> None:
        """
        start : first estimate, per input
        bounds : least and largest applied input, each a number or one per input; none without
        inputs : names, units, bounds and scales
        context : numbers of an operating point
        axes : entries of each, whose product are the cells
        noise_sd : of one reading of J
        horizon : readings at a point for which what is learnt pays
        averaged : readings whose mean a visit gives
        moving_cost : of another operating point, in visits
        memory_readings : in which level and place are expected to wander
        kept : readings at most
        smoothness : J that a squared bend of the map costs
        reach : from the best input of a cell, share of the bounds
        limit_probability : with which a limit holds in a cell
        seed : of the inputs that are compared
        maximize : False to minimise J
        limits : measured quantities to keep
        guide : what a model says of J
        limit_guides : the same of every limit
        """
    def __repr__(self) -> str:
        ...
    def _ask(self, context: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
        """
        Input of the next reading at a point.
        """
    def _cells(self) -> list:
        """
        Of every cell: point, best input and its sd, objective there, its sd, expected regret, excess, probability of limits.
        """
    def _suggest(self) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], float, float]:
        """
        Point and input of the next reading, by what it is expected to raise the objective, and what is not known of it there, as a standard deviation. Releases the GIL.
        """
    def _tell(self, context: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], j: typing.SupportsFloat | typing.SupportsIndex, limits: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], misfire: bool, readings: typing.SupportsFloat | typing.SupportsIndex, sd: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> int:
        """
        What was read: 0 where it was taken, 1 for a misfire, else it was refused. Releases the GIL.
        """
    def reseed(self, seed: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        Compare other inputs from here on.
        """
    @property
    def _estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Best input at the point of the last _ask, as it was known then.
        """
    @property
    def doubts(self) -> int:
        """
        How often readings were not what was expected, and what was known was aged.
        """
    @property
    def guide_factor(self) -> float:
        """
        What the guide is multiplied by, as learnt; 0 without one.
        """
    @property
    def noise_sd(self) -> float:
        """
        Standard deviation of one reading of the objective, as learnt.
        """
    @property
    def readings(self) -> int:
        """
        How many there were, failures included.
        """
    @property
    def settings(self) -> dict:
        """
        Arguments that make this search again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a search needs to go on bit for bit; a state that the settings do not allow is refused and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def trust(self) -> float:
        """
        Share of the objective's bends that the guide holds, as learnt; 1 without a guide.
        """
class IterativeLearning:
    """
    Iterative learning control, ask and tell.
    """
    def __init__(self, initial: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, law: str, impulse_response: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], relative_degree: typing.SupportsInt | typing.SupportsIndex | None = None, k_p: typing.SupportsFloat | typing.SupportsIndex | None = None, k_d: typing.SupportsFloat | typing.SupportsIndex | None = None, learning_function: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], lead: typing.SupportsInt | typing.SupportsIndex | None = None, cutoff: typing.SupportsFloat | typing.SupportsIndex | None = None, error_weight: typing.SupportsFloat | typing.SupportsIndex | None = None, input_weight: typing.SupportsFloat | typing.SupportsIndex | None = None, change_weight: typing.SupportsFloat | typing.SupportsIndex | None = None, lower: typing.SupportsFloat | typing.SupportsIndex = ..., upper: typing.SupportsFloat | typing.SupportsIndex = ..., rate: typing.SupportsFloat | typing.SupportsIndex = ..., guard: bool = True) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def ask(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Input of this trial.
        """
    def convergence(self) -> dict:
        """
        Findings of the linear theory, by name. Releases the GIL.
        """
    def restore(self, state: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        """
        Go on from the columns of `state`.
        """
    def state(self) -> dict[str, list[float]]:
        """
        Columns by name.
        """
    def tell(self, error: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        """
        Error of this trial; makes the next input. Releases the GIL.
        """
    @property
    def best_input(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Its input.
        """
    @property
    def best_norm(self) -> float:
        """
        Its error norm.
        """
    @property
    def best_trial(self) -> int:
        """
        Trial of the least error norm.
        """
    @property
    def error_norms(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Error norms of the latest trials.
        """
    @property
    def frozen(self) -> bool:
        """
        Whether the guard stopped learning.
        """
    @property
    def relative_degree(self) -> int:
        """
        Samples until an input acts.
        """
    @property
    def trial(self) -> int:
        """
        Number of the trial to come.
        """
def autocorrelation_time(residual: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> float:
    """
    Integrated autocorrelation time of a residual about zero, in samples (Geyer 1992).
    """
def latin_hypercube(parameters: collections.abc.Sequence[Parameter], n: typing.SupportsInt | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]]:
    """
    Points between the bounds, one per cell of every axis.
    """
def least_squares(fun: collections.abc.Callable, x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], *, parameters: collections.abc.Sequence[Parameter], options: LeastSquaresOptions, records: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] = []) -> FitReport:
    """
    Minimise sum(residual^2) / 2 for `fun(x) -> (residual, jacobian)`; None refuses a point. With the rows of each record, errors count blocks of what is correlated in time.
    """
