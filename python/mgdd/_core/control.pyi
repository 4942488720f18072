"""
Controllers of a throttle plate.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['GuidedPredictive', 'Pid', 'Plate', 'SinglePrecision', 'SlidingMode', 'ThrottleSupervisor']
class Plate:
    """
    What a controller knows of a throttle plate; ``Plate.fields()`` lists it.
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
    def __init__(self, *, gain_deg_per_s2: typing.SupportsFloat | typing.SupportsIndex = 83597.0, time_constant_s: typing.SupportsFloat | typing.SupportsIndex = 0.0197, electrical_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, limp_home_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, ramp_deg: typing.SupportsFloat | typing.SupportsIndex = 0.5, preload_above: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_above_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, preload_below: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_below_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, friction: typing.SupportsFloat | typing.SupportsIndex = 0.0927, closed_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0, open_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0) -> None:
        """
        gain_deg_per_s2 : acceleration per duty [degree/second²]
        time_constant_s : time constant of the speed [s]
        electrical_s : lag of the motor's torque [s]
        limp_home_deg : rest angle of the springs [deg]
        ramp_deg : half width over which the preload changes sides [deg]
        preload_above : duty against the preload above limp-home
        spring_above_per_deg : duty against the spring above limp-home [1/degree]
        preload_below : duty against the preload below limp-home
        spring_below_per_deg : duty against the spring below limp-home [1/degree]
        friction : duty against dry friction, at the start
        closed_deg : lower end of the travel [deg]
        open_deg : upper end of the travel [deg]
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> Plate:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def closed_deg(self) -> float:
        """
        lower end of the travel [deg]
        """
    @property
    def electrical_s(self) -> float:
        """
        lag of the motor's torque [s]
        """
    @property
    def friction(self) -> float:
        """
        duty against dry friction, at the start [-]
        """
    @property
    def gain_deg_per_s2(self) -> float:
        """
        acceleration per duty [degree/second²]
        """
    @property
    def limp_home_deg(self) -> float:
        """
        rest angle of the springs [deg]
        """
    @property
    def open_deg(self) -> float:
        """
        upper end of the travel [deg]
        """
    @property
    def preload_above(self) -> float:
        """
        duty against the preload above limp-home [-]
        """
    @property
    def preload_below(self) -> float:
        """
        duty against the preload below limp-home [-]
        """
    @property
    def ramp_deg(self) -> float:
        """
        half width over which the preload changes sides [deg]
        """
    @property
    def spring_above_per_deg(self) -> float:
        """
        duty against the spring above limp-home [1/degree]
        """
    @property
    def spring_below_per_deg(self) -> float:
        """
        duty against the spring below limp-home [1/degree]
        """
    @property
    def time_constant_s(self) -> float:
        """
        time constant of the speed [s]
        """
class Pid:
    """
    PID controller of a throttle plate, one sample at a time.
    
    Gains per side of limp-home, filtered derivative of the measurement, conditional integration, spring and friction
    feed-forward, a friction kick and a dead band. Keyword-only; the defaults fit the throttle ``P1``, tuned with its noise
    of 0.03 deg and a delay of one sample. ``Pid.fields()`` lists bounds and defaults.
    
    Parameters
    ----------
    sample_s : float
        Time between samples [s].
    proportional_above_per_deg, proportional_below_per_deg : float
        Duty per error above and below limp-home [1/deg]; all gains are blended over `ramp_deg` by the measured angle.
    integral_above_per_deg_s, integral_below_per_deg_s : float
        Integral gains [1/(deg s)].
    derivative_above_s_per_deg, derivative_below_s_per_deg : float
        Duty against the measured speed [s/deg].
    derivative_lag_s : float
        Lag of that speed [s].
    limp_home_deg, ramp_deg : float
        Rest angle of the springs, and half width over which preload and gains change sides [deg].
    preload_above, preload_below : float
        Duty against the preload, fed forward at the reference [-].
    spring_above_per_deg, spring_below_per_deg : float
        Duty against the springs [1/deg].
    kick, kick_width_deg : float
        Duty towards the reference against stiction [-], and the error at which it is full [deg].
    dead_band_deg : float
        Smaller errors count as zero [deg].
    integral_window_deg, integral_limit : float
        Only smaller errors are integrated [deg]; bound of the integral [-].
    rate_s_per_deg : float
        Duty fed forward per rate of the reference [s/deg].
    friction, friction_rate_deg_per_s : float
        Duty in the direction of that rate [-], and the rate at which it is full [deg/s].
    reference_lag_s, reference_jump_deg_per_s : float
        Lag of that rate [s]; a faster reference steps and has no rate [deg/s].
    lower, upper : float
        Bounds of the duty [-].
    
    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain, naming field, value and bound.
    
    See Also
    --------
    SlidingMode : the other classic baseline.
    mgdd.loop.VirtualThrottle : a plant to run it on.
    
    References
    ----------
    Åström and Hägglund (2006), Advanced PID Control.
    Armstrong-Helouvry et al. (1994), A survey of models, analysis tools and compensation methods for the control of
    machines with friction.
    
    Examples
    --------
    >>> from mgdd.control import Pid
    >>> from mgdd.loop import VirtualThrottle
    >>> plant, pid, measured_deg = VirtualThrottle(seed=1), Pid(), 8.0
    >>> for _ in range(300):
    ...     plant.apply({"duty": pid.step(40.0, measured_deg)})
    ...     values = plant.measure().values
    ...     measured_deg = values["sensed_angle_deg"]
    >>> abs(values["angle_deg"] - 40.0) < 0.3
    True
    """
    @staticmethod
    def _members() -> dict:
        """
        Member of the C++ settings by name.
        """
    @staticmethod
    def fields() -> dict:
        """
        Every setting by name: unit, bounds or choices, meaning, default.
        """
    def __getstate__(self) -> tuple[int, dict, dict[str, list[float]]]:
        ...
    def __init__(self, *, sample_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, proportional_above_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.12778, integral_above_per_deg_s: typing.SupportsFloat | typing.SupportsIndex = 1.3, derivative_above_s_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0014667, proportional_below_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.12778, integral_below_per_deg_s: typing.SupportsFloat | typing.SupportsIndex = 1.3, derivative_below_s_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0014667, derivative_lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.003, limp_home_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, ramp_deg: typing.SupportsFloat | typing.SupportsIndex = 0.5, preload_above: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_above_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, preload_below: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_below_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, kick: typing.SupportsFloat | typing.SupportsIndex = 0.1205, kick_width_deg: typing.SupportsFloat | typing.SupportsIndex = 0.019, dead_band_deg: typing.SupportsFloat | typing.SupportsIndex = 0.1, integral_window_deg: typing.SupportsFloat | typing.SupportsIndex = 2.0, integral_limit: typing.SupportsFloat | typing.SupportsIndex = 0.3, rate_s_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000346, friction: typing.SupportsFloat | typing.SupportsIndex = 0.0603, friction_rate_deg_per_s: typing.SupportsFloat | typing.SupportsIndex = 17.2, reference_lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.0045, reference_jump_deg_per_s: typing.SupportsFloat | typing.SupportsIndex = 400.0, lower: typing.SupportsFloat | typing.SupportsIndex = -1.0, upper: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> None:
        """
        sample_s : time between samples [s]
        proportional_above_per_deg : duty per error above limp-home [1/degree]
        integral_above_per_deg_s : integral gain above limp-home [1/(degree*second)]
        derivative_above_s_per_deg : duty against speed above limp-home [second/degree]
        proportional_below_per_deg : duty per error below limp-home [1/degree]
        integral_below_per_deg_s : integral gain below limp-home [1/(degree*second)]
        derivative_below_s_per_deg : duty against speed below limp-home [second/degree]
        derivative_lag_s : lag of the measured speed [s]
        limp_home_deg : rest angle of the springs [deg]
        ramp_deg : half width over which preload and gains change sides [deg]
        preload_above : duty against the preload above limp-home
        spring_above_per_deg : duty against the spring above limp-home [1/degree]
        preload_below : duty against the preload below limp-home
        spring_below_per_deg : duty against the spring below limp-home [1/degree]
        kick : duty towards the reference against stiction
        kick_width_deg : error at which the kick is full [deg]
        dead_band_deg : smaller errors count as zero [deg]
        integral_window_deg : only smaller errors are integrated [deg]
        integral_limit : bound of the integral
        rate_s_per_deg : duty per rate of the reference [second/degree]
        friction : duty in the direction of that rate against dry friction
        friction_rate_deg_per_s : rate at which it is full [degree/second]
        reference_lag_s : lag of the rate of the reference [s]
        reference_jump_deg_per_s : a faster reference steps and has no rate [degree/second]
        lower : least duty
        upper : largest duty
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def reset(self) -> None:
        """
        As made: no integral, no rates.
        """
    def step(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Duty [-] of this sample for a reference and a measured angle [deg].
        
        NaN repeats the last value; before the first ones the duty is 0.
        """
    def take_over(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex, duty: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        Start at rest from a duty without a bump, as far as the limit of the integral allows.
        
        Ignored if a number is not finite.
        """
    @property
    def duty(self) -> float:
        """
        Duty of the last sample [-].
        """
    @property
    def integral(self) -> float:
        """
        Share of the integral in the duty [-].
        """
    @property
    def settings(self) -> dict:
        """
        All settings as a new dict: keywords that make the controller again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a run needs to go on bit for bit; a state that the settings do not allow is refused and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
class SlidingMode:
    """
    Sliding-mode controller of a throttle plate, one sample at a time.
    
    With the angle y, the filtered reference r and e = y - r, the surface is ``s = de/dt + bandwidth_per_s (e +
    integral_per_s * integral of e)``. A model of the plate gives the duty that stays on it, `reaching` the duty that gets
    there. Keyword-only; the defaults fit the throttle ``P1``. ``SlidingMode.fields()`` lists bounds and defaults.
    
    Parameters
    ----------
    sample_s : float
        Time between samples [s].
    gain_deg_per_s2, time_constant_s : float
        Acceleration per duty [deg/s²] and time constant of the speed [s]; G and tau of `mgdd.throttle.PseudoWiener`.
    limp_home_deg, ramp_deg : float
        Rest angle of the springs, and half width over which the preload changes sides [deg].
    preload_above, preload_below : float
        Duty against the preload, at the measured angle [-].
    spring_above_per_deg, spring_below_per_deg : float
        Duty against the springs [1/deg].
    friction, friction_rate_deg_per_s : float
        Duty in the direction of the reference's rate [-], and the rate at which it is full [deg/s].
    bandwidth_per_s : float
        Decay of the error on the surface [1/s].
    integral_per_s, integral_layers : float
        Weight of the integral [1/s]; it grows only while ``|s|`` is below so many layers [-].
    reference_pole_per_s : float
        Double pole of the filter of the reference [1/s].
    derivative_lag_s : float
        Lag of the measured speed [s].
    switching, layer_deg : float
        Duty of the reaching law [-], and the error at which it is full [deg].
    root_per_root_deg_per_s, twist_per_s : float
        Super-twisting: duty per root of ``|s|`` [sqrt(s/deg)], and rate of its integral [1/s].
    lower, upper : float
        Bounds of the duty [-].
    reaching : {"implicit", "boundary_layer", "super_twisting"}
        ``boundary_layer``: ``-switching sat(s/layer)``. ``implicit``: its backward Euler step, which cannot chatter on
        the model however thin the layer. ``super_twisting``: ``-root sqrt|s| sgn s`` and an integral of ``-twist sgn s``.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain, naming field, value and bound.
    
    See Also
    --------
    Pid : the other classic baseline.
    
    References
    ----------
    Slotine and Li (1991), Applied Nonlinear Control, chapter 7.
    Acary and Brogliato (2010), Implicit Euler numerical scheme and chattering-free implementation of sliding mode systems.
    Levant (1993), Sliding order and sliding accuracy in sliding mode control.
    
    Examples
    --------
    >>> from mgdd.control import SlidingMode
    >>> from mgdd.loop import VirtualThrottle
    >>> plant, controller, measured_deg = VirtualThrottle(seed=1), SlidingMode(), 8.0
    >>> for _ in range(300):
    ...     plant.apply({"duty": controller.step(40.0, measured_deg)})
    ...     values = plant.measure().values
    ...     measured_deg = values["sensed_angle_deg"]
    >>> abs(values["angle_deg"] - 40.0) < 0.3
    True
    """
    @staticmethod
    def _members() -> dict:
        """
        Member of the C++ settings by name.
        """
    @staticmethod
    def fields() -> dict:
        """
        Every setting by name: unit, bounds or choices, meaning, default.
        """
    def __getstate__(self) -> tuple[int, dict, dict[str, list[float]]]:
        ...
    def __init__(self, *, sample_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, gain_deg_per_s2: typing.SupportsFloat | typing.SupportsIndex = 83597.0, time_constant_s: typing.SupportsFloat | typing.SupportsIndex = 0.0197, limp_home_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, ramp_deg: typing.SupportsFloat | typing.SupportsIndex = 0.5, preload_above: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_above_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, preload_below: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_below_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, friction: typing.SupportsFloat | typing.SupportsIndex = 0.076, friction_rate_deg_per_s: typing.SupportsFloat | typing.SupportsIndex = 17.2, bandwidth_per_s: typing.SupportsFloat | typing.SupportsIndex = 136.0, integral_per_s: typing.SupportsFloat | typing.SupportsIndex = 3.03, integral_layers: typing.SupportsFloat | typing.SupportsIndex = 3.0, reference_pole_per_s: typing.SupportsFloat | typing.SupportsIndex = 170.0, derivative_lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.003, switching: typing.SupportsFloat | typing.SupportsIndex = 0.793, layer_deg: typing.SupportsFloat | typing.SupportsIndex = 3.46, root_per_root_deg_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.015, twist_per_s: typing.SupportsFloat | typing.SupportsIndex = 2.0, lower: typing.SupportsFloat | typing.SupportsIndex = -1.0, upper: typing.SupportsFloat | typing.SupportsIndex = 1.0, reaching: str = 'implicit') -> None:
        """
        sample_s : time between samples [s]
        gain_deg_per_s2 : acceleration per duty [degree/second²]
        time_constant_s : time constant of the speed [s]
        limp_home_deg : rest angle of the springs [deg]
        ramp_deg : half width over which the preload changes sides [deg]
        preload_above : duty against the preload above limp-home
        spring_above_per_deg : duty against the spring above limp-home [1/degree]
        preload_below : duty against the preload below limp-home
        spring_below_per_deg : duty against the spring below limp-home [1/degree]
        friction : duty in the direction of the reference's rate
        friction_rate_deg_per_s : rate at which it is full [degree/second]
        bandwidth_per_s : decay of the error on the surface [1/second]
        integral_per_s : weight of the integral in the surface [1/second]
        integral_layers : integrates only while |s| is below so many layers
        reference_pole_per_s : double pole of the reference's filter [1/second]
        derivative_lag_s : lag of the measured speed [s]
        switching : duty of the reaching law
        layer_deg : error at which that duty is full [deg]
        root_per_root_deg_per_s : super-twisting: duty per root of |s| [(second/degree)**0.5]
        twist_per_s : super-twisting: rate of its integral [1/second]
        lower : least duty
        upper : largest duty
        reaching : law that drives the plate to the surface
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def reset(self) -> None:
        """
        As made: no integral, no rates.
        """
    def step(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Duty [-] of this sample for a reference and a measured angle [deg].
        
        NaN repeats the last value; before the first ones the duty is 0.
        """
    @property
    def duty(self) -> float:
        """
        Duty of the last sample [-].
        """
    @property
    def settings(self) -> dict:
        """
        All settings as a new dict: keywords that make the controller again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a run needs to go on bit for bit; a state that the settings do not allow is refused and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def surface_deg_per_s(self) -> float:
        """
        s of the last sample [deg/s].
        """
class GuidedPredictive:
    """
    Model-guided predictive controller of a throttle plate, one sample at a time.
    
    A rough model predicts a short horizon; one Gauss-Newton step per sample moves the last duties along its exact slopes;
    what is measured corrects the model while it runs. The default learns dry friction as two levels per side of limp-home,
    gain and damping, goes back to the last belief that proved itself where the learnt one predicts worse, asks the model for the duty at which the plate breaks away, and holds still inside the friction band.
    ``friction_learning=False`` is the plain form, ``prediction="linear"`` the usual linear MPC, more `gauss_newton_steps`
    the converged nonlinear one. Keyword-only; the defaults fit the throttle ``P1``. `mgdd.loop.tuned_controller` makes one
    for another throttle; ``GuidedPredictive.fields()`` lists bounds and defaults.
    
    Parameters
    ----------
    sample_s : float
        Time between samples [s].
    gain_deg_per_s2, time_constant_s : float
        Acceleration per duty [deg/s²] and time constant of the speed [s].
    electrical_s : float
        Lag of the motor's torque, L/R [s]; 0 for none.
    limp_home_deg, ramp_deg : float
        Rest angle of the springs, and half width over which the preload changes sides [deg].
    preload_above, preload_below : float
        Duty against the preload [-].
    spring_above_per_deg, spring_below_per_deg : float
        Duty against the springs [1/deg].
    friction : float
        Duty against dry friction [-], from which learning starts.
    closed_deg, open_deg : float
        Ends of the travel [deg].
    prediction_step_s : float
        Step of the horizon [s].
    error_weight, speed_weight, duty_change_weight : float
        Of the squared error [1/deg²] and speed [s²/deg²] at each step, and of the squared change of each move [-].
    lower, upper, duty_rate_per_s : float
        Bounds of the duty [-] and of its change [1/s], both hard.
    lowest_deg, highest_deg, angle_limit_weight : float
        Bounds of the predicted angle [deg], and the price of a squared degree beyond them [1/deg²].
    observer_angle_per_s, observer_speed_per_s2 : float
        Sum [1/s] and product [1/s²] of the rates at which errors of the model's angle and speed die, the same at every
        sample time.
    noise_deg : float
        Standard deviation of the measured angle [deg]: what counts as motion.
    learning_rate_per_s, gain_weight, damping_weight : float
        Learning: share of what explains an innovation, per time [1/s] of a sample up to 1 ms, and the first variances of the factors of gain and
        damping over that of a friction level [-].
    level_memory_s, memory_s : float
        Time of sliding after which a friction level, and gain and damping, are as uncertain as at first [s].
    least_gain_factor, largest_gain_factor : float
        Bounds of the learnt gain over the given one [-].
    rollback_ratio, rollback_s, certify_s : float
        A belief whose squared innovations are larger than those of the certified one by this ratio [-] over the first time
        of sliding [s] is given up for it; one whose are smaller by it over the second time [s] is certified.
    bias_rate_per_deg_s, trim_rate_per_deg_s : float
        Without learning: rates of the one bias and of the trim, which the model does not see [1/(deg s)].
    reference_lag_s, reference_jump_deg_per_s : float
        Lag of the reference's rate [s]; a faster reference steps and has no rate [deg/s].
    prediction : {"nonlinear", "linear"}
        ``linear``: the spring of the measured side without end, friction only fed forward.
    switching : {"predicted", "measured"}
        How the prediction knows its side of limp-home.
    delay_samples : int
        From a duty to its effect, beside the electrical lag: 0 to 20.
    delay_search_samples : int
        With learning: longer delays, by 1 to so many samples, that are tried against the readings beside the given one; 0
        for none, 6 at most.
    move_steps : sequence of three int
        Prediction steps for which each duty of the horizon is held; together at most 64.
    gauss_newton_steps : int
        At most so many per sample; it ends when the duties stand still.
    friction_learning : bool
        Learn friction levels and gain, and use breakaway and hold rules.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain, naming field, value and bound.
    
    See Also
    --------
    Mgdd1 : the plainest form, guided by the outputs of any model.
    mgdd.loop.tuned_controller : controllers for a throttle, all tuned alike.
    
    References
    ----------
    Tan (2018), Model-Guided Data-Driven Optimization and Control for Internal Combustion Engine Systems, section 7.3.
    Diehl, Bock and Schlöder (2005), A real-time iteration scheme for nonlinear optimization in optimal feedback control.
    
    Examples
    --------
    >>> from mgdd.control import GuidedPredictive
    >>> from mgdd.loop import VirtualThrottle
    >>> plant, controller, measured_deg = VirtualThrottle(seed=1), GuidedPredictive(), 8.0
    >>> for _ in range(120):
    ...     plant.apply({"duty": controller.step(40.0, measured_deg)})
    ...     values = plant.measure().values
    ...     measured_deg = values["sensed_angle_deg"]
    >>> abs(values["angle_deg"] - 40.0) < 0.2
    True
    >>> sorted(controller.learnt)
    ['bias_above', 'bias_below', 'damping_factor', 'friction_above', 'friction_below', 'gain_factor']
    """
    @staticmethod
    def _members() -> dict:
        """
        Member of the C++ settings by name.
        """
    @staticmethod
    def fields() -> dict:
        """
        Every setting by name: unit, bounds or choices, meaning, default.
        """
    def __getstate__(self) -> tuple[int, dict, dict[str, list[float]]]:
        ...
    def __init__(self, *, sample_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, gain_deg_per_s2: typing.SupportsFloat | typing.SupportsIndex = 83597.0, time_constant_s: typing.SupportsFloat | typing.SupportsIndex = 0.0197, electrical_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, limp_home_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, ramp_deg: typing.SupportsFloat | typing.SupportsIndex = 0.5, preload_above: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_above_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, preload_below: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_below_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, friction: typing.SupportsFloat | typing.SupportsIndex = 0.0927, closed_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0, open_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, prediction_step_s: typing.SupportsFloat | typing.SupportsIndex = 0.002, error_weight: typing.SupportsFloat | typing.SupportsIndex = 1.0, speed_weight: typing.SupportsFloat | typing.SupportsIndex = 0.0, duty_change_weight: typing.SupportsFloat | typing.SupportsIndex = 4.0, lower: typing.SupportsFloat | typing.SupportsIndex = -1.0, upper: typing.SupportsFloat | typing.SupportsIndex = 1.0, duty_rate_per_s: typing.SupportsFloat | typing.SupportsIndex = 10000.0, lowest_deg: typing.SupportsFloat | typing.SupportsIndex = -1000.0, highest_deg: typing.SupportsFloat | typing.SupportsIndex = 1000.0, angle_limit_weight: typing.SupportsFloat | typing.SupportsIndex = 20.0, observer_angle_per_s: typing.SupportsFloat | typing.SupportsIndex = 430.0, observer_speed_per_s2: typing.SupportsFloat | typing.SupportsIndex = 34549.0, noise_deg: typing.SupportsFloat | typing.SupportsIndex = 0.03, learning_rate_per_s: typing.SupportsFloat | typing.SupportsIndex = 150.0, gain_weight: typing.SupportsFloat | typing.SupportsIndex = 36.0, damping_weight: typing.SupportsFloat | typing.SupportsIndex = 36.0, level_memory_s: typing.SupportsFloat | typing.SupportsIndex = 0.01, memory_s: typing.SupportsFloat | typing.SupportsIndex = 0.5, least_gain_factor: typing.SupportsFloat | typing.SupportsIndex = 0.625, largest_gain_factor: typing.SupportsFloat | typing.SupportsIndex = 1.6, rollback_ratio: typing.SupportsFloat | typing.SupportsIndex = 1.5, rollback_s: typing.SupportsFloat | typing.SupportsIndex = 0.05, certify_s: typing.SupportsFloat | typing.SupportsIndex = 1.0, bias_rate_per_deg_s: typing.SupportsFloat | typing.SupportsIndex = 4.0, trim_rate_per_deg_s: typing.SupportsFloat | typing.SupportsIndex = 0.3, reference_lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.0045, reference_jump_deg_per_s: typing.SupportsFloat | typing.SupportsIndex = 400.0, prediction: str = 'nonlinear', switching: str = 'predicted', delay_samples: typing.SupportsInt | typing.SupportsIndex = 1, delay_search_samples: typing.SupportsInt | typing.SupportsIndex = 6, move_steps: typing.Annotated[collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], "FixedSize(3)"] = [3, 5, 12], gauss_newton_steps: typing.SupportsInt | typing.SupportsIndex = 1, friction_learning: bool = True) -> None:
        """
        sample_s : time between samples [s]
        gain_deg_per_s2 : acceleration per duty [degree/second²]
        time_constant_s : time constant of the speed [s]
        electrical_s : lag of the motor's torque [s]
        limp_home_deg : rest angle of the springs [deg]
        ramp_deg : half width over which the preload changes sides [deg]
        preload_above : duty against the preload above limp-home
        spring_above_per_deg : duty against the spring above limp-home [1/degree]
        preload_below : duty against the preload below limp-home
        spring_below_per_deg : duty against the spring below limp-home [1/degree]
        friction : duty against dry friction, at the start
        closed_deg : lower end of the travel [deg]
        open_deg : upper end of the travel [deg]
        prediction_step_s : step of the horizon [s]
        error_weight : of the squared error at each step [1/degree²]
        speed_weight : of the squared speed at each step [second²/degree²]
        duty_change_weight : of the squared change of each move
        lower : least duty
        upper : largest duty
        duty_rate_per_s : largest change of the duty [1/second]
        lowest_deg : least angle of the prediction [deg]
        highest_deg : largest angle of the prediction [deg]
        angle_limit_weight : of the squared angle beyond these [1/degree²]
        observer_angle_per_s : sum of the rates at which the errors of angle and speed die [1/second]
        observer_speed_per_s2 : and their product [1/second²]
        noise_deg : standard deviation of the measured angle [deg]
        learning_rate_per_s : share of what explains an innovation that is learnt [1/second]
        gain_weight : first variance of the gain factor over that of a friction level
        damping_weight : of the damping factor
        level_memory_s : sliding after which a level is as uncertain as at first [s]
        memory_s : the same for gain and damping [s]
        least_gain_factor : least learnt gain over the given one
        largest_gain_factor : largest learnt gain over the given one
        rollback_ratio : of squared innovations, from which a belief predicts worse
        rollback_s : sliding over which a worse belief is given up [s]
        certify_s : sliding over which a better belief is certified [s]
        bias_rate_per_deg_s : without learning: rate of the one bias [1/(degree*second)]
        trim_rate_per_deg_s : without learning: rate of the trim [1/(degree*second)]
        reference_lag_s : lag of the rate of the reference [s]
        reference_jump_deg_per_s : a faster reference steps and has no rate [degree/second]
        prediction : what the horizon is predicted with
        switching : how it knows its side of limp-home
        delay_samples : from a duty to its effect
        delay_search_samples : by which the delay may be longer than stated
        move_steps : prediction steps for which each duty is held
        gauss_newton_steps : at most, per sample
        friction_learning : learn friction levels and gain
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def prepare(self) -> None:
        """
        The part of the next sample that needs no measurement; `step` then does the rest.
        """
    def refine(self) -> float:
        """
        One more Gauss-Newton step on the last sample, and its duty [-]; feasible after every one.
        """
    def reset(self) -> None:
        """
        As made, with what was learnt forgotten.
        """
    def set_sent(self, duty: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        The duty that was really sent for the last one [-], where a gate or a limiter changed it.
        
        Ignored if it is not finite; what is clamped without its knowledge looks like a delay to the controller.
        """
    @typing.overload
    def step(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Duty [-] of this sample for a reference and a measured angle [deg].
        
        NaN repeats the last value; before the first ones the duty is 0.
        """
    @typing.overload
    def step(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex, preview_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> float:
        """
        The same with the references of the next samples [deg]; a short preview goes on at its last value.
        """
    def take_over(self, measurement_deg: typing.SupportsFloat | typing.SupportsIndex, duty: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        Start at rest from a duty, what was learnt kept.
        
        Ignored if a number is not finite.
        """
    @property
    def certified(self) -> dict[str, float]:
        """
        The last belief that predicted well for `certify_s`, like `learnt`: a worse one is rolled back to it.
        """
    @property
    def delay_found_samples(self) -> int:
        """
        Samples from a duty to its effect by which the plate is predicted now: `delay_samples` until the readings speak for more.
        """
    @property
    def duty(self) -> float:
        """
        Duty of the last sample [-].
        """
    @property
    def holds(self) -> bool:
        """
        Whether the plate is held where it is stuck.
        """
    @property
    def innovation_deg(self) -> float:
        """
        Measured less predicted angle of the last sample [deg].
        """
    @property
    def learnt(self) -> dict[str, float]:
        """
        Friction levels [-], factors of gain and damping [-] as learnt; setting some or all of them starts from them.
        """
    @learnt.setter
    def learnt(self, arg1: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex]) -> None:
        ...
    @property
    def rollbacks(self) -> int:
        """
        How often a learnt belief was given up for the certified one.
        """
    @property
    def settings(self) -> dict:
        """
        All settings as a new dict: keywords that make the controller again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a run needs to go on bit for bit; a state that the settings do not allow is refused and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
class ThrottleSupervisor:
    """
    Supervisor of a throttle controller: bad input, faults, and the safe state.
    
    Sees every sample before and after the controller. It bridges short gaps (mode ``holding``), limits the reference
    (``limited``), and opens the bridge so that the springs bring the plate to limp-home (``limp_home``), within 50 ms of what
    it can see. The last two stay until `acknowledge` finds the cause gone. Keyword-only; the defaults fit the throttle
    ``P1``. ``ThrottleSupervisor.fields()`` lists bounds and defaults. Not a certified safety function.
    
    Parameters
    ----------
    sample_s : float
        Time between samples [s].
    closed_deg, open_deg : float
        Travel; the reference is limited to it [deg].
    limited_open_deg : float
        Largest reference while the supply is low [deg].
    late_s, silence_s : float
        Age beyond which an angle is not used, and time without a usable reference, angle or duty that opens [s].
    range_margin_deg, disagreement_deg, sensor_s : float
        What a sensor may say beyond the travel, by what both may differ [deg], and the time of either that opens [s].
    nominal_supply_v, supply_low_v, supply_lost_v, supply_s : float
        Supply to which duties belong, below which the reference is limited, below which the bridge opens [V], and for how
        long [s].
    limp_home_deg, ramp_deg, preload_above, spring_above_per_deg, preload_below, spring_below_per_deg : float
        The springs in duty, as in `Pid`.
    friction : float
        Duty against dry friction at breakaway [-].
    gain_deg_per_s2, time_constant_s : float
        Acceleration per duty [deg/s²] and time constant of the speed [s], as in `SlidingMode`.
    uncertainty, load : float
        Share by which springs and friction may differ from these, and duty that the air may add [-].
    jam_error_deg, jam_move_deg, jam_s : float
        Error that demands a move, and the move [deg] that a pushed plate must make within that time [s].
    balance_lag_s, spring_band_deg, spring_evidence_s : float
        Two lags of the balance [s], distance from limp-home without a check of the springs [deg], and the duty beyond what a
        whole spring allows, summed over time, that opens [s].
    tracking_error_deg, tracking_s : float
        Error [deg] that must not last [s].
    overload_duty, overload_s : float
        Duty [-] that must not last away from the stops [s].
    oscillation_deg, oscillation_s : float
        Error [deg] whose side must not change six times in a row, each within that time [s], while the reference stands.
    limp_home_band_deg, return_s : float
        The plate is at limp-home so near to it [deg], and must be after that time with the bridge open [s].
    healthy_s : float
        Time without any reason before an acknowledgement counts [s].
    
    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain, naming field, value and bound.
    
    See Also
    --------
    SupervisedController : a controller and its supervisor as one object.
    mgdd.loop.ThrottleFault : faults to try it on.
    
    Notes
    -----
    Reasons: ``missing_reference``, ``reference_range``, ``missing_sample``, ``stale_sample``, ``sensor_range``,
    ``sensor_disagreement``, ``invalid_duty``, ``supply_low``, ``supply_lost``, ``jammed``, ``spring_lost``, ``tracking``,
    ``overload`` and ``oscillation``; ``none`` while nothing was wrong since the last acknowledgement.
    
    References
    ----------
    Bosch Motorsport, manual of the MS 6 engine control (sum and range of the sensors).
    Ohnishi et al. (1996), Motion control for advanced mechatronics (disturbance observer).
    Page (1954), Continuous inspection schemes.
    
    Examples
    --------
    >>> from mgdd.control import ThrottleSupervisor
    >>> supervisor = ThrottleSupervisor()
    >>> supervisor.observe(95.0, (60.0, 60.1), supply_v=12.0)
    (90.0, 60.0)
    >>> supervisor.decide(0.3), supervisor.mode, supervisor.reason
    ((0.3, False), 'limited', 'reference_range')
    """
    @staticmethod
    def _members() -> dict:
        """
        Member of the C++ settings by name.
        """
    @staticmethod
    def fields() -> dict:
        """
        Every setting by name: unit, bounds or choices, meaning, default.
        """
    def __getstate__(self) -> tuple[int, dict, dict[str, list[float]]]:
        ...
    def __init__(self, *, sample_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, closed_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0, open_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, limited_open_deg: typing.SupportsFloat | typing.SupportsIndex = 40.0, late_s: typing.SupportsFloat | typing.SupportsIndex = 0.003, silence_s: typing.SupportsFloat | typing.SupportsIndex = 0.02, range_margin_deg: typing.SupportsFloat | typing.SupportsIndex = 6.75, disagreement_deg: typing.SupportsFloat | typing.SupportsIndex = 4.5, sensor_s: typing.SupportsFloat | typing.SupportsIndex = 0.02, nominal_supply_v: typing.SupportsFloat | typing.SupportsIndex = 12.0, supply_low_v: typing.SupportsFloat | typing.SupportsIndex = 9.0, supply_lost_v: typing.SupportsFloat | typing.SupportsIndex = 6.0, supply_s: typing.SupportsFloat | typing.SupportsIndex = 0.02, limp_home_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, ramp_deg: typing.SupportsFloat | typing.SupportsIndex = 0.5, preload_above: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_above_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, preload_below: typing.SupportsFloat | typing.SupportsIndex = 0.1292, spring_below_per_deg: typing.SupportsFloat | typing.SupportsIndex = 0.000496, friction: typing.SupportsFloat | typing.SupportsIndex = 0.098, gain_deg_per_s2: typing.SupportsFloat | typing.SupportsIndex = 83597.0, time_constant_s: typing.SupportsFloat | typing.SupportsIndex = 0.0197, uncertainty: typing.SupportsFloat | typing.SupportsIndex = 0.3, load: typing.SupportsFloat | typing.SupportsIndex = 0.04, jam_error_deg: typing.SupportsFloat | typing.SupportsIndex = 2.0, jam_move_deg: typing.SupportsFloat | typing.SupportsIndex = 0.5, jam_s: typing.SupportsFloat | typing.SupportsIndex = 0.04, balance_lag_s: typing.SupportsFloat | typing.SupportsIndex = 0.006, spring_band_deg: typing.SupportsFloat | typing.SupportsIndex = 3.0, spring_evidence_s: typing.SupportsFloat | typing.SupportsIndex = 0.0004, tracking_error_deg: typing.SupportsFloat | typing.SupportsIndex = 8.0, tracking_s: typing.SupportsFloat | typing.SupportsIndex = 0.5, overload_duty: typing.SupportsFloat | typing.SupportsIndex = 0.9, overload_s: typing.SupportsFloat | typing.SupportsIndex = 1.0, oscillation_deg: typing.SupportsFloat | typing.SupportsIndex = 1.0, oscillation_s: typing.SupportsFloat | typing.SupportsIndex = 0.15, limp_home_band_deg: typing.SupportsFloat | typing.SupportsIndex = 1.0, return_s: typing.SupportsFloat | typing.SupportsIndex = 0.4, healthy_s: typing.SupportsFloat | typing.SupportsIndex = 0.05) -> None:
        """
        sample_s : time between samples [s]
        closed_deg : lower end of the travel [deg]
        open_deg : upper end of the travel [deg]
        limited_open_deg : largest reference while the supply is low [deg]
        late_s : age beyond which an angle is not used [s]
        silence_s : time without a usable reference, angle or duty: open [s]
        range_margin_deg : a sensor may say so much more than the travel [deg]
        disagreement_deg : the sensors may differ by so much [deg]
        sensor_s : time that a sensor must be wrong: open [s]
        nominal_supply_v : supply to which duties belong [V]
        supply_low_v : a lower supply limits the reference [V]
        supply_lost_v : a lower supply opens the bridge [V]
        supply_s : time that the supply must be low [s]
        limp_home_deg : rest angle of the springs [deg]
        ramp_deg : half width over which the preload changes sides [deg]
        preload_above : duty against the preload above limp-home
        spring_above_per_deg : duty against the spring above limp-home [1/degree]
        preload_below : duty against the preload below limp-home
        spring_below_per_deg : duty against the spring below limp-home [1/degree]
        friction : duty against dry friction at breakaway
        gain_deg_per_s2 : acceleration per duty [degree/second²]
        time_constant_s : time constant of the speed [s]
        uncertainty : share by which springs and friction may differ
        load : duty that the air may add
        jam_error_deg : a smaller error does not ask for a move [deg]
        jam_move_deg : a plate that moves farther is not jammed [deg]
        jam_s : time without that move: open [s]
        balance_lag_s : each of two lags of the balance [s]
        spring_band_deg : no check of the springs nearer to limp-home [deg]
        spring_evidence_s : sum of the duty beyond what a whole spring allows: open [s]
        tracking_error_deg : error that must not last [deg]
        tracking_s : time that it lasts: open [s]
        overload_duty : duty that must not last away from the stops
        overload_s : time that it lasts: open [s]
        oscillation_deg : error whose side must not change again and again [deg]
        oscillation_s : longest time between these changes: open [s]
        limp_home_band_deg : the plate is at limp-home so near to it [deg]
        return_s : time in which the springs must bring it there [s]
        healthy_s : time without any reason before an acknowledgement counts [s]
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def acknowledge(self) -> str:
        """
        Back to normal where the cause is gone: nothing wrong for `healthy_s`, and an open bridge has brought the plate to limp-home.
        
        Returns the reason that stands, ``'none'`` where it was accepted.
        """
    def decide(self, duty: typing.SupportsFloat | typing.SupportsIndex) -> tuple[float, bool]:
        """
        Second half of a sample: duty [-] for the bridge and whether it is open, for the duty that the controller asks for.
        """
    def observe(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, angles_deg: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(2)"], *, age_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, supply_v: typing.SupportsFloat | typing.SupportsIndex | None = None, sensor_fault: bool = False) -> tuple[float, float]:
        """
        First half of a sample, before the controller.
        
        Parameters
        ----------
        reference_deg : float
            What is asked for [deg]; NaN where nothing arrived.
        angles_deg : pair of float
            What each sensor alone says [deg]; NaN where nothing arrived.
        age_s : float
            Age of these angles [s].
        supply_v : float, optional
            Supply of the bridge [V]; unknown if left out.
        sensor_fault : bool
            From a check of the sensors elsewhere.
        
        Returns
        -------
        tuple of float
            Reference and angle that the controller shall use [deg].
        """
    def reset(self) -> None:
        """
        As made.
        """
    @property
    def bridge_open(self) -> bool:
        """
        Whether the bridge is open.
        """
    @property
    def duty(self) -> float:
        """
        Duty of the last sample [-].
        """
    @property
    def imbalance(self) -> float:
        """
        Duty that springs, inertia and back-EMF do not explain [-].
        """
    @property
    def mode(self) -> str:
        """
        Mode of the last sample: ``normal``, ``holding``, ``limited`` or ``limp_home``.
        """
    @property
    def reason(self) -> str:
        """
        Reason of the mode, or the last one since it was acknowledged.
        """
    @property
    def return_test(self) -> str:
        """
        Whether the open bridge has brought the plate to limp-home: ``none`` (not open), ``pending``, ``passed`` or ``failed``.
        """
    @property
    def settings(self) -> dict:
        """
        All settings as a new dict: keywords that make the controller again.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a run needs to go on bit for bit; a state that the settings do not allow is refused and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
class SinglePrecision:
    """
    A new controller of the same settings on float.
    """
    @typing.overload
    def __init__(self, controller: GuidedPredictive) -> None:
        ...
    @typing.overload
    def __init__(self, controller: Pid) -> None:
        ...
    @typing.overload
    def __init__(self, controller: SlidingMode) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def step(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex, measurement_deg: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Duty [-] of this sample; the angles [deg] are rounded.
        """
