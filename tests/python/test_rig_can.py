"""A rig over a bus: who is there, arming, leaving, and a node that trusts nobody."""

from __future__ import annotations

import io
import math
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from foreign_bus import write_foreign
from mgdd._core.rig import Frame
from mgdd.errors import DataError, ParameterError, RigError
from mgdd.loop import EngineBench, Measurement, VirtualThrottle
from mgdd.rig import CanRig, CanTransport, Recorder, RecordingRig, ReplayRig, Rig, RigRecord, SignalMap
from mgdd.rig.can.frame import changed
from mgdd.rig.can.inbox import Inbox
from mgdd.rig.can.link import Sender
from mgdd.rig.can.modes import RigMode, key_line
from mgdd.rig.can.node import node_of, run_node
from mgdd.rig.can.node_core import NodeCore, node_plant
from mgdd.rig.can.replay_bus import ReplayBus

pytest.importorskip("can", reason="the extra `can` is not installed")
pytest.importorskip("cantools", reason="the extra `can` is not installed")

ETB = SignalMap.load("etb")
LONG_S = 5.0  # nothing here waits so long, unless it fails


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) - before == set()


@contextmanager
def node(channel: str, *, step: bool = True, signal_map: SignalMap = ETB, seed: int = 1) -> Iterator[NodeCore]:
    """A node of this process behind a virtual bus."""
    core = NodeCore(node_of(signal_map, seed=seed), signal_map)
    stop = threading.Event()
    with CanTransport("virtual", channel) as bus:
        serving = threading.Thread(
            target=lambda: run_node(core, bus, step=step, keep_on=lambda: not stop.is_set()), daemon=True
        )
        serving.start()
        try:
            yield core
        finally:
            stop.set()
            serving.join()


def rig_on(channel: str, mode: str = "hil", **settings: object) -> CanRig:
    return CanRig(ETB, f"virtual:{channel}", mode=mode, timeout_s=LONG_S, **settings)  # type: ignore[arg-type]


def commands(spy: CanTransport) -> list[bytes]:
    """Frames of the host that the spy has seen."""
    out, until = [], time.monotonic() + 0.3  # a node with a clock never falls silent
    while time.monotonic() < until and (frame := spy.receive(0.05)) is not None:
        out += [frame.data] if frame.id == 0x120 else []
    return out


def is_safe(payload: bytes) -> bool:
    """Mode off, bridge open, duty 0: bits of the DBC by hand."""
    word = int.from_bytes(payload, "little")
    return (word >> 12) & 7 == 0 and (word >> 15) & 1 == 0 and (word >> 32) & 0xFFF == 0


# --- modes --------------------------------------------------------------------------------------------------


def test_nothing_is_sent_because_an_argument_was_forgotten() -> None:
    with CanTransport("virtual", "forgotten") as spy:
        with pytest.raises(ParameterError, match="mode = 'simulate': must be said for a bus: 'hil'"):
            CanRig("etb", "virtual:forgotten")
        with pytest.raises(ParameterError, match="plant = None: must be given for mode='simulate'"):
            CanRig("etb")
        with pytest.raises(ParameterError, match="mode = 'hil': must have a bus, and no plant"):
            CanRig("etb", plant=VirtualThrottle(), mode="hil")
        with pytest.raises(ParameterError, match="mode = 'real': must be one of simulate, hil, dry_run, replay, bench"):
            CanRig("etb", "virtual:forgotten", mode="real")
        with pytest.raises(ParameterError, match="timeout_s = 0: must be > 0 s"):
            CanRig("etb", "virtual:forgotten", mode="hil", timeout_s=0.0)
        assert spy.receive(0.0) is None


def test_the_bench_needs_a_person_or_a_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    key = tmp_path / "bench.key"
    with CanTransport("virtual", "bench") as spy, node("bench"):
        for arm, file, text in [
            (False, key, "mode = 'bench' drives real hardware: give arm=True"),
            (True, key, "no such key file: write the line 'arm etb.dbc "),
            (True, None, "without a terminal to confirm in: give a key_file"),
        ]:
            monkeypatch.setattr("sys.stdin", io.StringIO())
            with pytest.raises(RigError, match=text):
                rig_on("bench", "bench", arm=arm, key_file=file).open()
        key.write_text("arm etb.dbc 000000000000\n", encoding="utf-8")
        with pytest.raises(RigError, match="holds no key of this DBC"):
            rig_on("bench", "bench", arm=True, key_file=key).open()
        assert commands(spy) == []
        key.write_text(key_line(ETB) + "\n", encoding="utf-8")
        with rig_on("bench", "bench", arm=True, key_file=key) as rig:
            rig.apply({"duty": 0.2})
            assert rig.measure().applied == {"duty": pytest.approx(0.2)}
        assert rig.mode is RigMode.BENCH


