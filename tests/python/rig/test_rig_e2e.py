"""Protection of a CAN payload: known bytes, an independent CRC, AUTOSAR profile 2 of cantools."""

from __future__ import annotations

import copy
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mgdd._core.rig import E2eCheck, crc8, protect
from mgdd.errors import ParameterError, ShapeError
from mgdd.rig.realtime import E2eSettings

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


def test_known_bytes() -> None:
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
    for settings in (ODD, listed, E2eSettings(crc="h2f")):
        assert E2eSettings(**settings.to_dict()) == settings
        assert pickle.loads(pickle.dumps(settings)) == copy.deepcopy(settings) == settings
        assert len({settings, copy.copy(settings)}) == 1
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
