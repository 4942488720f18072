"""
Between a controller and a real actuator: frames of a bus, their protection and signals, records, the safety gate, buses, the loop.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
import typing_extensions
__all__: list[str] = ['Drive', 'E2eCheck', 'E2eSettings', 'Frame', 'RealtimeLoop', 'RecordReader', 'RecordWriter', 'RingTransport', 'SafetyEnvelope', 'SafetyGate', 'SignalLayout', 'SocketCanTransport', 'bus_states', 'check_message', 'commanded_names', 'crc8', 'error_classes', 'measured_names', 'protect', 'read_record', 'repair_record', 'safety_reasons', 'safety_requests', 'safety_states', 'send_results']
class E2eSettings:
    """
    End-to-end protection of a CAN payload: an alive counter and a CRC-8.
    
    Keyword-only and immutable. The defaults are those of a frame of 8 bytes with the CRC in its first byte and the counter
    in the low half of the second. Much like AUTOSAR profiles 1 and 2; not a conformant implementation of either.
    
    Parameters
    ----------
    crc : str or tuple of int
        ``"sae_j1850"`` (polynomial 0x1D) or ``"h2f"`` (0x2F), both with start and final xor 0xFF; otherwise (polynomial,
        start, final xor).
    data_id : int
        Identifier that both sides know, 0 to 65535: a frame of another message has a wrong CRC.
    data_id_mode : {"both", "low", "alternating", "none", "list"}
        Bytes of it under the CRC: low then high, the low one, low where the counter is even and high where it is odd, none;
        all before the payload. ``"list"``: the byte of `data_id_list` that the counter chooses, after the payload.
    data_id_list : sequence of int, optional
        Sixteen bytes, for the mode ``"list"``.
    size : int
        Bytes of the payload, 2 to 64.
    crc_byte, counter_byte : int
        Their places, from 0.
    counter_place : {"low_nibble", "high_nibble", "byte"}
        Bits of the counter in its byte.
    counter_modulus : int
        The counter runs from 0 to this minus 1.
    max_step : int
        Largest step between two frames that counts as good: one less may be lost.
    bad_until_invalid, good_until_valid : int
        Frames in a row until `E2eCheck.valid` changes.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A field outside its domain, naming field, value and bound.
    
    Examples
    --------
    >>> from mgdd._core.rig import E2eCheck, E2eSettings, protect
    >>> settings = E2eSettings(data_id=0x120)
    >>> check = E2eCheck(settings)
    >>> [check.push(protect(settings, counter, bytes(8))) for counter in (4, 5, 6)], check.valid
    (['initial', 'ok', 'ok'], True)
    >>> check.push(protect(E2eSettings(data_id=0x121), 7, bytes(8)))
    'wrong_crc'
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
    def __init__(self, *, crc: str | tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex] = 'sae_j1850', data_id: typing.SupportsInt | typing.SupportsIndex = 0, data_id_mode: str = 'both', data_id_list: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] | None = None, size: typing.SupportsInt | typing.SupportsIndex = 8, crc_byte: typing.SupportsInt | typing.SupportsIndex = 0, counter_byte: typing.SupportsInt | typing.SupportsIndex = 1, counter_place: str = 'low_nibble', counter_modulus: typing.SupportsInt | typing.SupportsIndex = 16, max_step: typing.SupportsInt | typing.SupportsIndex = 3, bad_until_invalid: typing.SupportsInt | typing.SupportsIndex = 3, good_until_valid: typing.SupportsInt | typing.SupportsIndex = 2) -> None:
        """
        crc : name, or (polynomial, start, final xor)
        data_id : identifier under the CRC
        data_id_mode : bytes of it under the CRC
        data_id_list : sixteen bytes of the mode 'list'
        size : of the payload [bytes]
        crc_byte : place of the CRC
        counter_byte : place of the counter
        counter_place : its bits in the byte
        counter_modulus : values of the counter
        max_step : largest good step
        bad_until_invalid : bad frames in a row [frames]
        good_until_valid : good frames in a row [frames]
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def next_counter(self, counter: typing.SupportsInt | typing.SupportsIndex) -> int:
        """
        The counter that follows.
        """
    def replace(self, **kwargs) -> E2eSettings:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    @property
    def bad_until_invalid(self) -> int:
        """
        bad frames in a row [frames]
        """
    @property
    def counter_byte(self) -> int:
        """
        place of the counter [-]
        """
    @property
    def counter_modulus(self) -> int:
        """
        values of the counter [-]
        """
    @property
    def counter_place(self) -> str:
        """
        its bits in the byte
        """
    @property
    def crc(self) -> str | tuple[int, int, int]:
        """
        name, or (polynomial, start, final xor)
        """
    @property
    def crc_byte(self) -> int:
        """
        place of the CRC [-]
        """
    @property
    def data_id(self) -> int:
        """
        identifier under the CRC [-]
        """
    @property
    def data_id_list(self) -> typing.Any:
        """
        sixteen bytes of the mode 'list'
        """
    @property
    def data_id_mode(self) -> str:
        """
        bytes of it under the CRC
        """
    @property
    def good_until_valid(self) -> int:
        """
        good frames in a row [frames]
        """
    @property
    def max_step(self) -> int:
        """
        largest good step [-]
        """
    @property
    def size(self) -> int:
        """
        of the payload [bytes]
        """
class E2eCheck:
    """
    The receiver's check of protected payloads.
    
    Valid after ``good_until_valid`` good frames in a row, no longer after ``bad_until_invalid`` bad ones in a row. It sees
    frames and not time: a frame that never comes needs a time limit beside it.
    
    Parameters
    ----------
    settings : E2eSettings
        As the sender has them.
    
    Examples
    --------
    >>> from mgdd._core.rig import E2eCheck, E2eSettings, protect
    >>> settings = E2eSettings(max_step=2)
    >>> check = E2eCheck(settings)
    >>> [check.push(protect(settings, counter, bytes(8))) for counter in (14, 0, 0, 5)]
    ['initial', 'ok', 'repeated', 'lost']
    >>> check.counts["missing"]
    5
    """
    def __init__(self, settings: E2eSettings) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def push(self, payload: typing_extensions.Buffer) -> str:
        """
        Judge the next payload: 'ok', 'initial', 'repeated', 'lost', 'wrong_crc', 'wrong_length' or 'wrong_counter'.
        """
    def reset(self) -> None:
        """
        Forget the last frame and the validity; the counts stay.
        """
    @property
    def counts(self) -> dict:
        """
        Frames by status, and 'missing': frames that the counter skipped.
        """
    @property
    def settings(self) -> E2eSettings:
        """
        As given.
        """
    @property
    def valid(self) -> bool:
        """
        Whether enough good frames came, and not too many bad ones.
        """
class SignalLayout:
    """
    Where a number stands in the bits of a CAN payload, as a DBC says it.
    
    Keyword-only and immutable. The physical value is ``raw * scale + offset``. A value never wraps, and NaN is never sent.
    
    Parameters
    ----------
    start, length : int
        First bit as a DBC counts (of a big-endian signal its most significant one), and 1 to 64 bits.
    byte_order : {"little_endian", "big_endian"}
        Intel or Motorola.
    raw_type : {"unsigned", "signed", "float32", "float64"}
        Meaning of the bits.
    scale, offset : float
        Of the physical value.
    minimum, maximum : float, optional
        Bounds of the physical value.
    
    Examples
    --------
    >>> from mgdd._core.rig import SignalLayout
    >>> duty = SignalLayout(start=16, length=12, raw_type="signed", scale=0.0005, minimum=-1.0, maximum=1.0)
    >>> payload = duty.pack(bytes(8), -3.0)
    >>> payload.hex(), duty.unpack(payload)
    ('0000300800000000', -1.0)
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
    def __init__(self, *, start: typing.SupportsInt | typing.SupportsIndex, length: typing.SupportsInt | typing.SupportsIndex, byte_order: str = 'little_endian', raw_type: str = 'unsigned', scale: typing.SupportsFloat | typing.SupportsIndex = 1.0, offset: typing.SupportsFloat | typing.SupportsIndex = 0.0, minimum: typing.SupportsFloat | typing.SupportsIndex | None = None, maximum: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        start : first bit, as a DBC counts
        length : bits
        byte_order : order of the bytes
        raw_type : meaning of the bits
        scale : physical value of one step
        offset : physical value of the raw 0
        minimum : lowest physical value
        maximum : highest physical value
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def pack(self, payload: typing_extensions.Buffer, value: typing.SupportsFloat | typing.SupportsIndex, out_of_range: str = 'clamp') -> bytes:
        """
        The payload with this physical value; beyond its range it is clamped, or with 'refuse' a ParameterError.
        """
    def pack_raw(self, payload: typing_extensions.Buffer, raw: typing.Any) -> bytes:
        """
        The payload with this raw number; ParameterError where it does not fit the bits.
        """
    def replace(self, **kwargs) -> SignalLayout:
        """
        A validated copy with some fields changed; an unknown name is a ParameterError.
        """
    def to_dict(self) -> dict:
        """
        All fields as a new dict.
        """
    def unpack(self, payload: typing_extensions.Buffer) -> float:
        """
        The physical value.
        """
    def unpack_column(self, payloads: numpy.typing.NDArray[numpy.uint8]) -> numpy.typing.NDArray[numpy.float64]:
        """
        The physical values of a table of payloads, uint8 with a row per frame, without the GIL.
        """
    def unpack_raw(self, payload: typing_extensions.Buffer) -> int | int | float:
        """
        The raw number.
        """
    @property
    def byte_order(self) -> str:
        """
        order of the bytes
        """
    @property
    def length(self) -> int:
        """
        bits [-]
        """
    @property
    def maximum(self) -> float | None:
        """
        highest physical value
        """
    @property
    def minimum(self) -> float | None:
        """
        lowest physical value
        """
    @property
    def offset(self) -> float:
        """
        physical value of the raw 0 [-]
        """
    @property
    def raw_type(self) -> str:
        """
        meaning of the bits
        """
    @property
    def scale(self) -> float:
        """
        physical value of one step [-]
        """
    @property
    def start(self) -> int:
        """
        first bit, as a DBC counts [-]
        """
class Frame:
    """
    One CAN or CAN FD frame. Keyword-only and immutable.
    
    Parameters
    ----------
    id : int
        Identifier: 11 bits, 29 of an extended frame; of an error frame its class bits.
    data : bytes
        Payload, up to 64 bytes.
    extended, error, received, fd, bit_rate_switch, remote : bool
        29-bit identifier; news of a bus error; from the bus rather than sent by us; CAN FD; its data at the higher rate;
        request of a frame.
    channel : int
        Which bus, where one record holds several.
    monotonic_ns, bus_ns : int
        When it was received or handed to the bus, and the driver's own stamp [ns].
    
    Examples
    --------
    >>> from mgdd.rig.realtime import Frame
    >>> Frame(id=0x121, data=bytes(3), received=True).data
    b'\\x00\\x00\\x00'
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, id: typing.SupportsInt | typing.SupportsIndex, data: typing_extensions.Buffer = b'', extended: bool = False, error: bool = False, received: bool = False, fd: bool = False, bit_rate_switch: bool = False, remote: bool = False, channel: typing.SupportsInt | typing.SupportsIndex = 0, monotonic_ns: typing.SupportsInt | typing.SupportsIndex = 0, bus_ns: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
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
    def bit_rate_switch(self) -> bool:
        """
        Fast data.
        """
    @property
    def bus_ns(self) -> int:
        """
        Stamp of the driver [ns]; 0: none.
        """
    @property
    def channel(self) -> int:
        """
        Which bus.
        """
    @property
    def data(self) -> bytes:
        """
        Payload, up to 64 bytes.
        """
    @property
    def error(self) -> bool:
        """
        News of a bus error.
        """
    @property
    def extended(self) -> bool:
        """
        29-bit identifier.
        """
    @property
    def fd(self) -> bool:
        """
        CAN FD.
        """
    @property
    def id(self) -> int:
        """
        Identifier.
        """
    @property
    def monotonic_ns(self) -> int:
        """
        When received or handed to the bus [ns].
        """
    @property
    def received(self) -> bool:
        """
        From the bus rather than sent by us.
        """
    @property
    def remote(self) -> bool:
        """
        Request of a frame.
        """
class RecordWriter:
    """
    Appends to a record file; behind mgdd.rig.Recorder.
    """
    def __init__(self, path: str, *, run_id: bytes, wall_ns: typing.SupportsInt | typing.SupportsIndex, monotonic_ns: typing.SupportsInt | typing.SupportsIndex, json: str) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def add_table(self, name: str, columns: collections.abc.Sequence[str], monotonic_ns: typing.SupportsInt | typing.SupportsIndex) -> int:
        """
        Number of a new table of samples.
        """
    def close(self) -> None:
        """
        Close the file; what is written later is a RigError.
        """
    def sync(self) -> None:
        """
        Wait until the disk has everything.
        """
    def write(self, frame: Frame) -> None:
        """
        Append a frame.
        """
    def write_event(self, monotonic_ns: typing.SupportsInt | typing.SupportsIndex, category: str, text: str) -> None:
        """
        Append an event.
        """
    def write_sample(self, table: typing.SupportsInt | typing.SupportsIndex, monotonic_ns: typing.SupportsInt | typing.SupportsIndex, values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        """
        Append a number per column of a table.
        """
    @property
    def path(self) -> str:
        """
        As given.
        """
    @property
    def refused(self) -> int:
        """
        Records that could not be written.
        """
    @property
    def size(self) -> int:
        """
        Bytes.
        """
    @property
    def written(self) -> int:
        """
        Records.
        """
class RecordReader:
    """
    Iterates over a record: frames, and tuples ('sample', ns, table, values), ('event', ns, category, text) and ('damage', bytes).
    """
    def __init__(self, path: str) -> None:
        ...
    def __iter__(self) -> RecordReader:
        ...
    def __next__(self) -> typing.Any:
        ...
    def __repr__(self) -> str:
        ...
    @property
    def header(self) -> dict:
        """
        As written.
        """
    @property
    def ignored_bytes(self) -> int:
        """
        Bytes behind the last readable record; known at the end.
        """
    @property
    def incomplete(self) -> bool:
        """
        Whether they may be the start of a record that is still being written.
        """
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
        """
        cycle_s : time between two cycles of the gate [s]
        duty_limit : largest duty
        slew_per_s : largest change of the duty [1/s]
        ramp_s : time in which the duty grows in after the start [s]
        invalid_duties : duties in a row that are not finite: FAULT [cycles]
        rms_duty_limit : largest RMS duty of the heat model: LIMP
        rms_duty_to_arm : RMS duty to which it cools before arming
        heat_time_constant_s : lag of the heat model [s]
        stall_duty : duty that must move the plate
        stall_move_deg : motion that it must make [deg]
        stall_s : time without that motion: LIMP [s]
        largest_age_cycles : age beyond which a measurement is not used [cycles]
        held_cycles : cycles for which the last duty bridges it, then LIMP [cycles]
        bad_frames : bad frames in a row: LIMP
        good_frames : good frames before arming and before a reset
        missed_deadlines : deadlines missed in a row: LIMP
        unsent_cycles : commands in a row that did not leave: LIMP [cycles]
        sensor_sum_v : sum of both sensors [V]
        sensor_sum_tolerance_v : by which it may be off [V]
        sensor_low_v : least voltage of a healthy sensor [V]
        sensor_high_v : largest voltage of a healthy sensor [V]
        sensor_slope_v_per_s : fastest change of a healthy sensor [V/s]
        sensor_cycles : measurements in a row that fail a check of the sensors: FAULT [cycles]
        closed_deg : lower end of the travel [deg]
        open_deg : upper end of the travel [deg]
        travel_margin_deg : by which an angle may leave it [deg]
        bus_fault_from : state of the CAN controller from which on it is limp
        """
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
    def __getstate__(self) -> tuple[int, float, bool, bool]:
        ...
    def __hash__(self) -> int:
        ...
    def __iter__(self) -> collections.abc.Iterator:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
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
    def __repr__(self) -> str:
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
class RingTransport:
    """
    A bus behind two rings, fed and drained by a thread of Python.
    
    A `RealtimeLoop` takes and gives frames without waiting for Python. `BusBridge` connects it with any interface of
    python-can; a simulated plant may serve it as well.
    
    Parameters
    ----------
    receive_capacity : int
        Frames from the bus that may wait for the loop, a power of two; what does not fit is lost and counted.
    send_capacity : int
        Frames towards the bus that may wait, a power of two. Short, so that no command leaves late: a command that finds no
        room is not sent, and the loop knows.
    
    Raises
    ------
    mgdd.errors.ParameterError
        A capacity that is not a power of two from 2 to 16777216.
    
    See Also
    --------
    BusBridge : a python-can bus on the other side.
    SocketCanTransport : a CAN interface of Linux, without Python in between.
    
    Examples
    --------
    >>> from mgdd.rig.realtime import Frame, RingTransport
    >>> bus = RingTransport()
    >>> bus.feed(Frame(id=0x121, data=bytes(8)))
    True
    >>> bus.counts["lost"], bus.take() is None, bus.bus_state
    (0, True, 'active')
    """
    def __init__(self, *, receive_capacity: typing.SupportsInt | typing.SupportsIndex = 1024, send_capacity: typing.SupportsInt | typing.SupportsIndex = 16) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def fail(self) -> None:
        """
        Say that the bus is gone, for good: the loop sees it as off and opens the bridge.
        """
    def feed(self, frame: Frame) -> bool:
        """
        Hand a frame from the bus to the loop.
        
        Parameters
        ----------
        frame : Frame
            Without a stamp ``monotonic_ns`` it gets that of now.
        
        Returns
        -------
        bool
            False, and counted as lost, where it finds no room.
        """
    def take(self, timeout_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> typing.Any:
        """
        Take the next frame that the loop sends; other threads run while it waits.
        
        Parameters
        ----------
        timeout_s : float
            How long to wait for one, 0 to 3600 [s].
        
        Returns
        -------
        Frame or None
            None where none came.
        """
    @property
    def bus_state(self) -> str:
        """
        ``"active"``, ``"warning"``, ``"passive"`` or ``"off"``.
        """
    @property
    def counts(self) -> dict:
        """
        Frames by what became of them, and error frames by kind, as a new dict.
        """
    @property
    def in_use(self) -> bool:
        """
        Whether a loop takes its frames.
        """
    @property
    def waiting_for_loop(self) -> int:
        """
        Frames that the loop has not taken yet.
        """
    @property
    def waiting_to_send(self) -> int:
        """
        Frames of the loop that nobody has taken yet.
        """
class SocketCanTransport:
    """
    A CAN interface of Linux as a raw socket that never blocks, for a `RealtimeLoop`.
    
    Several sockets on one interface see each other's frames: a logger of python-can beside it records all, our own commands
    too. Set the queue of the interface short (``ip link set can0 txqueuelen 10``), or old commands leave late.
    
    Parameters
    ----------
    interface : str
        Its name, for example ``"can0"``.
    fd : bool
        CAN FD frames too.
    filters : sequence of tuple
        ``(id, mask, extended)``: a frame passes whose identifier agrees with one of them in the bits of its mask; all frames
        if empty. They hold before the first frame can arrive.
    receive_buffer_bytes : int
        Asked of the kernel; `receive_buffer_bytes` says what it granted.
    send_patience_s : float
        How long to try again where the queue of the interface is full, 0 to 0.1 [s].
    
    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain.
    mgdd.errors.RigError
        The kernel is built without CAN; or the interface does not exist, is down, is of another type or cannot do CAN FD.
    
    See Also
    --------
    RingTransport : any other adapter, through python-can.
    
    Examples
    --------
    >>> from mgdd.errors import RigError
    >>> from mgdd.rig.realtime import SocketCanTransport
    >>> try:
    ...     bus = SocketCanTransport("no_such_can")
    ... except RigError:
    ...     print("no bus")
    no bus
    """
    def __init__(self, interface: str, *, fd: bool = False, filters: collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex, bool]] = [], receive_buffer_bytes: typing.SupportsInt | typing.SupportsIndex = 4194304, send_patience_s: typing.SupportsFloat | typing.SupportsIndex = 0.0002) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def receive(self, timeout_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> typing.Any:
        """
        Take the next frame from the bus; other threads run while it waits.
        
        Parameters
        ----------
        timeout_s : float
            How long to wait for one, 0 to 3600 [s].
        
        Returns
        -------
        Frame or None
            None where none came.
        
        Raises
        ------
        mgdd.errors.RigError
            A loop takes the frames.
        """
    def send(self, frame: Frame) -> str:
        """
        Send a frame now.
        
        Parameters
        ----------
        frame : Frame
            Its stamps are not used.
        
        Returns
        -------
        str
            ``"sent"``, ``"full"`` where the queue had no room in time, ``"failed"`` where the frame or the interface is unfit.
        
        Raises
        ------
        mgdd.errors.RigError
            A loop sends here.
        """
    @property
    def bus_state(self) -> str:
        """
        ``"active"``, ``"warning"``, ``"passive"`` or ``"off"``.
        """
    @property
    def counts(self) -> dict:
        """
        Frames by what became of them, and error frames by kind, as a new dict.
        """
    @property
    def in_use(self) -> bool:
        """
        Whether a loop takes its frames.
        """
    @property
    def receive_buffer_bytes(self) -> int:
        """
        Bytes that the kernel granted.
        """
class RealtimeLoop:
    """
    A controller in a thread of its own; behind mgdd.rig.realtime.RealtimeLoop.
    """
    def __init__(self, *, controller: typing.Any, transport: RingTransport | SocketCanTransport, envelope: SafetyEnvelope, command: tuple[typing.SupportsInt | typing.SupportsIndex, bool, typing.SupportsInt | typing.SupportsIndex, E2eSettings | None, collections.abc.Sequence[tuple[str, SignalLayout, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex | None, collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]]]], received: collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, bool, typing.SupportsInt | typing.SupportsIndex, E2eSettings | None, collections.abc.Sequence[tuple[str, SignalLayout, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex | None, collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]]]]], period_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, initial_reference_deg: typing.SupportsFloat | typing.SupportsIndex = 0.0, reference_timeout_s: typing.SupportsFloat | typing.SupportsIndex | None = None, transmit: bool = True, stop_frames: typing.SupportsInt | typing.SupportsIndex = 5, realtime: bool = True, priority: typing.SupportsInt | typing.SupportsIndex = 50, lock_memory: bool = True, sample_capacity: typing.SupportsInt | typing.SupportsIndex = 16384, queue_capacity: typing.SupportsInt | typing.SupportsIndex = 65536) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def events(self) -> list:
        """
        Changes of state since the last call: cycle, from, to, reason, count.
        """
    def give_back(self, controller: typing.Any) -> None:
        ...
    def queue_references(self, reference_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        ...
    def report(self) -> dict:
        """
        Account of the loop so far.
        """
    def request(self, request: str) -> bool:
        ...
    def samples(self) -> dict:
        """
        Samples since the last call, as a dict of columns.
        """
    def set_reference(self, reference_deg: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def start(self) -> None:
        """
        Start; returns at once.
        """
    def stop(self, timeout_s: typing.SupportsFloat | typing.SupportsIndex) -> bool:
        """
        Ask for the end; whether it came in time.
        """
    def wait(self, timeout_s: typing.SupportsFloat | typing.SupportsIndex | None) -> bool:
        """
        Wait for the end without the GIL; whether it came.
        """
    @property
    def bus_state(self) -> str:
        ...
    @property
    def cause(self) -> str:
        ...
    @property
    def patience_s(self) -> float:
        ...
    @property
    def queued_references(self) -> int:
        ...
    @property
    def reason(self) -> str:
        ...
    @property
    def running(self) -> bool:
        ...
    @property
    def state(self) -> str:
        ...
def check_message(signals: collections.abc.Mapping[str, SignalLayout], size: typing.SupportsInt | typing.SupportsIndex, branches: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]] | None = None) -> None:
    """
    ParameterError naming signals that reach beyond a message of `size` bytes or share bits; `branches` gives the values of the multiplexer that select a signal.
    """
def crc8(data: bytes, crc: str | tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex] = 'sae_j1850') -> int:
    """
    CRC-8 by name, or of (polynomial, start, final xor).
    """
def error_classes(frame: Frame) -> list[str]:
    """
    Name what an error frame reports, as Linux defines its bits.
    
    Parameters
    ----------
    frame : Frame
        An error frame.
    
    Returns
    -------
    list of str
        ``"transmit_timeout"``, ``"lost_arbitration"``, ``"controller"``, ``"protocol"``, ``"transceiver"``,
        ``"no_acknowledgement"``, ``"bus_off"``, ``"bus_error"``, ``"restarted"``; ``"error_passive"`` last where the data of a
        controller error say so; ``"unknown"`` where no bit is known.
    """
def protect(settings: E2eSettings, counter: typing.SupportsInt | typing.SupportsIndex, payload: typing_extensions.Buffer) -> bytes:
    """
    Puts counter and checksum into a payload.
    """
def read_record(path: str) -> dict:
    """
    All of a record as columns; behind mgdd.rig.read_record.
    """
def repair_record(path: str, target: str) -> dict:
    """
    Behind mgdd.rig.repair_record.
    """
bus_states: tuple = ('active', 'warning', 'passive', 'off')
commanded_names: tuple = ('duty', 'enable', 'reference_deg', 'fixed')
measured_names: tuple = ('angle_deg', 'first_v', 'second_v', 'supply_v', 'current_a', 'speed_deg_per_s', 'applied_duty')
safety_reasons: tuple = ('none', 'requested', 'wrong_state', 'too_few_frames', 'aborted', 'stale', 'bad_frames', 'bus_fault', 'not_sent', 'deadlines', 'not_observed', 'heat', 'stall', 'sensor_range', 'sensor_disagreement', 'sensor_slope', 'travel', 'invalid_duty')
safety_requests: tuple = ('none', 'arm', 'run', 'stop', 'disarm', 'reset', 'abort')
safety_states: tuple = ('init', 'armed', 'run', 'limp', 'fault')
send_results: tuple = ('sent', 'full', 'failed')