class Terminal:
    """A person at a keyboard."""

    def __init__(self, said: str) -> None:
        self.said = said

    def isatty(self) -> bool:
        return True

    def readline(self) -> str:
        return self.said + "\n"


def test_a_person_confirms_by_a_word(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    with node("person"):
        monkeypatch.setattr("sys.stdin", Terminal("yes"))
        with pytest.raises(RigError, match="not confirmed: nothing was sent"):
            rig_on("person", "bench", arm=True).open()
        monkeypatch.setattr("sys.stdin", Terminal("ARM"))
        with rig_on("person", "bench", arm=True) as rig:
            assert rig.state == "armed"
    assert "virtual:person will be driven with etb.toml" in capsys.readouterr().err


def test_a_dry_run_receives_and_sends_nothing() -> None:
    with CanTransport("virtual", "dry") as spy, node("dry", step=False) as core:
        with rig_on("dry", "dry_run") as rig:
            for _ in range(3):
                rig.apply({"duty": 0.8})
                measured = rig.measure()
            assert 5.0 < measured.values["sensed_angle_deg"] < 12.0
            assert measured.applied == {"duty": 0.0}
        assert commands(spy) == []
        assert core.state == "init"


# --- leaving ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["end", "error", "nan", "exit"])
def test_leaving_sends_five_safe_frames_and_then_nothing(way: str) -> None:
    with CanTransport("virtual", "leave") as spy, node("leave") as core:
        raised: type[BaseException] = {"error": ZeroDivisionError, "nan": ParameterError, "exit": SystemExit}.get(
            way, RuntimeError
        )
        try:
            with rig_on("leave") as rig:
                for _ in range(4):
                    rig.apply({"duty": 0.7})
                    rig.measure()
                if way == "error":
                    raise ZeroDivisionError
                if way == "nan":
                    rig.apply({"duty": math.nan})
                if way == "exit":
                    raise SystemExit
        except raised:
            assert way != "end"
        sent = commands(spy)
        assert not any(map(is_safe, sent[-9:-5]))
        assert all(map(is_safe, sent[-5:]))
        assert all(map(is_safe, sent[:-9]))  # those that armed it
        assert len(sent) >= 3 + 4 + 5  # a slow answer is asked for again
        until = time.monotonic() + LONG_S
        while core.state != "armed" and time.monotonic() < until:
            time.sleep(0.005)
        assert core.state == "armed"


def drive_until_killed(number: signal.Signals) -> None:
    with rig_on("signal") as rig:
        rig.apply({"duty": 0.7})
        os.kill(os.getpid(), number)
        time.sleep(LONG_S)


@pytest.mark.parametrize(("number", "raised"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit)])
def test_signals_leave_by_the_exit(number: signal.Signals, raised: type[BaseException]) -> None:
    before = signal.signal(number, signal.SIG_IGN)  # as a shell leaves SIGINT to its background jobs
    try:
        with CanTransport("virtual", "signal") as spy, node("signal"):
            with pytest.raises(raised):
                drive_until_killed(number)
            assert all(map(is_safe, commands(spy)[-5:]))
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, before)


