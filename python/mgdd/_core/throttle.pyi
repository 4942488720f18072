"""
Throttle body, its sensors, pseudo-Wiener models.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['PseudoWienerModel', 'PseudoWienerStepper', 'SensorPair', 'Stepper', 'Throttle', 'airflow_torque', 'pseudo_wiener_of', 'pseudo_wiener_units', 'sense', 'sensor_fault_kinds', 'simulate', 'simulate_many']
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
    def __init__(self, *, inertia_kgm2: typing.SupportsFloat | typing.SupportsIndex = 0.0021, viscous_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.0088, torque_constant_nm_per_a: typing.SupportsFloat | typing.SupportsIndex = 0.383, back_emf_vs_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.383, resistance_ohm: typing.SupportsFloat | typing.SupportsIndex = 1.5, inductance_mh: typing.SupportsFloat | typing.SupportsIndex = 1.5, supply_v: typing.SupportsFloat | typing.SupportsIndex = 12.0, driver_drop_v: typing.SupportsFloat | typing.SupportsIndex = 0.0, driver_resistance_ohm: typing.SupportsFloat | typing.SupportsIndex = 0.0, dead_band: typing.SupportsFloat | typing.SupportsIndex = 0.0, coulomb_nm: typing.SupportsFloat | typing.SupportsIndex = 0.284, stiction_nm: typing.SupportsFloat | typing.SupportsIndex = 0.284, stribeck_rad_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.3, karnopp_rad_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.05, tanh_rad_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.05, bristle_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 81.0, bristle_damping_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.41, limp_home_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, spring_above_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.087, spring_below_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.087, preload_above_nm: typing.SupportsFloat | typing.SupportsIndex = 0.396, preload_below_nm: typing.SupportsFloat | typing.SupportsIndex = 0.396, preload_ramp_deg: typing.SupportsFloat | typing.SupportsIndex = 0.25, closed_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0, open_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, stop_stiffness_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 5000.0, stop_damping_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 4.5, backlash_half_deg: typing.SupportsFloat | typing.SupportsIndex = 0.2, gear_stiffness_nm_per_rad: typing.SupportsFloat | typing.SupportsIndex = 200.0, gear_damping_nms_per_rad: typing.SupportsFloat | typing.SupportsIndex = 0.2, plate_inertia_kgm2: typing.SupportsFloat | typing.SupportsIndex = 0.0003, plate_friction_share: typing.SupportsFloat | typing.SupportsIndex = 0.3, bore_mm: typing.SupportsFloat | typing.SupportsIndex = 60.0, pressure_drop_kpa: typing.SupportsFloat | typing.SupportsIndex = 0.0, friction: str = 'coulomb', backlash: str = 'none') -> None:
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
        play between gear and plate
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
        law of the dry friction
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
class Stepper:
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
def airflow_torque(throttle: Throttle, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Torque of the modelled air flow [N m]; behind mgdd.throttle.airflow_torque_nm.
    """
def pseudo_wiener_of(throttle: Throttle) -> PseudoWienerModel:
    """
    PW-R with the groups of a first-principle throttle.
    """
def pseudo_wiener_units(kind: str) -> dict:
    """
    Unit of every parameter.
    """
def sense(pair: SensorPair, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, sample_s: typing.SupportsFloat | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex, faults: typing.Annotated[collections.abc.Sequence[tuple[str, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex | None]], "FixedSize(2)"]) -> dict:
    """
    Samples of both sensors; behind mgdd.throttle.SensorPair.sense.
    """
def simulate(throttle: Throttle, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, sample_s: typing.SupportsFloat | typing.SupportsIndex, start_deg: typing.SupportsFloat | typing.SupportsIndex, bridge: str, supply_v: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], airflow_torque_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], step_s: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    One throttle over columns, from rest; behind mgdd.throttle.simulate.
    """
def simulate_many(throttles: collections.abc.Sequence[Throttle], duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, sample_s: typing.SupportsFloat | typing.SupportsIndex, start_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], bridge: str, supply_v: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], airflow_torque_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], step_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Many throttles under one input, in lanes; behind mgdd.throttle.simulate.
    """
sensor_fault_kinds: tuple = ('none', 'open_wire', 'short_to_ground', 'short_to_supply', 'offset', 'gain', 'stuck')
