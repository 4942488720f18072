"""
Models that guide a seeker: feed-forward, curves, trust.
"""
from __future__ import annotations
import collections.abc
import mgdd._core.engine
import mgdd._core.optimize
import numpy
import numpy.typing
import typing
__all__: list[str] = ['Curve', 'CurveSeeking', 'FeedForward', 'GuidedEngine', 'ModelOptimum', 'OnlineCalibration', 'calibrated_parameters']
class Curve:
    """
    What a model says of one quantity over one input: a smooth curve through given points.
    
    Between the points runs a cubic, beyond them a straight line.
    
    Parameters
    ----------
    inputs : array_like, shape (n,)
        Increasing inputs, three or more, in their unit.
    values : array_like, shape (n,)
        What the model says there, in its unit.
    
    Raises
    ------
    mgdd.errors.ShapeError
        Fewer than three points, or not one value per input.
    mgdd.errors.ParameterError
        A number that is not finite, or inputs that do not increase.
    
    Examples
    --------
    >>> from mgdd.guide import Curve
    >>> curve = Curve([-20.0, -10.0, 0.0, 10.0], [-5.0, 0.0, -4.0, -16.0])
    >>> curve(-10.0), round(curve.best, 1)
    (0.0, -9.4)
    >>> round(Curve.parabola(curvature=-0.05, best=-6.0, reach=40.0)(-4.0), 3)
    -0.1
    """
    __hash__: typing.ClassVar[None] = None
    @staticmethod
    def _of_table(table: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> Curve:
        """
        The curve of such a table.
        """
    @staticmethod
    def parabola(*, curvature: typing.SupportsFloat | typing.SupportsIndex, best: typing.SupportsFloat | typing.SupportsIndex, reach: typing.SupportsFloat | typing.SupportsIndex) -> Curve:
        """
        curvature/2 (x - best)^2 on [best - reach, best + reach]; ParameterError unless curvature < 0.
        """
    def __call__(self, inputs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Value at one input or at many; ParameterError for one that is not finite.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict[str, list[float]]]:
        ...
    def __init__(self, inputs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def curvature(self, reach: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Second difference over +-reach about the best input.
        """
    @property
    def _table(self) -> dict[str, list[float]]:
        """
        What a file keeps of it.
        """
    @property
    def best(self) -> float:
        """
        Input of the largest value.
        """
    @property
    def lower(self) -> float:
        """
        First input given.
        """
    @property
    def top(self) -> float:
        """
        The largest value.
        """
    @property
    def upper(self) -> float:
        """
        Last input given.
        """
class CurveSeeking:
    """
    Seeking guided by a curve; see mgdd.guide.CurveSeeking.
    """
    def __init__(self, *, start: typing.Any, bounds: typing.Any = None, inputs: collections.abc.Sequence[mgdd._core.optimize.Input] | None = None, curve: Curve, prior_sd: typing.SupportsFloat | typing.SupportsIndex | None = None, scale_sd: typing.SupportsFloat | typing.SupportsIndex = 0.3, discrepancy: typing.SupportsFloat | typing.SupportsIndex = 0.25, noise_sd: typing.SupportsFloat | typing.SupportsIndex | None = None, memory_cycles: typing.SupportsFloat | typing.SupportsIndex = 143.0, amplitude_max: typing.SupportsFloat | typing.SupportsIndex | None = None, rate: typing.SupportsFloat | typing.SupportsIndex | None = None, delay_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, lag_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, delay_uncertainty: typing.SupportsInt | typing.SupportsIndex = 4, hand_over: bool = True, maximize: bool = True, limits: collections.abc.Sequence[mgdd._core.optimize.Limit] = [], limit_curves: collections.abc.Sequence[Curve] | None = None) -> None:
        """
        start : first estimate, per input
        bounds : least and largest applied input, each a number or one per input; none without
        inputs : names, units, bounds and scales
        curve : the guide's J
        prior_sd : how far the best input may lie from the guide's
        scale_sd : of the plant's curvature over the guide's
        discrepancy : error of the curve per unit of its drop
        noise_sd : of one reading of J
        memory_cycles : time constant with which readings fade
        amplitude_max : largest distance from the estimate that is applied
        rate : largest change of the applied input per cycle
        delay_cycles : between the plant and J
        lag_cycles : the same
        delay_uncertainty : cycles by which the delay may be shorter or longer
        hand_over : to plain extremum seeking where the guide keeps failing
        maximize : False to minimise J
        limits : measured quantities to keep
        limit_curves : of the guide, one per limit
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
    def guide(self, curve: Curve) -> bool:
        """
        The operating point has changed, and the guide's curve with it.
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
    def answered(self) -> bool:
        """
        False where 60 readings and more have not shown that J answers the input: the estimate is the guide's.
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
    def delay_cycles(self) -> int:
        """
        Whole cycles between input and reading that explain the readings best.
        """
    @property
    def doubts(self) -> int:
        """
        How often the readings were doubted.
        """
    @property
    def estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Present estimate of the optimum, shape (inputs,).
        """
    @property
    def estimate_sd(self) -> float:
        """
        Standard deviation of the estimate as stated, in the unit of the input; NaN after a hand-over.
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
    def handed_over(self) -> bool:
        """
        Whether plain extremum seeking is at work, because the guide kept failing.
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
    def scale(self) -> float:
        """
        Curvature of the plant's J over that of the guide, as learnt.
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
        Share of what the curve leaves that is noise, times the smaller of `scale` and its inverse; 0 after a hand-over.
        """
class FeedForward:
    """
    A seeker with feed-forward; see mgdd.guide.FeedForward.
    """
    def __init__(self, seeker: typing.Any, *, calibration_rate: typing.Any, following_share: typing.SupportsFloat | typing.SupportsIndex, trust: typing.SupportsFloat | typing.SupportsIndex, probe_cycles: typing.SupportsInt | typing.SupportsIndex, probe_settling: typing.SupportsInt | typing.SupportsIndex, trust_sd: typing.SupportsFloat | typing.SupportsIndex, doubt: typing.SupportsFloat | typing.SupportsIndex, curvature_spread: typing.SupportsFloat | typing.SupportsIndex, significance: typing.SupportsFloat | typing.SupportsIndex, noise_sd: typing.SupportsFloat | typing.SupportsIndex | None) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def _hold(self) -> None:
        """
        A new operating point of which the guide says nothing.
        """
    def _offer(self, optimum: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], curvature: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], cause: str) -> bool:
        """
        What the guide says; False where it cannot be used.
        """
    def _set_seeker_history(self, columns: collections.abc.Mapping[str, typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]) -> None:
        """
        History of the seeker, as its _history_columns gave it.
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
    def _core_state(self) -> dict[str, list[float]]:
        """
        State of the feed-forward and of its seeker.
        """
    @_core_state.setter
    def _core_state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def _seeker_history(self) -> dict:
        """
        History of the seeker, as its _history_columns.
        """
    @property
    def _seeker_state(self) -> dict[str, list[float]]:
        """
        State of the seeker.
        """
    @property
    def _watched(self) -> dict:
        """
        What the findings are made of.
        """
    @property
    def applied(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input of the last ask, shape (inputs,).
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
    def feed_forward(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Feed-forward in force, shape (inputs,); NaN before there is one.
        """
    @property
    def guide_optimum(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last valid optimum of the guide, shape (inputs,); NaN before there is one.
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
        Standard deviation of one reading of J, as given or learnt; NaN while it is not known.
        """
    @property
    def settable(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The estimate in the steps in which its inputs are set, shape (inputs,).
        """
    @property
    def testing(self) -> int:
        """
        1: the next cycle measures the old place, 2: the new one, 0: no test of the guide is under way.
        """
    @property
    def trim(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Estimate less feed-forward, what the seeker has learnt itself, shape (inputs,); NaN without a guide.
        """
    @property
    def trust(self) -> float:
        """
        Trust in the guide, 0 to 1: share of its next move that is made.
        """
    @property
    def verdict(self) -> str:
        """
        What the last test of the guide said: ``untested``, ``undecided``, ``confirmed`` or ``wrong``.
        """
class ModelOptimum:
    """
    Best timing of the cycle model; see mgdd.guide.ModelOptimum.
    """
    def __init__(self, cylinder: mgdd._core.engine.Cylinder, *, performance: mgdd._core.engine.Performance, nox: mgdd._core.engine.NoxModel, method: str, bounds_cad: tuple[typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex], step_size: typing.SupportsFloat | typing.SupportsIndex, difference_cad: typing.SupportsFloat | typing.SupportsIndex, tolerance_cad: typing.SupportsFloat | typing.SupportsIndex, iterations: typing.SupportsInt | typing.SupportsIndex, step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def _curves(self, point: mgdd._core.engine.OperatingPoint, names: collections.abc.Sequence[str]) -> list[Curve] | None:
        """
        J and indicators over SOC at one operating point; None where the model has no physical cycle.
        """
    def _find(self, point: mgdd._core.engine.OperatingPoint) -> dict:
        """
        The search at one operating point.
        """
    def _set_cylinder(self, cylinder: mgdd._core.engine.Cylinder) -> None:
        """
        Other parameters of the same geometry.
        """
    @property
    def cylinder(self) -> mgdd._core.engine.Cylinder:
        """
        The model at present.
        """
    @property
    def settings(self) -> dict:
        """
        Keyword arguments that, with `cylinder`, make this guide again.
        """
class OnlineCalibration:
    """
    Calibration while an engine runs; use mgdd.guide.OnlineCalibration.
    """
    def __init__(self, *, cylinder: mgdd._core.engine.Cylinder, method: str, parameters: collections.abc.Sequence[str], uncertainty: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], window_cycles: typing.SupportsInt | typing.SupportsIndex, steady_cycles: typing.SupportsInt | typing.SupportsIndex, cov_limit_percent: typing.SupportsFloat | typing.SupportsIndex, forgetting: typing.SupportsFloat | typing.SupportsIndex, soc_scatter_cad: typing.SupportsFloat | typing.SupportsIndex, jump_factor: typing.SupportsFloat | typing.SupportsIndex, trials_per_update: typing.SupportsInt | typing.SupportsIndex, step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def offer(self, pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], point: mgdd._core.engine.OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, *, misfire: bool = False) -> str:
        """
        Takes one cycle; the status says what became of it.
        """
    def restart(self) -> None:
        """
        Forget all cycles, keep the parameters.
        """
    def update(self) -> str:
        """
        One step of the calibration; the status says what became of it.
        """
    @property
    def angles_cad(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Angles that a pressure trace is taken on [°CA aTDC].
        """
    @property
    def cylinder(self) -> mgdd._core.engine.Cylinder:
        """
        The guide's cylinder with the adapted parameters.
        """
    @property
    def determined(self) -> bool:
        """
        Whether the data determine every parameter that is adapted.
        """
    @property
    def errors(self) -> dict:
        ...
    @property
    def figures(self) -> dict:
        ...
    @property
    def settings(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        State between two cycles: named lists of numbers, JSON-able. Setting it continues that run bit for
        bit; a state of other settings raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def status(self) -> str:
        """
        Of the last call.
        """
    @property
    def values(self) -> dict:
        ...
    @property
    def verdicts(self) -> dict:
        ...
class GuidedEngine:
    """
    The guided loop of an engine; see mgdd.guide.GuidedEngine.
    """
    def __init__(self, seeker: typing.Any, model: ModelOptimum, calibration: OnlineCalibration | None, point: mgdd._core.engine.OperatingPoint, *, changed_share: typing.SupportsFloat | typing.SupportsIndex, calibrated_sd_cad: typing.SupportsFloat | typing.SupportsIndex, recalibrated_cad: typing.SupportsFloat | typing.SupportsIndex, calibration_rate_cad: typing.SupportsFloat | typing.SupportsIndex, noise_sd: typing.SupportsFloat | typing.SupportsIndex | None, keep_start: bool) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def _at(self, point: mgdd._core.engine.OperatingPoint) -> str:
        """
        The operating point of the next cycle.
        """
    def _now(self) -> dict:
        """
        What the next cycle is made of.
        """
    def _tell(self, J: typing.Any, limits: typing.Any, misfire: bool, applied: typing.Any, pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None) -> None:
        """
        tell, with the pressure.
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
    def applied(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input of the last ask, shape (1,).
        """
    @property
    def calibration_status(self) -> str:
        """
        What became of the last cycle in the calibration; ``none`` without one.
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
    def cylinder(self) -> mgdd._core.engine.Cylinder:
        """
        The guide's cylinder as calibrated.
        """
    @property
    def estimate(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Present estimate of the optimum, shape (inputs,).
        """
    @property
    def estimate_sd(self) -> float:
        """
        Standard deviation of the estimate as stated [°CA]; NaN where the seeker states none.
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
    def recalibrations(self) -> int:
        """
        How often a calibration moved what the guide says.
        """
    @property
    def refusals(self) -> int:
        """
        Answers of the model, and operating points, that could not be used.
        """
    @property
    def settable(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The estimate in the steps in which its inputs are set, shape (inputs,).
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What the run needs to go on bit for bit, the history excepted: named lists of numbers, JSON-able.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def trust(self) -> float:
        """
        Trust in the guide, 0 to 1.
        """
def calibrated_parameters() -> dict:
    """
    Unit and meaning of every parameter of an online calibration, by name.
    """
