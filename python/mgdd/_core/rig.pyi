"""
Between a controller and a real actuator.
"""
from __future__ import annotations
import collections.abc
import typing
__all__: list[str] = ['Drive', 'SafetyEnvelope', 'SafetyGate', 'bus_states', 'safety_reasons', 'safety_requests', 'safety_states']
class SafetyEnvelope:
    """
    What a safety gate lets pass, and what must be true of the measurements meanwhile.
    
    Keyword-only and immutable; the defaults are the shipped envelope ``etb``. ``SafetyEnvelope.fields()`` lists bounds, units
    and defaults.
    
    Parameters
    ----------
    cycle_s : float
        Time between two cycles of the gate [s].
    duty_limit, slew_per_s, ramp_s : float
        Largest duty [-], its largest change [1/s], and the time in which it grows in after the start [s].
    invalid_duties : float
        Duties in a row that are not finite and lead to ``fault`` [cycles]; the last good one is held before.
    rms_duty_limit, rms_duty_to_arm, heat_time_constant_s : float
        Largest RMS duty of the heat model [-], what it must cool to before the next start [-], and its time constant [s].
    stall_duty, stall_move_deg, stall_s : float
        Duty that must move the plate [-], by how much [deg], and within which time [s].
    largest_age_cycles, held_cycles : float
        Age beyond which a measurement is not used, and for how long the last duty bridges it [cycles].
    bad_frames, good_frames : float
        Bad frames in a row that lead to ``limp``; good ones, with nothing wrong meanwhile, before arming and a reset [-].
    missed_deadlines, unsent_cycles : float
        Deadlines missed in a row [-], and commands in a row that did not leave [cycles], that lead to ``limp``.
    sensor_sum_v, sensor_sum_tolerance_v, sensor_low_v, sensor_high_v : float
        Sum of both sensors, by which it may be off, and the range of each [V].
    sensor_slope_v_per_s : float
        Fastest change of a healthy sensor [V/s].
    sensor_cycles : float
        Measurements in a row that fail a check of the sensors or of the travel and lead to ``fault`` [cycles].
    closed_deg, open_deg, travel_margin_deg : float
        Travel, and by which an angle may leave it [deg].
    bus_fault_from : {"warning", "passive", "off"}
        State of the CAN controller from which on it is ``limp``.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, naming field, value and bound.
    
    See Also
    --------
    SafetyGate : what keeps it.
    
    References
    ----------
    Bosch Motorsport, manual of the MS 6 engine control (sum and range of the sensors).
    
    Examples
    --------
    >>> from mgdd.rig import SafetyEnvelope
    >>> SafetyEnvelope(duty_limit=0.5).slew_per_s
    200.0
    >>> SafetyEnvelope.from_toml(SafetyEnvelope(duty_limit=0.5).to_toml()) == SafetyEnvelope(duty_limit=0.5)
    True
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
    def __init__(self, *, cycle_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, duty_limit: typing.SupportsFloat | typing.SupportsIndex = 0.8, slew_per_s: typing.SupportsFloat | typing.SupportsIndex = 200.0, ramp_s: typing.SupportsFloat | typing.SupportsIndex = 0.2, invalid_duties: typing.SupportsFloat | typing.SupportsIndex = 1.0, rms_duty_limit: typing.SupportsFloat | typing.SupportsIndex = 0.5, rms_duty_to_arm: typing.SupportsFloat | typing.SupportsIndex = 0.4, heat_time_constant_s: typing.SupportsFloat | typing.SupportsIndex = 10.0, stall_duty: typing.SupportsFloat | typing.SupportsIndex = 0.6, stall_move_deg: typing.SupportsFloat | typing.SupportsIndex = 0.5, stall_s: typing.SupportsFloat | typing.SupportsIndex = 0.2, largest_age_cycles: typing.SupportsFloat | typing.SupportsIndex = 3.0, held_cycles: typing.SupportsFloat | typing.SupportsIndex = 1.0, bad_frames: typing.SupportsFloat | typing.SupportsIndex = 3.0, good_frames: typing.SupportsFloat | typing.SupportsIndex = 20.0, missed_deadlines: typing.SupportsFloat | typing.SupportsIndex = 3.0, unsent_cycles: typing.SupportsFloat | typing.SupportsIndex = 3.0, sensor_sum_v: typing.SupportsFloat | typing.SupportsIndex = 5.0, sensor_sum_tolerance_v: typing.SupportsFloat | typing.SupportsIndex = 0.2, sensor_low_v: typing.SupportsFloat | typing.SupportsIndex = 0.2, sensor_high_v: typing.SupportsFloat | typing.SupportsIndex = 4.8, sensor_slope_v_per_s: typing.SupportsFloat | typing.SupportsIndex = 400.0, sensor_cycles: typing.SupportsFloat | typing.SupportsIndex = 4.0, closed_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0, open_deg: typing.SupportsFloat | typing.SupportsIndex = 90.0, travel_margin_deg: typing.SupportsFloat | typing.SupportsIndex = 6.75, bus_fault_from: str = 'passive') -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def replace(self, **kwargs) -> SafetyEnvelope:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def bad_frames(self) -> float:
        """
        bad frames in a row: LIMP [-]
        """
    @property
    def bus_fault_from(self) -> str:
        """
        state of the CAN controller from which on it is limp
        """
    @property
    def closed_deg(self) -> float:
        """
        lower end of the travel [deg]
        """
    @property
    def cycle_s(self) -> float:
        """
        time between two cycles of the gate [s]
        """
    @property
    def duty_limit(self) -> float:
        """
        largest duty [-]
        """
    @property
    def good_frames(self) -> float:
        """
        good frames before arming and before a reset [-]
        """
    @property
    def heat_time_constant_s(self) -> float:
        """
        lag of the heat model [s]
        """
    @property
    def held_cycles(self) -> float:
        """
        cycles for which the last duty bridges it, then LIMP [cycles]
        """
    @property
    def invalid_duties(self) -> float:
        """
        duties in a row that are not finite: FAULT [cycles]
        """
    @property
    def largest_age_cycles(self) -> float:
        """
        age beyond which a measurement is not used [cycles]
        """
    @property
    def missed_deadlines(self) -> float:
        """
        deadlines missed in a row: LIMP [-]
        """
    @property
    def open_deg(self) -> float:
        """
        upper end of the travel [deg]
        """
    @property
    def ramp_s(self) -> float:
        """
        time in which the duty grows in after the start [s]
        """
    @property
    def rms_duty_limit(self) -> float:
        """
        largest RMS duty of the heat model: LIMP [-]
        """
    @property
    def rms_duty_to_arm(self) -> float:
        """
        RMS duty to which it cools before arming [-]
        """
    @property
    def sensor_cycles(self) -> float:
        """
        measurements in a row that fail a check of the sensors: FAULT [cycles]
        """
    @property
    def sensor_high_v(self) -> float:
        """
        largest voltage of a healthy sensor [V]
        """
    @property
    def sensor_low_v(self) -> float:
        """
        least voltage of a healthy sensor [V]
        """
    @property
    def sensor_slope_v_per_s(self) -> float:
        """
        fastest change of a healthy sensor [V/s]
        """
    @property
    def sensor_sum_tolerance_v(self) -> float:
        """
        by which it may be off [V]
        """
    @property
    def sensor_sum_v(self) -> float:
        """
        sum of both sensors [V]
        """
    @property
    def slew_per_s(self) -> float:
        """
        largest change of the duty [1/s]
        """
    @property
    def stall_duty(self) -> float:
        """
        duty that must move the plate [-]
        """
    @property
    def stall_move_deg(self) -> float:
        """
        motion that it must make [deg]
        """
    @property
    def stall_s(self) -> float:
        """
        time without that motion: LIMP [s]
        """
    @property
    def travel_margin_deg(self) -> float:
        """
        by which an angle may leave it [deg]
        """
    @property
    def unsent_cycles(self) -> float:
        """
        commands in a row that did not leave: LIMP [cycles]
        """
class Drive:
    """
    What may leave the machine in this cycle.
    
    A gate gives it; ``duty, bridge_open, send`` unpacks it.
    
    Examples
    --------
    >>> from mgdd.rig import SafetyGate
    >>> gate = SafetyGate()
    >>> gate.observe()
    >>> gate.command(0.3)
    Drive(duty=0.0, bridge_open=True, send=True)
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __hash__(self) -> int:
        ...
    def __iter__(self) -> collections.abc.Iterator:
        ...
    def __repr__(self) -> str:
        ...
    @property
    def bridge_open(self) -> bool:
        """
        Whether the bridge is open, so that the springs bring the plate to limp-home.
        """
    @property
    def duty(self) -> float:
        """
        Duty of the bridge [-].
        """
    @property
    def send(self) -> bool:
        """
        Whether to send anything; not while the bus is off.
        """
