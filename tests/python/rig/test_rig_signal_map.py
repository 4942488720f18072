"""DBC and signal map: what is shipped, a layout of somebody else, and what is refused before anything is sent."""

import math
from pathlib import Path

import pytest

from mgdd.errors import DataError, Error, ParameterError
from mgdd.rig import SignalMap
from mgdd.rig.can.dbc import DbcFile
from user_buses import FOREIGN, FOREIGN_MAP, write_foreign

cantools = pytest.importorskip("cantools", reason="the extra `can` is not installed")

BUSES = Path(__import__("mgdd.rig.can", fromlist=["x"]).__file__).parent / "buses"
SHIPPED = ("etb", "engine")

# Identifiers, periods, lengths, scales and bounds of throttle.md 7.3, written down by hand.
ETB = {
    "ETB_Cmd": (0x120, 5, {"ThetaRef": (16, 0.01, 0, 90), "DutyFF": (12, 0.0005, -1, 1), "Mode": (3, 1, 0, 4),
                           "Enable": (1, 1, 0, 1), "Alive": (4, 1, 0, 15), "CRC8": (8, 1, 0, 255)}),
    "ETB_Status": (0x121, 5, {"Theta": (16, 0.01, -20, 120), "Omega": (16, 0.1, None, None),
                              "Duty": (12, 0.0005, -1, 1), "State": (4, 1, 0, 4), "Side": (1, 1, 0, 1),
                              "Alive": (4, 1, 0, 15), "CRC8": (8, 1, 0, 255)}),
    "ETB_Sensors": (0x122, 5, {"TPS1": (12, 1.25, 0, None), "TPS2": (12, 1.25, 0, None),
                               "Current": (12, 0.01, None, None), "Vbat": (10, 0.02, 0, None),
                               "MotorTemp": (8, 1, -40, None)}),
    "ETB_Diag": (0x123, 100, {"LimpAngle": (12, 0.025, 0, None), "MinStop": (12, 0.025, 0, None),
                              "MaxStop": (12, 0.025, 0, None)}),
    "ETB_Model": (0x124, 20, {"Bias": (12, 0.0005, None, None), "PredErr": (12, 0.02, None, None),
                              "G_A": (8, 0.01, 0, None), "Beta_A": (8, 0.002, 0, None), "CostJ": (16, 1, 0, None),
                              "SolveTime": (8, 1, 0, None)}),
    "ETB_Config": (0x125, None, {"Index": (8, 1, 0, 255), "SupplyVoltage": (32, 1, 0, 50)}),
    "ENG_Air": (0x130, 10, {"Rpm": (16, 0.25, 0, None), "Pm": (16, 10, 0, None), "P0": (8, 0.5, 0, None),
                            "Tin": (8, 1, -40, None), "MassFlow": (16, 0.01, 0, None)}),
    "PED_Pedal": (0x131, 10, {"Ped1": (12, 0.025, 0, 100), "Ped2": (12, 0.025, 0, 100), "Alive": (4, 1, 0, 15),
                              "CRC8": (8, 1, 0, 255)}),
}  # fmt: skip


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_dbc_loads_strictly_and_fits_classic_can(name: str) -> None:
    database = cantools.database.load_file(BUSES / f"{name}.dbc", strict=True)
    for message in database.messages:
        assert message.length == 8, message.name
        assert message.cycle_time or message.send_type == "event", message.name
        bits = [bit for signal in message.signals if not signal.multiplexer_ids for bit in bits_of(signal)]
        assert len(bits) == len(set(bits)), message.name
        assert max(bits) < 64
    assert len({message.frame_id for message in database.messages}) == len(database.messages)


def bits_of(signal: object) -> range:
    assert signal.byte_order == "little_endian"  # type: ignore[attr-defined]
    return range(signal.start, signal.start + signal.length)  # type: ignore[attr-defined]


def test_the_throttle_has_the_messages_that_were_agreed() -> None:
    database = cantools.database.load_file(BUSES / "etb.dbc", strict=True)
    for name, (identifier, period, signals) in ETB.items():
        message = database.get_message_by_name(name)
        assert (message.frame_id, message.cycle_time) == (identifier, period)
        for signal_name, (length, scale, low, high) in signals.items():
            signal = message.get_signal_by_name(signal_name)
            assert (signal.length, signal.scale) == (length, scale), signal_name
            assert low is None or signal.minimum == low, signal_name
            assert high is None or signal.maximum == high, signal_name
    states = database.get_message_by_name("ETB_Status").get_signal_by_name("State").choices
    assert {int(raw): str(text) for raw, text in states.items()} == dict(
        enumerate(("init", "armed", "run", "limp", "fault"))
    )
    codes = [s.name for s in database.get_message_by_name("ETB_Diag").signals if s.length == 1]
    assert len(codes) == 16


