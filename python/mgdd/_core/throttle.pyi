"""
Throttle body, its sensors, pseudo-Wiener models, demand chain.
"""
from __future__ import annotations
import collections.abc
import mgdd._core.control
import numpy
import numpy.typing
import typing
__all__: list[str] = ['DemandChain', 'DemandTracker', 'PedalMap', 'PseudoWienerModel', 'PseudoWienerStepper', 'SensorPair', 'Stepper', 'Throttle', 'airflow_torque', 'fill_manifold', 'pseudo_wiener_of', 'pseudo_wiener_units', 'sense', 'sensor_fault_kinds', 'simulate', 'simulate_many']
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
        """
        inertia_kgm2 : inertia of plate, gears and motor at the plate [kg m²]
        viscous_nms_per_rad : viscous friction [N m s/rad]
        torque_constant_nm_per_a : motor torque per current at the plate [N m/A]
        back_emf_vs_per_rad : motor voltage per plate speed [V s/rad]
        resistance_ohm : armature resistance [ohm]
        inductance_mh : armature inductance [mH]
        supply_v : supply of the bridge [V]
        driver_drop_v : voltage lost in the bridge at full duty [V]
        driver_resistance_ohm : resistance of the bridge [ohm]
        dead_band : duty without effect on either side of zero
        coulomb_nm : Coulomb friction [N m]
        stiction_nm : breakaway friction [N m]
        stribeck_rad_per_s : speed of the Stribeck curve [rad/s]
        karnopp_rad_per_s : half band of rest of Karnopp's form [rad/s]
        tanh_rad_per_s : width of the smooth form [rad/s]
        bristle_nm_per_rad : LuGre bristle stiffness [N m/rad]
        bristle_damping_nms_per_rad : LuGre bristle damping [N m s/rad]
        limp_home_deg : rest angle without current [deg]
        spring_above_nm_per_rad : spring above limp-home [N m/rad]
        spring_below_nm_per_rad : spring below limp-home [N m/rad]
        preload_above_nm : preload above limp-home [N m]
        preload_below_nm : preload below limp-home [N m]
        preload_ramp_deg : half width over which the preload changes sign [deg]
        closed_deg : lower end stop [deg]
        open_deg : upper end stop [deg]
        stop_stiffness_nm_per_rad : stiffness of the end stops [N m/rad]
        stop_damping_nms_per_rad : damping of the end stops [N m s/rad]
        backlash_half_deg : half gap of the gear [deg]
        gear_stiffness_nm_per_rad : contact stiffness of the gear [N m/rad]
        gear_damping_nms_per_rad : contact damping of the gear [N m s/rad]
        plate_inertia_kgm2 : inertia on the plate's side of the gap [kg m²]
        plate_friction_share : share of the friction on the plate's side of the gap
        bore_mm : bore of the throttle [mm]
        pressure_drop_kpa : pressure drop that loads the plate [kPa]
        friction : law of the dry friction
        backlash : play between gear and plate
        """
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
    def plate(self) -> mgdd._core.control.Plate:
        """
        What a controller can know of it: gain, springs, friction in duty.
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
        So long a check must fail before the fault counts [s]; a sample that passes takes back half of one.
    
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
    def __init__(self, *, closed_v: typing.SupportsFloat | typing.SupportsIndex = 0.5, span_v: typing.SupportsFloat | typing.SupportsIndex = 4.0, travel_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, supply_v: typing.SupportsFloat | typing.SupportsIndex = 5.0, noise_v: typing.SupportsFloat | typing.SupportsIndex = 0.002, lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.0003, adc_bits: typing.SupportsInt | typing.SupportsIndex = 12, sum_tolerance_v: typing.SupportsFloat | typing.SupportsIndex = 0.2, low_v: typing.SupportsFloat | typing.SupportsIndex = 0.2, high_v: typing.SupportsFloat | typing.SupportsIndex = 4.8, debounce_s: typing.SupportsFloat | typing.SupportsIndex = 0.2) -> None:
        """
        closed_v : first sensor at 0 deg [V]
        span_v : change of voltage over the travel [V]
        travel_deg : travel behind that change [deg]
        supply_v : supply of both sensors [V]
        noise_v : noise of each sensor, rms [V]
        lag_s : time constant of the input filter [s]
        adc_bits : bits of the converter
        sum_tolerance_v : tolerance of the sum [V]
        low_v : lowest healthy voltage [V]
        high_v : highest healthy voltage [V]
        debounce_s : time a fault must last [s]
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> SensorPair:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def adc_bits(self) -> int:
        """
        bits of the converter [-]
        """
    @property
    def closed_v(self) -> float:
        """
        first sensor at 0 deg [V]
        """
    @property
    def debounce_s(self) -> float:
        """
        time a fault must last [s]
        """
    @property
    def high_v(self) -> float:
        """
        highest healthy voltage [V]
        """
    @property
    def lag_s(self) -> float:
        """
        time constant of the input filter [s]
        """
    @property
    def low_v(self) -> float:
        """
        lowest healthy voltage [V]
        """
    @property
    def lsb_v(self) -> float:
        """
        Step of the converter [V].
        """
    @property
    def noise_v(self) -> float:
        """
        noise of each sensor, rms [V]
        """
    @property
    def span_v(self) -> float:
        """
        change of voltage over the travel [V]
        """
    @property
    def sum_tolerance_v(self) -> float:
        """
        tolerance of the sum [V]
        """
    @property
    def supply_v(self) -> float:
        """
        supply of both sensors [V]
        """
    @property
    def travel_deg(self) -> float:
        """
        travel behind that change [deg]
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
    def __repr__(self) -> str:
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
    def __repr__(self) -> str:
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
    def __repr__(self) -> str:
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
class PedalMap:
    """
    What the driver wants: engine torque over pedal and speed, a table read bilinearly.
    
    Immutable. Outside of the axes the edge holds. `of_full_load` makes a progressive one of a full-load curve.
    
    Parameters
    ----------
    pedal_percent : array_like, shape (n,)
        Pedal [%], two or more increasing entries in 0 to 100.
    speed_rpm : array_like, shape (m,)
        Engine speed [rpm], two or more increasing entries > 0.
    wanted_nm : array_like, shape (n, m)
        Torque at the crankshaft [N m], which does not fall with the pedal; negative where the released pedal brakes.
    
    Raises
    ------
    mgdd.errors.ParameterError, mgdd.errors.ShapeError
        An axis or entry that cannot be, by name.
    
    Examples
    --------
    >>> from mgdd.throttle import PedalMap
    >>> sport = PedalMap(pedal_percent=[0, 50, 100], speed_rpm=[1000, 5000], wanted_nm=[[-5, -9], [80, 70], [120, 105]])
    >>> float(sport.torque_nm(75.0, 1000.0))
    100.0
    >>> PedalMap.of_full_load([1000.0, 6000.0], [120.0, 105.0]).torque_nm([0.0, 100.0], 6000.0).tolist()
    [-10.5, 105.0]
    """
    @staticmethod
    def of_full_load(speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], full_load_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, pedal_percent: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None) -> PedalMap:
        """
        A progressive map: with M the full-load torque and p the pedal 0 to 1, ``M (0.6 p + 0.4 p²) - 0.1 M (1 - p) N/N_last``.
        
        The pedal's axis is that of the default map if left out.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, pedal_percent: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], wanted_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    def torque_nm(self, pedal_percent: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Wanted torque [N m]; arrays are broadcast together.
        """
    @property
    def pedal_percent(self) -> tuple:
        """
        Pedal [%].
        """
    @property
    def speed_rpm(self) -> tuple:
        """
        Speed [rpm].
        """
    @property
    def wanted_nm(self) -> tuple:
        """
        Torque [N m], a row per pedal.
        """
class DemandChain:
    """
    Parameters of the chain; see mgdd.throttle.DemandChain.
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
    def __init__(self, *, indicated_efficiency: typing.SupportsFloat | typing.SupportsIndex = 0.33, heating_value_mj_per_kg: typing.SupportsFloat | typing.SupportsIndex = 42.5, stoichiometric_air_fuel: typing.SupportsFloat | typing.SupportsIndex = 14.7, air_fuel_ratio: typing.SupportsFloat | typing.SupportsIndex = 1.0, friction_nm: typing.SupportsFloat | typing.SupportsIndex = 15.0, friction_nm_per_rpm: typing.SupportsFloat | typing.SupportsIndex = 0.003, displacement_l: typing.SupportsFloat | typing.SupportsIndex = 2.0, volumetric_efficiency: typing.SupportsFloat | typing.SupportsIndex = 0.85, manifold_l: typing.SupportsFloat | typing.SupportsIndex = 3.0, manifold_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 310.0, ambient_kpa: typing.SupportsFloat | typing.SupportsIndex = 101.325, ambient_temperature_k: typing.SupportsFloat | typing.SupportsIndex = 298.15, bore_mm: typing.SupportsFloat | typing.SupportsIndex = 60.0, shaft_mm: typing.SupportsFloat | typing.SupportsIndex = 8.0, plate_closed_deg: typing.SupportsFloat | typing.SupportsIndex = 6.0, leak_mm2: typing.SupportsFloat | typing.SupportsIndex = 3.0, discharge_5: typing.SupportsFloat | typing.SupportsIndex = 0.65, discharge_20: typing.SupportsFloat | typing.SupportsIndex = 0.75, discharge_45: typing.SupportsFloat | typing.SupportsIndex = 0.85, discharge_90: typing.SupportsFloat | typing.SupportsIndex = 0.9, discharge_pressure_loss: typing.SupportsFloat | typing.SupportsIndex = 0.1, pressure_lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.05, filling_share: typing.SupportsFloat | typing.SupportsIndex = 1.0, lowest_flow_function: typing.SupportsFloat | typing.SupportsIndex = 0.1, highest_ratio: typing.SupportsFloat | typing.SupportsIndex = 0.95, reference_rate_deg_per_s: typing.SupportsFloat | typing.SupportsIndex = 800.0, reference_bandwidth_per_s: typing.SupportsFloat | typing.SupportsIndex = 80.0, widest_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, pedal_map: PedalMap | None = None) -> None:
        """
        indicated_efficiency : indicated work over the heat of the fuel
        heating_value_mj_per_kg : lower heating value of the fuel [MJ/kg]
        stoichiometric_air_fuel : stoichiometric air over fuel by mass
        air_fuel_ratio : lambda
        friction_nm : friction torque at standstill [N m]
        friction_nm_per_rpm : rise of the friction torque with the speed [N m/rpm]
        displacement_l : displacement of the engine [L]
        volumetric_efficiency : charge over what the displacement holds of manifold gas
        manifold_l : volume of the manifold [L]
        manifold_temperature_k : temperature in the manifold [K]
        ambient_kpa : pressure before the throttle [kPa]
        ambient_temperature_k : temperature before the throttle [K]
        bore_mm : bore of the throttle [mm]
        shaft_mm : shaft of the plate [mm]
        plate_closed_deg : plate against the cross-section where the opening is zero [deg]
        leak_mm2 : area that is open at any angle [mm²]
        discharge_5 : discharge coefficient up to 5 deg of opening
        discharge_20 : discharge coefficient at 20 deg
        discharge_45 : discharge coefficient at 45 deg
        discharge_90 : discharge coefficient at 90 deg
        discharge_pressure_loss : share that it loses at equal pressures
        pressure_lag_s : lag of the wanted manifold pressure [s]
        filling_share : share fed forward of the air that fills the manifold
        lowest_flow_function : the flow function is taken no lower
        highest_ratio : pressure ratio up to which a measured pressure counts
        reference_rate_deg_per_s : fastest change of the reference [deg/s]
        reference_bandwidth_per_s : bandwidth of the filter of the reference [1/s]
        widest_deg : largest reference [deg]
        pedal_map : torque that the pedal wants over the speed
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def _steady(self, pedal_percent: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Torque, air, pressure and opening of steady demands.
        """
    def air_g_per_s(self, torque_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Air that makes a torque [g/s]; 0 where friction alone brakes more.
        """
    def angle_of_area_deg(self, area_mm2: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Smallest opening of at least that area [deg]; 0 or 90 beyond its range.
        """
    def area_mm2(self, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Open area of the throttle with its leak [mm²].
        """
    def cylinder_g_per_s(self, pressure_kpa: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Air that the cylinders take at a manifold pressure [g/s], by speed density.
        """
    def filling_time_s(self, speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Time constant of the manifold where the throttle is choked [s].
        """
    def opening_deg(self, air_g_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_kpa: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Opening that lets an air flow through against a manifold pressure [deg].
        """
    def pressure_kpa(self, air_g_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Manifold pressure at which the cylinders take an air flow [kPa], by speed density.
        """
    def replace(self, **kwargs) -> DemandChain:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def steady_kpa(self, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Manifold pressure at which a held opening ends [kPa].
        """
    def throttle_g_per_s(self, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_kpa: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Air through the throttle against a manifold pressure [g/s]; negative above the ambient one.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    def torque_nm(self, air_g_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], speed_rpm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
        """
        Torque that an air flow makes [N m].
        """
    @property
    def air_fuel_ratio(self) -> float:
        """
        lambda [-]
        """
    @property
    def ambient_kpa(self) -> float:
        """
        pressure before the throttle [kPa]
        """
    @property
    def ambient_temperature_k(self) -> float:
        """
        temperature before the throttle [K]
        """
    @property
    def bore_mm(self) -> float:
        """
        bore of the throttle [mm]
        """
    @property
    def discharge_20(self) -> float:
        """
        discharge coefficient at 20 deg [-]
        """
    @property
    def discharge_45(self) -> float:
        """
        discharge coefficient at 45 deg [-]
        """
    @property
    def discharge_5(self) -> float:
        """
        discharge coefficient up to 5 deg of opening [-]
        """
    @property
    def discharge_90(self) -> float:
        """
        discharge coefficient at 90 deg [-]
        """
    @property
    def discharge_pressure_loss(self) -> float:
        """
        share that it loses at equal pressures [-]
        """
    @property
    def displacement_l(self) -> float:
        """
        displacement of the engine [L]
        """
    @property
    def filling_share(self) -> float:
        """
        share fed forward of the air that fills the manifold [-]
        """
    @property
    def friction_nm(self) -> float:
        """
        friction torque at standstill [N m]
        """
    @property
    def friction_nm_per_rpm(self) -> float:
        """
        rise of the friction torque with the speed [N m/rpm]
        """
    @property
    def heating_value_mj_per_kg(self) -> float:
        """
        lower heating value of the fuel [MJ/kg]
        """
    @property
    def highest_ratio(self) -> float:
        """
        pressure ratio up to which a measured pressure counts [-]
        """
    @property
    def indicated_efficiency(self) -> float:
        """
        indicated work over the heat of the fuel [-]
        """
    @property
    def leak_mm2(self) -> float:
        """
        area that is open at any angle [mm²]
        """
    @property
    def lowest_flow_function(self) -> float:
        """
        the flow function is taken no lower [-]
        """
    @property
    def manifold_l(self) -> float:
        """
        volume of the manifold [L]
        """
    @property
    def manifold_temperature_k(self) -> float:
        """
        temperature in the manifold [K]
        """
    @property
    def pedal_map(self) -> PedalMap:
        """
        torque that the pedal wants over the speed
        """
    @property
    def plate_closed_deg(self) -> float:
        """
        plate against the cross-section where the opening is zero [deg]
        """
    @property
    def pressure_lag_s(self) -> float:
        """
        lag of the wanted manifold pressure [s]
        """
    @property
    def reference_bandwidth_per_s(self) -> float:
        """
        bandwidth of the filter of the reference [1/s]
        """
    @property
    def reference_rate_deg_per_s(self) -> float:
        """
        fastest change of the reference [deg/s]
        """
    @property
    def shaft_mm(self) -> float:
        """
        shaft of the plate [mm]
        """
    @property
    def stoichiometric_air_fuel(self) -> float:
        """
        stoichiometric air over fuel by mass [-]
        """
    @property
    def volumetric_efficiency(self) -> float:
        """
        charge over what the displacement holds of manifold gas [-]
        """
    @property
    def widest_deg(self) -> float:
        """
        largest reference [deg]
        """
class DemandTracker:
    """
    The chain sample by sample; see mgdd.throttle.DemandChain.tracker.
    """
    def __init__(self, chain: DemandChain, *, sample_s: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def reset(self) -> None:
        """
        As made: no demand yet.
        """
    def step(self, pedal_percent: typing.SupportsFloat | typing.SupportsIndex, speed_rpm: typing.SupportsFloat | typing.SupportsIndex, pressure_kpa: typing.SupportsFloat | typing.SupportsIndex = ...) -> dict:
        """
        Demand and reference of this sample, by name.
        
        NaN repeats the last value; without any measured pressure yet it is the wanted one. The first demand is taken as steady.
        """
    def take_over(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        The next reference goes on from this angle, at the allowed rate.
        
        Ignored if it is not finite.
        """
    @property
    def sample_s(self) -> float:
        """
        Time between samples [s].
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a run needs to go on bit for bit.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
def airflow_torque(throttle: Throttle, angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Torque of the modelled air flow [N m]; behind mgdd.throttle.airflow_torque_nm.
    """
def fill_manifold(chain: DemandChain, pressure_kpa: typing.SupportsFloat | typing.SupportsIndex, angle_deg: typing.SupportsFloat | typing.SupportsIndex, speed_rpm: typing.SupportsFloat | typing.SupportsIndex, *, sample_s: typing.SupportsFloat | typing.SupportsIndex) -> tuple[float, float, float]:
    """
    Pressure [kPa] after a sample, and the mean flows through throttle and cylinders [g/s].
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
    One throttle over columns, from rest; behind mgdd.throttle.simulate_throttle.
    """
def simulate_many(throttles: collections.abc.Sequence[Throttle], duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, sample_s: typing.SupportsFloat | typing.SupportsIndex, start_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], bridge: str, supply_v: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], airflow_torque_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], step_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Many throttles under one input, in lanes; behind mgdd.throttle.simulate_throttle.
    """
sensor_fault_kinds: tuple = ('none', 'open_wire', 'short_to_ground', 'short_to_supply', 'offset', 'gain', 'stuck')
