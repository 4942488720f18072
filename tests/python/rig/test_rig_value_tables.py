"""What a DBC says beside its signals: raw values that are no measurement, and messages that cannot be mapped."""

import math
from pathlib import Path
from typing import Any

import pytest

from mgdd.errors import DataError, ParameterError
from mgdd.loop import ThrottleFault, VirtualThrottle
from mgdd.rig import CanRig, SignalMap
from mgdd.rig.can.node import node_of
from mgdd.rig.can.node_core import NodeCore, node_plant

BENCH = """VERSION ""

NS_ :

BS_:

BU_: Host Node

BO_ 288 Cmd: 8 Host
 SG_ Drive : 0|16@1- (0.005,0) [-100|100] "%" Node
 SG_ Go : 16|1@1+ (1,0) [0|1] "" Node

BO_ 289 Answer: 8 Node
 SG_ Angle : 0|16@1- (0.01,0) [-300|300] "deg" Host
 SG_ Oil : 16|8@1+ (1,-40) [-40|215] "degC" Host
 SG_ Fan : 24|3@1+ (1,0) [0|7] "" Host
 SG_ Torque : 32|8@1+ (0.5,0) [0|127] "" Host

{odd}
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 288 10;
BA_ "GenMsgCycleTime" BO_ 289 10;
VAL_ 289 Angle {angle};
VAL_ 289 Oil {oil};
VAL_ 289 Fan 0 "Off" 1 "On" 2 "Fault" 3 "Invalid" 4 "not fitted" ;
VAL_ 289 Torque 254 "Error" 255 "SNA" ;
"""
BENCH_MAP = """kind = "signal_map"
format = 1
dbc = "bench.dbc"
trigger = "Answer"

[commands.Cmd]
driven = { Go = 1 }
safe = { Go = 0, Drive = 0.0 }

[commands.Cmd.inputs]
duty = { signal = "Drive", unit = "%", scale = 0.01, lower = -0.9, upper = 0.9 }

[measurements.Answer.values]
sensed_angle_deg = { signal = "Angle", unit = "deg" }
oil_c = { signal = "Oil", unit = "degC" }
fan = { signal = "Fan", unit = "-" }
torque = { signal = "Torque", unit = "-" }
"""


def bench(folder: Path, angle: str = '32767 "SNA" ', oil: str = '255 "SNA" ', odd: str = "") -> Path:
    """Write a map whose answer has these value tables, beside an odd message."""
    text = BENCH.replace("{angle}", angle).replace("{oil}", oil).replace("{odd}", odd)
    (folder / "bench.dbc").write_text(text, encoding="utf-8")
    file = folder / "bench.toml"
    file.write_text(BENCH_MAP, encoding="utf-8")
    return file


def answer(angle: int = 0, oil: int = 100, fan: int = 0, torque: int = 0) -> bytes:
    return (angle % 65536).to_bytes(2, "little") + bytes([oil, fan, torque, 0, 0, 0])


@pytest.mark.parametrize(
    "word",
    [
        "SNA", "sna", "Signal not available", "SignalNotAvailable", "NOT_AVAILABLE", "Not Available", "N/A",
        "n.a.", "NA", "Invalid", "INVALID_VALUE", "Sensor invalid", "Error", "ERR", "Err", "Fault",
        "Sensor defect", "SensorFault", "Signal Error", "Error indicator", "Reserved", "undefined",
        "Value unknown", "Sensor failure", "No signal", "SNA (Signal not available)", "Error / not available",
        "Out of range", "Short circuit", "0xFF SNA",
    ],
)  # fmt: skip
def test_a_word_for_no_measurement_is_none(tmp_path: Path, word: str) -> None:
    read = SignalMap.load(bench(tmp_path, oil=f'253 "High" 254 "{word}" ')).measurements["Answer"].read
    assert math.isnan(read(answer(oil=254))["oil_c"])
    assert (read(answer(oil=253))["oil_c"], read(answer(oil=255))["oil_c"]) == (213.0, 215.0)


@pytest.mark.parametrize(
    "word",
    ["Off", "valid", "Available", "Error free", "No fault", "Faults cleared", "Max", "Snapshot", "Nominal", "Warning",
     "Not inverted", "Terror"],
)  # fmt: skip
def test_a_word_for_a_measurement_is_a_number(tmp_path: Path, word: str) -> None:
    read = SignalMap.load(bench(tmp_path, oil=f'254 "{word}" ')).measurements["Answer"].read
    assert read(answer(oil=254))["oil_c"] == 214.0


def test_every_raw_value_of_a_name_is_missing_and_the_first_that_says_so_is_sent(tmp_path: Path) -> None:
    """Also a raw value that a tool wrote without its sign; an error is not what a node sends for what it has not."""
    message = SignalMap.load(
        bench(tmp_path, angle='32768 "Error" 32767 "SNA" ', oil='252 "Fault" 254 "SNA" 255 "SNA" ')
    ).measurements["Answer"]
    for oil in (252, 254, 255):
        assert math.isnan(message.read(answer(oil=oil))["oil_c"])
    for angle in (-32768, 32767):
        assert math.isnan(message.read(answer(angle=angle))["sensed_angle_deg"])
    (sent,) = message.payloads({"oil_c": math.nan, "sensed_angle_deg": math.nan}, {})
    assert (sent[2], sent[:2]) == (254, b"\xff\x7f")