def test_a_dead_bus_does_not_hide_why_it_was_left(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise RigError("gone")

    def lose_the_bus() -> None:
        with rig_on("dead") as rig:
            rig.apply({"duty": 0.7})
            monkeypatch.setattr(rig.bus, "send", refuse)
            raise ZeroDivisionError

    with node("dead"), pytest.raises(ZeroDivisionError):
        lose_the_bus()


# --- who is there -------------------------------------------------------------------------------------------


def test_a_bus_without_peers_is_named_and_left() -> None:
    begin = time.monotonic()
    rig = CanRig(ETB, "virtual:empty", mode="hil", timeout_s=0.05)
    with pytest.raises(RigError, match=r"virtual:empty: within 1 s no frame ETB_Status \(0x121\) came; .*seen: none"):
        rig.open()
    assert time.monotonic() - begin < 30.0
    with pytest.raises(RigError, match="not open"):
        rig.apply({"duty": 0.0})


def test_a_node_of_another_dbc_is_told_by_what_it_sends() -> None:
    with node("other", step=False, signal_map=SignalMap.load("engine")):
        rig = CanRig(ETB, "virtual:other", mode="hil", timeout_s=0.05)
        with pytest.raises(RigError, match=r"no frame ETB_Status .*identifiers seen: 0x210, 0x211"):
            rig.open()


def test_a_node_with_another_data_identifier_has_no_valid_frame(tmp_path: Path) -> None:
    (tmp_path / "etb.dbc").write_bytes(ETB.dbc.file.read_bytes())
    file = tmp_path / "etb.toml"
    file.write_text(
        ETB.file.read_text(encoding="utf-8").replace("data_id = 0x121", "data_id = 0x999"), encoding="utf-8"
    )
    with node("crc", step=False, signal_map=SignalMap.load(file)):
        rig = CanRig(ETB, "virtual:crc", mode="hil", timeout_s=0.05)
        with pytest.raises(RigError, match=r"frames ETB_Status \(0x121\) came, too few of them valid .*wrong_crc"):
            rig.open()


def test_two_nodes_with_the_identifier_of_the_measurement() -> None:
    stop = threading.Event()
    status = ETB.measurements["ETB_Status"]

    def report(bus: CanTransport) -> None:
        one, other = Sender(), Sender()
        other.frames(status, [bytes(8)] * 7)  # it was switched on earlier
        while not stop.wait(0.004):
            for sender in (one, other):
                for frame in sender.frames(status, [bytes(8)]):
                    bus.send(frame)

    with CanTransport("virtual", "twins") as bus, CanTransport("virtual", "twins") as spy:
        busy = threading.Thread(target=report, args=(bus,))
        busy.start()
        try:
            with pytest.raises(RigError, match=r"alive counter of ETB_Status \(0x121\) jumps .*two nodes send it"):
                rig_on("twins").open()
        finally:
            stop.set()
            busy.join()
        assert commands(spy) == []


def test_another_host_is_found_before_anything_is_sent() -> None:
    stop = threading.Event()
    with CanTransport("virtual", "hosts") as other, CanTransport("virtual", "hosts") as spy, node("hosts"):
        sender = Sender()
        command = ETB.commands["ETB_Cmd"]

        def drive() -> None:
            while not stop.wait(0.004):
                for frame in sender.frames(command, command.payloads({"duty": 0.1}, command.driven)):
                    other.send(frame)

        busy = threading.Thread(target=drive)
        busy.start()
        rig = rig_on("hosts")
        try:
            with pytest.raises(
                RigError, match="frame 0x120 arrived, which this host sends: two nodes have one identifier"
            ):
                rig.open()
        finally:
            stop.set()
            busy.join()
        assert not any(map(is_safe, commands(spy)))
        assert rig.counters["commands"] == 0


# --- the node -----------------------------------------------------------------------------------------------


class Host:
    """The host of a core without a bus: frames and time by hand."""

    def __init__(self, core: NodeCore) -> None:
        self.core, self.sender, self.now_ns = core, Sender(), 10**9
        self.command = ETB.commands["ETB_Cmd"]

    def frame(self, duty: float | None) -> Frame:
        """A command with this duty, or a safe one."""
        payloads = (
            self.command.payloads({}, self.command.safe)
            if duty is None
            else self.command.payloads({"duty": duty}, self.command.driven)
        )
        (frame,) = self.sender.frames(self.command, payloads)
        return changed(frame, monotonic_ns=self.now_ns)

    def send(self, duty: float | None, times: int = 1) -> None:
        for _ in range(times):
            self.core.take(self.frame(duty))
            self.wait(0.005)

    def wait(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)
        self.core.watch(self.now_ns)


@pytest.fixture
def host() -> Host:
    return Host(NodeCore(node_of(ETB, seed=1), ETB))


def test_a_node_has_to_be_armed_before_it_is_driven(host: Host) -> None:
    host.send(0.5, 20)
    assert host.core.state == "init"
    host.send(None, 2)
    assert host.core.state == "init"
    host.send(0.5)
    host.send(None, 3)
    assert host.core.state == "armed"
    host.send(0.5)
    assert host.core.state == "run"
    host.send(None)
    assert host.core.state == "armed"


def running(host: Host) -> None:
    host.send(None, 5)
    host.send(0.5, 3)
    assert host.core.state == "run"


def test_a_late_command_opens_the_bridge_and_only_arming_closes_it(host: Host) -> None:
    running(host)
    host.wait(0.014)
    assert host.core.state == "run"
    host.wait(0.007)  # 5 + 14 + 7 ms after the last one, with a limit of 20 ms
    assert (host.core.state, host.core.reasons) == ("limp", {"command_timeout": 1})
    host.send(0.5, 50)
    assert host.core.state == "limp"
    running(host)


def test_broken_commands_are_ignored_and_three_of_them_open_the_bridge(host: Host) -> None:
    running(host)
    for _ in range(2):
        bad = host.frame(0.9)
        host.core.take(changed(bad, data=bad.data[:-1] + bytes([bad.data[-1] ^ 0x10])))
        assert host.core.state == "run"
    assert host.core._inputs == {"duty": 0.5}
    host.send(0.4)  # one good frame between
    for k in range(3):
        bad = host.frame(0.9)
        host.core.take(changed(bad, data=bytes([bad.data[0] ^ 1]) + bad.data[1:]))
        assert host.core.state == ("limp" if k == 2 else "run")
    assert host.core.reasons == {"wrong_crc": 1}


def test_a_frozen_sender_is_not_one_that_lives(host: Host) -> None:
    running(host)
    frozen = host.frame(0.5)
    host.core.take(frozen)
    for _ in range(3):
        host.wait(0.004)
        host.core.take(changed(frozen, monotonic_ns=host.now_ns))
    assert (host.core.state, host.core.reasons) == ("limp", {"wrong_counter": 1})


def test_a_mode_that_the_node_does_not_have_is_not_driven_and_does_not_arm(host: Host) -> None:
    def in_mode(name: str) -> Frame:
        mode = host.command.message.signals["Mode"]
        raws = {**host.command.driven, "Mode": mode.choices[name]}
        (frame,) = host.sender.frames(host.command, host.command.payloads({"duty": 0.5}, raws))
        return changed(frame, monotonic_ns=host.now_ns)

    for _ in range(10):
        host.core.take(in_mode("position"))
    assert host.core.state == "init"
    running(host)
    host.core.take(in_mode("calib"))
    assert not host.core.driven
    host.send(0.5)
    assert host.core.driven


def test_what_came_too_long_ago_is_missing() -> None:
    core = NodeCore(node_of(ETB, seed=1), ETB)
    inbox = Inbox(ETB)
    seen = []
    for cycle in range(12):
        for frame in core.sample():
            if frame.id != 0x122 or cycle < 5:  # the sensors fall silent
                inbox.take(frame)
        if inbox.ready:
            seen.append(inbox.read().values)
    limit = 3  # cycles, as the map says nothing else
    assert [math.isnan(values["first_v"]) for values in seen] == [False] * (3 + limit) + [True] * (7 - limit)
    assert not any(math.isnan(values["sensed_angle_deg"]) for values in seen[1:])


def test_foreign_and_short_frames_change_nothing(host: Host) -> None:
    running(host)
    good = host.frame(0.5)
    assert not host.core.take(changed(good, id=0x121))
    assert not host.core.take(changed(good, extended=True))
    assert not host.core.take(changed(good, data=good.data[:7]))
    assert host.core.state == "run"


def test_in_steps_a_command_that_comes_twice_is_one_sample(host: Host) -> None:
    running(host)
    frame = host.frame(0.5)
    assert host.core.take(frame)
    host.core.answer()
    assert not host.core.take(frame)


def test_without_drive_the_plate_is_at_limp_home_and_an_engine_stands(host: Host) -> None:
    running(host)
    for _ in range(40):
        host.send(0.5)
        host.core.sample()
    assert host.core.last is not None
    assert host.core.last.values["angle_deg"] > 40.0
    host.wait(0.1)
    for _ in range(80):
        host.core.sample()
    assert host.core.last.values["angle_deg"] == pytest.approx(8.0, abs=1.0)
    assert host.core.last.applied == {"duty": 0.0}
    engine = node_plant(EngineBench())
    assert engine.sample(None) == ({}, {})


def measure_all(rig: CanRig, times: int) -> None:
    for _ in range(times):
        rig.measure()


def test_a_late_command_is_seen_over_the_bus_and_arming_mends_it() -> None:
    with node("late", step=False), rig_on("late") as rig:
        tried = 0
        while True:  # on a machine that stops for 20 ms the node lets go, and is armed again
            tried += 1
            rig.apply({"duty": 0.5})
            time.sleep(0.1)
            rig.bus.receive(0.0)
            with pytest.raises(RigError, match="node is in state 'limp' and does not drive; look for the cause"):
                measure_all(rig, 3)
            rig.arm()
            rig.apply({"duty": 0.5})
            try:
                assert "sensed_angle_deg" in rig.measure().values
            except RigError:
                assert tried < 10
                continue
            break


def test_a_node_needs_the_inputs_of_its_map_and_a_bridge_that_opens() -> None:
    with pytest.raises(ParameterError, match="inputs of the map = 'soc_cad': must be those of the plant, duty"):
        NodeCore(node_of(ETB), SignalMap.load("engine"))
    with pytest.raises(ParameterError, match="with 'bridge_open': power off means an open bridge"):
        node_plant(VirtualThrottle())
    with pytest.raises(ParameterError, match=r"soi_cad.*those of a virtual throttle"):
        node_of(SignalMap.load("surrogate"))
    with pytest.raises(ParameterError, match="fault = 'offset:sensor=1': must be left out"):
        node_of(SignalMap.load("engine"), faults=["offset:sensor=1"])
    with pytest.raises(ParameterError, match="did you mean 'from_s'"):
        node_of(ETB, faults=["jammed:form_s=1"])


def test_faults_of_the_plant_reach_the_host() -> None:
    core = NodeCore(node_of(ETB, faults=["short_to_ground:sensor=2", "jammed_at:size=20"]), ETB)
    values = [core.plant.sample({"duty": 0.6}).values for _ in range(40)][-1]
    assert values["second_v"] == pytest.approx(0.0, abs=0.01)
    assert values["angle_deg"] == pytest.approx(20.0, abs=0.5)


# --- maps of somebody else ------------------------------------------------------------------------------------


def test_a_throttle_behind_a_bus_of_somebody_else(tmp_path: Path) -> None:
    """No state to be asked, multiplexed answers, a trigger without protection: the node is driven all the same."""
    straight = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=0.01, seed=4)
    plant = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=0.01, seed=4)
    with CanRig(write_foreign(tmp_path), plant=plant) as rig:
        for k in range(30):
            duty = 0.00025 * round(4000 * 0.3 * math.sin(0.4 * k))
            rig.apply({"duty": duty})
            measured = rig.measure()
            straight.apply({"duty": duty, "bridge_open": 0.0})
            wanted = straight.measure().values
            assert measured.values["sensed_angle_deg"] == pytest.approx(wanted["sensed_angle_deg"], abs=3e-3)
            assert measured.values["current_a"] == pytest.approx(wanted["current_a"], abs=5.1e-4)
            assert measured.applied == {"duty": pytest.approx(duty, abs=1e-9)}


