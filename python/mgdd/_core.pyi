"""
The C++ core of mgdd. Use it through mgdd.engine, mgdd.throttle, mgdd.identify, mgdd.optimize and mgdd.loop.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['BoundedSeeking', 'ComponentLag', 'Cylinder', 'CylinderFit', 'DriveAxis', 'EngineBench', 'ExtremumSeeking', 'FitReport', 'FreeRunFit', 'FreeRunRecord', 'GoldenSection', 'GradientDescent', 'GradientPwR', 'IterativeLearning', 'LeastSquaresOptions', 'Limit', 'LoadBurn', 'LoadFit', 'MeasuredCycle', 'NewtonSeeking', 'NoxFit', 'NoxModel', 'NoxProxy', 'OperatingPoint', 'Parameter', 'Performance', 'PerformanceTerm', 'PseudoWienerModel', 'PseudoWienerStepper', 'RecursivePwR', 'SensorDynamics', 'SensorPair', 'SoftSensor', 'Spsa', 'Throttle', 'ThrottleStepper', 'TraceOptions', 'TwoTanks', 'VirtualThrottle', 'WienerHammerstein', 'WindowPwR', 'analyze_trace', 'burn_duration_cad', 'burned_fraction', 'check_trace', 'common_parameters', 'compiled_simd_level', 'compiler', 'convergence', 'correlation_limit', 'differentiable_inputs', 'estimate_burn', 'filter_series', 'fit_cylinder', 'fit_nox_proxy', 'fit_pseudo_wiener', 'fit_smooth_throttle', 'fit_throttle_groups', 'hardenberg_hase_delay_cad', 'hohenberg_coefficient', 'indicator_units', 'input_unit', 'latin_hypercube', 'least_squares', 'load_parameters', 'monte_carlo', 'processor_simd_levels', 'pseudo_wiener_of', 'pseudo_wiener_units', 'run_loop', 'scan', 'sense_throttle', 'sensitivities', 'sensor_fault_kinds', 'simulate', 'simulate_smooth_throttle', 'simulate_throttle', 'simulate_throttle_groups', 'simulate_throttle_many', 'smooth_throttle_example', 'smooth_throttle_instruction_set', 'smooth_throttle_names', 'start_of_combustion', 'start_of_injection', 'throttle_airflow_torque', 'throttle_group_bounds', 'throttle_group_names', 'timing_window_cad', 'tune', 'volume_l', 'wall_area_m2', 'wall_heat_scale_upper', 'watson_delay_ms', 'with_burn', 'wolfer_delay_ms', 'woschni_c1_bar_m', 'woschni_coefficient']
class Parameter:
    """
    One unknown of a fit: name, bounds, and whether it is searched as its log.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, arg0: Parameter) -> bool:
        ...
    def __getstate__(self) -> tuple:
        ...
    def __init__(self, *, name: str, lower: typing.SupportsFloat | typing.SupportsIndex = ..., upper: typing.SupportsFloat | typing.SupportsIndex = ..., log_scaled: bool = False) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def log_scaled(self) -> bool:
        """
        Searched as log(p); needs lower > 0.
        """
    @property
    def lower(self) -> float:
        """
        Lower bound, -inf for none.
        """
    @property
    def name(self) -> str:
        """
        Name in reports and messages.
        """
    @property
    def upper(self) -> float:
        """
        Upper bound, inf for none.
        """
