"""
The C++ core of mgdd. Use it through mgdd.engine, mgdd.identify and mgdd.optimize.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['ConvergenceError', 'Cylinder', 'CylinderFit', 'DataError', 'Error', 'FitReport', 'IterativeLearning', 'LeastSquaresOptions', 'LoadBurn', 'LoadFit', 'MeasuredCycle', 'NoxProxy', 'OperatingPoint', 'Parameter', 'ParameterError', 'ShapeError', 'TraceOptions', 'analyze_trace', 'burn_duration_cad', 'burned_fraction', 'check_trace', 'common_parameters', 'compiled_simd_level', 'compiler', 'convergence', 'correlation_limit', 'differentiable_inputs', 'estimate_burn', 'fit_cylinder', 'hardenberg_hase_delay_cad', 'hohenberg_coefficient', 'indicator_units', 'input_unit', 'least_squares', 'load_parameters', 'processor_simd_levels', 'scan', 'sensitivities', 'simulate', 'start_of_combustion', 'start_of_injection', 'timing_window_cad', 'volume_l', 'wall_area_m2', 'wall_heat_scale_upper', 'watson_delay_ms', 'with_burn', 'wolfer_delay_ms', 'woschni_c1_bar_m', 'woschni_coefficient']
class Error(Exception):
    """
    Base of everything mgdd raises.
    """
class ParameterError(Error, ValueError):
    """
    A parameter outside its domain; the message names field, value and bound.
    """
class ShapeError(Error, ValueError):
    """
    An array of the wrong length or dimension.
    """
class DataError(Error, ValueError):
    """
    Measured data that cannot be what the caller says they are.
    """
class ConvergenceError(Error, RuntimeError):
    """
    A numerical method that did not reach its tolerance.
    """
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
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, arg0: LeastSquaresOptions) -> bool:
        ...
    def __getstate__(self) -> tuple:
        ...
    def __init__(self, *, max_iterations: typing.SupportsInt | typing.SupportsIndex = 200, cost_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-12, step_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-10, gradient_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-12, initial_damping: typing.SupportsFloat | typing.SupportsIndex = 0.001, correlation_limit: typing.SupportsFloat | typing.SupportsIndex = 0.98, rank_tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-10, evaluate_together: bool = True) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
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
        Findings of the linear theory, by name.
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
        Error of this trial; makes the next input.
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
    def __init__(self, *, reference_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 1900.0, reference_nox_ppm: typing.SupportsFloat | typing.SupportsIndex = 1200.0, activation_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 16000.0) -> None:
        ...
    def affine_log_ppm(self, t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        NOx [ppm] by the affine-log map.
        """
    def arrhenius_ppm(self, t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        NOx [ppm] by the Arrhenius map.
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
class TraceOptions:
    def __init__(self, *, pegging: str = 'none', pegging_exponent: typing.SupportsFloat | typing.SupportsIndex = 1.35, inlet_pressure_kpa: typing.SupportsFloat | typing.SupportsIndex = 0.0, gamma_source: str = 'constant', gamma: typing.SupportsFloat | typing.SupportsIndex = 1.33, gamma_compression: typing.SupportsFloat | typing.SupportsIndex = 1.37, gamma_combustion: typing.SupportsFloat | typing.SupportsIndex = 1.3, heat_from_cad: typing.SupportsFloat | typing.SupportsIndex = -10.0, heat_to_cad: typing.SupportsFloat | typing.SupportsIndex = 90.0, burn_from_cad: typing.SupportsFloat | typing.SupportsIndex = -10.0, total_at_end: bool = False, fractions_of_gross: bool = False) -> None:
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
def fit_cylinder(traces: collections.abc.Sequence[MeasuredCycle], cylinder: Cylinder, start: collections.abc.Sequence[LoadBurn], free: collections.abc.Sequence[str], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str, max_iterations: typing.SupportsInt | typing.SupportsIndex) -> CylinderFit:
    """
    Levenberg-Marquardt with exact sensitivities; releases the GIL.
    """
def hardenberg_hase_delay_cad(pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cetane_number: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], piston_speed_m_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    ...
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
def least_squares(fun: collections.abc.Callable, x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], *, parameters: collections.abc.Sequence[Parameter], options: LeastSquaresOptions) -> FitReport:
    """
    Minimise sum(residual^2) / 2 for `fun(x) -> (residual, jacobian)`; None refuses a point.
    """
def load_parameters() -> list[str]:
    """
    Names that may be freed per load.
    """
def processor_simd_levels() -> list[str]:
    """
    Vector instruction sets of this processor.
    """
def scan(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    Indicators over a column of timings; releases the GIL.
    """
def sensitivities(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, names: collections.abc.Sequence[str], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    Exact derivatives of indicators and pressure.
    """
def simulate(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    One cycle: traces and indicators.
    """
def start_of_combustion(cylinder: Cylinder, point: OperatingPoint, soi_cad: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    SOI to SOC.
    """
def start_of_injection(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    SOC to SOI.
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
    ...
def with_burn(cylinder: Cylinder, burn: LoadBurn) -> Cylinder:
    """
    The cylinder with one load's shape fields.
    """
def wolfer_delay_ms(pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    ...
def woschni_coefficient(c1_bar_m: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], bore_m: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], gas_velocity_m_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Film coefficient [W/(m2 K)].
    """
__version__: str = '0.1.0'
correlation_limit: float = 0.98
timing_window_cad: tuple = (-60.0, 20.0)
wall_heat_scale_upper: float = 2.5
woschni_c1_bar_m: float = 129.8
