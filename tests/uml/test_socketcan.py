"""On a kernel with CAN: run in User-Mode Linux by tests/python/rig/test_rig_uml.py, or by hand where vcan0 exists."""

import gc
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from mgdd.errors import RigError
from mgdd.loop import VirtualThrottle
from mgdd.rig import CanRig, SignalMap
from mgdd.rig.can.node import run_node
from mgdd.rig.can.node_core import NodeCore, node_plant
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.realtime import Frame, SocketCanTransport

CHANNEL = "vcan0"
BUS_OFF, CONTROLLER, RESTARTED = 0x40, 0x04, 0x100
PASSIVE, WARNING = 0x30, 0x0C  # of byte 1 of a controller error
HOME_DEG = 8.0


def open_bus(**settings: object) -> can.BusABC:
    return can.Bus(interface="socketcan", channel=CHANNEL, ignore_config=True, **settings)  # type: ignore[arg-type]


@pytest.fixture
def peer() -> Iterator[can.BusABC]:
    with open_bus() as bus:
        yield bus


def error_frame(kind: int, detail: int = 0) -> can.Message:
    return can.Message(
        arbitration_id=kind, data=[0, detail, 0, 0, 0, 0, 0, 0], is_error_frame=True, is_extended_id=False
    )


# --- the kernel and python-can ------------------------------------------------------------------------------


def test_frames_cross_the_kernel_in_order_and_through_filters(peer: can.BusABC) -> None:
    with open_bus(can_filters=[{"can_id": 0x121, "can_mask": 0x7FF}]) as bus:
        for number in range(200):
            peer.send(can.Message(arbitration_id=0x120 + number % 2, data=[number], is_extended_id=False))
        got = [bus.recv(1.0) for _ in range(100)]
        assert [frame.data[0] for frame in got if frame is not None] == list(range(1, 200, 2))
        assert bus.recv(0.05) is None


def test_the_library_does_not_see_a_bus_off(peer: can.BusABC) -> None:
    """Why error frames are read by our own transport: `state` of python-can says ACTIVE whatever happens."""
    with open_bus() as bus:
        peer.send(error_frame(BUS_OFF))
        frame = bus.recv(1.0)
        assert frame is not None
        assert frame.is_error_frame
        assert frame.arbitration_id & BUS_OFF
        assert bus.state is can.BusState.ACTIVE


def test_the_kernel_itself_sends_on_time(peer: can.BusABC) -> None:
    with open_bus() as bus:
        task = bus.send_periodic(can.Message(arbitration_id=0x130, data=b"\x01", is_extended_id=False), 0.02)
        begun = time.monotonic()
        frames = [peer.recv(1.0) for _ in range(5)]
        task.stop()
        assert all(frame is not None and frame.arbitration_id == 0x130 for frame in frames)
        assert time.monotonic() - begun > 0.05


# --- our transport ------------------------------------------------------------------------------------------


def test_our_transport_sends_and_receives(peer: can.BusABC) -> None:
    with CanTransport.parse(f"socketcan:{CHANNEL}") as transport:
        transport.send(Frame(id=0x120, data=b"\x01\x02"))
        heard = peer.recv(1.0)
        assert heard is not None
        assert (heard.arbitration_id, bytes(heard.data)) == (0x120, b"\x01\x02")
        before = time.monotonic_ns()
        peer.send(can.Message(arbitration_id=0x18FF0001, data=b"\x07", is_extended_id=True))
        frame = transport.receive(1.0)
        assert frame is not None
        assert (frame.id, frame.extended, frame.data) == (0x18FF0001, True, b"\x07")
        assert before <= frame.monotonic_ns <= time.monotonic_ns()
        assert frame.bus_ns > 0


@pytest.mark.parametrize(
    ("kind", "detail", "fatal"),
    [
        (BUS_OFF, 0, "bus_off"),
        (CONTROLLER, PASSIVE, "error_passive"),
        (CONTROLLER, WARNING, None),
        (RESTARTED, 0, None),
    ],
)
def test_error_frames_are_classified(peer: can.BusABC, kind: int, detail: int, fatal: str | None) -> None:
    with CanTransport.parse(f"socketcan:{CHANNEL}") as transport:
        peer.send(error_frame(kind, detail))
        if fatal is not None:
            with pytest.raises(RigError, match=fatal):
                transport.receive(1.0)
            with pytest.raises(RigError, match=fatal):
                transport.send(Frame(id=0x120, data=bytes(8)))
        else:
            peer.send(can.Message(arbitration_id=0x121, data=b"\x01", is_extended_id=False))
            frame = transport.receive(1.0)
            assert frame is not None
            assert frame.id == 0x121
            assert sum(transport.counters.get(name, 0) for name in ("controller", "restarted")) == 1


def complaint_about(interface: str) -> str:
    try:
        CanTransport.parse(f"socketcan:{interface}").open()
    except RigError as error:
        return str(error)
    return ""


def test_an_interface_that_is_not_there_is_named() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # python-can forgets the socket of a bus that did not open
        assert "vcan7" in complaint_about("vcan7")
        gc.collect()