class SafetyGate:
    """
    The gate of the core; behind mgdd.rig.SafetyGate.
    """
    def __init__(self, envelope: SafetyEnvelope) -> None:
        ...
    def command(self, duty: typing.SupportsFloat | typing.SupportsIndex) -> Drive:
        """
        Second half of a cycle: the drive that may leave, for the duty [-] that the controller asks for.
        
        NaN is a fault of the controller.
        """
    def count(self, reason: str) -> int:
        """
        Changes of state for a reason so far.
        """
    def drain(self) -> list[tuple[int, str, str, str, int]]:
        """
        Take the waiting changes of state out of the audit list, oldest first: cycle, from, to, reason, count.
        """
    def observe(self, *, good_frames: typing.SupportsInt | typing.SupportsIndex = 0, bad_frames: typing.SupportsInt | typing.SupportsIndex = 0, age_s: typing.SupportsFloat | typing.SupportsIndex | None = None, sensor_v: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(2)"] | None = None, angle_deg: typing.SupportsFloat | typing.SupportsIndex | None = None, bus: str = 'active', sent: bool = True, missed_deadlines: typing.SupportsInt | typing.SupportsIndex = 0, request: str = 'none') -> None:
        """
        First half of a cycle, before the controller: what is known of it.
        
        Parameters
        ----------
        good_frames, bad_frames : int
            Frames that arrived since the last cycle and passed or failed their checks, >= 0.
        age_s : float, optional
            Age of the last good one [s]; it grows by a cycle if left out.
        sensor_v : pair of float, optional
            Both position sensors [V]; looked at where a good frame arrived.
        angle_deg : float, optional
            Angle of the plate [deg]; the same.
        bus : {"active", "warning", "passive", "off"}
            Error state of the CAN controller.
        sent : bool
            Whether the last command left.
        missed_deadlines : int
            Since the last cycle, >= 0.
        request : {"none", "arm", "run", "stop", "disarm", "reset", "abort"}
            What the operator asks for, after all checks of the cycle.
        
        Raises
        ------
        mgdd.errors.ParameterError
            A negative count, an unknown name.
        """
    def request(self, request: str) -> str:
        """
        Ask for another state between two cycles.
        
        Returns what stands against it, ``'none'`` where it was accepted.
        """
    @property
    def cause(self) -> str:
        """
        What is wrong now; arming, starting and a reset wait for its end.
        """
    @property
    def clamped(self) -> int:
        """
        Duties so far that were beyond the limit.
        """
    @property
    def cycle(self) -> int:
        """
        Cycles so far, missed ones included.
        """
    @property
    def drive(self) -> Drive:
        """
        The drive of the last cycle.
        """
    @property
    def dropped(self) -> int:
        """
        Changes of state that found no room in the audit list.
        """
    @property
    def envelope(self) -> SafetyEnvelope:
        """
        The envelope.
        """
    @property
    def mode(self) -> str:
        """
        ``init``, ``armed``, ``run``, ``limp`` or ``fault``.
        """
    @property
    def reason(self) -> str:
        """
        Why that state was entered.
        """
    @property
    def rms_duty(self) -> float:
        """
        RMS duty of the heat model [-].
        """
    @property
    def slewed(self) -> int:
        """
        Duties so far that changed too fast.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        What a run needs to go on bit for bit; a state that the envelope does not allow is refused and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
bus_states: tuple = ('active', 'warning', 'passive', 'off')
safety_reasons: tuple = ('none', 'requested', 'wrong_state', 'too_few_frames', 'aborted', 'stale', 'bad_frames', 'bus_fault', 'not_sent', 'deadlines', 'not_observed', 'heat', 'stall', 'sensor_range', 'sensor_disagreement', 'sensor_slope', 'travel', 'invalid_duty')
safety_requests: tuple = ('none', 'arm', 'run', 'stop', 'disarm', 'reset', 'abort')
safety_states: tuple = ('init', 'armed', 'run', 'limp', 'fault')
