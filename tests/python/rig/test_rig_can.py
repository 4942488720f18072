"""A rig over a bus: modes, who is there, arming and leaving."""

import contextlib
import io
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bus_node import ETB, LONG_S, commands, is_safe, node, rig_on
from mgdd.errors import ParameterError, RigError
from mgdd.loop import VirtualThrottle
from mgdd.rig import CanRig, SignalMap
from mgdd.rig.can.can_rig import key_line, may_be_real
from mgdd.rig.can.link import Punctual, Sender
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.realtime import Frame
from user_buses import write_bus

pytestmark = pytest.mark.usefixtures("no_thread_is_left")


def test_nothing_is_sent_because_an_argument_was_forgotten() -> None:
    with CanTransport("virtual", "forgotten") as spy:
        with pytest.raises(ParameterError, match="mode = 'simulate': must be given for a bus: 'hil'"):
            CanRig("etb", "virtual:forgotten")
        with pytest.raises(ParameterError, match="plant = None: must be given for mode='simulate'"):
            CanRig("etb")
        with pytest.raises(ParameterError, match="mode = 'hil': must have a bus, and no plant"):
            CanRig("etb", plant=VirtualThrottle(), mode="hil")
        with pytest.raises(ParameterError, match="mode = 'real': must be one of simulate, hil, dry_run, bench"):
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
        assert rig.mode == "bench"


@pytest.mark.parametrize(
    ("bus", "stays"),
    [
        ("virtual:x", True),
        ("socketcan:vcan0", True),
        ("socketcand:can0?host=127.0.0.1&port=29536", True),
        ("socketcan:can0", False),
        ("socketcand:can0?host=10.0.0.7&port=29536", False),
        ("pcan:PCAN_USBBUS1", False),
    ],
)
def test_hil_on_a_bus_that_leaves_this_machine_is_armed_as_a_bench(bus: str, stays: bool) -> None:
    """What answers there may be a real plate."""
    assert CanTransport.parse(bus).stays_here == stays
    rig = CanRig("etb", bus, mode="hil")
    assert may_be_real(rig.mode, rig.bus) != stays
    assert may_be_real("bench", rig.bus)
    assert not may_be_real("dry_run", rig.bus)
    if not stays:
        with pytest.raises(RigError, match=r"mode = 'hil' on .*, which leaves this machine, may, too: give arm=True"):
            rig.open()


class Terminal(io.StringIO):
    """A person at a keyboard."""

    def isatty(self) -> bool:
        return True


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
        assert core.gate.mode == "init"


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
        while core.gate.mode != "armed" and time.monotonic() < until:
            time.sleep(0.005)
        assert core.gate.mode == "armed"


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


@pytest.mark.parametrize(
    ("other", "text"),
    [
        (None, r"virtual:there: within 1 s no frame ETB_Status \(0x121\) came; .*seen: none"),
        (SignalMap.load("engine").file, r"no frame ETB_Status .*identifiers seen: 0x210, 0x211"),
        ("0x999", r"frames ETB_Status \(0x121\) came, too few of them valid .*wrong_crc"),  # another data identifier
    ],
)
def test_a_bus_without_its_node_is_named_by_what_came_and_left(
    other: Path | str | None, text: str, tmp_path: Path
) -> None:
    begin = time.monotonic()
    with contextlib.ExitStack() as stack:
        if isinstance(other, str):
            changed = ETB.file.read_text(encoding="utf-8").replace("data_id = 0x121", f"data_id = {other}")
            other = write_bus(tmp_path, "etb", ETB.dbc.file.read_text(encoding="utf-8"), changed)
        if other is not None:
            stack.enter_context(node("there", step=False, signal_map=SignalMap.load(other)))
        rig = CanRig(ETB, "virtual:there", mode="hil", timeout_s=0.05)
        with pytest.raises(RigError, match=text):
            rig.open()
    assert time.monotonic() - begin < 30.0
    with pytest.raises(RigError, match="not open"):
        rig.apply({"duty": 0.0})