class LeastSquaresOptions:
    """
    When a least-squares search ends and what it reports.
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, max_iterations: typing.SupportsInt | typing.SupportsIndex = 200, cost_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-12, step_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-10, gradient_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-12, initial_damping: typing.SupportsFloat | typing.SupportsIndex = 0.001, correlation_limit: typing.SupportsFloat | typing.SupportsIndex = 0.98, rank_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-10, evaluate_together: bool = True) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def correlation_limit(self) -> float:
        """
        Correlation beyond which two parameters count as unidentifiable [-].
        """
    @property
    def cost_tolerance(self) -> float:
        """
        Relative decrease of the cost [-].
        """
    @property
    def evaluate_together(self) -> bool:
        """
        Residual and Jacobian in one call.
        """
    @property
    def gradient_tolerance(self) -> float:
        """
        Cosine between the residual and a free Jacobian column [-].
        """
    @property
    def initial_damping(self) -> float:
        """
        Relative to unit columns [-].
        """
    @property
    def max_iterations(self) -> int:
        """
        Trial steps.
        """
    @property
    def rank_tolerance(self) -> float:
        """
        Singular value, relative to the largest, that counts as zero [-].
        """
    @property
    def step_tolerance(self) -> float:
        """
        Step over parameters, scaled [-].
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
    
    Raises
    ------
    mgdd.errors.ParameterError
        When a seeker is made with it: limit not finite, negative margin, weight not > 0.
    
    Examples
    --------
    >>> from mgdd.optimize import Limit
    >>> Limit("p_max_bar", 95.0, margin=1.0)
    Limit('p_max_bar', 95.0, margin=1.0, method='switching', weight=1.0, scale=0.0)
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, arg0: Limit) -> bool:
        ...
    def __getstate__(self) -> tuple[str, float, float, str, float, float]:
        ...
    def __init__(self, name: str, upper: typing.SupportsFloat | typing.SupportsIndex, *, margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, method: str = 'switching', weight: typing.SupportsFloat | typing.SupportsIndex = 1.0, scale: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def margin(self) -> float:
        """
        Kept free below the limit.
        """
    @property
    def method(self) -> str:
        """
        How J knows of the limit.
        """
    @property
    def name(self) -> str:
        """
        What is limited.
        """
    @property
    def scale(self) -> float:
        """
        Unit of the excess.
        """
    @property
    def upper(self) -> float:
        """
        The limit.
        """
    @property
    def weight(self) -> float:
        """
        Of penalty or barrier.
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
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, arg0: ComponentLag) -> bool:
        ...
    def __getstate__(self) -> tuple[float, float]:
        ...
    def __init__(self, *, delay_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0, lag_cycles: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def response(self, *, period: typing.SupportsInt | typing.SupportsIndex, harmonic: typing.SupportsInt | typing.SupportsIndex = 1) -> tuple[float, float]:
        """
        Gain [-] and phase lag [deg] at `harmonic` oscillations per `period` cycles.
        """
    @property
    def delay_cycles(self) -> float:
        """
        Transport delay [cycles].
        """
    @property
    def lag_cycles(self) -> float:
        """
        Time constant of the lag [cycles].
        """
class ExtremumSeeking:
    """
    Extremum seeking; see mgdd.optimize.ExtremumSeeking.
    """
    def __init__(self, *, start: typing.Any, lower: typing.Any = ..., upper: typing.Any = ..., form: str = 'batch', amplitude: typing.Any = 1.0, period: typing.SupportsInt | typing.SupportsIndex = 10, harmonics: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] | None = None, gain: typing.Any = 0.98, rate: typing.Any = None, recovery_rate: typing.Any = None, washout_pole: typing.SupportsFloat | typing.SupportsIndex = 0.9, low_pass: typing.SupportsFloat | typing.SupportsIndex = 1.0, components: collections.abc.Sequence[ComponentLag] | None = None, hold_cycles: typing.SupportsInt | typing.SupportsIndex | None = None, amplitude_floor: typing.SupportsFloat | typing.SupportsIndex = 1.0, full_gradient: typing.SupportsFloat | typing.SupportsIndex = 0.0, limit_amplitude: typing.SupportsFloat | typing.SupportsIndex = 0.5, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], curvature: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
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
    def ask(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its numbers are not read.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
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
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last estimate of the slope of the maximised objective, shape (inputs,).
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
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
class NewtonSeeking:
    """
    Newton extremum seeking; see mgdd.optimize.NewtonSeeking.
    """
    def __init__(self, *, start: typing.Any, lower: typing.Any = ..., upper: typing.Any = ..., amplitude: typing.Any = 2.0, period: typing.SupportsInt | typing.SupportsIndex = 10, harmonics: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] | None = None, time_constant_cycles: typing.SupportsFloat | typing.SupportsIndex = 40.0, hessian_rate: typing.SupportsFloat | typing.SupportsIndex = 0.03, riccati_rate: typing.SupportsFloat | typing.SupportsIndex = 0.02, initial_hessian: typing.Any = -0.051, initial_inverse: typing.Any = -20.0, largest_inverse: typing.SupportsFloat | typing.SupportsIndex = 100.0, hold_cycles: typing.SupportsInt | typing.SupportsIndex = 300, rate: typing.Any = None, components: collections.abc.Sequence[ComponentLag] | None = None, limit_amplitude: typing.SupportsFloat | typing.SupportsIndex = 0.5, maximize: bool = True, limits: collections.abc.Sequence[Limit] = []) -> None:
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
    def ask(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its numbers are not read.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
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
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last estimate of the slope of the maximised objective, shape (inputs,).
        """
    @property
    def hessian(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Filtered Hessian of the maximised objective, shape (inputs, inputs).
        """
    @property
    def inverse_hessian(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        State of the Riccati filter, which tends to the inverse Hessian.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
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
class BoundedSeeking:
    """
    Bounded extremum seeking; see mgdd.optimize.BoundedSeeking.
    """
    def __init__(self, *, start: typing.Any, lower: typing.Any = ..., upper: typing.Any = ..., amplitude: typing.Any = 1.0, period: typing.SupportsInt | typing.SupportsIndex = 10, harmonics: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] | None = None, kappa: typing.SupportsFloat | typing.SupportsIndex = 1.0, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], curvature: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
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
    def ask(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its numbers are not read.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
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
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
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
    def __init__(self, *, start: typing.Any, lower: typing.Any = ..., upper: typing.Any = ..., form: str = 'first_order', schedule: str = 'decreasing', gain: typing.SupportsFloat | typing.SupportsIndex | None = None, stability: typing.SupportsFloat | typing.SupportsIndex = 50.0, gain_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.602, perturbation: typing.SupportsFloat | typing.SupportsIndex = 1.5, perturbation_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.101, step_max: typing.SupportsFloat | typing.SupportsIndex | None = None, averaging: typing.SupportsInt | typing.SupportsIndex = 1, blocking: bool = False, noise_sd: typing.SupportsFloat | typing.SupportsIndex = 0.0, initial_hessian: typing.SupportsFloat | typing.SupportsIndex = -0.051, hessian_prior: typing.SupportsFloat | typing.SupportsIndex = 20.0, limit_amplitude: typing.SupportsFloat | typing.SupportsIndex = 0.5, seed: typing.SupportsInt | typing.SupportsIndex = 0, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], curvature: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
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
    def ask(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its numbers are not read.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
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
    def iteration(self) -> int:
        """
        Iterations since the start or restart.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
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
    def __init__(self, *, start: typing.Any, lower: typing.Any = ..., upper: typing.Any = ..., step_size: typing.SupportsFloat | typing.SupportsIndex = 15.0, difference: typing.SupportsFloat | typing.SupportsIndex = 1.0, rate: typing.Any = None, tolerance: typing.SupportsFloat | typing.SupportsIndex = 0.02, iterations: typing.SupportsInt | typing.SupportsIndex = 60, maximize: bool = True, limits: collections.abc.Sequence[Limit] = [], curvature: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
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
    def ask(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its numbers are not read.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
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
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last estimate of the slope of the maximised objective, shape (inputs,).
        """
    @property
    def iteration(self) -> int:
        """
        Steps made.
        """
    @property
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
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
class GoldenSection:
    """
    Golden-section search; see mgdd.optimize.GoldenSection.
    """
    def __init__(self, *, start: typing.Any, lower: typing.Any, upper: typing.Any, noise_sd: typing.SupportsFloat | typing.SupportsIndex = 0.0, significance: typing.SupportsFloat | typing.SupportsIndex = 2.0, samples_max: typing.SupportsInt | typing.SupportsIndex = 8, tolerance: typing.SupportsFloat | typing.SupportsIndex = 0.02, maximize: bool = True, limits: collections.abc.Sequence[Limit] = []) -> None:
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
    def ask(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.
        """
    def restart(self) -> None:
        """
        The operating point has changed: forget the window, keep the estimate.
        """
    def tell(self, J: typing.Any = None, limits: typing.Any = None, *, misfire: bool = False) -> None:
        """
        Accept what was measured at the input of the last ask.
        
        J: float, or one number per component; limits: one value per limit, in order or by name;
        misfire: the cycle is counted and its numbers are not read.
        Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond
        1e30 in magnitude); the state is unchanged then.
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
    def limit_names(self) -> list[str]:
        """
        Names of the limits, in the order of tell.
        """
    @property
    def misfires(self) -> int:
        """
        Misfired cycles told so far.
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
class IterativeLearning:
    """
    Iterative learning control, ask and tell.
    """
    def __init__(self, initial: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, law: str, impulse_response: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], relative_degree: typing.SupportsInt | typing.SupportsIndex | None = None, k_p: typing.SupportsFloat | typing.SupportsIndex | None = None, k_d: typing.SupportsFloat | typing.SupportsIndex | None = None, learning_function: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], lead: typing.SupportsInt | typing.SupportsIndex | None = None, cutoff: typing.SupportsFloat | typing.SupportsIndex | None = None, error_weight: typing.SupportsFloat | typing.SupportsIndex | None = None, input_weight: typing.SupportsFloat | typing.SupportsIndex | None = None, change_weight: typing.SupportsFloat | typing.SupportsIndex | None = None, lower: typing.SupportsFloat | typing.SupportsIndex = ..., upper: typing.SupportsFloat | typing.SupportsIndex = ..., rate: typing.SupportsFloat | typing.SupportsIndex = ..., guard: bool = True) -> None:
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
class Cylinder:
    """
    Parameters of one cylinder: geometry, charge, gas, wall heat, burn law, ignition delay.
    
    Keyword-only and immutable; units stand in the names. Defaults are the preset `puma_single`.
    `Cylinder.fields()` lists every field with unit, bounds, meaning and default.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A field outside its domain, naming field, value and bound.
    
    Examples
    --------
    >>> from mgdd.engine import Cylinder
    >>> c = Cylinder(bore_mm=128.0, stroke_mm=144.0, connecting_rod_mm=241.5)
    >>> round(c.swept_volume_l, 4)
    1.853
    >>> c.replace(burn_shape="wiebe").burn_shape
    'wiebe'
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
    def __init__(self, *, burn_shape: str = 'triangle', gamma_model: str = 'constant', wall_heat_model: str = 'woschni', ignition_model: str = 'watson', bore_mm: typing.SupportsFloat | typing.SupportsIndex = 86.0, stroke_mm: typing.SupportsFloat | typing.SupportsIndex = 86.0, connecting_rod_mm: typing.SupportsFloat | typing.SupportsIndex = 155.0, compression_ratio: typing.SupportsFloat | typing.SupportsIndex = 18.2, ivc_cad: typing.SupportsFloat | typing.SupportsIndex = -140.0, evo_cad: typing.SupportsFloat | typing.SupportsIndex = 130.0, bowl_area_factor: typing.SupportsFloat | typing.SupportsIndex = 1.0, ivc_pressure_rise_kpa: typing.SupportsFloat | typing.SupportsIndex = 0.0, volumetric_efficiency: typing.SupportsFloat | typing.SupportsIndex = 0.9, lower_heating_value_mj_per_kg: typing.SupportsFloat | typing.SupportsIndex = 42.8, gamma: typing.SupportsFloat | typing.SupportsIndex = 1.37, gamma_linear_300k: typing.SupportsFloat | typing.SupportsIndex = 1.38, gamma_linear_slope_per_k: typing.SupportsFloat | typing.SupportsIndex = -8e-05, gamma_polynomial_c0: typing.SupportsFloat | typing.SupportsIndex = 1.338, gamma_polynomial_c1_per_k: typing.SupportsFloat | typing.SupportsIndex = -6e-05, gamma_polynomial_c2_per_k2: typing.SupportsFloat | typing.SupportsIndex = 1e-08, wall_heat_scale: typing.SupportsFloat | typing.SupportsIndex = 0.5, woschni_c2: typing.SupportsFloat | typing.SupportsIndex = 2.28, woschni_cp_m_per_sk: typing.SupportsFloat | typing.SupportsIndex = 0.00324, wall_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 450.0, burn_duration_ref_cad: typing.SupportsFloat | typing.SupportsIndex = 30.0, burn_fuel_ref_mg: typing.SupportsFloat | typing.SupportsIndex = 20.0, burn_speed_ref_rpm: typing.SupportsFloat | typing.SupportsIndex = 1500.0, burn_fuel_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.6, burn_speed_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.3, wiebe_a: typing.SupportsFloat | typing.SupportsIndex = 6.908, wiebe_m: typing.SupportsFloat | typing.SupportsIndex = 1.5, second_fraction: typing.SupportsFloat | typing.SupportsIndex = 0.6, second_delay_cad: typing.SupportsFloat | typing.SupportsIndex = 3.0, second_duration_cad: typing.SupportsFloat | typing.SupportsIndex = 50.0, second_wiebe_m: typing.SupportsFloat | typing.SupportsIndex = 0.8, cetane_number: typing.SupportsFloat | typing.SupportsIndex = 45.0, ignition_c0_cad: typing.SupportsFloat | typing.SupportsIndex = 4.0, ignition_c1: typing.SupportsFloat | typing.SupportsIndex = 0.0, ignition_c2_per_cad: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> Cylinder:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def bore_mm(self) -> float:
        """
        cylinder bore [mm]
        """
    @property
    def bowl_area_factor(self) -> float:
        """
        head and piston area over two flat discs [-]
        """
    @property
    def burn_duration_ref_cad(self) -> float:
        """
        burn duration at the reference point [°CA]
        """
    @property
    def burn_fuel_exponent(self) -> float:
        """
        duration law: exponent of fuel [-]
        """
    @property
    def burn_fuel_ref_mg(self) -> float:
        """
        fuel of the reference point [mg]
        """
    @property
    def burn_shape(self) -> str:
        ...
    @property
    def burn_speed_exponent(self) -> float:
        """
        duration law: exponent of speed [-]
        """
    @property
    def burn_speed_ref_rpm(self) -> float:
        """
        speed of the reference point [rpm]
        """
    @property
    def cetane_number(self) -> float:
        """
        for Hardenberg-Hase [-]
        """
    @property
    def clearance_volume_l(self) -> float:
        """
        Clearance volume [L].
        """
    @property
    def compression_ratio(self) -> float:
        """
        geometric compression ratio [-]
        """
    @property
    def connecting_rod_mm(self) -> float:
        """
        connecting rod, eye to eye [mm]
        """
    @property
    def evo_cad(self) -> float:
        """
        exhaust valve opening [°CA aTDC]
        """
    @property
    def gamma(self) -> float:
        """
        constant ratio of specific heats [-]
        """
    @property
    def gamma_linear_300k(self) -> float:
        """
        linear gamma(T) at 300 K [-]
        """
    @property
    def gamma_linear_slope_per_k(self) -> float:
        """
        slope of linear gamma(T) [1/K]
        """
    @property
    def gamma_model(self) -> str:
        ...
    @property
    def gamma_polynomial_c0(self) -> float:
        """
        polynomial gamma(T), constant [-]
        """
    @property
    def gamma_polynomial_c1_per_k(self) -> float:
        """
        polynomial gamma(T), linear term [1/K]
        """
    @property
    def gamma_polynomial_c2_per_k2(self) -> float:
        """
        polynomial gamma(T), quadratic term [1/K^2]
        """
    @property
    def ignition_c0_cad(self) -> float:
        """
        polynomial ignition delay, constant [°CA]
        """
    @property
    def ignition_c1(self) -> float:
        """
        polynomial ignition delay, linear term [-]
        """
    @property
    def ignition_c2_per_cad(self) -> float:
        """
        polynomial ignition delay, quadratic term [1/°CA]
        """
    @property
    def ignition_model(self) -> str:
        ...
    @property
    def ivc_cad(self) -> float:
        """
        intake valve closing [°CA aTDC]
        """
    @property
    def ivc_pressure_rise_kpa(self) -> float:
        """
        p(IVC) above the intake pressure [kPa]
        """
    @property
    def lower_heating_value_mj_per_kg(self) -> float:
        """
        heat of the fuel [MJ/kg]
        """
    @property
    def second_delay_cad(self) -> float:
        """
        start of the second Wiebe law after the first [°CA]
        """
    @property
    def second_duration_cad(self) -> float:
        """
        duration of the second Wiebe law [°CA]
        """
    @property
    def second_fraction(self) -> float:
        """
        share of the heat in the second Wiebe law [-]
        """
    @property
    def second_wiebe_m(self) -> float:
        """
        shape of the second Wiebe law [-]
        """
    @property
    def stroke_mm(self) -> float:
        """
        piston stroke [mm]
        """
    @property
    def swept_volume_l(self) -> float:
        """
        Swept volume [L].
        """
    @property
    def volumetric_efficiency(self) -> float:
        """
        trapped over ideal charge at intake conditions [-]
        """
    @property
    def wall_heat_model(self) -> str:
        ...
    @property
    def wall_heat_scale(self) -> float:
        """
        wall heat over the textbook law (Woschni C1/129.8) [-]
        """
    @property
    def wall_temperature_k(self) -> float:
        """
        mean wall temperature [K]
        """
    @property
    def wiebe_a(self) -> float:
        """
        Wiebe completeness [-]
        """
    @property
    def wiebe_m(self) -> float:
        """
        Wiebe shape, exponent m + 1 [-]
        """
    @property
    def woschni_c2(self) -> float:
        """
        weight of the mean piston speed [-]
        """
    @property
    def woschni_cp_m_per_sk(self) -> float:
        """
        combustion term of the gas velocity [m/(s K)]
        """
class OperatingPoint:
    """
    What changes from cycle to cycle: speed, fuel, intake state.
    
    Keyword-only and immutable. `burn_duration_cad=None` is the cylinder's duration law; `trapped_mass_g=None` its
    volumetric efficiency.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A field outside its domain, naming field, value and bound.
    
    Examples
    --------
    >>> from mgdd.engine import OperatingPoint
    >>> OperatingPoint(speed_rpm=2000.0, fuel_mg=12.0)
    OperatingPoint(speed_rpm=2000.0, fuel_mg=12.0)
    """
    @staticmethod
    def fields() -> dict:
        """
        Every field by name: unit, bounds, meaning, default.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, speed_rpm: typing.SupportsFloat | typing.SupportsIndex = 1500.0, fuel_mg: typing.SupportsFloat | typing.SupportsIndex = 20.0, intake_pressure_kpa: typing.SupportsFloat | typing.SupportsIndex = 150.0, intake_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 313.0, burn_duration_cad: typing.SupportsFloat | typing.SupportsIndex | None = None, trapped_mass_g: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> OperatingPoint:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def burn_duration_cad(self) -> float | None:
        ...
    @property
    def fuel_mg(self) -> float:
        """
        fuel per cycle, 0 = motored [mg]
        """
    @property
    def intake_pressure_kpa(self) -> float:
        """
        intake pressure [kPa]
        """
    @property
    def intake_temperature_k(self) -> float:
        """
        intake temperature [K]
        """
    @property
    def speed_rpm(self) -> float:
        """
        engine speed [rpm]
        """
    @property
    def trapped_mass_g(self) -> float | None:
        ...
class NoxProxy:
    """
    NOx proxy from the maximum bulk gas temperature: a correlation to be fitted.
    
    Two maps with equal slope at the reference: affine-log, NOx0 exp(b/T0^2 (T - T0)), and Arrhenius,
    NOx0 exp(-b (1/T - 1/T0)). Valid at fixed intake oxygen only; the defaults are plausible, not of any engine.
    
    Parameters
    ----------
    reference_temperature_k : float
        T0 [K].
    reference_nox_ppm : float
        NOx0, at T0 [ppm].
    activation_temperature_k : float
        b [K].
    
    Raises
    ------
    mgdd.errors.ParameterError
        A constant that is not > 0.
    
    Examples
    --------
    >>> from mgdd.engine import NoxProxy
    >>> float(NoxProxy().arrhenius_ppm(1900.0))
    1200.0
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, reference_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 1900.0, reference_nox_ppm: typing.SupportsFloat | typing.SupportsIndex = 1200.0, activation_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 16000.0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def affine_log_ppm(self, t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        NOx [ppm] by the affine-log map.
        """
    def arrhenius_ppm(self, t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        NOx [ppm] by the Arrhenius map.
        """
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def activation_temperature_k(self) -> float:
        """
        b [K].
        """
    @property
    def reference_nox_ppm(self) -> float:
        """
        NOx0 [ppm].
        """
    @property
    def reference_temperature_k(self) -> float:
        """
        T0 [K].
        """
class NoxModel:
    """
    NOx of one cycle from its maximum bulk gas temperature and the intake oxygen.
    
    NOx = map(T_max) (x_O2 / 0.209)^n: a `NoxProxy` with the map that is used.
    
    Parameters
    ----------
    proxy : NoxProxy
        Constants of the map.
    map : {"affine_log", "arrhenius"}
        Form of the map.
    intake_o2_fraction : float
        Oxygen in the intake by volume [-]; 0.209 is air without exhaust gas recirculation.
    o2_exponent : float
        n [-], 2 to 4, to be fitted.
    
    Raises
    ------
    mgdd.errors.ParameterError
        An unknown map, or a value outside its domain.
    
    Examples
    --------
    >>> from mgdd.engine import NoxModel
    >>> float(NoxModel(intake_o2_fraction=0.1045).ppm(1900.0))
    150.0
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, proxy: NoxProxy | None = None, map: str = 'affine_log', intake_o2_fraction: typing.SupportsFloat | typing.SupportsIndex = 0.209, o2_exponent: typing.SupportsFloat | typing.SupportsIndex = 3.0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def ppm(self, t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        NOx [ppm].
        """
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def intake_o2_fraction(self) -> float:
        """
        Intake oxygen by volume [-].
        """
    @property
    def map(self) -> str:
        """
        Name of the map.
        """
    @property
    def o2_exponent(self) -> float:
        """
        n [-].
        """
    @property
    def proxy(self) -> NoxProxy:
        """
        Constants of the map.
        """
class SoftSensor:
    """
    Soft NOx sensor: the value of each cycle at once, its level held to a slow analyser.
    
    ``b += c (ln(analyser / delayed) - b)`` once per cycle, where ``delayed`` is the uncorrected soft value after the
    analyser's own delay and lag: b approaches the log-ratio of the two at the rate c, however late the analyser is.
    
    Parameters
    ----------
    model : NoxModel
        NOx from the maximum bulk gas temperature.
    correction_gain : float
        c per cycle [-], in [0, 1]; 0 never corrects.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain.
    
    Examples
    --------
    >>> from mgdd.engine import SoftSensor
    >>> sensor = SoftSensor(correction_gain=0.5)
    >>> bias = sensor.next_bias(0.0, analyser_ppm=1320.0, delayed_soft_ppm=1200.0)
    >>> round(float(sensor.ppm(1900.0, ln_bias=bias)), 1)
    1258.6
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, model: NoxModel | None = None, correction_gain: typing.SupportsFloat | typing.SupportsIndex = 0.01) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def next_bias(self, ln_bias: typing.SupportsFloat | typing.SupportsIndex, *, analyser_ppm: typing.SupportsFloat | typing.SupportsIndex, delayed_soft_ppm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        The log-bias after one reading; values that are not positive leave it alone.
        """
    def ppm(self, t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, ln_bias: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> typing.Any:
        """
        NOx [ppm] at the log-bias b.
        """
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def correction_gain(self) -> float:
        """
        c per cycle [-].
        """
    @property
    def model(self) -> NoxModel:
        """
        NOx from T_max.
        """
class NoxFit:
    """
    A NOx proxy fitted to a sweep, with its spread: what `fit_nox_proxy` returns.
    
    Attributes
    ----------
    proxy : NoxProxy
        The fitted constants.
    map : str
        Name of the map.
    points : int
        Number of points.
    residual_ln : float
        Standard deviation of ln NOx about the fit [-].
    reference_nox_stderr_ppm : float
        Standard error of NOx0 [ppm], delta method.
    activation_temperature_stderr_k : float
        Standard error of b [K].
    
    Examples
    --------
    >>> from mgdd.engine import NoxProxy, fit_nox_proxy
    >>> t = [1800.0, 1850.0, 1900.0, 1950.0, 2000.0]
    >>> fit_nox_proxy(t, NoxProxy().affine_log_ppm(t)).points
    5
    """
    def __repr__(self) -> str:
        ...
    @property
    def activation_temperature_stderr_k(self) -> float:
        """
        Standard error of b [K].
        """
    @property
    def map(self) -> str:
        """
        Name of the map.
        """
    @property
    def points(self) -> int:
        """
        Number of points.
        """
    @property
    def proxy(self) -> NoxProxy:
        """
        The fitted constants.
        """
    @property
    def reference_nox_stderr_ppm(self) -> float:
        """
        Standard error of NOx0 [ppm].
        """
    @property
    def residual_ln(self) -> float:
        """
        Standard deviation of ln NOx about the fit [-].
        """
class PerformanceTerm:
    """
    One term of the performance J of a cycle.
    
    Its value is ``weight * x / reference``; with a limit, ``weight * max(0, (x - above) / above) ** 2``. J is maximised,
    so a penalty has a negative weight.
    
    Parameters
    ----------
    signal : str
        ``efficiency_percent``, ``imep_gross_bar``, ``imep_closed_bar``, ``nox_ppm``, ``p_max_bar``,
        ``dp_max_bar_per_cad`` or ``t_max_k``.
    weight : float
        Unit of J per unit of x / reference.
    reference : float
        > 0, in the unit of the signal; not used by a hinge.
    above : float, optional
        Limit > 0 of a hinge, in the unit of the signal.
    
    Raises
    ------
    mgdd.errors.ParameterError
        An unknown signal or a value outside its domain.
    
    Examples
    --------
    >>> from mgdd.engine import PerformanceTerm
    >>> PerformanceTerm("dp_max_bar_per_cad", -2.0, above=10.0).value(15.0)
    -0.5
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, signal: str, weight: typing.SupportsFloat | typing.SupportsIndex = 1.0, *, reference: typing.SupportsFloat | typing.SupportsIndex = 1.0, above: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    def value(self, x: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Value of the term at the signal x.
        """
    @property
    def above(self) -> float | None:
        """
        Limit of a hinge, or None.
        """
    @property
    def reference(self) -> float:
        """
        In the unit of the signal.
        """
    @property
    def signal(self) -> str:
        """
        Name of the signal.
        """
    @property
    def weight(self) -> float:
        """
        Unit of J per unit of x / reference.
        """
class Performance:
    """
    The performance J of a cycle, to be maximised: a sum of one to eight terms.
    
    Parameters
    ----------
    terms : sequence of PerformanceTerm, optional
        Efficiency in percent if left out.
    
    Raises
    ------
    mgdd.errors.ParameterError
        No term, or more than eight.
    
    References
    ----------
    Tan (2018), section 5.3.
    
    Examples
    --------
    >>> from mgdd.engine import Performance
    >>> j = Performance.efficiency_and_nox(0.004)
    >>> j.components({"efficiency_percent": 56.0, "nox_ppm": 1500.0})
    array([56., -6.])
    >>> j.value({"efficiency_percent": 56.0, "nox_ppm": 1500.0})
    50.0
    """
    @staticmethod
    def efficiency_and_nox(nox_weight_percent_per_ppm: typing.SupportsFloat | typing.SupportsIndex = 0.004) -> Performance:
        """
        J = efficiency in percent - weight * NOx; the weight in %/ppm.
        """
    @staticmethod
    def efficiency_only() -> Performance:
        """
        J = gross indicated efficiency in percent.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, terms: collections.abc.Sequence[PerformanceTerm] | None = None) -> None:
        ...
    def __len__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def components(self, signals: dict) -> numpy.typing.NDArray[numpy.float64]:
        """
        Value of each term, from a dict of signals by name.
        """
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    def value(self, signals: dict) -> float:
        """
        J, from a dict of signals by name.
        """
    @property
    def terms(self) -> tuple:
        """
        The terms, in order.
        """
class TraceOptions:
    def __init__(self, *, pegging: str = 'none', pegging_exponent: typing.SupportsFloat | typing.SupportsIndex = 1.35, inlet_pressure_kpa: typing.SupportsFloat | typing.SupportsIndex = 0.0, gamma_source: str = 'constant', gamma: typing.SupportsFloat | typing.SupportsIndex = 1.33, gamma_compression: typing.SupportsFloat | typing.SupportsIndex = 1.37, gamma_combustion: typing.SupportsFloat | typing.SupportsIndex = 1.3, heat_from_cad: typing.SupportsFloat | typing.SupportsIndex = -10.0, heat_to_cad: typing.SupportsFloat | typing.SupportsIndex = 90.0, burn_from_cad: typing.SupportsFloat | typing.SupportsIndex = -10.0, total_at_end: bool = False, fractions_of_gross: bool = False) -> None:
        ...
    @property
    def burn_from_cad(self) -> float:
        ...
    @property
    def fractions_of_gross(self) -> bool:
        ...
    @property
    def gamma(self) -> float:
        ...
    @property
    def gamma_combustion(self) -> float:
        ...
    @property
    def gamma_compression(self) -> float:
        ...
    @property
    def gamma_source(self) -> str:
        ...
    @property
    def heat_from_cad(self) -> float:
        ...
    @property
    def heat_to_cad(self) -> float:
        ...
    @property
    def inlet_pressure_kpa(self) -> float:
        ...
    @property
    def pegging(self) -> str:
        ...
    @property
    def pegging_exponent(self) -> float:
        ...
    @property
    def total_at_end(self) -> bool:
        ...
class Throttle:
    """
    Parameters of an electronic throttle body, seen from the plate shaft.
    
    Keyword-only and immutable; units stand in the names. Angles are degrees from mechanically closed, opening positive.
    Defaults are the preset `P1`. `Throttle.fields()` lists every field with unit, bounds, meaning and default.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A field outside its domain, naming field, value and bound.
    
    Examples
    --------
    >>> from mgdd.throttle import Throttle
    >>> t = Throttle(limp_home_deg=10.0, friction="stribeck", stiction_nm=0.3)
    >>> t
    Throttle(stiction_nm=0.3, limp_home_deg=10.0, friction='stribeck')
    >>> t.replace(supply_v=14.4).supply_v
    14.4
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
    def __init__(self, *, friction: str = 'coulomb', backlash: str = 'none', inertia_kgm2: typing.SupportsFloat | typing.SupportsIndex = 0.0021, viscous_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.0088, torque_constant_nm_per_a: typing.SupportsFloat | typing.SupportsIndex = 0.383, back_emf_vs_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.383, resistance_ohm: typing.SupportsFloat | typing.SupportsIndex = 1.5, inductance_mh: typing.SupportsFloat | typing.SupportsIndex = 1.5, supply_v: typing.SupportsFloat | typing.SupportsIndex = 12.0, driver_drop_v: typing.SupportsFloat | typing.SupportsIndex = 0.0, driver_resistance_ohm: typing.SupportsFloat | typing.SupportsIndex = 0.0, dead_band: typing.SupportsFloat | typing.SupportsIndex = 0.0, coulomb_nm: typing.SupportsFloat | typing.SupportsIndex = 0.284, stiction_nm: typing.SupportsFloat | typing.SupportsIndex = 0.284, stribeck_rad_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.3, karnopp_rad_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.05, tanh_rad_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.05, bristle_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 81.0, bristle_damping_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.41, limp_home_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, spring_above_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.087, spring_below_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.087, preload_above_nm: typing.SupportsFloat | typing.SupportsIndex = 0.396, preload_below_nm: typing.SupportsFloat | typing.SupportsIndex = 0.396, preload_ramp_deg: typing.SupportsFloat | typing.SupportsIndex = 0.25, closed_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0, open_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, stop_stiffness_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 5000.0, stop_damping_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 4.5, backlash_half_deg: typing.SupportsFloat | typing.SupportsIndex = 0.2, gear_stiffness_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 200.0, gear_damping_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.2, plate_inertia_kgm2: typing.SupportsFloat | typing.SupportsIndex = 0.0003, plate_friction_share: typing.SupportsFloat | typing.SupportsIndex = 0.3, bore_mm: typing.SupportsFloat | typing.SupportsIndex = 60.0, pressure_drop_kpa: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> Throttle:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def back_emf_vs_per_rad(self) -> float:
        """
        motor voltage per plate speed [V s/rad]
        """
    @property
    def backlash(self) -> str:
        """
        Play between gear and plate.
        """
    @property
    def backlash_half_deg(self) -> float:
        """
        half gap of the gear [deg]
        """
    @property
    def bore_mm(self) -> float:
        """
        bore of the throttle [mm]
        """
    @property
    def bristle_damping_nms_per_rad(self) -> float:
        """
        LuGre bristle damping [N m s/rad]
        """
    @property
    def bristle_nm_per_rad(self) -> float:
        """
        LuGre bristle stiffness [N m/rad]
        """
    @property
    def closed_deg(self) -> float:
        """
        lower end stop [deg]
        """
    @property
    def coulomb_nm(self) -> float:
        """
        Coulomb friction [N m]
        """
    @property
    def damping_nms_per_rad(self) -> float:
        """
        Viscous friction and braking by the shorted motor, b = K_v + K K_e/R [N m s/rad].
        """
    @property
    def dead_band(self) -> float:
        """
        duty without effect on either side of zero [-]
        """
    @property
    def driver_drop_v(self) -> float:
        """
        voltage lost in the bridge at full duty [V]
        """
    @property
    def driver_resistance_ohm(self) -> float:
        """
        resistance of the bridge [ohm]
        """
    @property
    def friction(self) -> str:
        """
        Law of the dry friction.
        """
    @property
    def gear_damping_nms_per_rad(self) -> float:
        """
        contact damping of the gear [N m s/rad]
        """
    @property
    def gear_stiffness_nm_per_rad(self) -> float:
        """
        contact stiffness of the gear [N m/rad]
        """
    @property
    def inductance_mh(self) -> float:
        """
        armature inductance [mH]
        """
    @property
    def inertia_kgm2(self) -> float:
        """
        inertia of plate, gears and motor at the plate [kg m²]
        """
    @property
    def karnopp_rad_per_s(self) -> float:
        """
        half band of rest of Karnopp's form [rad/s]
        """
    @property
    def limp_home_deg(self) -> float:
        """
        rest angle without current [deg]
        """
    @property
    def open_deg(self) -> float:
        """
        upper end stop [deg]
        """
    @property
    def plate_friction_share(self) -> float:
        """
        share of the friction on the plate's side of the gap [-]
        """
    @property
    def plate_inertia_kgm2(self) -> float:
        """
        inertia on the plate's side of the gap [kg m²]
        """
    @property
    def preload_above_nm(self) -> float:
        """
        preload above limp-home [N m]
        """
    @property
    def preload_below_nm(self) -> float:
        """
        preload below limp-home [N m]
        """
    @property
    def preload_ramp_deg(self) -> float:
        """
        half width over which the preload changes sign [deg]
        """
    @property
    def pressure_drop_kpa(self) -> float:
        """
        pressure drop that loads the plate [kPa]
        """
    @property
    def resistance_ohm(self) -> float:
        """
        armature resistance [ohm]
        """
    @property
    def spring_above_nm_per_rad(self) -> float:
        """
        spring above limp-home [N m/rad]
        """
    @property
    def spring_below_nm_per_rad(self) -> float:
        """
        spring below limp-home [N m/rad]
        """
    @property
    def stall_torque_nm(self) -> float:
        """
        Stall torque per unit duty, g = K (V - V_drop)/R [N m].
        """
    @property
    def stiction_nm(self) -> float:
        """
        breakaway friction [N m]
        """
    @property
    def stop_damping_nms_per_rad(self) -> float:
        """
        damping of the end stops [N m s/rad]
        """
    @property
    def stop_stiffness_nm_per_rad(self) -> float:
        """
        stiffness of the end stops [N m/rad]
        """
    @property
    def stribeck_rad_per_s(self) -> float:
        """
        speed of the Stribeck curve [rad/s]
        """
    @property
    def supply_v(self) -> float:
        """
        supply of the bridge [V]
        """
    @property
    def tanh_rad_per_s(self) -> float:
        """
        width of the smooth form [rad/s]
        """
    @property
    def torque_constant_nm_per_a(self) -> float:
        """
        motor torque per current at the plate [N m/A]
        """
    @property
    def viscous_nms_per_rad(self) -> float:
        """
        viscous friction [N m s/rad]
        """
class SensorPair:
    """
    Two redundant position sensors of a throttle with opposite slopes, and their check.
    
    Keyword-only and immutable. The first gives ``closed_v + span_v angle/travel_deg``, the second ``supply_v`` minus that.
    
    Parameters
    ----------
    closed_v, span_v : float
        First sensor at 0 deg, and its rise over the travel [V]; 0 and 5 are the ideal form of catalogues.
    travel_deg : float
        Angle of the full span [deg].
    supply_v : float
        Supply of sensors and converter [V].
    noise_v : float
        Noise at the converter, rms of each sensor [V].
    lag_s : float
        Time constant of the anti-alias filter [s].
    adc_bits : int
        Bits of the converter, 4 to 24.
    sum_tolerance_v : float
        The sum may differ from the supply by less than this [V].
    low_v, high_v : float
        Range of a healthy sensor [V].
    debounce_s : float
        A check must fail without a break for so long before the fault counts [s].
    
    Raises
    ------
    mgdd.errors.ParameterError
        A field outside its domain, naming field, value and bound.
    
    Examples
    --------
    >>> from mgdd.throttle import SensorPair
    >>> SensorPair().adc_bits
    12
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, closed_v: typing.SupportsFloat | typing.SupportsIndex = 0.5, span_v: typing.SupportsFloat | typing.SupportsIndex = 4.0, travel_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, supply_v: typing.SupportsFloat | typing.SupportsIndex = 5.0, noise_v: typing.SupportsFloat | typing.SupportsIndex = 0.002, lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.0003, adc_bits: typing.SupportsInt | typing.SupportsIndex = 12, sum_tolerance_v: typing.SupportsFloat | typing.SupportsIndex = 0.2, low_v: typing.SupportsFloat | typing.SupportsIndex = 0.2, high_v: typing.SupportsFloat | typing.SupportsIndex = 4.8, debounce_s: typing.SupportsFloat | typing.SupportsIndex = 0.2) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def adc_bits(self) -> int:
        """
        Bits of the converter.
        """
    @property
    def closed_v(self) -> float:
        """
        First sensor at 0 deg [V].
        """
    @property
    def debounce_s(self) -> float:
        """
        Time a check must fail [s].
        """
    @property
    def high_v(self) -> float:
        """
        Highest healthy voltage [V].
        """
    @property
    def lag_s(self) -> float:
        """
        Time constant of the anti-alias filter [s].
        """
    @property
    def low_v(self) -> float:
        """
        Lowest healthy voltage [V].
        """
    @property
    def lsb_v(self) -> float:
        """
        Step of the converter [V].
        """
    @property
    def noise_v(self) -> float:
        """
        Noise of each sensor, rms [V].
        """
    @property
    def span_v(self) -> float:
        """
        Rise of the first sensor over the travel [V].
        """
    @property
    def sum_tolerance_v(self) -> float:
        """
        Tolerance of the sum [V].
        """
    @property
    def supply_v(self) -> float:
        """
        Supply of sensors and converter [V].
        """
    @property
    def travel_deg(self) -> float:
        """
        Angle of the full span [deg].
        """
class ThrottleStepper:
    """
    One sample of a throttle from a given state; behind mgdd.throttle.to_iosystem.
    
    The state is angle [deg], speed [deg/s], current [A] and bristle [deg] of motor and gear, then angle, speed and bristle
    of the plate.
    """
    @staticmethod
    def at_rest(angle_deg: typing.SupportsFloat | typing.SupportsIndex) -> typing.Annotated[list[float], "FixedSize(7)"]:
        """
        State at rest at an angle [deg], without current.
        """
    def __init__(self, throttle: Throttle, *, sample_s: typing.SupportsFloat | typing.SupportsIndex, step_s: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def advance(self, state: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(7)"], duty: typing.SupportsFloat | typing.SupportsIndex) -> typing.Annotated[list[float], "FixedSize(7)"]:
        """
        State after one sample under a duty [-], which is clipped to -1..1.
        """
class PseudoWienerStepper:
    """
    One sample of a pseudo-Wiener model from a given state; behind mgdd.throttle.to_iosystem.
    """
    def __init__(self, kind: str, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, switching: str = 'predicted', friction: str = 'set_valued') -> None:
        ...
    def advance(self, state: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], duty: typing.SupportsFloat | typing.SupportsIndex) -> list[float]:
        """
        State after one sample under a duty [-].
        """
    def at_rest(self, angle_deg: typing.SupportsFloat | typing.SupportsIndex) -> list[float]:
        """
        State at rest at an angle [deg].
        """
    def output(self, state: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> float:
        """
        Angle [deg] of a state.
        """
class PseudoWienerModel:
    """
    A pseudo-Wiener model; use mgdd.throttle.PseudoWiener.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __init__(self, kind: str, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, switching: str = 'predicted', friction: str = 'set_valued') -> None:
        ...
    def at_sample(self, sample_s: typing.SupportsFloat | typing.SupportsIndex, *, substeps: typing.SupportsInt | typing.SupportsIndex | None = None) -> dict:
        """
        Parameters for another sample time, the delay in seconds kept.
        """
    def predict(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], horizon: typing.SupportsInt | typing.SupportsIndex, *, angle_gain: typing.SupportsFloat | typing.SupportsIndex = 0.35, speed_gain_per_s: typing.SupportsFloat | typing.SupportsIndex = 35.0, bias_gain_duty_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.004, offset_gain: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> list[float]:
        """
        Prediction, corrected at every sample, `horizon` samples ahead [deg].
        """
    def simulate(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], start_deg: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
        """
        Free run: angle [deg] per sample.
        """
    def slopes(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, start_deg: typing.SupportsFloat | typing.SupportsIndex, speed_deg_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> tuple[numpy.typing.NDArray[numpy.float64], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]]:
        """
        Angle after each sample of a horizon [deg] and d angle / d duty [deg].
        """
    @property
    def kind(self) -> str:
        ...
    @property
    def parameters(self) -> dict:
        ...
class MeasuredCycle:
    def __init__(self, *, label: str, crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], point: OperatingPoint) -> None:
        ...
class LoadBurn:
    def __init__(self) -> None:
        ...
    @property
    def burn_duration_cad(self) -> float:
        ...
    @burn_duration_cad.setter
    def burn_duration_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def fuel_heat_j(self) -> float:
        ...
    @fuel_heat_j.setter
    def fuel_heat_j(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_delay_cad(self) -> float:
        ...
    @second_delay_cad.setter
    def second_delay_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_duration_cad(self) -> float:
        ...
    @second_duration_cad.setter
    def second_duration_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_fraction(self) -> float:
        ...
    @second_fraction.setter
    def second_fraction(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_wiebe_m(self) -> float:
        ...
    @second_wiebe_m.setter
    def second_wiebe_m(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def soc_cad(self) -> float:
        ...
    @soc_cad.setter
    def soc_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def wiebe_m(self) -> float:
        ...
    @wiebe_m.setter
    def wiebe_m(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class LoadFit:
    @property
    def burn(self) -> LoadBurn:
        ...
    @property
    def ca50_cad(self) -> float:
        ...
    @property
    def heat_loss_fraction(self) -> float:
        ...
    @property
    def imep_closed_bar(self) -> float:
        ...
    @property
    def imep_closed_error_percent(self) -> float:
        ...
    @property
    def imep_closed_model_bar(self) -> float:
        ...
    @property
    def largest_error_bar(self) -> float:
        ...
    @property
    def largest_error_cad(self) -> float:
        ...
    @property
    def model_bar(self) -> numpy.typing.NDArray[numpy.float64]:
        ...
    @property
    def p_max_bar(self) -> float:
        ...
    @property
    def rmse_bar(self) -> float:
        ...
    @property
    def rmse_percent(self) -> float:
        ...
class CylinderFit:
    @property
    def correlation_if_free(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def cylinder(self) -> Cylinder:
        ...
    @property
    def loads(self) -> list[LoadFit]:
        ...
    @property
    def report(self) -> FitReport:
        ...
class RecursivePwR:
    """
    Recursive least squares of PW-R; use mgdd.identify.OnlineUpdate.
    """
    def __init__(self, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, free: collections.abc.Sequence[str], every: typing.SupportsInt | typing.SupportsIndex, noise_deg: typing.SupportsFloat | typing.SupportsIndex, forgetting: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def restore(self, state: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    def state(self) -> dict[str, list[float]]:
        ...
    def update(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> int:
        """
        Takes samples in order, without the GIL; returns how many changed the model.
        """
    @property
    def parameters(self) -> dict:
        ...
class WindowPwR:
    """
    Sliding-window fit of PW-R; use mgdd.identify.OnlineUpdate.
    """
    def __init__(self, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, free: collections.abc.Sequence[str], every: typing.SupportsInt | typing.SupportsIndex, noise_deg: typing.SupportsFloat | typing.SupportsIndex, prior_spread: typing.SupportsFloat | typing.SupportsIndex, iterate_every: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def restore(self, state: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    def state(self) -> dict[str, list[float]]:
        ...
    def update(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> int:
        """
        Takes samples in order, without the GIL; returns how many changed the model.
        """
    @property
    def parameters(self) -> dict:
        ...
class GradientPwR:
    """
    Gradient update of PW-R; use mgdd.identify.OnlineUpdate.
    """
    def __init__(self, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, free: collections.abc.Sequence[str], adaptation_gain: typing.SupportsFloat | typing.SupportsIndex, noise_deg: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def restore(self, state: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    def state(self) -> dict[str, list[float]]:
        ...
    def update(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> int:
        """
        Takes samples in order, without the GIL; returns how many changed the model.
        """
    @property
    def parameters(self) -> dict:
        ...
class FreeRunRecord:
    """
    One measured record, its start and what of the start is unknown.
    """
    def __init__(self, *, input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], output: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], start: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], free_start: collections.abc.Sequence[str] = [], skip: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
        ...
class FreeRunFit:
    """
    What a free-run fit hands back.
    """
    @property
    def outputs(self) -> list:
        ...
    @property
    def parameters(self) -> list[float]:
        ...
    @property
    def report(self) -> FitReport:
        ...
    @property
    def starts(self) -> list[list[float]]:
        ...
class DriveAxis:
    """
    Motor-driven axis with friction.
    """
    parameter_names: typing.ClassVar[list] = ['mass_kg', 'viscous_ns_per_m', 'viscous_asymmetry_ns_per_m', 'coulomb_n', 'stribeck_n', 'stribeck_speed_m_per_s', 'offset_n', 'offset_drift_n_per_s', 'stiffness_n_per_m']
    state_names: typing.ClassVar[list] = ['position_m', 'speed_m_per_s', 'time_s']
    def __init__(self, *, force_n_per_v: typing.SupportsFloat | typing.SupportsIndex, centre_m: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    def fit(self, *, base: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], free: collections.abc.Sequence[str], records: collections.abc.Sequence[FreeRunRecord], dt_s: typing.SupportsFloat | typing.SupportsIndex, options: LeastSquaresOptions) -> FreeRunFit:
        """
        Levenberg-Marquardt on the free run with exact sensitivities; releases the GIL.
        """
    def free_run(self, *, parameters: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], start: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], dt_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
        """
        Output at every sample.
        """
class TwoTanks:
    """
    Two tanks in a row with overflow.
    """
    parameter_names: typing.ClassVar[list] = ['pump_per_s', 'upper_outflow_per_s', 'upper_exponent', 'lower_outflow_per_s', 'lower_exponent', 'lower_datum_v', 'upper_brim_v', 'overflow_share', 'delay_samples']
    state_names: typing.ClassVar[list] = ['upper_level_v', 'lower_level_v', 'pump_before_v', 'pump_before_that_v']
    def __init__(self, *, lower_brim_v: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def fit(self, *, base: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], free: collections.abc.Sequence[str], records: collections.abc.Sequence[FreeRunRecord], dt_s: typing.SupportsFloat | typing.SupportsIndex, options: LeastSquaresOptions) -> FreeRunFit:
        """
        Levenberg-Marquardt on the free run with exact sensitivities; releases the GIL.
        """
    def free_run(self, *, parameters: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], start: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], dt_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
        """
        Output at every sample.
        """
class WienerHammerstein:
    """
    Filter, static curve, filter.
    """
    def __init__(self, *, first_order: typing.SupportsInt | typing.SupportsIndex, last_order: typing.SupportsInt | typing.SupportsIndex, n_curve: typing.SupportsInt | typing.SupportsIndex, lower: typing.SupportsFloat | typing.SupportsIndex, upper: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def curve(self, parameters: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        The static curve.
        """
    def fit(self, *, start: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], output: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], skip: typing.SupportsInt | typing.SupportsIndex, options: LeastSquaresOptions) -> FitReport:
        """
        Levenberg-Marquardt on the response with exact derivatives; releases the GIL.
        """
    def simulate(self, parameters: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Response from rest.
        """
    @property
    def lower(self) -> float:
        ...
    @property
    def names(self) -> list[str]:
        ...
    @property
    def upper(self) -> float:
        ...
class SensorDynamics:
    """
    Transport delay, first-order lag and noise of a gas sensor.
    
    Parameters
    ----------
    delay_s : float
        Transport delay of the sample line [s], in [0, 60].
    lag_s : float
        Time constant [s], in [0, 60]; t10-90 is 2.2 times it.
    noise_fraction : float
        Standard deviation of a reading over the reading [-], in [0, 0.2].
    delay_cycles : int, optional
        Delay in engine cycles instead; it does not follow the speed.
    lag_cycles : float, optional
        Time constant in engine cycles instead.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain.
    
    Examples
    --------
    >>> from mgdd.loop import SensorDynamics
    >>> SensorDynamics(delay_s=3.0, lag_s=2.0).delay_at(1500.0)
    38
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, delay_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, noise_fraction: typing.SupportsFloat | typing.SupportsIndex = 0.0, delay_cycles: typing.SupportsInt | typing.SupportsIndex | None = None, lag_cycles: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def delay_at(self, speed_rpm: typing.SupportsFloat | typing.SupportsIndex) -> int:
        """
        Delay in whole cycles at a speed.
        """
    def gain_at(self, speed_rpm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Gain of the lag filter per cycle [-].
        """
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def delay_cycles(self) -> int | None:
        """
        Delay in cycles, or None.
        """
    @property
    def delay_s(self) -> float:
        """
        Transport delay [s].
        """
    @property
    def lag_cycles(self) -> float | None:
        """
        Time constant in cycles, or None.
        """
    @property
    def lag_s(self) -> float:
        """
        Time constant [s].
        """
    @property
    def noise_fraction(self) -> float:
        """
        Relative noise [-].
        """
class EngineBench:
    """
    The virtual engine bench; use mgdd.loop.EngineBench.
    """
    def __getstate__(self) -> tuple[int, dict, dict[str, list[float]]]:
        ...
    def __init__(self, *, cylinder: Cylinder, schedule: collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, OperatingPoint]], performance: Performance | None = None, nox_sensor: str = 'soft', limits: collections.abc.Sequence[str] = [], soc_scatter_cad: typing.SupportsFloat | typing.SupportsIndex = 0.3, efficiency_noise_percent: typing.SupportsFloat | typing.SupportsIndex = 0.25, misfire_probability: typing.SupportsFloat | typing.SupportsIndex = 0.0, soc_drift_cad_per_kcycle: typing.SupportsFloat | typing.SupportsIndex = 0.0, wall_heat_drift_per_kcycle: typing.SupportsFloat | typing.SupportsIndex = 0.0, true_nox: NoxModel | None = None, soft_sensor: SoftSensor | None = None, analyser: SensorDynamics | None = None, fast_sensor: SensorDynamics | None = None, delay_whole_objective: bool = False, step_cad: typing.SupportsFloat | typing.SupportsIndex = 1.0, integrator: str = 'trapezoid', seed: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def point_at(self, cycle: typing.SupportsInt | typing.SupportsIndex) -> OperatingPoint:
        """
        Operating point of a cycle.
        """
    def reset(self, seed: typing.SupportsInt | typing.SupportsIndex | None = None) -> None:
        """
        Back to cycle 0, with another seed if given.
        """
    def run_columns(self, soc_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> dict:
        """
        Run one cycle per request, without the GIL: columns by name.
        """
    def step(self, soc_cad: typing.SupportsFloat | typing.SupportsIndex) -> dict:
        """
        Run one cycle: what was measured, by name.
        """
    @property
    def analyser_delay_cycles(self) -> int:
        """
        Delay of the analyser at the next cycle.
        """
    @property
    def analyser_gain(self) -> float:
        """
        Gain of the analyser's lag filter at the next cycle [-].
        """
    @property
    def cycle(self) -> int:
        """
        Index of the next cycle.
        """
    @property
    def operating_point_changes(self) -> bool:
        """
        Whether speed or fuel of the next cycle differ by more than 5 % from those of the last one.
        """
    @property
    def point(self) -> OperatingPoint:
        """
        Operating point of the next cycle.
        """
    @property
    def seed(self) -> int:
        """
        Seed of the run.
        """
    @property
    def settings(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        State of the run between two cycles: named lists of numbers, JSON-able. Setting it continues that
        run bit for bit; a state of another bench raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def window_cad(self) -> typing.Annotated[list[float], "FixedSize(2)"]:
        """
        Earliest and latest SOC that is not clamped.
        """
class VirtualThrottle:
    """
    A throttle with its sensors, sample by sample; behind mgdd.loop.VirtualThrottle.
    """
    def __init__(self, *, throttle: Throttle, sensors: SensorPair, faults: typing.Annotated[collections.abc.Sequence[tuple[str, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]], "FixedSize(2)"], sample_s: typing.SupportsFloat | typing.SupportsIndex, step_s: typing.SupportsFloat | typing.SupportsIndex, start_deg: typing.SupportsFloat | typing.SupportsIndex, bridge: str, seed: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def step(self, duty: typing.SupportsFloat | typing.SupportsIndex, supply_v: typing.SupportsFloat | typing.SupportsIndex, airflow_torque_nm: typing.SupportsFloat | typing.SupportsIndex) -> dict:
        """
        Run one sample.
        """
    @property
    def samples(self) -> int:
        """
        Samples run so far.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a run needs to go on bit for bit.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
def analyze_trace(crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cylinder: Cylinder, point: OperatingPoint, options: TraceOptions) -> dict:
    """
    Pegging, heat release, burn angles, work.
    """
def burn_duration_cad(cylinder: Cylinder, point: OperatingPoint) -> float:
    """
    Burn duration in force [°CA].
    """
def burned_fraction(cylinder: Cylinder, crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], soc_cad: typing.SupportsFloat | typing.SupportsIndex, burn_duration_cad: typing.SupportsFloat | typing.SupportsIndex) -> typing.Any:
    """
    Burned fraction [-].
    """
def check_trace(crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
    """
    DataError unless the trace can be analysed.
    """
def common_parameters() -> list[str]:
    """
    Cylinder fields that may be freed for all loads.
    """
def compiled_simd_level() -> str:
    """
    Instruction set of this build.
    """
def compiler() -> str:
    """
    Compiler of this build.
    """
def convergence(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    Step-size error per indicator: (value, extrapolated, error, order, unit).
    """
def differentiable_inputs() -> list[str]:
    """
    Names that `sensitivities` takes.
    """
def estimate_burn(trace: MeasuredCycle, cylinder: Cylinder) -> LoadBurn:
    """
    A start from the trace's heat release.
    """
def filter_series(b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    """
    B/A u from rest.
    """
def fit_cylinder(traces: collections.abc.Sequence[MeasuredCycle], cylinder: Cylinder, start: collections.abc.Sequence[LoadBurn], free: collections.abc.Sequence[str], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str, max_iterations: typing.SupportsInt | typing.SupportsIndex) -> CylinderFit:
    """
    Levenberg-Marquardt with exact sensitivities; releases the GIL.
    """
def fit_nox_proxy(t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], nox_ppm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], map: str, reference_temperature_k: typing.SupportsFloat | typing.SupportsIndex) -> NoxFit:
    """
    Least squares on ln NOx; use mgdd.engine.fit_nox_proxy.
    """
def fit_pseudo_wiener(*, kind: str, records: collections.abc.Sequence[tuple[typing.Annotated[numpy.typing.ArrayLike, numpy.float64], typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]], parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], sides: str, free: collections.abc.Sequence[str], delays: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], starts: typing.SupportsInt | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex, only_given_start: bool, try_map_start: bool, max_iterations: typing.SupportsInt | typing.SupportsIndex) -> tuple[dict, FitReport, numpy.typing.NDArray[numpy.float64], int]:
    """
    Output-error fit from several starts: parameters, report, RMSE of every search, hits of the best.
    """
def fit_smooth_throttle(duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, starts: collections.abc.Sequence[typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(10)"]], lower: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(10)"], upper: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(10)"], step_s: typing.SupportsFloat | typing.SupportsIndex, start: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"], inertia_kgm2: typing.SupportsFloat | typing.SupportsIndex, gear_ratio: typing.SupportsFloat | typing.SupportsIndex, inductance_h: typing.SupportsFloat | typing.SupportsIndex, supply_v: typing.SupportsFloat | typing.SupportsIndex, cost_tolerance: typing.SupportsFloat | typing.SupportsIndex, lanes: bool) -> dict:
    """
    Staged fit of the ten parameters from every start; releases the GIL.
    """
def fit_throttle_groups(records: collections.abc.Sequence[tuple[typing.SupportsFloat | typing.SupportsIndex, typing.Annotated[numpy.typing.ArrayLike, numpy.float64], typing.Annotated[numpy.typing.ArrayLike, numpy.float64], collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], typing.SupportsInt | typing.SupportsIndex, bool]], *, stages: collections.abc.Sequence[tuple[collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]], starts: collections.abc.Sequence[typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(9)"]], closed_deg: typing.SupportsFloat | typing.SupportsIndex, open_deg: typing.SupportsFloat | typing.SupportsIndex, ramp_deg: typing.SupportsFloat | typing.SupportsIndex, substeps: typing.SupportsInt | typing.SupportsIndex, n_threads: typing.SupportsInt | typing.SupportsIndex) -> dict:
    """
    Staged multi-start fit of the throttle groups; releases the GIL.
    """
def hardenberg_hase_delay_cad(pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cetane_number: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], piston_speed_m_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Ignition delay [°CA].
    """
def hohenberg_coefficient(c1_bar_m3: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], volume_m3: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], piston_speed_m_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Film coefficient [W/(m2 K)].
    """
def indicator_units() -> dict:
    """
    Unit of every indicator.
    """
def input_unit(name: str) -> str:
    """
    Unit of a differentiable input.
    """
def latin_hypercube(parameters: collections.abc.Sequence[Parameter], n: typing.SupportsInt | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]]:
    """
    Points between the bounds, one per cell of every axis.
    """
def least_squares(fun: collections.abc.Callable, x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], *, parameters: collections.abc.Sequence[Parameter], options: LeastSquaresOptions) -> FitReport:
    """
    Minimise sum(residual^2) / 2 for `fun(x) -> (residual, jacobian)`; None refuses a point.
    """
def load_parameters() -> list[str]:
    """
    Names that may be freed per load.
    """
def monte_carlo(benches: collections.abc.Sequence[EngineBench], seekers: list, seeds: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], *, cycles: typing.SupportsInt | typing.SupportsIndex, optimum_cad: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]], threads: typing.SupportsInt | typing.SupportsIndex) -> dict:
    """
    Whole loops on all cores; behind mgdd.loop.monte_carlo.
    """
def processor_simd_levels() -> list[str]:
    """
    Vector instruction sets of this processor.
    """
def pseudo_wiener_of(throttle: Throttle) -> PseudoWienerModel:
    """
    PW-R with the groups of a first-principle throttle.
    """
def pseudo_wiener_units(kind: str) -> dict:
    """
    Unit of every parameter.
    """
@typing.overload
def run_loop(bench: EngineBench, seeker: ExtremumSeeking, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: EngineBench, seeker: NewtonSeeking, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: EngineBench, seeker: BoundedSeeking, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: EngineBench, seeker: Spsa, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: EngineBench, seeker: GradientDescent, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: EngineBench, seeker: GoldenSection, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
def scan(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    Indicators over a column of timings; releases the GIL.
    """
def sense_throttle(pair: SensorPair, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, sample_s: typing.SupportsFloat | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex, faults: typing.Annotated[collections.abc.Sequence[tuple[str, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]], "FixedSize(2)"]) -> dict:
    """
    Samples of both sensors; behind mgdd.throttle.sense.
    """
def sensitivities(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, names: collections.abc.Sequence[str], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    Exact derivatives of indicators and pressure.
    """
def simulate(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    One cycle: traces and indicators.
    """
def simulate_smooth_throttle(parameters: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(10)"], duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, step_s: typing.SupportsFloat | typing.SupportsIndex, start: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"], inertia_kgm2: typing.SupportsFloat | typing.SupportsIndex, gear_ratio: typing.SupportsFloat | typing.SupportsIndex, inductance_h: typing.SupportsFloat | typing.SupportsIndex, supply_v: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Angle [deg] on every sample; releases the GIL.
    """
def simulate_throttle(throttle: Throttle, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, sample_s: typing.SupportsFloat | typing.SupportsIndex, start_deg: typing.SupportsFloat | typing.SupportsIndex, bridge: str, supply_v: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], airflow_torque_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], step_s: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    One throttle over columns, from rest; behind mgdd.throttle.simulate.
    """
def simulate_throttle_groups(values: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(9)"], duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, step_s: typing.SupportsFloat | typing.SupportsIndex, start: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"], closed_deg: typing.SupportsFloat | typing.SupportsIndex, open_deg: typing.SupportsFloat | typing.SupportsIndex, ramp_deg: typing.SupportsFloat | typing.SupportsIndex, substeps: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Angle [deg] on every sample; releases the GIL.
    """
def simulate_throttle_many(throttles: collections.abc.Sequence[Throttle], duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, sample_s: typing.SupportsFloat | typing.SupportsIndex, start_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], bridge: str, supply_v: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], airflow_torque_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], step_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Many throttles under one input, in lanes; behind mgdd.throttle.simulate_many.
    """
def smooth_throttle_instruction_set() -> str:
    """
    Instruction set that the kernel chose on this machine.
    """
def start_of_combustion(cylinder: Cylinder, point: OperatingPoint, soi_cad: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    SOI to SOC.
    """
def start_of_injection(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    SOC to SOI.
    """
def throttle_airflow_torque(throttle: Throttle, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Torque of the modelled air flow [N m]; behind mgdd.throttle.airflow_torque_nm.
    """
def throttle_group_bounds() -> list:
    """
    The nine groups with their bounds.
    """
def tune(*, noise_sd: typing.SupportsFloat | typing.SupportsIndex, curvature: typing.SupportsFloat | typing.SupportsIndex, method: str, delay_cycles: typing.SupportsFloat | typing.SupportsIndex, lag_cycles: typing.SupportsFloat | typing.SupportsIndex, compensated: bool, rms: typing.SupportsFloat | typing.SupportsIndex | None, cycles: typing.SupportsFloat | typing.SupportsIndex | None, distance: typing.SupportsFloat | typing.SupportsIndex | None, arrival: typing.SupportsFloat | typing.SupportsIndex | None, amplitude_max: typing.SupportsFloat | typing.SupportsIndex | None) -> dict:
    """
    Behind mgdd.optimize.tune.
    """
def volume_l(cylinder: Cylinder, crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Cylinder volume [L].
    """
def wall_area_m2(cylinder: Cylinder, crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Wall area [m2].
    """
def watson_delay_ms(pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Ignition delay [ms].
    """
def with_burn(cylinder: Cylinder, burn: LoadBurn) -> Cylinder:
    """
    The cylinder with one load's shape fields.
    """
def wolfer_delay_ms(pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Ignition delay [ms].
    """
def woschni_coefficient(c1_bar_m: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], bore_m: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], gas_velocity_m_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Film coefficient [W/(m2 K)].
    """
__version__: str = '0.1.0'
correlation_limit: float = 0.98
sensor_fault_kinds: tuple = ('none', 'open_wire', 'short_to_ground', 'short_to_supply', 'offset', 'gain', 'stuck')
smooth_throttle_example: tuple = (0.016, 0.004, 0.12, 0.5, 0.12, 0.25, 0.02, 0.14, 0.016, 1.2)
smooth_throttle_names: tuple = ('torque_constant_nm_per_a', 'viscous_nms_per_rad', 'coulomb_nm', 'friction_width_rad_per_s', 'spring_nm_per_rad', 'preload_nm', 'preload_width_rad', 'limp_home_rad', 'emf_constant_vs_per_rad', 'resistance_ohm')
throttle_group_names: tuple = ('tau_s', 'gain_deg_per_s2_per_duty', 'beta_above_duty', 'kappa_above_duty_per_deg', 'delta_duty', 'beta_below_duty', 'kappa_below_duty_per_deg', 'limp_home_deg', 'electrical_s')
timing_window_cad: tuple = (-60.0, 20.0)
wall_heat_scale_upper: float = 2.5
woschni_c1_bar_m: float = 129.8
