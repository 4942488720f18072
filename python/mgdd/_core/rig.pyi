"""
Frames of a bus, their protection, signals in their bits, records of a run.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
import typing_extensions
__all__: list[str] = ['E2eCheck', 'E2eSettings', 'Frame', 'RecordReader', 'RecordWriter', 'SignalLayout', 'check_message', 'crc8', 'protect', 'read_record', 'repair_record']
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
    >>> from mgdd.rig import E2eCheck, E2eSettings, protect
    >>> settings = E2eSettings(data_id=0x120)
    >>> check = E2eCheck(settings)
    >>> [check.push(protect(settings, counter, bytes(8))) for counter in (4, 5, 6)], check.valid
    (['initial', 'ok', 'ok'], True)
    >>> check.push(protect(E2eSettings(data_id=0x121), 7, bytes(8)))
    'wrong_crc'
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, crc: str | tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex] = 'sae_j1850', data_id: typing.SupportsInt | typing.SupportsIndex = 0, data_id_mode: str = 'both', data_id_list: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] | None = None, size: typing.SupportsInt | typing.SupportsIndex = 8, crc_byte: typing.SupportsInt | typing.SupportsIndex = 0, counter_byte: typing.SupportsInt | typing.SupportsIndex = 1, counter_place: str = 'low_nibble', counter_modulus: typing.SupportsInt | typing.SupportsIndex = 16, max_step: typing.SupportsInt | typing.SupportsIndex = 3, bad_until_invalid: typing.SupportsInt | typing.SupportsIndex = 3, good_until_valid: typing.SupportsInt | typing.SupportsIndex = 2) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def next_counter(self, counter: typing.SupportsInt | typing.SupportsIndex) -> int:
        """
        The counter that follows.
        """
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def bad_until_invalid(self) -> int:
        """
        Bad frames in a row.
        """
    @property
    def counter_byte(self) -> int:
        """
        Place of the counter.
        """
    @property
    def counter_modulus(self) -> int:
        """
        Values of the counter.
        """
    @property
    def counter_place(self) -> str:
        """
        Its bits in the byte.
        """
    @property
    def crc(self) -> str | tuple[int, int, int]:
        """
        Name, or (polynomial, start, final xor).
        """
    @property
    def crc_byte(self) -> int:
        """
        Place of the CRC.
        """
    @property
    def data_id(self) -> int:
        """
        Identifier under the CRC.
        """
    @property
    def data_id_list(self) -> typing.Any:
        """
        Sixteen bytes of the mode 'list', or None.
        """
    @property
    def data_id_mode(self) -> str:
        """
        Bytes of it under the CRC.
        """
    @property
    def good_until_valid(self) -> int:
        """
        Good frames in a row.
        """
    @property
    def max_step(self) -> int:
        """
        Largest good step.
        """
    @property
    def size(self) -> int:
        """
        Bytes of the payload.
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
    >>> from mgdd.rig import E2eCheck, E2eSettings, protect
    >>> settings = E2eSettings(max_step=2)
    >>> check = E2eCheck(settings)
    >>> [check.push(protect(settings, counter, bytes(8))) for counter in (14, 0, 0, 5)]
    ['initial', 'ok', 'repeated', 'lost']
    >>> check.counts["missing"]
    5
    """
    def __init__(self, settings: E2eSettings) -> None:
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
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, dict]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, *, start: typing.SupportsInt | typing.SupportsIndex, length: typing.SupportsInt | typing.SupportsIndex, byte_order: str = 'little_endian', raw_type: str = 'unsigned', scale: typing.SupportsFloat | typing.SupportsIndex = 1.0, offset: typing.SupportsFloat | typing.SupportsIndex = 0.0, minimum: typing.SupportsFloat | typing.SupportsIndex | None = None, maximum: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        ...
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
    def to_dict(self) -> dict:
        """
        Constructor keywords as a new dict.
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
        Order of the bytes.
        """
    @property
    def length(self) -> int:
        """
        Bits.
        """
    @property
    def maximum(self) -> float | None:
        """
        Highest physical value, or None.
        """
    @property
    def minimum(self) -> float | None:
        """
        Lowest physical value, or None.
        """
    @property
    def offset(self) -> float:
        """
        Physical value of the raw 0.
        """
    @property
    def raw_type(self) -> str:
        """
        Meaning of the bits.
        """
    @property
    def scale(self) -> float:
        """
        Physical value of one step.
        """
    @property
    def start(self) -> int:
        """
        First bit, as a DBC counts.
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
    >>> from mgdd.rig import Frame
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
def check_message(signals: collections.abc.Mapping[str, SignalLayout], size: typing.SupportsInt | typing.SupportsIndex, branches: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]] | None = None) -> None:
    """
    ParameterError naming signals that reach beyond a message of `size` bytes or share bits; `branches` gives the values of the multiplexer that select a signal.
    """
def crc8(data: bytes, crc: str | tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex] = 'sae_j1850') -> int:
    """
    CRC-8 by name, or of (polynomial, start, final xor).
    """
def protect(settings: E2eSettings, counter: typing.SupportsInt | typing.SupportsIndex, payload: typing_extensions.Buffer) -> bytes:
    """
    Behind mgdd.rig.protect.
    """
def read_record(path: str) -> dict:
    """
    All of a record as columns; behind mgdd.rig.read_record.
    """
def repair_record(path: str, target: str) -> dict:
    """
    Behind mgdd.rig.repair_record.
    """
