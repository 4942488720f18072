"""
Cycle model of one cylinder, emissions, performance, measured pressure.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['Cylinder', 'Indicating', 'NoxFit', 'NoxModel', 'NoxProxy', 'OperatingPoint', 'Performance', 'PerformanceTerm', 'SoftSensor', 'ThermalNoModel', 'TraceOptions', 'analyze', 'analyze_cycles', 'at_even_angles', 'batch', 'batch_form', 'batch_inputs', 'burn_duration_cad', 'burned_fraction', 'check_trace', 'convergence', 'differentiable_inputs', 'eichelberg_coefficient', 'encoder_angle', 'fit_nox_proxy', 'hardenberg_hase_delay_cad', 'hohenberg_coefficient', 'indicator_units', 'input_unit', 'scan', 'sensitivities', 'simulate', 'start_of_combustion', 'start_of_injection', 'thermal_no', 'timing_window_cad', 'volume_l', 'wall_area_m2', 'watson_delay_ms', 'wolfer_delay_ms', 'woschni_c1_bar_m', 'woschni_coefficient']
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
    def __init__(self, *, bore_mm: typing.SupportsFloat | typing.SupportsIndex = 86.0, stroke_mm: typing.SupportsFloat | typing.SupportsIndex = 86.0, connecting_rod_mm: typing.SupportsFloat | typing.SupportsIndex = 155.0, compression_ratio: typing.SupportsFloat | typing.SupportsIndex = 18.2, ivc_cad: typing.SupportsFloat | typing.SupportsIndex = -140.0, evo_cad: typing.SupportsFloat | typing.SupportsIndex = 130.0, bowl_area_factor: typing.SupportsFloat | typing.SupportsIndex = 1.0, ivc_pressure_rise_kpa: typing.SupportsFloat | typing.SupportsIndex = 0.0, volumetric_efficiency: typing.SupportsFloat | typing.SupportsIndex = 0.9, lower_heating_value_mj_per_kg: typing.SupportsFloat | typing.SupportsIndex = 42.8, gamma: typing.SupportsFloat | typing.SupportsIndex = 1.37, gamma_linear_300k: typing.SupportsFloat | typing.SupportsIndex = 1.38, gamma_linear_slope_per_k: typing.SupportsFloat | typing.SupportsIndex = -8e-05, gamma_polynomial_c0: typing.SupportsFloat | typing.SupportsIndex = 1.338, gamma_polynomial_c1_per_k: typing.SupportsFloat | typing.SupportsIndex = -6e-05, gamma_polynomial_c2_per_k2: typing.SupportsFloat | typing.SupportsIndex = 1e-08, wall_heat_scale: typing.SupportsFloat | typing.SupportsIndex = 0.5, woschni_c2: typing.SupportsFloat | typing.SupportsIndex = 2.28, woschni_cp_m_per_sk: typing.SupportsFloat | typing.SupportsIndex = 0.00324, wall_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 450.0, burn_duration_ref_cad: typing.SupportsFloat | typing.SupportsIndex = 30.0, burn_fuel_ref_mg: typing.SupportsFloat | typing.SupportsIndex = 20.0, burn_speed_ref_rpm: typing.SupportsFloat | typing.SupportsIndex = 1500.0, burn_fuel_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.6, burn_speed_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.3, wiebe_a: typing.SupportsFloat | typing.SupportsIndex = 6.908, wiebe_m: typing.SupportsFloat | typing.SupportsIndex = 1.5, second_fraction: typing.SupportsFloat | typing.SupportsIndex = 0.6, second_delay_cad: typing.SupportsFloat | typing.SupportsIndex = 3.0, second_duration_cad: typing.SupportsFloat | typing.SupportsIndex = 50.0, second_wiebe_m: typing.SupportsFloat | typing.SupportsIndex = 0.8, cetane_number: typing.SupportsFloat | typing.SupportsIndex = 45.0, ignition_c0_cad: typing.SupportsFloat | typing.SupportsIndex = 4.0, ignition_c1: typing.SupportsFloat | typing.SupportsIndex = 0.0, ignition_c2_per_cad: typing.SupportsFloat | typing.SupportsIndex = 0.0, burn_shape: str = 'triangle', gamma_model: str = 'constant', wall_heat_model: str = 'woschni', ignition_model: str = 'watson') -> None:
        """
        bore_mm : cylinder bore [mm]
        stroke_mm : piston stroke [mm]
        connecting_rod_mm : connecting rod, eye to eye [mm]
        compression_ratio : geometric compression ratio
        ivc_cad : intake valve closing [°CA aTDC]
        evo_cad : exhaust valve opening [°CA aTDC]
        bowl_area_factor : head and piston area over two flat discs
        ivc_pressure_rise_kpa : p(IVC) above the intake pressure [kPa]
        volumetric_efficiency : trapped over ideal charge at intake conditions
        lower_heating_value_mj_per_kg : heat of the fuel [MJ/kg]
        gamma : constant ratio of specific heats
        gamma_linear_300k : linear gamma(T) at 300 K
        gamma_linear_slope_per_k : slope of linear gamma(T) [1/K]
        gamma_polynomial_c0 : polynomial gamma(T), constant
        gamma_polynomial_c1_per_k : polynomial gamma(T), linear term [1/K]
        gamma_polynomial_c2_per_k2 : polynomial gamma(T), quadratic term [1/K^2]
        wall_heat_scale : wall heat over the textbook law (Woschni C1/129.8)
        woschni_c2 : weight of the mean piston speed
        woschni_cp_m_per_sk : combustion term of the gas velocity [m/(s K)]
        wall_temperature_k : mean wall temperature [K]
        burn_duration_ref_cad : burn duration at the reference point [°CA]
        burn_fuel_ref_mg : fuel of the reference point [mg]
        burn_speed_ref_rpm : speed of the reference point [rpm]
        burn_fuel_exponent : duration law: exponent of fuel
        burn_speed_exponent : duration law: exponent of speed
        wiebe_a : Wiebe completeness
        wiebe_m : Wiebe shape, exponent m + 1
        second_fraction : share of the heat in the second Wiebe law
        second_delay_cad : start of the second Wiebe law after the first [°CA]
        second_duration_cad : duration of the second Wiebe law [°CA]
        second_wiebe_m : shape of the second Wiebe law
        cetane_number : for Hardenberg-Hase
        ignition_c0_cad : polynomial ignition delay, constant [°CA]
        ignition_c1 : polynomial ignition delay, linear term
        ignition_c2_per_cad : polynomial ignition delay, quadratic term [1/°CA]
        burn_shape : burn law
        gamma_model : gamma against T
        wall_heat_model : wall-heat correlation
        ignition_model : ignition-delay correlation
        """
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
        """
        burn law
        """
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
        """
        gamma against T
        """
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
        """
        ignition-delay correlation
        """
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
        """
        wall-heat correlation
        """
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
    
    Keyword-only and immutable. `burn_duration_cad=None` is the cylinder's duration law. Without `trapped_mass_g` the mass
    is p V/(R T) at IVC where `ivc_temperature_k` is given, else a simulation takes the volumetric efficiency, and a
    measured trace p V/(R T) with the intake temperature + 40 K.
    
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
        Every field by name: unit, bounds or choices, meaning, default.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, speed_rpm: typing.SupportsFloat | typing.SupportsIndex = 1500.0, fuel_mg: typing.SupportsFloat | typing.SupportsIndex = 20.0, intake_pressure_kpa: typing.SupportsFloat | typing.SupportsIndex = 150.0, intake_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 313.0, burn_duration_cad: typing.SupportsFloat | typing.SupportsIndex | None = None, trapped_mass_g: typing.SupportsFloat | typing.SupportsIndex | None = None, ivc_temperature_k: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        speed_rpm : engine speed [rpm]
        fuel_mg : fuel per cycle, 0 = motored [mg]
        intake_pressure_kpa : intake pressure [kPa]
        intake_temperature_k : intake temperature [K]
        burn_duration_cad : burn duration; none = the duration law
        trapped_mass_g : trapped charge; none = from ivc_temperature_k or volumetric efficiency
        ivc_temperature_k : charge at IVC; none = volumetric efficiency, for a measured trace the intake temperature + 40 K
        """
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
        """
        burn duration; none = the duration law
        """
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
    def ivc_temperature_k(self) -> float | None:
        """
        charge at IVC; none = volumetric efficiency, for a measured trace the intake temperature + 40 K
        """
    @property
    def speed_rpm(self) -> float:
        """
        engine speed [rpm]
        """
    @property
    def trapped_mass_g(self) -> float | None:
        """
        trapped charge; none = from ivc_temperature_k or volumetric efficiency
        """
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
    def __init__(self, *, reference_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 1900.0, reference_nox_ppm: typing.SupportsFloat | typing.SupportsIndex = 1200.0, activation_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 16000.0) -> None:
        """
        reference_temperature_k : T0 of the map [K]
        reference_nox_ppm : NOx at T0 [ppm]
        activation_temperature_k : b of the Arrhenius map [K]
        """
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
    def replace(self, **kwargs) -> NoxProxy:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def activation_temperature_k(self) -> float:
        """
        b of the Arrhenius map [K]
        """
    @property
    def reference_nox_ppm(self) -> float:
        """
        NOx at T0 [ppm]
        """
    @property
    def reference_temperature_k(self) -> float:
        """
        T0 of the map [K]
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
    def __init__(self, *, proxy: NoxProxy | None = None, map: str = 'affine_log', intake_o2_fraction: typing.SupportsFloat | typing.SupportsIndex = 0.209, o2_exponent: typing.SupportsFloat | typing.SupportsIndex = 3.0) -> None:
        """
        proxy : constants of the map
        map : form of the map
        intake_o2_fraction : intake oxygen by volume
        o2_exponent : exponent of the oxygen factor
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def ppm(self, t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        NOx [ppm].
        """
    def replace(self, **kwargs) -> NoxModel:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def intake_o2_fraction(self) -> float:
        """
        intake oxygen by volume [-]
        """
    @property
    def map(self) -> str:
        """
        form of the map
        """
    @property
    def o2_exponent(self) -> float:
        """
        exponent of the oxygen factor [-]
        """
    @property
    def proxy(self) -> NoxProxy:
        """
        constants of the map
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
    def __init__(self, *, model: NoxModel | None = None, correction_gain: typing.SupportsFloat | typing.SupportsIndex = 0.01) -> None:
        """
        model : NOx from the maximum gas temperature
        correction_gain : share of the log-ratio per cycle
        """
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
    def replace(self, **kwargs) -> SoftSensor:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def correction_gain(self) -> float:
        """
        share of the log-ratio per cycle [-]
        """
    @property
    def model(self) -> NoxModel:
        """
        NOx from the maximum gas temperature
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
class ThermalNoModel:
    def __init__(self, *, lambda_burned: typing.SupportsFloat | typing.SupportsIndex = 1.1, mixing_time_ms: typing.SupportsFloat | typing.SupportsIndex = 2.0, intake_o2_fraction: typing.SupportsFloat | typing.SupportsIndex = 0.209, hydrogen_to_carbon: typing.SupportsFloat | typing.SupportsIndex = 1.86, rates: str = 'hanson_salimian', calibration: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> None:
        """
        lambda_burned : air over the need of the fuel where it burns; the one to fit
        mixing_time_ms : in which burned gas takes on the bulk temperature [ms]
        intake_o2_fraction : oxygen of the charge by volume; below air by burned gas
        hydrogen_to_carbon : atoms of the fuel
        rates : rate coefficients
        calibration : factor on the result, to be fitted
        """
    def __repr__(self) -> str:
        ...
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
    def __init__(self, *, pegging: str = 'none', pegging_exponent: typing.SupportsFloat | typing.SupportsIndex = 1.35, inlet_pressure_kpa: typing.SupportsFloat | typing.SupportsIndex = 0.0, gamma_source: str = 'constant', gamma: typing.SupportsFloat | typing.SupportsIndex = 1.33, gamma_compression: typing.SupportsFloat | typing.SupportsIndex = 1.37, gamma_combustion: typing.SupportsFloat | typing.SupportsIndex = 1.3, heat_from_cad: typing.SupportsFloat | typing.SupportsIndex | None = None, heat_to_cad: typing.SupportsFloat | typing.SupportsIndex | None = None, earliest_burn_cad: typing.SupportsFloat | typing.SupportsIndex | None = None, burn_from_cad: typing.SupportsFloat | typing.SupportsIndex | None = None, total_at_end: bool = False, fractions: str = 'net', smoothing: str = 'automatic', smoothing_width_cad: typing.SupportsFloat | typing.SupportsIndex = 4.0, smoothing_cutoff_hz: typing.SupportsFloat | typing.SupportsIndex = 3000.0, knock_low_hz: typing.SupportsFloat | typing.SupportsIndex = 4000.0, knock_high_hz: typing.SupportsFloat | typing.SupportsIndex = 20000.0, knock_from_cad: typing.SupportsFloat | typing.SupportsIndex = -10.0, knock_to_cad: typing.SupportsFloat | typing.SupportsIndex = 90.0, intake_pressure_kpa: typing.SupportsFloat | typing.SupportsIndex | None = None, intake_factor: typing.SupportsFloat | typing.SupportsIndex = 1.5, bmep_bar: typing.SupportsFloat | typing.SupportsIndex | None = None, fuel_heat_j: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        pegging : how the absolute pressure is found
        pegging_exponent : polytropic exponent of compression
        inlet_pressure_kpa : pressure at intake bottom dead centre [kPa]
        gamma_source : where gamma comes from
        gamma : constant over the window
        gamma_compression : before the burn
        gamma_combustion : from the burn start on
        heat_from_cad : start of the cumulative heat
        heat_to_cad : its end
        earliest_burn_cad : the burn is searched from here on
        burn_from_cad : the combustion term of the wall heat acts from here
        total_at_end : report the heat at the end of the window, not its peak
        fractions : what the burn angles are shares of
        smoothing : of the pressure before the heat release
        smoothing_width_cad : whole width [°CA]
        smoothing_cutoff_hz : where the gain is 1/2 [Hz]
        knock_low_hz : lower end of the band of the oscillation [Hz]
        knock_high_hz : its upper end [Hz]
        knock_from_cad : start of the window of the oscillation [°CA aTDC]
        knock_to_cad : its end [°CA aTDC]
        intake_pressure_kpa : what p(IVC) is judged against
        intake_factor : beyond this factor of it p(IVC) is doubted
        bmep_bar : a gross IMEP that cannot reach it is refused
        fuel_heat_j : heat of the stated fuel
        """
    def __repr__(self) -> str:
        ...
class Indicating:
    def __init__(self, crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cylinder: Cylinder, speed_rpm: typing.SupportsFloat | typing.SupportsIndex, options: TraceOptions) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def many(self, pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], threads: typing.SupportsInt | typing.SupportsIndex = 0) -> dict:
        """
        Figures of cycles, the last axis its angles.
        """
    def one(self, pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> dict:
        """
        Figures of one cycle.
        """
    def oscillation(self, pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> dict:
        """
        Pressure in the band of knock.
        """
def analyze(crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cylinder: Cylinder, point: OperatingPoint, options: TraceOptions) -> dict:
    """
    Pegging, heat release, burn angles, work.
    """
def analyze_cycles(crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cylinder: Cylinder, point: OperatingPoint, options: TraceOptions, traces: bool = True, threads: typing.SupportsInt | typing.SupportsIndex = 0) -> dict:
    """
    The same of every row; warnings counted together.
    """
def at_even_angles(angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], from_deg: typing.SupportsFloat | typing.SupportsIndex, step_deg: typing.SupportsFloat | typing.SupportsIndex, count: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Samples at even angles.
    """
def batch(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, names: collections.abc.Sequence[str], rows: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], outputs: collections.abc.Sequence[str], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str, threads: typing.SupportsInt | typing.SupportsIndex = 0, form: str = 'automatic') -> dict:
    """
    Indicators of many cycles; `rows` is (cases, names). NaN where a cycle is not physical. Releases the GIL.
    """
def batch_form(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, names: collections.abc.Sequence[str], rows: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> str:
    """
    What `form='automatic'` stands for: pass it on where a batch is cut into pieces.
    """
def batch_inputs() -> dict:
    """
    What may vary in a batch: unit and meaning by name.
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
def convergence(cylinder: Cylinder, point: OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> dict:
    """
    Step-size error per indicator: (value, extrapolated, error, order, unit).
    """
def differentiable_inputs() -> list[str]:
    """
    Names that `sensitivities` takes.
    """
def eichelberg_coefficient(c1_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], piston_speed_m_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Film coefficient [W/(m2 K)].
    """
def encoder_angle(time_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], signal: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], index: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None, teeth: typing.SupportsInt | typing.SupportsIndex = 360, missing_teeth: typing.SupportsInt | typing.SupportsIndex = 0, falling: bool = False, level: typing.SupportsFloat | typing.SupportsIndex | None = None) -> dict:
    """
    Crank angle of every sample of an encoder.
    """
def fit_nox_proxy(t_max_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], nox_ppm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], map: str, reference_temperature_k: typing.SupportsFloat | typing.SupportsIndex) -> NoxFit:
    """
    Least squares on ln NOx; use mgdd.engine.fit_nox_proxy.
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
def thermal_no(crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], volume_l: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], burned_fraction: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cylinder: Cylinder, point: OperatingPoint, model: ThermalNoModel) -> dict:
    """
    Thermal NO of one cycle.
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
def wolfer_delay_ms(pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Ignition delay [ms].
    """
def woschni_coefficient(c1_bar_m: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], bore_m: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], temperature_k: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], gas_velocity_m_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    Film coefficient [W/(m2 K)].
    """
timing_window_cad: tuple = (-60.0, 20.0)
woschni_c1_bar_m: float = 129.8