def test_a_node_that_stops_is_not_taken_for_another_one() -> None:
    with contextlib.ExitStack() as left, node("stops"):
        rig = left.enter_context(CanRig(ETB, "virtual:stops", mode="hil", timeout_s=1.0))
        for _ in range(10):
            rig.apply({"duty": 0.1})
            rig.measure()
        serving = left.pop_all()
    with serving:
        rig.apply({"duty": 0.1})
        # On a loaded machine the node has missed commands before it stops, and says so first.
        with pytest.raises(RigError, match=r"no new frame ETB_Status \(0x121\) came; those before were valid|'limp'"):
            rig.measure()


@contextlib.contextmanager
def sending(channel: str, frames: Callable[[], list[Frame]]) -> Iterator[None]:
    """Somebody else on a bus who sends such frames every 4 ms."""
    stop = threading.Event()

    def send(bus: CanTransport) -> None:
        while not stop.wait(0.004):
            for frame in frames():
                bus.send(frame)

    with CanTransport("virtual", channel) as bus:
        busy = threading.Thread(target=send, args=(bus,))
        busy.start()
        try:
            yield
        finally:
            stop.set()
            busy.join()


def test_two_nodes_with_the_identifier_of_the_measurement() -> None:
    status, one, other = ETB.measurements["ETB_Status"], Sender(), Sender()
    other.frames(status, [bytes(8)] * 7)  # it was switched on earlier
    with (
        CanTransport("virtual", "twins") as spy,
        sending("twins", lambda: [*one.frames(status, [bytes(8)]), *other.frames(status, [bytes(8)])]),
    ):
        late = r"ETB_Status \(0x121\) came, too few of them valid .*two senders of it"  # of a computer that is too busy
        with pytest.raises(RigError, match=rf"alive counter of ETB_Status \(0x121\) jumps .*two nodes send it|{late}"):
            rig_on("twins").open()
        assert commands(spy) == []


def test_another_host_is_found_before_anything_is_sent() -> None:
    command, sender, rig = ETB.commands["ETB_Cmd"], Sender(), rig_on("hosts")
    payloads = command.payloads({"duty": 0.1}, command.driven)
    with CanTransport("virtual", "hosts") as spy, node("hosts"):
        with (
            sending("hosts", lambda: sender.frames(command, payloads)),
            pytest.raises(RigError, match="frame 0x120 arrived, which this host sends: two nodes have one identifier"),
        ):
            rig.open()
        assert not any(map(is_safe, commands(spy)))
        assert rig.counters["commands"] == 0


def test_a_host_that_is_late_before_a_node_with_a_clock_has_to_arm_again() -> None:
    with node("late", step=False), rig_on("late") as rig:
        rig.apply({"duty": 0.2})
        time.sleep(0.05)  # this process stood still
        for _ in range(2):
            with pytest.raises(RigError, match=r"ms since the last command, the time limit is 20 ms: .*call arm\(\)"):
                rig.apply({"duty": 0.2})
        rig.arm()
        time.sleep(0.05)
        rig.apply({"duty": 0.2})


def test_a_measurement_that_waited_is_refused() -> None:
    punctual = Punctual(ETB, "the bus", 0.015)
    old_ns = time.monotonic_ns() - 50_000_000
    punctual.require_measurement(old_ns)  # of a node that steps: it waits as long as it takes
    punctual.is_timed = True
    with pytest.raises(RigError, match=r"the bus: the measurement is \d+ ms old, the limit is 20 ms: .*stood still"):
        punctual.require_measurement(old_ns)
    Punctual(ETB, "the bus", LONG_S).require_measurement(old_ns)


def test_a_host_may_think_before_a_node_that_steps() -> None:
    with node("thinks"), rig_on("thinks") as rig:
        for _ in range(3):
            rig.apply({"duty": 0.2})
            time.sleep(0.03)
            assert rig.measure().applied == {"duty": 0.2}