def test_a_multiplexed_command_carries_one_input_per_frame(tmp_path: Path) -> None:
    """Supply and torque of the air by ETB_Config, which is sent on events and has no safe frame."""
    (tmp_path / "etb.dbc").write_bytes(ETB.dbc.file.read_bytes())
    file = tmp_path / "config.toml"
    more = """
[commands.ETB_Config.inputs]
supply_v = { signal = "SupplyVoltage", unit = "V", lower = 6.0, upper = 16.0 }
airflow_torque_nm = { signal = "AirflowTorque", unit = "N m", lower = -5.0, upper = 5.0 }

[commands.ETB_Cmd]
"""
    text = ETB.file.read_text(encoding="utf-8")
    file.write_text(text.replace("\n[commands.ETB_Cmd]\n", more), encoding="utf-8")
    names = ["supply_v", "airflow_torque_nm", "duty"]
    frames: list[Frame] = []
    plant = VirtualThrottle(inputs=[*names, "bridge_open"], sample_s=5e-3, seed=4)
    straight = VirtualThrottle(inputs=[*names, "bridge_open"], sample_s=5e-3, seed=4)
    with CanRig(file, plant=plant, on_frame=frames.append) as rig:
        assert rig.input_names == ("supply_v", "airflow_torque_nm", "duty")
        for supply in (8.0, 13.5):
            for _ in range(10):
                given = {"supply_v": supply, "airflow_torque_nm": -0.125, "duty": 0.5}
                rig.apply(given)
                measured = rig.measure()
                straight.apply({**given, "bridge_open": 0.0})
                wanted = straight.measure().values
            assert measured.values["supply_v"] == pytest.approx(supply)
            assert measured.values["sensed_angle_deg"] == pytest.approx(wanted["sensed_angle_deg"], abs=5.1e-3)
    config = [frame.data for frame in frames if frame.id == 0x125]
    assert len(config) == 2 * 20
    assert {data[0] for data in config} == {0, 1}