# --- a rig and its node on one bus --------------------------------------------------------------------------


@pytest.fixture
def slow_map(tmp_path: Path) -> SignalMap:
    """The shipped map with the longest time limit that a node may have: this kernel ticks every 10 ms."""
    shipped = SignalMap.load("etb")
    text = shipped.file.read_text().replace("timeout_ms = 20", "timeout_ms = 50")
    file = tmp_path / "etb.toml"
    file.write_text(text.replace('dbc = "etb.dbc"', f'dbc = "{shipped.dbc.file}"'))
    return SignalMap.load(file)


@pytest.fixture
def node(slow_map: SignalMap) -> Iterator[NodeCore]:
    """A throttle behind the same bus, deaf to error frames, as another controller is to those of ours."""
    throttle = VirtualThrottle(inputs=("duty", "bridge_open"), sample_s=0.02, seed=1)
    core, stop = NodeCore(node_plant(throttle), slow_map), threading.Event()
    with CanTransport.parse(f"socketcan:{CHANNEL}?ignore_rx_error_frames=true") as bus:
        serve = threading.Thread(
            target=run_node, args=(core, bus), kwargs={"period_s": 0.02, "keep_on": lambda: not stop.is_set()}
        )
        serve.start()
        yield core
        stop.set()
        serve.join(10.0)


def angle_of(core: NodeCore) -> float:
    return float("nan") if core.last is None else core.last.values["angle_deg"]


def hold_open(rig: CanRig, core: NodeCore) -> None:
    """Drive until the plate stands open; a kernel that ticks slowly may let the node time out."""
    until = time.monotonic() + 30.0
    while not angle_of(core) > 40.0:
        assert time.monotonic() < until
        try:
            rig.apply({"duty": 0.3})
            rig.measure()
        except RigError:
            rig.arm()


@pytest.mark.parametrize(("kind", "detail"), [(BUS_OFF, 0), (CONTROLLER, PASSIVE)], ids=["bus-off", "error passive"])
def test_an_error_frame_takes_the_drive_away(
    peer: can.BusABC, node: NodeCore, slow_map: SignalMap, kind: int, detail: int
) -> None:
    def drive_on(rig: CanRig) -> None:
        until = time.monotonic() + 10.0
        while time.monotonic() < until:
            rig.apply({"duty": 0.3})
            rig.measure()

    with CanRig(slow_map, f"socketcan:{CHANNEL}", mode="hil", timeout_s=2.0) as rig:
        hold_open(rig, node)
        peer.send(error_frame(kind, detail))
        with pytest.raises(RigError, match=r"bus_off|error_passive"):
            drive_on(rig)
        until = time.monotonic() + 10.0
        while not abs(angle_of(node) - HOME_DEG) < 1.0:  # nothing is sent any more: the node opens the bridge itself
            assert time.monotonic() < until
            time.sleep(0.02)
        assert (node.gate.mode, node.gate.reason) == ("limp", "stale")
    assert not node.driven


def test_a_run_over_the_bus_ends_at_home(node: NodeCore, slow_map: SignalMap) -> None:
    with CanRig(slow_map, f"socketcan:{CHANNEL}", mode="hil", timeout_s=2.0) as rig:
        hold_open(rig, node)
        assert rig.counters["checks"]["ETB_Status"]["wrong_crc"] == 0
    until = time.monotonic() + 10.0
    while not abs(angle_of(node) - HOME_DEG) < 1.0:
        assert time.monotonic() < until
        time.sleep(0.02)
    assert node.gate.mode == "armed"  # five safe frames: an orderly end


# --- the raw socket of the core -----------------------------------------------------------------------------


def test_the_socket_of_the_core_speaks_with_python_can(peer: can.BusABC) -> None:
    socket = SocketCanTransport(CHANNEL)
    for number in range(50):
        peer.send(can.Message(arbitration_id=0x121, data=[number], is_extended_id=False))
    frames = [socket.receive(timeout_s=1.0) for _ in range(50)]
    assert [frame.data[0] for frame in frames] == list(range(50))
    assert all(frame.received and frame.monotonic_ns <= time.monotonic_ns() for frame in frames)
    socket.send(Frame(id=0x120, data=b"\x05\x06"))
    heard = peer.recv(1.0)
    assert heard is not None
    assert (heard.arbitration_id, bytes(heard.data)) == (0x120, b"\x05\x06")
    assert socket.counts["lost"] == 0


def test_the_socket_of_the_core_follows_the_state_of_the_bus(peer: can.BusABC) -> None:
    socket = SocketCanTransport(CHANNEL)
    assert socket.bus_state == "active"
    for frame, state in ((error_frame(CONTROLLER, PASSIVE), "passive"), (error_frame(BUS_OFF), "off")):
        peer.send(frame)
        socket.receive(timeout_s=1.0)
        assert socket.bus_state == state
    peer.send(error_frame(RESTARTED))
    socket.receive(timeout_s=1.0)
    assert socket.bus_state == "active"
