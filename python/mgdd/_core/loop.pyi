"""
Virtual benches and the loops over them.
"""
from __future__ import annotations
import collections.abc
import mgdd._core.engine
import mgdd._core.guide
import mgdd._core.optimize
import mgdd._core.throttle
import numpy
import numpy.typing
import typing
__all__: list[str] = ['FunctionPlant', 'Mgdd1', 'ObjectGuidedMgdd1', 'SensorDynamics', 'VirtualEngine', 'VirtualThrottle', 'bench_inputs', 'bench_limits', 'loop_form', 'monte_carlo', 'plant_noise', 'run_function', 'run_loop', 'step_times_us', 'throttle_fault_kinds', 'track_throttle', 'track_throttles', 'tracking_figures']
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
    def __init__(self, *, delay_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, noise_fraction: typing.SupportsFloat | typing.SupportsIndex = 0.0, delay_cycles: typing.SupportsInt | typing.SupportsIndex | None = None, lag_cycles: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        delay_s : delay of the sample line [s]
        lag_s : time constant [s]
        noise_fraction : noise over reading
        delay_cycles : delay in engine cycles instead
        lag_cycles : time constant in engine cycles instead
        """
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
    def replace(self, **kwargs) -> SensorDynamics:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def delay_cycles(self) -> int | None:
        """
        delay in engine cycles instead
        """
    @property
    def delay_s(self) -> float:
        """
        delay of the sample line [s]
        """
    @property
    def lag_cycles(self) -> float | None:
        """
        time constant in engine cycles instead
        """
    @property
    def lag_s(self) -> float:
        """
        time constant [s]
        """
    @property
    def noise_fraction(self) -> float:
        """
        noise over reading [-]
        """
class VirtualEngine:
    """
    The virtual engine bench; use mgdd.loop.VirtualEngine.
    """
    @staticmethod
    def fields() -> dict:
        """
        Every setting by name: unit, bounds or choices, meaning, default.
        """
    def __getstate__(self) -> tuple[int, dict, dict[str, list[float]]]:
        ...
    def __init__(self, *, cylinder: mgdd._core.engine.Cylinder, schedule: collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, mgdd._core.engine.OperatingPoint]], performance: mgdd._core.engine.Performance | None = None, nox_sensor: str = 'soft', limits: collections.abc.Sequence[str] = [], inputs: collections.abc.Sequence[str] = ['soc_cad'], soc_scatter_cad: typing.SupportsFloat | typing.SupportsIndex = 0.3, efficiency_noise_percent: typing.SupportsFloat | typing.SupportsIndex = 0.25, misfire_probability: typing.SupportsFloat | typing.SupportsIndex = 0.0, soc_drift_cad_per_kcycle: typing.SupportsFloat | typing.SupportsIndex = 0.0, wall_heat_drift_per_kcycle: typing.SupportsFloat | typing.SupportsIndex = 0.0, pressure_noise_bar: typing.SupportsFloat | typing.SupportsIndex = 0.0, tdc_error_cad: typing.SupportsFloat | typing.SupportsIndex = 0.0, pressure_gain_error: typing.SupportsFloat | typing.SupportsIndex = 0.0, pressure_offset_bar: typing.SupportsFloat | typing.SupportsIndex = 0.0, pressure_drift_bar_per_kcycle: typing.SupportsFloat | typing.SupportsIndex = 0.0, true_nox: mgdd._core.engine.NoxModel | None = None, soft_sensor: mgdd._core.engine.SoftSensor | None = None, analyser: SensorDynamics | None = None, fast_sensor: SensorDynamics | None = None, delay_whole_objective: bool = False, step_cad: typing.SupportsFloat | typing.SupportsIndex = 1.0, integrator: str = 'trapezoid', seed: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
        """
        cylinder : the engine
        schedule : first cycle of each operating point
        performance : what is to be maximised: gross efficiency in percent
        nox_sensor : whose NOx enters the performance
        limits : indicators to report as limits
        inputs : what is steered, soc_cad first; whatever is not named stays as the point has it
        soc_scatter_cad : standard deviation of SOC from cycle to cycle [°CA]
        efficiency_noise_percent : standard deviation of the measured efficiency in points, with the work and IMEP that belong to it [%]
        misfire_probability : misfires per cycle, drawn at random
        soc_drift_cad_per_kcycle : offset of SOC per 1000 cycles [°CA]
        wall_heat_drift_per_kcycle : change of wall_heat_scale per 1000 cycles
        pressure_noise_bar : noise of each sample of the pressure trace, standard deviation; indicators have none of it [bar]
        tdc_error_cad : angles of the pressure trace read that much high [°CA]
        pressure_gain_error : share by which the pressure trace reads high
        pressure_offset_bar : by which the pressure trace is pegged too high [bar]
        pressure_drift_bar_per_kcycle : change of pressure_offset_bar per 1000 cycles [bar]
        true_nox : NOx of the plant from its own maximum gas temperature: an Arrhenius map
        soft_sensor : the soft sensor: an affine-log map of the same constants
        analyser : NOx analyser: 3 s late, lag 2 s, noise 1 %
        fast_sensor : fast NOx sensor: 0.05 s late, lag 0.05 s, noise 3 %
        delay_whole_objective : every component passes the delay and lag of the analyser, without its noise; NOx is the true one
        step_cad : step of the cycle model, as in mgdd.engine.simulate [°CA]
        integrator : of the cycle model, as in mgdd.engine.simulate
        seed : of all noise
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def noise_free_limits(self, soc_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cycle: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], further: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]] = ()) -> numpy.typing.NDArray[numpy.float64]:
        """
        Limited quantities without scatter, noise and misfire, drift included: one row per request and its cycle, in
        the order of limit_names; the true steady NOx for every sensor. NaN for the COV of IMEP, which has no such
        value. The bench itself does not run. `further` are columns of the other inputs.
        """
    def point_at(self, cycle: typing.SupportsInt | typing.SupportsIndex) -> mgdd._core.engine.OperatingPoint:
        """
        Operating point of a cycle.
        """
    def pressure_columns(self) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Angles and pressure of the last cycle as the sensor reads them; both empty before the first.
        """
    def reset(self, seed: typing.SupportsInt | typing.SupportsIndex | None = None) -> None:
        """
        Back to cycle 0, with another seed if given.
        """
    def run_columns(self, soc_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], further: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]] = ()) -> dict:
        """
        Run one cycle per request, without the GIL: columns by name. `further` are columns of the other inputs.
        """
    def step(self, soc_cad: typing.SupportsFloat | typing.SupportsIndex, further: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] = ()) -> dict:
        """
        Run one cycle: what was measured, by name. `further` are the other inputs in their order; what is left out
        stays.
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
    def input_bounds(self) -> dict:
        """
        Least and greatest value of each input that is not clamped, by name.
        """
    @property
    def operating_point_changes(self) -> bool:
        """
        Whether speed or fuel of the next cycle differ by more than 5 % from those of the last one.
        """
    @property
    def point(self) -> mgdd._core.engine.OperatingPoint:
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
class FunctionPlant:
    """
    A compiled function as a plant; use mgdd.loop.FunctionPlant.
    """
    def __deepcopy__(self, memo: dict) -> FunctionPlant:
        """
        The same function and data at the same cycle.
        """
    def __init__(self, address: typing.SupportsInt | typing.SupportsIndex, user_data: typing.SupportsInt | typing.SupportsIndex, *, inputs: typing.SupportsInt | typing.SupportsIndex, values: typing.SupportsInt | typing.SupportsIndex, limits: collections.abc.Sequence[str], noise_sd: typing.SupportsFloat | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def measure(self, inputs: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> list[float] | None:
        """
        Run one cycle without the GIL: its outputs, None where it failed.
        """
    @property
    def cycle(self) -> int:
        """
        Index of the next cycle.
        """
class VirtualThrottle:
    """
    A throttle with its sensors, sample by sample; behind mgdd.loop.VirtualThrottle.
    """
    def __init__(self, *, throttle: mgdd._core.throttle.Throttle, sensors: mgdd._core.throttle.SensorPair, faults: typing.Annotated[collections.abc.Sequence[tuple[str, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex | None]], "FixedSize(2)"], plant_faults: collections.abc.Sequence[tuple[str, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex | None]], sample_s: typing.SupportsFloat | typing.SupportsIndex, step_s: typing.SupportsFloat | typing.SupportsIndex, start_deg: typing.SupportsFloat | typing.SupportsIndex, bridge: str, seed: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def step(self, *, duty: typing.SupportsFloat | typing.SupportsIndex, supply_v: typing.SupportsFloat | typing.SupportsIndex, airflow_torque_nm: typing.SupportsFloat | typing.SupportsIndex, bridge_open: bool) -> dict:
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
class Mgdd1:
    """
    The plainest model-guided controller; use mgdd.control.Mgdd1.
    """
    @staticmethod
    def fields() -> dict:
        ...
    def __init__(self, guide: mgdd._core.throttle.PseudoWienerModel, *, horizon_samples: typing.SupportsInt | typing.SupportsIndex, delay_samples: typing.SupportsInt | typing.SupportsIndex, numbers: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def reset(self) -> None:
        ...
    def set_sent(self, duty: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def step(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex) -> float:
        ...
    @property
    def duty(self) -> float:
        ...
    @property
    def state(self) -> dict[str, list[float]]:
        ...
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
class ObjectGuidedMgdd1:
    """
    The same guided by a Python object; use mgdd.control.Mgdd1.
    """
    def __init__(self, guide: typing.Any, *, n_states: typing.SupportsInt | typing.SupportsIndex, sample_s: typing.SupportsFloat | typing.SupportsIndex, horizon_samples: typing.SupportsInt | typing.SupportsIndex, delay_samples: typing.SupportsInt | typing.SupportsIndex, numbers: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def reset(self) -> None:
        ...
    def set_sent(self, duty: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def step(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex) -> float:
        ...
    @property
    def duty(self) -> float:
        ...
    @property
    def state(self) -> dict[str, list[float]]:
        ...
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
def loop_form(loops: typing.SupportsInt | typing.SupportsIndex) -> str:
    """
    Form that so many loops take; who cuts them into pieces passes it on.
    """
@typing.overload
def monte_carlo(benches: collections.abc.Sequence[VirtualEngine], seekers: list, seeds: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], answers: collections.abc.Sequence[collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] | None, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], str]]], *, cycles: typing.SupportsInt | typing.SupportsIndex, optimum_cad: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]], limits: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]], threads: typing.SupportsInt | typing.SupportsIndex, form: str = 'automatic') -> dict:
    """
    Whole loops on all cores; behind mgdd.loop.monte_carlo.
    """