# --- replay of frames ---------------------------------------------------------------------------------------


def recorded_run(duties: list[float]) -> tuple[list[Frame], list[Measurement]]:
    frames: list[Frame] = []
    with CanRig(ETB, plant=VirtualThrottle(inputs=["duty", "bridge_open"], seed=2), on_frame=frames.append) as rig:
        measured = []
        for duty in duties:
            rig.apply({"duty": duty})
            measured.append(rig.measure())
    return frames, measured


def replayed(frames: list[Frame], duties: list[float], *, strict: bool = True) -> tuple[list[Measurement], ReplayBus]:
    bus = ReplayBus(frames, ETB, strict=strict)
    with CanRig(ETB, bus, mode="replay") as rig:
        out = []
        for duty in duties:
            rig.apply({"duty": duty})
            out.append(rig.measure())
    return out, bus


DUTIES = [0.1 * (k % 7) for k in range(30)]


def test_recorded_frames_pass_the_same_checks_and_give_the_same_measurements() -> None:
    frames, measured = recorded_run(DUTIES)
    assert sum(not frame.received for frame in frames) == 5 + 30 + 5  # three usable safe frames arm it
    again, _ = replayed(frames, DUTIES)
    assert [m.values for m in again] == [m.values for m in measured]
    assert [m.applied for m in again] == [m.applied for m in measured]
    frames[-20] = changed(frames[-20], data=bytes(8))
    with pytest.raises(RigError):  # a changed frame of the record is seen as on the bus
        replayed(frames, DUTIES)


