"""Bytes of a bus that are not a frame, and our own frames that come back: left out and counted."""

import math
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hub_thread import bus_of, running_hub
from mgdd.errors import DataError, RigError
from mgdd.loop import VirtualEngine
from mgdd.rig import CanRig
from mgdd.rig.can.bus_bridge import BusBridge
from mgdd.rig.can.hub import Hub
from mgdd.rig.can.node_core import NodeCore
from mgdd.rig.can.python_can import frame_of
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.realtime import Frame, RingTransport
from user_buses import dbc_of, write_bus

can = pytest.importorskip("can", reason="the extra `can` is not installed")

LONG_S = 10.0
GOOD = "< send 121 2 1 2 >"
NOT_FRAMES = [
    "< send FFFFFFFFFFFF 1 0 >",
    "< send 800 1 0 >",  # 12 bits in the form of 11
    "< send -12 1 0 >",
    "< send 20000000 1 0 >",  # 30 bits
    "< send 120 41 " + "0 " * 65 + ">",
    "< send 120 2 0 >",
    "< send 120 1 0 0 >",
    "< send 120 1 100 >",
    "< send 120 -1 >",
    "< send 120 >",
    "< send >",
    "< send xyz 1 0 >",
]


@contextmanager
def stranger(hub: Hub) -> Iterator[socket.socket]:
    """A client in raw mode that writes what it likes."""
    with socket.create_connection((hub.host, hub.port), timeout=LONG_S) as stream:
        for said in (b"< open can0 >", b"< rawmode >"):
            stream.recv(64)
            stream.sendall(said)
        assert b"ok" in stream.recv(64)
        yield stream


def received(bus: CanTransport, count: int) -> list[Frame]:
    """The next frames."""
    out = [bus.receive(LONG_S) for _ in range(count)]
    assert None not in out
    return [frame for frame in out if frame is not None]


@pytest.mark.parametrize("text", NOT_FRAMES)
def test_a_malformed_line_ends_nobody_at_the_hub(text: str) -> None:
    with running_hub() as hub, CanTransport.parse(bus_of(hub)) as bus, stranger(hub) as stream:
        stream.sendall(f"{GOOD}{text}{GOOD}".encode())
        assert [frame.data for frame in received(bus, 2)] == [b"\x01\x02"] * 2
        assert (hub.counts["frames"], hub.counts["malformed"]) == (2, 1)
        assert bus.counters == {"received": 2}


def test_bytes_without_an_end_are_not_kept() -> None:
    with (
        running_hub() as hub,
        CanTransport.parse(bus_of(hub)) as bus,
        CanTransport.parse(bus_of(hub)) as other,
        stranger(hub) as stream,
    ):
        for _ in range(100):
            stream.sendall(b"<" * 10_000)
            other.send(Frame(id=0x122, data=b"\x07"))
        stream.sendall(f">{GOOD}".encode())
        assert len([frame for frame in received(bus, 101) if frame.id == 0x122]) == 100
        assert all(len(client._text) < 2000 for client in hub.connections)
        assert hub.counts["malformed"] > 1