@typing.overload
def monte_carlo(benches: collections.abc.Sequence[FunctionPlant], seekers: list, seeds: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], answers: collections.abc.Sequence[collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] | None, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], str]]], *, cycles: typing.SupportsInt | typing.SupportsIndex, optimum_cad: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]], limits: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]], threads: typing.SupportsInt | typing.SupportsIndex, form: str = 'automatic') -> dict:
    """
    Whole loops on all cores; behind mgdd.loop.monte_carlo.
    """
def plant_noise(seed: typing.SupportsInt | typing.SupportsIndex, cycle: typing.SupportsInt | typing.SupportsIndex) -> float:
    """
    Standard normal noise of a cycle.
    """
@typing.overload
def run_function(plant: FunctionPlant, seeker: mgdd._core.optimize.ExtremumSeeking, cycles: typing.SupportsInt | typing.SupportsIndex) -> int:
    """
    Run a seeker on a function without the GIL: how many cycles were run.
    """
@typing.overload
def run_function(plant: FunctionPlant, seeker: mgdd._core.optimize.Spsa, cycles: typing.SupportsInt | typing.SupportsIndex) -> int:
    """
    Run a seeker on a function without the GIL: how many cycles were run.
    """
@typing.overload
def run_function(plant: FunctionPlant, seeker: mgdd._core.optimize.GradientDescent, cycles: typing.SupportsInt | typing.SupportsIndex) -> int:
    """
    Run a seeker on a function without the GIL: how many cycles were run.
    """