def test_a_fault_is_a_state_of_a_switch_and_none_of_a_quantity(tmp_path: Path) -> None:
    read = SignalMap.load(bench(tmp_path)).measurements["Answer"].read
    assert [read(answer(fan=raw))["fan"] for raw in (0, 1, 2, 4)] == [0.0, 1.0, 2.0, 4.0]
    assert math.isnan(read(answer(fan=3))["fan"])
    assert [math.isnan(read(answer(torque=raw))["torque"]) for raw in (253, 254, 255)] == [False, True, True]


def test_a_name_of_two_raw_values_cannot_be_commanded(tmp_path: Path) -> None:
    file = bench(tmp_path, odd='VAL_ 288 Go 0 "No" 1 "No" ;')
    file.write_text(BENCH_MAP.replace("Go = 1", 'Go = "No"'), encoding="utf-8")
    with pytest.raises(ParameterError, match="'No': must be one of the raw values 0, 1: all have that name"):
        SignalMap.load(file)


SIGNAL = ' SG_ A : 0|8@1+ (1,0) [0|0] "" X\n'
NESTED = """BO_ 300 Odd: 8 X
 SG_ A M : 0|4@1+ (1,0) [0|0] "" X
 SG_ B m1M : 8|8@1+ (1,0) [0|0] "" X
 SG_ C m3 : 16|8@1+ (1,0) [0|0] "" X

SG_MUL_VAL_ 300 B A 1-1;
SG_MUL_VAL_ 300 C B 3-3;
"""


@pytest.mark.parametrize(
    ("odd", "why"),
    [
        (f'BO_ 300 Odd: 8 X\n{SIGNAL} SG_ B : 4|8@1+ (1,0) [0|0] "" X\n', "overlapping"),
        ('BO_ 300 Odd: 2 X\n SG_ A : 7|24@0+ (1,0) [0|15] "" X\n', "does not fit"),
        ('BO_ 300 Odd: 8 X\n SG_ A : 0|8@1+ (0,5) [0|0] "" X\n', "scale = 0"),
        ('BO_ 300 Odd: 8 X\n SG_ A : 0|8@1+ (1,0) [9|3] "" X\n', "maximum = 3"),
        (NESTED, "multiplexers A, B"),
        (f"BO_ 300 Odd: 8 X\n{SIGNAL}\nBO_ 300 Other: 8 X\n{SIGNAL}", "identifier 0x12c of Other"),
    ],
)
def test_an_odd_message_is_named_and_the_others_are_mapped(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, odd: str, why: str
) -> None:
    file = bench(tmp_path, odd=odd)
    assert "oil_c" in SignalMap.load(file).value_names
    assert "message Odd cannot be mapped: " in caplog.text
    assert why in caplog.text
    file.write_text(BENCH_MAP + '\n[measurements.Odd.values]\na = { signal = "A", unit = "-" }\n', encoding="utf-8")
    with pytest.raises(DataError, match=rf"bench\.dbc: message Odd: .*{why}.*; correct the file"):
        SignalMap.load(file)


def test_a_line_that_is_no_dbc_is_named_with_the_way_on(tmp_path: Path) -> None:
    file = bench(tmp_path, odd='VAL_ 289 Fan 3 "a" 1 ;' + " " * 3000)
    with pytest.raises(DataError, match=r"line 19.*map a copy of the file that has only the messages") as refused:
        SignalMap.load(file)
    assert len(str(refused.value)) < 500


def throttle(**settings: Any) -> VirtualThrottle:
    return VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=0.01, seed=1, **settings)


def test_what_the_plant_does_not_measure_is_missing_for_the_host_too(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with CanRig(bench(tmp_path), plant=throttle()) as rig:
        rig.apply({"duty": 0.1})
        values = rig.measure().values
    assert math.isfinite(values["sensed_angle_deg"])
    assert [name for name, value in values.items() if math.isnan(value)] == ["oil_c", "fan", "torque"]
    assert "Answer: the plant does not measure oil_c, fan, torque: sent as missing" in caplog.text


@pytest.mark.parametrize("plant", ["throttle", "engine"])
def test_a_value_that_is_not_measured_and_cannot_be_said_to_be_missing_is_refused(tmp_path: Path, plant: str) -> None:
    file = bench(tmp_path, oil='0 "Cold" ')
    if plant == "engine":  # of which nobody knows before it runs
        text = BENCH_MAP.replace("duty = {", "soc_cad = {")
        text = text.replace("scale = 0.01, lower = -0.9, upper = 0.9", "scale = 0.2, lower = -20, upper = 0")
        file.write_text(text.replace('sensed_angle_deg = { signal = "Angle", unit = "deg" }', ""), encoding="utf-8")
    signal_map = SignalMap.load(file)
    with pytest.raises(ParameterError, match=r"values of Answer = 'oil_c': must be measured by the plant .*VAL_"):
        NodeCore(node_of(signal_map), signal_map)


def test_a_sample_without_a_number_is_not_sent_as_one(tmp_path: Path) -> None:
    """A dead measurement: the frame that cannot say so is left out, one that can says so."""
    dead = [ThrottleFault(kind="nan_sample", from_s=0.05)]
    for angle, sent in (('0 "Closed" ', False), ('32767 "SNA" ', True)):
        signal_map = SignalMap.load(bench(tmp_path, angle=angle))
        core = NodeCore(node_plant(throttle(faults=dead)), signal_map)
        frames = [core.sample(k * 10_000_000) for k in range(20)]
        seen = [signal_map.measurements["Answer"].read(one.data)["sensed_angle_deg"] for row in frames for one in row]
        assert len(seen) == (20 if sent else sum(map(math.isfinite, seen)))
        assert 0 < sum(map(math.isfinite, seen)) < 20