@pytest.mark.parametrize("name", SHIPPED)
def test_every_signal_comes_back_at_every_bound_and_as_cantools_reads_it(name: str) -> None:
    database = cantools.database.load_file(BUSES / f"{name}.dbc", strict=True)
    tried = 0
    for message in DbcFile.read(BUSES / f"{name}.dbc").messages.values():
        theirs = database.get_message_by_name(message.name)
        for signal in message.signals.values():
            low, high = signal.bounds
            values = (0.0, 1.0) if signal.multiplexer else (low, high, 0.5 * (low + high), max(low, 0.0))
            for value in values:
                payload = bytes(message.size)
                if signal.branches:
                    assert message.multiplexer is not None
                    payload = message.multiplexer.layout.pack_raw(payload, signal.branches[0])
                payload = signal.layout.pack(payload, value)
                back = signal.layout.unpack(payload)
                step = abs(signal.layout.scale) if not signal.layout.raw_type.startswith("float") else 0.0
                assert back == pytest.approx(value, abs=0.5 * step + 1e-9)
                decoded = theirs.decode(payload, decode_choices=False)
                assert decoded[signal.name] == pytest.approx(back, rel=1e-12, abs=1e-12)
                tried += 1
    assert tried > 150


@pytest.mark.parametrize("name", SHIPPED)
def test_a_missing_value_lies_outside_of_the_range(name: str) -> None:
    for message in DbcFile.read(BUSES / f"{name}.dbc").messages.values():
        for signal in message.signals.values():
            if signal.missing_raw is not None:
                raw = signal.layout.pack_raw(bytes(8), signal.missing_raw)
                low, high = signal.bounds
                assert not low <= signal.layout.unpack(raw) <= high, (message.name, signal.name)


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    return write_foreign(tmp_path)


def test_a_layout_of_somebody_else(foreign: Path) -> None:
    """Big endian, identifiers of 29 bits, multiplexed, another CRC, other units: as cantools reads it."""
    made = SignalMap.load(foreign)
    command = made.commands["Cmd"]
    assert command.key == (0x18FF00FE, True)
    assert command.timeout_s == pytest.approx(0.03)
    assert command.e2e is not None
    assert (command.e2e.crc, command.e2e.counter_place, command.e2e.counter_byte) == ("h2f", "low_nibble", 1)
    theirs = cantools.database.load_file(foreign.parent / "foreign.dbc", strict=True)
    (payload,) = command.payloads({"duty": -0.43}, command.driven)
    assert theirs.get_message_by_name("Cmd").decode(payload) == {"Check": 0, "Count": 0, "Go": 1, "Drive": -43.0}
    assert command.drives(payload)
    (off,) = command.payloads({}, command.safe)
    assert not command.drives(off)
    answer = made.measurements["Answer"]
    payloads = answer.payloads({"sensed_angle_deg": 33.0, "current_a": -2.5}, {}, {"duty": 0.2})
    assert len(payloads) == 2
    decoded = [theirs.get_message_by_name("Answer").decode(payload) for payload in payloads]
    assert decoded[0]["Angle"] == pytest.approx(math.radians(33.0), abs=5e-5)
    assert (decoded[1]["Current"], decoded[1]["Used"]) == (-2.5, 20.0)
    assert set(answer.read(payloads[0])) == {"sensed_angle_deg"}
    assert answer.read(payloads[1]) == {"current_a": -2.5}
    assert answer.read_applied(payloads[1]) == {"duty": pytest.approx(0.2)}


WRONG = [
    ('trigger = "Done"', 'trigger = "Don"', ParameterError, r"trigger = 'Don': must be one of the measurements"),
    ("[commands.Cmd.inputs]", "[commands.Cmd.inputz]", ParameterError, r"commands.Cmd.inputz = .*inputs"),
    ("[commands.Cmd", "[commands.Kmd", DataError, r"\[commands.Kmd\]: foreign.dbc has no .*'Cmd'"),
    ('signal = "Drive"', 'signal = "Driev"', ParameterError, r"duty.signal = 'Driev': .*did you mean 'Drive'"),
    ('"Angle", unit = "rad"', '"Current", unit = "A"', ParameterError, "mapped once: .*sensed_angle_deg has it too"),
    ('signal = "Current", unit = "A"', 'signal = "Current", unit = "mA"', ParameterError, "unit = 'mA': must be 'A'"),
    ('"rad", scale = 57.29577951308232', '"rad"', ParameterError, "unit = 'rad': must be 'deg' as .* give scale"),
    ("upper = 0.9", "upper = 1.1", ParameterError, r"inputs.duty = \[-0.9, 1.1\]: must be .* range of Cmd.Drive"),
    ("lower = -0.9, ", "", DataError, "inputs.duty.lower is missing"),
    ("driven = { Go = 1 }", "driven = {}", ParameterError, "a value of Go too"),
    (", Drive = 0.0 }", " }", ParameterError, "a value of Drive: what is sent when the rig is left"),
    ('driven = { Go = 1 }', 'driven = { Go = "yes" }', ParameterError, "Go = 'yes': must be a name of its value table"),
    ("driven = { Go = 1 }", "driven = { Go = 2 }", ParameterError, r"Go = 2: must be within \[0, 1\]"),
    ('crc = "Check"', 'crc = "Drive"', ParameterError, "crc = 'Drive': must be a signal of 8 bits"),
    ('counter = "Count"', 'counter = "Go"', ParameterError, "counter = 'Go': must be a signal of 4 bits"),
    ("data_id = 7", "data_id = 70000", ParameterError, "data_id = 70000"),
    ('profile = "h2f"', 'profile = "h2"', ParameterError, "e2e.profile = 'h2': must be sae_j1850, h2f or"),
    ('e2e = { profile', 'timeout_ms = 10\ne2e = { profile', ParameterError, "timeout_ms = 10: must be above"),
    ('[measurements.Answer.applied]\nduty', '[measurements.Answer.applied]\ndudy', ParameterError, "mean 'duty'"),
    ("format = 1", "format = 2", ParameterError, "format = 2: must be 1"),
    ('"signal_map"', '"engine"', ParameterError, "kind = 'engine': must be 'signal_map'"),
    ('dbc = "foreign.dbc"', "", DataError, "dbc is missing: it must be text"),
    ("[measurements.Done]", 'limits = ["p"]\n[measurements.Done]', ParameterError, "limits"),
    ("[measurements.Done]\n", '[measurements.Done.values]\ncurrent_a = { signal = "Beat", unit = "-", scale = 0.1 }\n',
     ParameterError, "'current_a' is mapped twice: Answer has it too; remove one"),
    ('scale = 0.01, lower', 'scale = 0.0, lower', ParameterError, "scale = 0: must be finite and not 0"),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "kind", "text"), WRONG, ids=[row[3][:30] for row in WRONG])
