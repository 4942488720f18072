"""A node behind a bus trusts nobody: frames and time by hand."""

import contextlib
import math
import time

import pytest

from bus_node import ETB, node, rig_on
from mgdd._core.rig import Frame
from mgdd.errors import ParameterError, RigError
from mgdd.loop import VirtualEngine, VirtualThrottle
from mgdd.rig import SafetyEnvelope, SignalMap
from mgdd.rig.can.link import Inbox, Sender
from mgdd.rig.can.node import node_of, run_node
from mgdd.rig.can.node_core import NodeCore, node_plant
from mgdd.rig.can.transport import changed


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
        """One sample of the node, so much later."""
        self.now_ns += round(seconds * 1e9)
        self.core.sample(self.now_ns)

    @property
    def decided(self) -> tuple[str, str]:
        """Mode and reason of the gate."""
        return self.core.gate.mode, self.core.gate.reason


@pytest.fixture
def host() -> Host:
    return Host(NodeCore(node_of(ETB, seed=1), ETB))


def test_a_node_has_to_be_armed_before_it_is_driven(host: Host) -> None:
    host.send(0.5, 20)
    assert host.core.gate.mode == "init"
    host.send(None, 2)
    assert host.core.gate.mode == "init"
    host.send(0.5)
    host.send(None, 3)
    assert host.core.gate.mode == "armed"
    host.send(0.5)
    assert host.core.gate.mode == "run"
    host.send(None)
    assert host.core.gate.mode == "armed"


def trouble(host: Host) -> set[str]:
    """Trouble codes that are on in the next ETB_Diag."""
    message, names = ETB.measurements["ETB_Diag"], ("command_timeout", "wrong_crc", "wrong_counter")
    while True:
        host.now_ns += 5_000_000
        for frame in host.core.sample(host.now_ns):
            if frame.id == message.message.frame_id:
                told = message.read(frame.data)
                return {name for name in names if told[name]}


def running(host: Host) -> None:
    host.send(None, 5)
    host.send(0.5, 3)
    assert host.core.gate.mode == "run"


def test_a_late_command_opens_the_bridge_and_only_arming_closes_it(host: Host) -> None:
    running(host)
    host.wait(0.014)
    assert host.core.gate.mode == "run"
    host.wait(0.007)  # 5 + 14 + 7 ms after the last one, with a limit of 20 ms
    assert host.decided == ("limp", "stale")
    assert trouble(host) == {"command_timeout"}
    host.send(0.5, 50)
    assert host.core.gate.mode == "limp"
    running(host)


def test_a_node_that_stood_still_trusts_nothing_that_waited(host: Host) -> None:
    """Below the time limit of the commands a gap is not a fault."""
    assert host.core.patience_s == 0.02
    running(host)
    begin_ns, waited = host.now_ns, [host.frame(None) for _ in range(8)] + [host.frame(0.5)]
    host.now_ns += 400_000_000
    host.core.stood_still(begin_ns, host.now_ns)
    for place, frame in enumerate(waited):  # a handshake and a command, the last one just before the end of the gap
        arrived = changed(frame, monotonic_ns=host.now_ns - 5_000_000 * (len(waited) - place))
        assert not host.core.take(arrived, host.now_ns)
    host.core.sample(host.now_ns)
    assert host.decided == ("limp", "deadlines")
    assert host.core.late == len(waited)
    host.send(0.5, 50)
    assert host.core.gate.mode == "limp"
    running(host)


def test_a_gap_is_a_fault_of_a_node_that_is_only_armed(host: Host) -> None:
    host.send(None, 6)
    assert host.core.gate.mode == "armed"
    host.wait(3.0)  # the host may be silent
    assert host.core.gate.mode == "armed"
    host.core.stood_still(host.now_ns, host.now_ns + 30_000_000)
    host.wait(0.03)
    assert host.decided == ("limp", "deadlines")


def test_a_frame_that_waited_on_the_bus_is_left_out(host: Host) -> None:
    """The hub stood still, and the node did not."""
    running(host)
    for waited_s, taken in ((0.019, True), (0.021, False)):
        frame = changed(host.frame(0.5), monotonic_ns=host.now_ns - round(waited_s * 1e9))
        assert host.core.take(frame, host.now_ns) is taken
    assert host.core.late == 1


