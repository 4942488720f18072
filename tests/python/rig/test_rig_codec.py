"""Numbers in CAN payloads and their protection, against cantools and by known bytes."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mgdd._core.rig import E2eCheck, SignalLayout, check_message, crc8, protect
from mgdd.errors import ParameterError, ShapeError
from mgdd.rig.realtime import E2eSettings

KNOWN = [  # by hand from the bit charts of the DBC convention
    ({"start": 0, "length": 16, "scale": 0.01}, 81.92, "0020"),
    ({"start": 4, "length": 12}, 0xABC, "c0ab"),
    ({"start": 3, "length": 12, "byte_order": "big_endian"}, 0xABC, "0abc"),
    ({"start": 7, "length": 16, "byte_order": "big_endian", "raw_type": "signed"}, -2, "fffe"),
    ({"start": 13, "length": 3, "byte_order": "big_endian"}, 5, "0028"),
    ({"start": 6, "length": 12, "raw_type": "signed", "scale": 0.0005}, -1.0, "000c02"),
    ({"start": 8, "length": 32, "raw_type": "float32"}, 1.5, "000000c03f"),
    ({"start": 7, "length": 64, "byte_order": "big_endian", "raw_type": "float64"}, -2.0, "c0"),
]


@pytest.mark.parametrize(("layout", "value", "bytes_"), KNOWN)
def test_known_bytes(layout: dict[str, object], value: float, bytes_: str) -> None:
    signal = SignalLayout(**layout)
    assert signal.pack(bytes(8), value, "refuse") == bytes.fromhex(bytes_).ljust(8, b"\0")
    assert signal.unpack(bytes.fromhex(bytes_).ljust(8, b"\0")) == value


@st.composite
def layouts(draw: st.DrawFn) -> tuple[dict[str, object], int]:
    """A signal that fits a message of 8 or 64 bytes, as keywords, and the size."""
    size = draw(st.sampled_from([8, 64]))
    raw_type = draw(st.sampled_from(["unsigned", "signed", "unsigned", "signed", "float32", "float64"]))
    length = {"float32": 32, "float64": 64}.get(raw_type) or draw(st.integers(1, 64))
    order = draw(st.sampled_from(["little_endian", "big_endian"]))
    first = draw(st.integers(0, 8 * size - length))
    start = first if order == "little_endian" else first // 8 * 8 + 7 - first % 8
    scale = draw(st.sampled_from([1.0, 0.01, -0.25, 0.0005, 3.7]))
    offset = draw(st.sampled_from([0.0, -40.0, 0.1]))
    keywords = {"start": start, "length": length, "byte_order": order, "raw_type": raw_type}
    return keywords | {"scale": scale, "offset": offset}, size


def of_cantools(layout: dict[str, object], size: int):
    database = pytest.importorskip("cantools.database")
    conversion = pytest.importorskip("cantools.database.conversion").BaseConversion
    signal = database.can.Signal(
        "S",
        layout["start"],
        layout["length"],
        byte_order=layout["byte_order"],
        is_signed=layout["raw_type"] == "signed",
        conversion=conversion.factory(layout["scale"], layout["offset"], is_float="float" in str(layout["raw_type"])),
    )
    return database.can.Message(1, "M", size, [signal], is_fd=size > 8, strict=True)


def raw_bounds(layout: dict[str, object]) -> tuple[int, int]:
    length = int(str(layout["length"]))
    return (-(2 ** (length - 1)), 2 ** (length - 1) - 1) if layout["raw_type"] == "signed" else (0, 2**length - 1)


def same(ours: float, theirs: float) -> bool:
    """Equal; an integer of cantools beyond 2**53, which it scales without rounding, as near as a double can be."""
    beyond = isinstance(theirs, int) and abs(theirs) >= 2**53
    return math.isclose(ours, theirs, rel_tol=2**-52) if beyond else ours == theirs


@settings(max_examples=600)
@given(layouts(), st.data())
def test_identical_to_cantools(drawn: tuple[dict[str, object], int], data: st.DataObject) -> None:
    layout, size = drawn
    ours, theirs = SignalLayout(**layout), of_cantools(layout, size)
    noise = data.draw(st.binary(min_size=size, max_size=size))
    if "float" in str(layout["raw_type"]):
        raw = data.draw(st.floats(width=32 if layout["length"] == 32 else 64, allow_nan=False, allow_infinity=False))
    else:
        least, most = raw_bounds(layout)
        raw = data.draw(st.sampled_from([least, most, 0]) | st.integers(least, most))
    coded = theirs.encode({"S": raw}, scaling=False)
    assert ours.pack_raw(bytes(size), raw) == coded
    assert ours.unpack_raw(coded) == raw
    assert same(ours.unpack(coded), theirs.decode(coded)["S"])
    back, physical = ours.unpack_raw(noise), theirs.decode(noise)["S"]
    if not math.isnan(physical):
        assert back == theirs.decode(noise, scaling=False)["S"]
        assert same(ours.unpack(noise), physical)
        assert ours.unpack_column(np.frombuffer(noise + coded, np.uint8).reshape(2, size)).tolist() == [
            ours.unpack(noise),
            ours.unpack(coded),
        ]
    mask = ours.pack_raw(bytes(size), -1) if layout["raw_type"] == "signed" else None
    if mask is not None:  # all ones: nothing beside the signal moves
        kept = ours.pack_raw(noise, raw)
        assert all((a ^ b) & ~m & 0xFF == 0 for a, b, m in zip(kept, noise, mask, strict=True))


@settings(max_examples=600)
@given(layouts(), st.data())
def test_physical_values_are_coded_as_by_cantools(drawn: tuple[dict[str, object], int], data: st.DataObject) -> None:
    layout, size = drawn
    ours, theirs = SignalLayout(**layout), of_cantools(layout, size)
    scale, offset = float(str(layout["scale"])), float(str(layout["offset"]))
    if "float" in str(layout["raw_type"]):
        value = data.draw(st.floats(-1e30, 1e30))
    else:
        least, most = (max(-(2**52), min(2**52, bound)) for bound in raw_bounds(layout))
        value = data.draw(st.floats(least, most)) * scale + offset
        assume(least <= round((value - offset) / scale) <= most)
    assert ours.pack(bytes(size), value, "refuse") == theirs.encode({"S": value}, strict=False)


def test_refused_values() -> None:
    duty = SignalLayout(start=0, length=12, raw_type="signed", scale=0.0005, minimum=-1.0, maximum=1.0)
    assert duty.unpack(duty.pack(bytes(8), 3.2)) == 1.0
    with pytest.raises(ParameterError, match=r"value = 3.2: must be finite and >= -1 and <= 1 and fit the 12 bits"):
        duty.pack(bytes(8), 3.2, "refuse")
    for value in (math.nan, math.inf):
        with pytest.raises(ParameterError, match="must be finite"):
            duty.pack(bytes(8), value)
    for raw in (2048, -2049, 2**64, -(2**63) - 1):
        with pytest.raises(ParameterError, match="within the 12 bits"):
            duty.pack_raw(bytes(8), raw)
    with pytest.raises(ParameterError, match="a whole number"):
        duty.pack_raw(bytes(8), 0.5)
    with pytest.raises(ParameterError, match="out_of_range = 'wrap': must be one of clamp, refuse"):
        duty.pack(bytes(8), 0.5, "wrap")
    with pytest.raises(ShapeError, match="reaches beyond"):
        duty.pack(bytes(1), 0.5)
    with pytest.raises(ShapeError, match="reaches beyond"):
        duty.unpack_column(np.zeros((2, 1), np.uint8))
    with pytest.raises(ShapeError, match="1 dimensions"):
        duty.unpack_column(np.zeros(8, np.uint8))


def test_a_message_is_checked() -> None:
    theta, state = SignalLayout(start=0, length=16), SignalLayout(start=23, length=4, byte_order="big_endian")
    check_message({"Theta": theta, "State": state}, 3)
    with pytest.raises(ParameterError, match="signal State: its 4 bits from bit 23 reach beyond the 2 bytes") as error:
        check_message({"Theta": theta, "State": state}, 2)
    assert error.value.field == "State"
    side = SignalLayout(start=15, length=1)
    with pytest.raises(ParameterError, match="signal Theta: shares bits with signal Side"):
        check_message({"Theta": theta, "Side": side}, 8)
    check_message({"Theta": theta, "Side": side}, 8, {"Theta": [0], "Side": [1, 2]})


ODD = E2eSettings(
    crc=(0x2F, 0x5A, 0xA5),
    data_id=0xBEEF,
    data_id_mode="alternating",
    crc_byte=7,
    counter_byte=2,
    counter_place="high_nibble",
    counter_modulus=15,
    max_step=2,
    bad_until_invalid=2,
    good_until_valid=3,
)
BODY = bytes.fromhex("0000112233445566")


def test_known_bytes_of_a_protected_payload() -> None:
    assert protect(E2eSettings(data_id=0x0120), 5, BODY) == bytes.fromhex("3a05112233445566")
    assert protect(ODD, 9, BODY) == bytes.fromhex("0000912233445554")


def by_long_division(data: bytes, polynomial: int, start: int, final_xor: int) -> int:
    """The remainder of the message as one polynomial over GF(2): no table and no register."""
    message = int.from_bytes(bytes([data[0] ^ start]) + data[1:] + b"\0", "big")
    divisor = 0x100 | polynomial
    for shift in range(message.bit_length() - 9, -1, -1):
        if message >> (shift + 8) & 1:
            message ^= divisor << shift
    return message ^ final_xor


@given(st.binary(min_size=1, max_size=64), *[st.integers(0, 255)] * 3)
def test_crc_is_the_remainder_of_a_division(data: bytes, polynomial: int, start: int, final_xor: int) -> None:
    assert crc8(data, (polynomial, start, final_xor)) == by_long_division(data, polynomial, start, final_xor)


@given(
    st.binary(min_size=2, max_size=64),
    st.lists(st.integers(0, 255), min_size=16, max_size=16),
    st.integers(0, 15),
)
def test_profile_2_is_that_of_cantools(payload: bytes, ids: list[int], counter: int) -> None:
    profile = pytest.importorskip("cantools.autosar.end_to_end")
    settings = E2eSettings(crc="h2f", data_id_mode="list", data_id_list=ids, size=len(payload))
    sent = protect(settings, counter, payload)
    assert sent[1] == payload[1] & 0xF0 | counter
    assert profile.check_profile2_crc(sent, ids[counter]) is True


@given(st.data())
def test_what_was_protected_is_accepted_and_no_other_content(data: st.DataObject) -> None:
    payload = data.draw(st.binary(min_size=8, max_size=8))
    counter = data.draw(st.integers(0, 14))
    sent = protect(ODD, counter, payload)
    assert E2eCheck(ODD).push(sent) == "initial"
    other = data.draw(st.binary(min_size=8, max_size=8).filter(lambda other: other != sent))
    again = protect(ODD, counter, other)
    kept = [byte for place, byte in enumerate(again) if place not in (2, 7)]
    assert kept == [byte for place, byte in enumerate(other) if place not in (2, 7)]
    assert again[2] == other[2] & 0x0F | counter << 4


def test_statuses_and_counts() -> None:
    check = E2eCheck(ODD)
    seen = [check.push(protect(ODD, counter, BODY)) for counter in (13, 14, 1, 1, 4)]
    seen += [check.push(b""), check.push(bytes(8))]
    assert seen == ["initial", "ok", "ok", "repeated", "lost", "wrong_length", "wrong_crc"]
    assert check.counts == {
        "ok": 2, "initial": 1, "repeated": 1, "lost": 1, "wrong_crc": 1, "wrong_length": 1, "wrong_counter": 0,
        "missing": 3,
    }  # fmt: skip
    assert not check.valid
    assert check.settings == ODD


def test_what_a_bus_hands_out_is_taken() -> None:
    sent = protect(ODD, 3, bytearray(BODY))
    for form in (bytearray(sent), memoryview(sent), memoryview(sent + sent)[:8]):
        assert E2eCheck(ODD).push(form) == "initial"


def test_settings_are_a_value() -> None:
    listed = E2eSettings(data_id_mode="list", data_id_list=range(16))
    for own in (ODD, listed, E2eSettings(crc="h2f")):
        assert E2eSettings(**own.to_dict()) == own
        assert pickle.loads(pickle.dumps(own)) == copy.deepcopy(own) == own
        assert len({own, copy.copy(own)}) == 1
    assert E2eSettings(crc=(0x2F, 0xFF, 0xFF)).crc == "h2f"
    assert ODD.next_counter(14) == 0
    assert ODD.next_counter(3) == 4


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"crc": "crc16"}, "crc"),
        ({"crc": (0x1D, 256, 0)}, "start of crc"),
        ({"data_id": -1}, "data_id"),
        ({"data_id": 0x10000}, "data_id"),
        ({"data_id_mode": "high"}, "data_id_mode"),
        ({"data_id_mode": "list"}, "data_id_list"),
        ({"data_id_list": [0] * 16}, "data_id_list"),
        ({"data_id_mode": "list", "data_id_list": [0] * 15}, "data_id_list"),
        ({"size": 1}, "size"),
        ({"size": 65}, "size"),
        ({"crc_byte": 8}, "crc_byte"),
        ({"counter_byte": -1}, "counter_byte"),
        ({"counter_modulus": 17}, "counter_modulus"),
        ({"max_step": 16}, "max_step"),
        ({"bad_until_invalid": 0}, "bad_until_invalid"),
        ({"good_until_valid": 0}, "good_until_valid"),
        ({"crc_byte": 1}, "counter_byte"),
        ({"counter_place": "byte", "counter_modulus": 257}, "counter_modulus"),
    ],
)
def test_refused_settings(wrong: dict[str, object], field: str) -> None:
    with pytest.raises(ParameterError) as error:
        E2eSettings(**wrong)
    assert error.value.field == field


def test_refused_payloads_and_counters() -> None:
    with pytest.raises(ShapeError, match="payload has 7 bytes: must be 8"):
        protect(ODD, 3, bytes(7))
    with pytest.raises(ParameterError, match=r"counter = 15: must be in \[0, 14\]"):
        protect(ODD, 15, BODY)
    with pytest.raises(ShapeError, match="at most 64"):
        E2eCheck(ODD).push(bytes(65))
    with pytest.raises(ParameterError, match="payload = 'text': must be bytes"):
        E2eCheck(ODD).push("text")
