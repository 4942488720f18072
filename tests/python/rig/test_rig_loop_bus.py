"""A loop with a socket of its own: what the rig hears, records and refuses; the socket itself in tests/uml."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mgdd.errors import RigError
from mgdd.rig import Recorder, SignalMap, read_record
from mgdd.rig.can.signal_map import loop_messages
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment import core_track
from mgdd.rig.experiment.core_track import SocketBus, WatchedBus
from mgdd.rig.realtime import Frame
from mgdd.rig.recorder import RecordedBus
from realtime_loops import becomes

ETB = SignalMap.load("etb")
COMMAND = (0x120, False)


class Socket:
    """Stands for the raw socket, which needs a kernel with CAN: what it was asked for, and what it counts."""

    def __init__(self, channel: str, filters: list[tuple[int, int, bool]]) -> None:
        self.channel, self.filters = channel, filters
        self.counts = {"sent": 0}


class Stand:
    """A recorded bus, the other side of it, and a loop that is told of."""

    def __init__(self, folder: Path, *, transmits: bool) -> None:
        self.file = folder / "run.rec"
        self.recorder = Recorder(self.file)
        self.rig = RecordedBus(CanTransport("virtual", f"loop bus {id(self)}"), self.recorder)
        self.other = CanTransport("virtual", f"loop bus {id(self)}")
        command, measurements = loop_messages(ETB)
        self.bus = SocketBus(
            WatchedBus(self.rig, ETB), "can7", command=command, measurements=measurements, transmits=transmits
        )
        self.foreign = self.error_frames = 0
        self.rig.claim({COMMAND} if transmits else set())

    def report(self) -> dict[str, Any]:
        return {"frames": {"foreign": self.foreign}, "bus": {"error_frames": self.error_frames}}

    def command(self, number: int) -> None:
        """Send one of the loop, from elsewhere."""
        socket: Any = self.bus.transport
        self.other.send(Frame(id=0x120, data=bytes([number, *bytes(7)])))
        socket.counts["sent"] += 1

    def recorded(self) -> list[tuple[int, bool]]:
        self.recorder.close()
        frames = read_record(self.file).frames
        return list(
            zip(frames["id"].to_numpy().tolist(), frames["received"].to_numpy().astype(bool).tolist(), strict=True)
        )


def opened(folder: Path, monkeypatch: pytest.MonkeyPatch, *, transmits: bool) -> Iterator[Stand]:
    monkeypatch.setattr(core_track, "SocketCanTransport", Socket)
    stand = Stand(folder, transmits=transmits)
    with stand.rig.bus, stand.other:  # type: ignore[attr-defined]
        yield stand


@pytest.fixture
def driving(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stand]:
    yield from opened(tmp_path, monkeypatch, transmits=True)


@pytest.fixture
def watching(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stand]:
    yield from opened(tmp_path, monkeypatch, transmits=False)


def test_the_socket_lets_pass_what_the_loop_reads_and_its_command_and_nothing_else(driving: Stand) -> None:
    socket: Any = driving.bus.transport
    assert socket.channel == "can7"
    _, measurements = loop_messages(ETB)
    wanted = {(0x120, 0x7FF, False), *((one.can_id, 0x7FF, one.extended) for one in measurements)}
    assert set(socket.filters) == wanted
    unread = {message.key for message in ETB.measurements.values()} - {(number, far) for number, _, far in wanted}
    assert unread  # of the map, and no stranger


def test_heard_commands_are_recorded_as_sent_and_are_no_fault(driving: Stand) -> None:
    with driving.bus as bus:
        for number in range(20):
            driving.command(number)
            driving.other.send(Frame(id=0x121, data=bytes(8)))
            bus.look(driving.report)
        driving.command(20)  # the last ones are waited for
    assert bus.error is None
    assert bus.counters == {"commands_heard": 21}
    assert driving.recorded() == [(0x120, False), (0x121, True)] * 20 + [(0x120, False)]


def test_before_the_loop_the_claim_of_the_rig_holds(driving: Stand) -> None:
    driving.other.send(Frame(id=0x120, data=bytes(8)))
    with pytest.raises(RigError, match="two nodes have one identifier"):
        driving.rig.receive(1.0)


def test_another_sender_shows_itself_at_the_socket(driving: Stand) -> None:
    with driving.bus as bus:
        driving.foreign = 2  # the last safe frames of the rig, before the loop was driven
        bus.look(driving.report)
        driving.foreign, driving.error_frames = 5, 3
        bus.look(driving.report)
        assert bus.error is None
        driving.foreign = 6
        bus.look(driving.report)
        with pytest.raises(RigError, match=r"0x120 arrived, which this host sends: two nodes have one identifier"):
            raise bus.error or AssertionError


def test_a_dry_run_records_the_commands_of_another_as_received(watching: Stand) -> None:
    with watching.bus as bus:
        for _ in range(3):
            watching.foreign += 1
            watching.other.send(Frame(id=0x120, data=bytes(8)))
        assert becomes(lambda: (bus.look(watching.report), watching.recorder.written == 3)[1])
    assert bus.error is None
    assert watching.recorded() == [(0x120, True)] * 3


def test_a_listener_whose_bus_has_a_fault_ends_the_run(driving: Stand) -> None:
    with driving.bus as bus:
        bus.look(driving.report)
        driving.rig.close()
        bus.look(driving.report)
        with pytest.raises(RigError, match="is not open"):
            raise bus.error or AssertionError
        driving.bus.transport.counts["sent"] += 5
        begun = time.monotonic()
    assert time.monotonic() - begun < 0.15  # nothing is waited for that cannot come