@typing.overload
def run_function(plant: FunctionPlant, seeker: mgdd._core.optimize.GoldenSection, cycles: typing.SupportsInt | typing.SupportsIndex) -> int:
    """
    Run a seeker on a function without the GIL: how many cycles were run.
    """
@typing.overload
def run_function(plant: FunctionPlant, seeker: mgdd._core.optimize.GaussianProcessSeeking, cycles: typing.SupportsInt | typing.SupportsIndex) -> int:
    """
    Run a seeker on a function without the GIL: how many cycles were run.
    """
@typing.overload
def run_function(plant: FunctionPlant, seeker: mgdd._core.guide.CurveSeeking, cycles: typing.SupportsInt | typing.SupportsIndex) -> int:
    """
    Run a seeker on a function without the GIL: how many cycles were run.
    """
@typing.overload
def run_loop(bench: VirtualEngine, seeker: mgdd._core.optimize.ExtremumSeeking, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], limits: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: VirtualEngine, seeker: mgdd._core.optimize.Spsa, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], limits: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: VirtualEngine, seeker: mgdd._core.optimize.GradientDescent, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], limits: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: VirtualEngine, seeker: mgdd._core.optimize.GoldenSection, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], limits: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: VirtualEngine, seeker: mgdd._core.optimize.GaussianProcessSeeking, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], limits: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
@typing.overload
def run_loop(bench: VirtualEngine, seeker: mgdd._core.guide.CurveSeeking, cycles: typing.SupportsInt | typing.SupportsIndex, *, optimum_cad: typing.SupportsFloat | typing.SupportsIndex, arrival_cad: typing.SupportsFloat | typing.SupportsIndex, tail_cycles: typing.SupportsInt | typing.SupportsIndex, exceed_from: typing.SupportsInt | typing.SupportsIndex | None, exceed_above: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], limits: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> dict:
    """
    Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.
    """