def test_broken_commands_are_ignored_and_three_of_them_open_the_bridge(host: Host) -> None:
    running(host)
    for _ in range(2):
        bad = host.frame(0.9)
        host.core.take(changed(bad, data=bad.data[:-1] + bytes([bad.data[-1] ^ 0x10])))
        host.wait(0.001)
        assert host.core.gate.mode == "run"
        assert host.core.last is not None
        assert host.core.last.applied == {"duty": 0.5}
    host.send(0.4)  # one good frame between
    for k in range(3):
        bad = host.frame(0.9)
        host.core.take(changed(bad, data=bytes([bad.data[0] ^ 1]) + bad.data[1:]))
        host.wait(0.001)
        assert host.core.gate.mode == ("limp" if k == 2 else "run")
    assert host.decided == ("limp", "bad_frames")
    assert trouble(host) == {"wrong_crc"}


def test_a_frozen_sender_is_not_one_that_lives(host: Host) -> None:
    running(host)
    frozen = host.frame(0.5)
    host.core.take(frozen)
    for _ in range(3):
        host.wait(0.004)
        host.core.take(changed(frozen, monotonic_ns=host.now_ns))
    host.wait(0.001)
    assert host.decided == ("limp", "bad_frames")
    assert trouble(host) == {"wrong_counter"}


def test_a_mode_that_the_node_does_not_have_is_not_driven_and_does_not_arm(host: Host) -> None:
    def in_mode(name: str) -> Frame:
        mode = host.command.message.signals["Mode"]
        raws = {**host.command.driven, "Mode": mode.choices[name]}
        (frame,) = host.sender.frames(host.command, host.command.payloads({"duty": 0.5}, raws))
        return changed(frame, monotonic_ns=host.now_ns)

    for _ in range(10):
        host.core.take(in_mode("position"))
        host.wait(0.005)
    assert host.core.gate.mode == "init"
    running(host)
    host.core.take(in_mode("calib"))
    host.wait(0.005)
    assert host.decided == ("armed", "requested")
    host.send(0.5)
    assert host.core.driven


def test_what_came_too_long_ago_is_missing() -> None:
    core = NodeCore(node_of(ETB, seed=1), ETB)
    inbox = Inbox(ETB)
    seen = []
    for cycle in range(12):
        for frame in core.sample(cycle * 5_000_000):
            if frame.id != 0x122 or cycle < 5:  # the sensors fall silent
                inbox.take(frame)
        if inbox.ready:
            seen.append(inbox.read()[1].values)
    limit = 3  # cycles, as the map says nothing else
    assert [math.isnan(values["first_v"]) for values in seen] == [False] * (3 + limit) + [True] * (7 - limit)
    assert not any(math.isnan(values["sensed_angle_deg"]) for values in seen[1:])


def test_foreign_and_short_frames_change_nothing(host: Host) -> None:
    running(host)
    good = host.frame(0.5)
    assert not host.core.take(changed(good, id=0x119))
    assert not host.core.take(changed(good, extended=True))
    assert not host.core.take(changed(good, data=good.data[:7]))
    host.wait(0.005)
    assert host.core.gate.mode == "run"


def test_a_frame_that_only_the_node_may_send_opens_the_bridge_and_ends_nothing(host: Host) -> None:
    """Somebody else has one of its identifiers: whatever the frame says, and whatever its length."""
    for number, identifier in enumerate((0x121, 0x122, 0x123), 1):
        running(host)
        stranger = changed(host.frame(0.5), id=identifier, data=bytes(number))
        assert not host.core.take(stranger, host.now_ns)
        host.send(0.5)
        assert host.decided == ("limp", "bus_fault")
        assert host.core.foreign == number
        host.send(0.5, 50)
        assert host.core.gate.mode == "limp"
    running(host)  # once it has gone, the node can be armed again


class DyingBus:
    """A bus that lets so many calls pass, then fails in one of its ways; what is sent at the end still leaves."""

    name, shared = "dying", True

    def __init__(self, host: Host, failing: str, error: BaseException) -> None:
        self._host, self._failing, self._error, self.final = host, failing, error, list[Frame]()

    def receive(self, timeout_s: float) -> Frame | None:
        driven = self._host.core.driven
        if driven and self._failing == "receive":
            raise self._error
        time.sleep(min(timeout_s, 0.001))
        return changed(self._host.frame(0.5 if driven or self._host.core.gate.mode == "armed" else None),
                       monotonic_ns=time.monotonic_ns())  # fmt: skip

    def send(self, frame: Frame, *, final: bool = False) -> None:
        if final:
            self.final.append(frame)
        elif self._host.core.driven and self._failing == "send":
            raise self._error