def test_a_replay_of_frames_says_where_a_command_differs() -> None:
    frames, measured = recorded_run(DUTIES)
    other = [*DUTIES]
    other[12] += 0.25
    with pytest.raises(RigError, match=r"command 12: {'duty': 0.75.*} was asked for, {'duty': 0.5} is recorded"):
        replayed(frames, other)
    again, bus = replayed(frames, other, strict=False)
    assert [number for number, _, _ in bus.differences] == [12]
    assert [m.values for m in again] == [m.values for m in measured]
    with pytest.raises(RigError, match="the record ends after 30 commands"):
        replayed(frames, [*DUTIES, 0.0])


def test_a_run_in_real_time_is_replayed_from_its_file(tmp_path: Path) -> None:
    """Frames through the checks, and measurements as they were: both from one record."""
    patient = tmp_path / "patient.toml"  # a node that does not let go when this machine stops for a moment
    (tmp_path / "etb.dbc").write_bytes(ETB.dbc.file.read_bytes())
    text = ETB.file.read_text(encoding="utf-8").replace("timeout_ms = 20", "timeout_ms = 20000")
    patient.write_text(text, encoding="utf-8")
    file = tmp_path / "run.rec"
    with Recorder(file) as recorder, node("record", step=False, signal_map=SignalMap.load(patient)):
        live = rig_on("record", on_frame=recorder.frame)
        with RecordingRig(live, lambda row: recorder.sample("rig", row)) as rig:
            for duty in DUTIES:
                rig.apply({"duty": duty})
                rig.measure()
    measured = [exchange.measurement.values for exchange in map(rig.record.__getitem__, range(len(DUTIES)))]
    with CanRig(ETB, ReplayBus.read(file, ETB), mode="replay") as again:
        np.testing.assert_equal([answer(again, duty) for duty in DUTIES], measured)
    with ReplayRig(RigRecord.read(file)) as again:
        np.testing.assert_equal([answer(again, duty) for duty in DUTIES], measured)
    with pytest.raises(DataError, match="has no table 'bench': it has rig"):
        RigRecord.read(file, table="bench")


def answer(rig: Rig, duty: float) -> dict[str, float]:
    rig.apply({"duty": duty})
    return dict(rig.measure().values)