def step_times_us(controller: typing.Any, reference_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], measured_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Time of every step of a copy of the controller [us].
    """
def track_throttle(controller: typing.Any, plant: VirtualThrottle, *, delay_samples: typing.SupportsInt | typing.SupportsIndex, reference_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], airflow_torque_nm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], supply_v: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], from_sample: typing.SupportsInt | typing.SupportsIndex, band_deg: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    Run a controller on a virtual throttle without the GIL; behind mgdd.loop.track.
    """
def track_throttles(plants: collections.abc.Sequence[VirtualThrottle], controllers: list, scenarios: collections.abc.Sequence[tuple[typing.Annotated[numpy.typing.ArrayLike, numpy.float64], typing.Annotated[numpy.typing.ArrayLike, numpy.float64], typing.Annotated[numpy.typing.ArrayLike, numpy.float64], typing.SupportsInt | typing.SupportsIndex]], *, delay_samples: typing.SupportsInt | typing.SupportsIndex, band_deg: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], threads: typing.SupportsInt | typing.SupportsIndex) -> tuple:
    """
    Whole loops on all cores; behind mgdd.loop.track_many.
    """
def tracking_figures(*, reference_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], sample_s: typing.SupportsFloat | typing.SupportsIndex, from_sample: typing.SupportsInt | typing.SupportsIndex, band_deg: typing.SupportsFloat | typing.SupportsIndex) -> dict:
    """
    How well a reference was followed.
    """
bench_inputs: tuple = ('soc_cad', 'intake_pressure_kpa', 'burn_duration_cad', 'second_fraction', 'egr')
bench_limits: tuple = ('t_evo_k', 'nox_true_ppm', 'nox_analyser_ppm', 'nox_fast_ppm', 'nox_soft_ppm', 'nox_soft_corrected_ppm')
throttle_fault_kinds: tuple = ('jammed', 'jammed_at', 'spring_above', 'spring_below', 'supply_sag', 'missing_sample', 'nan_sample', 'stale_sample')