@pytest.mark.parametrize("step", [False, True])
@pytest.mark.parametrize("failing", ["receive", "send", "log", "nothing"])
def test_whatever_ends_a_node_the_bridge_is_opened_first(host: Host, step: bool, failing: str) -> None:
    error = RigError("the bus is gone") if failing != "log" else OSError(28, "No space left on device")
    bus, core, until = DyingBus(host, failing, error), host.core, time.monotonic() + 20.0
    rows: list[tuple[str, bool]] = []

    class Log:
        def write(self, core: NodeCore, _: int) -> None:
            rows.append((core.gate.mode, core.driven))
            if failing == "log" and core.driven:
                raise error

    def keep_on() -> bool:
        assert time.monotonic() < until
        return not (failing == "nothing" and core.driven)

    ends = contextlib.nullcontext() if failing == "nothing" else pytest.raises(type(error))
    with ends:
        run_node(core, bus, step=step, log=Log(), keep_on=keep_on)  # type: ignore[arg-type]
    assert host.decided == ("limp", "aborted")
    assert rows[-1] == ("limp", False)
    status = ETB.measurements["ETB_Status"]
    told = [frame for frame in bus.final if frame.id == status.message.frame_id]
    assert ETB.state is not None
    assert [ETB.state.name_of(frame.data) for frame in told] == ["limp"]
    assert math.isclose(status.read_applied(told[0].data)["duty"], 0.0)


def test_in_steps_a_command_that_comes_twice_is_one_sample(host: Host) -> None:
    running(host)
    frame = host.frame(0.5)
    assert host.core.take(frame)
    host.core.answer()
    assert not host.core.take(frame)


def test_what_the_gate_limits_is_applied_and_reported() -> None:
    tight = SafetyEnvelope.load("etb_node").replace(duty_limit=0.3, slew_per_s=20.0)
    host, applied = Host(NodeCore(node_of(ETB, seed=1), ETB, tight)), []
    host.send(None, 5)
    for _ in range(5):
        host.send(0.5)
        assert host.core.last is not None
        applied.append(host.core.last.applied["duty"])
    assert applied == pytest.approx([0.1, 0.2, 0.3, 0.3, 0.3])
    (status,) = (frame for frame in host.core.sample(host.now_ns) if frame.id == 0x121)
    assert ETB.measurements["ETB_Status"].read_applied(status.data)["duty"] == pytest.approx(0.3)


def test_in_steps_the_age_of_a_command_is_counted_in_samples() -> None:
    """Commands that jump in their counter bring samples, and are not used: no clock but that of the samples."""
    patient = SafetyEnvelope.load("etb_node").replace(bad_frames=1e3)
    host, driven = Host(NodeCore(node_of(ETB, seed=1), ETB, patient)), []
    for duty in (None, None, None, None, None, 0.5):
        assert host.core.take(host.frame(duty))
        host.core.answer()
    for _ in range(6):
        for _ in range(7):
            host.frame(0.5)  # lost
        assert host.core.take(host.frame(0.5))
        host.core.answer()
        driven.append(host.core.driven)
    assert driven == [True] * 4 + [False] * 2  # 20 ms are four samples
    assert host.decided == ("limp", "stale")


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
    with pytest.raises(ParameterError, match=r"with keys from_s, until_s, size, sensor$"):
        node_of(ETB, faults=["jammed:x=1"])
    with pytest.raises(ParameterError, match=r"fault offset: sensor = 'left': must be a number"):
        node_of(ETB, faults=["offset:sensor=left"])


def test_without_drive_an_engine_stands() -> None:
    assert node_plant(VirtualEngine()).sample(None) == ({}, {})


def test_faults_of_the_plant_reach_the_host() -> None:
    core = NodeCore(node_of(ETB, faults=["short_to_ground:sensor=2", "jammed_at:size=20"]), ETB)
    values = [core.plant.sample({"duty": 0.6}).values for _ in range(40)][-1]
    assert values["second_v"] == pytest.approx(0.0, abs=0.01)
    assert values["angle_deg"] == pytest.approx(20.0, abs=0.5)


def test_a_late_answer_to_an_arming_frame_is_not_the_first_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy node answers later than a cycle: the host waits for what it has asked for."""
    answer = NodeCore.answer

    def late(self: NodeCore) -> list[Frame]:
        time.sleep(0.03)
        return answer(self)

    monkeypatch.setattr(NodeCore, "answer", late)
    with node("late-answers"), rig_on("late-answers") as rig:
        for duty in (0.2, 0.25):
            rig.apply({"duty": duty})
            measured = rig.measure()
            assert measured.applied == {"duty": pytest.approx(duty)}
            assert math.isfinite(measured.values["sensed_angle_deg"])
        assert rig.counters["skipped"] == 0