def test_a_wrong_map_is_refused_by_name(foreign: Path, right: str, wrong: str, kind: type[Error], text: str) -> None:
    assert right in FOREIGN_MAP
    foreign.write_text(FOREIGN_MAP.replace(right, wrong), encoding="utf-8")
    with pytest.raises(kind, match=text) as refused:
        SignalMap.load(foreign)
    assert str(foreign) in str(refused.value)


@pytest.mark.parametrize(
    ("right", "wrong", "text"),
    [
        ("SG_ Go : 15|1@0+", "SG_ Go : 10|1@0+", "overlap"),
        ("SG_ Drive : 20|13@0-", "SG_ Drive : 60|13@0-", "fit"),
        ("BO_ 2566848766 Cmd: 8 PC\n", "BO_ Cmd\n", "cannot be read|Invalid syntax"),
    ],
)
def test_a_wrong_dbc_is_refused_by_name(foreign: Path, right: str, wrong: str, text: str) -> None:
    dbc = foreign.parent / "foreign.dbc"
    assert right in FOREIGN
    dbc.write_text(FOREIGN.replace(right, wrong), encoding="utf-8")
    with pytest.raises(DataError, match=text) as refused:
        SignalMap.load(foreign)
    assert str(dbc) in str(refused.value)


def test_files_that_are_not_there(foreign: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"did you mean 'foreign.toml'"):
        SignalMap.load(foreign.with_name("foreignn.toml"))
    (foreign.parent / "foreign.dbc").unlink()
    with pytest.raises(FileNotFoundError, match="no such file"):
        SignalMap.load(foreign)
    foreign.write_text("kind = [", encoding="utf-8")
    with pytest.raises(DataError, match="not valid TOML"):
        SignalMap.load(foreign)
    foreign.write_bytes('kind = "Träger"'.encode("latin-1"))
    with pytest.raises(DataError, match="not a UTF-8 text file"):
        SignalMap.load(foreign)


def test_goals_are_values_that_are_measured() -> None:
    engine = SignalMap.load("engine")
    other = engine.with_goals(limits=["t_max_k"], objective={"nox_fast_ppm": -0.004, "imep_gross_bar": 2.0})
    assert (other.limits, dict(other.objective)) == (("t_max_k",), {"nox_fast_ppm": -0.004, "imep_gross_bar": 2.0})
    assert engine.limits == ("p_max_bar", "dp_max_bar_per_cad")
    with pytest.raises(ParameterError, match=r"limits = 't_mxa_k': .* did you mean 't_max_k'"):
        engine.with_goals(limits=["t_mxa_k"])
    with pytest.raises(ParameterError, match="objective of t_max_k = nan: must be finite"):
        engine.with_goals(objective={"t_max_k": math.nan})


def test_packing_is_clamped_and_says_what_is_missing() -> None:
    status = SignalMap.load("etb").measurements["ETB_Status"]
    entry = status.signals["sensed_angle_deg"]
    for value, read in [(1e9, 120.0), (-math.inf, -20.0), (math.inf, 120.0), (12.344, 12.34), (math.nan, math.nan)]:
        back = entry.unpack(entry.pack(bytes(8), value))
        assert back == pytest.approx(read, nan_ok=True), value
    side = SignalMap.load("engine").measurements["ENG_Status"].signals["misfire"]
    with pytest.raises(ParameterError):
        side.pack(bytes(8), math.nan)