def test_a_server_that_says_what_is_not_a_frame_ends_the_receiving() -> None:
    """Another socketcand than ours: whoever drives over it learns so."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with server.accept()[0] as look:  # whether somebody is there
                look.sendall(b"< hi >")
            with server.accept()[0] as stream:
                for said in (b"< hi >", b"< ok >"):
                    stream.sendall(said)
                    stream.recv(64)
                stream.sendall(b"< ok >")
                time.sleep(0.05)
                stream.sendall(b"< frame zzz 1.0 00 >")
                stream.recv(64)

        serving = threading.Thread(target=serve)
        serving.start()
        bus = CanTransport.parse(f"socketcand:can0?host=127.0.0.1&port={server.getsockname()[1]}")
        with bus, pytest.raises(RigError, match="receiving ended"):
            bus.receive(LONG_S)
        serving.join()


@pytest.mark.parametrize(
    "message",
    [
        can.Message(arbitration_id=0x800, is_extended_id=False),
        can.Message(arbitration_id=1 << 29),
        can.Message(arbitration_id=-1),
        can.Message(arbitration_id=1, data=bytes(65)),
        can.Message(arbitration_id=1, dlc=65, is_remote_frame=True),
        can.Message(arbitration_id=1, timestamp=math.nan),
        can.Message(arbitration_id=1, timestamp=math.inf),
    ],
)
def test_a_message_of_a_driver_that_is_not_a_frame(message: can.Message) -> None:
    with pytest.raises(DataError, match="not a frame: identifier"):
        frame_of(message, monotonic_ns=1)
    transport = RingTransport()
    with (
        can.Bus(interface="virtual", channel="bad", ignore_config=True, preserve_timestamps=True) as driver,
        can.Bus(interface="virtual", channel="bad", ignore_config=True, preserve_timestamps=True) as raw,
        CanTransport("virtual", "bad", options={"preserve_timestamps": True}) as bus,
        BusBridge(raw, transport) as bridge,
    ):
        driver.send(message)
        driver.send(can.Message(arbitration_id=0x121, data=[5], is_extended_id=False))
        (frame,) = received(bus, 1)
        assert (frame.data, bus.counters) == (b"\x05", {"received": 1, "malformed": 1})
        until = time.monotonic() + LONG_S
        while transport.waiting_for_loop == 0:
            assert time.monotonic() < until
            time.sleep(0.01)
        assert bridge.error is None


def test_a_driver_that_gives_back_what_we_sent() -> None:
    with CanTransport("virtual", "echo", options={"receive_own_messages": True}) as bus:
        bus.claim({(0x120, False)})
        bus.send(Frame(id=0x120, data=b"\x01"))
        assert bus.receive(0.2) is None
        assert bus.counters == {"sent": 1, "own": 1}


def test_an_input_that_is_not_finite_is_a_broken_command(tmp_path: Path) -> None:
    """A float signal can carry NaN: the plant of the node never sees it."""
    with CanRig(write_bus(tmp_path, "float", FLOAT_DBC, FLOAT_MAP), plant=VirtualEngine(seed=1)) as rig:
        core = rig.bus.core  # type: ignore[attr-defined]
        assert isinstance(core, NodeCore)
        rig.apply({"soc_cad": -6.0})
        assert rig.measure().values["imep_gross_bar"] > 1.0
        command = rig.map.commands["Cmd"]
        good = command.payloads({"soc_cad": -6.0}, command.driven)[0]
        nan, infinity = b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f"
        for bad in (nan, infinity, nan):
            core.take(Frame(id=0x200, data=bad + good[4:], monotonic_ns=1, received=True))
            core.answer()
        assert (core.gate.mode, core.gate.reason) == ("limp", "bad_frames")


FLOAT_DBC = dbc_of(
    """\
BO_ 512 Cmd: 8 PC
 SG_ Soc : 0|32@1- (1,0) [-90|90] "deg" BOX
 SG_ Go : 32|1@1+ (1,0) [0|1] "" BOX

BO_ 513 Answer: 8 BOX
 SG_ Imep : 0|32@1- (1,0) [-100|100] "bar" PC
""",
    {512: 80, 513: 80},
    "SIG_VALTYPE_ 512 Soc : 1;\nSIG_VALTYPE_ 513 Imep : 1;\n",
)
FLOAT_MAP = """kind = "signal_map"
format = 1
dbc = "float.dbc"
trigger = "Answer"

[commands.Cmd]
driven = { Go = 1 }
safe = { Go = 0, Soc = 0.0 }

[commands.Cmd.inputs]
soc_cad = { signal = "Soc", unit = "deg", lower = -60.0, upper = 20.0 }

[measurements.Answer.values]
imep_gross_bar = { signal = "Imep", unit = "bar" }
"""
