"""The transport: every way to open, lose and close a bus, and the faults of a hub."""

import contextlib
import errno
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from hub_thread import bus_of, running_hub
from mgdd._core.rig import Frame, error_classes
from mgdd.errors import ParameterError, RigError
from mgdd.rig.can.hub import BusFault, Hub
from mgdd.rig.can.python_can import STILL_S, Reception
from mgdd.rig.can.transport import CanTransport

can = pytest.importorskip("can", reason="the extra `can` is not installed")
pytestmark = pytest.mark.usefixtures("no_thread_is_left")


def frame(number: int = 0, identifier: int = 0x120, *, extended: bool = False) -> Frame:
    return Frame(id=identifier, data=number.to_bytes(8, "little"), extended=extended)


def numbers(bus: CanTransport, most: int, timeout_s: float = 0.3) -> list[int]:
    """What arrives until nothing comes for a while."""
    out: list[int] = []
    while len(out) < most and (got := bus.receive(timeout_s)) is not None:
        out.append(int.from_bytes(got.data, "little"))
    return out


def test_frames_cross_with_both_kinds_of_identifier_and_our_own_stamp() -> None:
    with CanTransport("virtual", "cross") as one, CanTransport("virtual", "cross") as other:
        before = time.monotonic_ns()
        one.send(frame(1))
        one.send(frame(2, 0x18FF00FE, extended=True))
        first, second = other.receive(1.0), other.receive(1.0)
        assert first is not None
        assert second is not None
        assert (first.id, first.extended, second.id, second.extended) == (0x120, False, 0x18FF00FE, True)
        assert before <= first.monotonic_ns <= second.monotonic_ns <= time.monotonic_ns()
        assert one.receive(0.0) is None  # not its own
        assert (one.counters, other.counters) == ({"sent": 2}, {"received": 2})


def test_frames_cross_a_hub_in_order() -> None:
    with running_hub() as hub, CanTransport.parse(bus_of(hub)) as one, CanTransport.parse(bus_of(hub)) as other:
        for number in range(500):
            one.send(frame(number))
        assert numbers(other, 500, 2.0) == list(range(500))
        other.send(frame(7, 0x1ABCDEF0, extended=True))
        back = one.receive(2.0)
        assert back is not None
        assert (back.id, back.extended, back.data[0]) == (0x1ABCDEF0, True, 7)
        assert hub.counts["frames"] == 501


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sockettcan:can0", "no such interface: did you mean 'socketcan'"),
        ("wat:can0", "no such interface: must be one of .*socketcan.*virtual"),
        (
            "socketcan:mgdd_none",
            "channel 'mgdd_none' of interface socketcan cannot be opened: .*(no CAN|No such device)",
        ),
        ("socketcand:can0", "socketcand needs host and port"),
        ("socketcand:can0?host=127.0.0.1&port=1", "no answer there: .*start the hub first: mgdd rig hub"),
        ("pcan:PCAN_USBBUS1", "channel 'PCAN_USBBUS1' of interface pcan cannot be opened"),
    ],
)
def test_a_bus_that_is_not_there_is_named_at_once(text: str, message: str) -> None:
    begin = time.monotonic()
    with pytest.raises(RigError, match=message):
        CanTransport.parse(text).open()
    assert time.monotonic() - begin < 30.0  # python-can alone tries a hub for ten seconds, logging all the time


def test_something_else_at_the_port_of_a_hub() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]

        def greet() -> None:
            with server.accept()[0] as stream:
                stream.sendall(b"SSH-2.0")

        answer = threading.Thread(target=greet)
        answer.start()
        with pytest.raises(RigError, match=r"not socketcand: it sent b'SSH-2.0'"):
            CanTransport.parse(f"socketcand:can0?host=127.0.0.1&port={port}").open()
        answer.join()


@pytest.mark.parametrize("text", ["socketcan", "", ":can0", "socketcan:"])
def test_interface_and_channel_are_always_given(text: str) -> None:
    with pytest.raises(ParameterError, match=r"bus = .*INTERFACE:CHANNEL"):
        CanTransport.parse(text)


def test_no_configuration_file_chooses_the_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "socketcan")
    monkeypatch.setenv("CAN_CHANNEL", "vcan9")
    monkeypatch.setenv("CAN_CONFIG", '{"receive_own_messages": true}')
    with CanTransport("virtual", "own") as bus:
        assert bus._bus.channel_info == "Virtual bus channel own"
        bus.send(frame())
        assert bus.receive(0.1) is None


def test_use_before_and_after_it_is_open() -> None:
    bus = CanTransport("virtual", "twice")
    with pytest.raises(RigError, match="is not open"):
        bus.send(frame())
    bus.open()
    with pytest.raises(RigError, match="open already"):
        bus.open()
    bus.close()
    bus.close()
    with pytest.raises(RigError, match="is not open"):
        bus.receive(0.0)
    with bus:  # once more
        assert bus.receive(0.0) is None


class FakeBus:
    """A bus of python-can whose driver misbehaves as told."""

    def __init__(self, incoming: list[Any], refusals: int = 0) -> None:
        self.incoming, self.refusals = incoming, refusals
        self.sent: list[Any] = []
        self.closed = False

    def recv(self, timeout: float) -> Any:
        if not self.incoming:
            time.sleep(min(timeout, 0.01))
            return None
        got = self.incoming.pop(0)
        if isinstance(got, Exception):
            raise got
        return got

    def send(self, message: Any) -> None:
        if self.refusals > 0:
            self.refusals -= 1
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        self.sent.append(message)

    def shutdown(self) -> None:
        self.closed = True


def behind(monkeypatch: pytest.MonkeyPatch, fake: FakeBus, **settings: float) -> CanTransport:
    monkeypatch.setattr(can, "Bus", lambda **_: fake)
    return CanTransport("virtual", "fake", **settings)  # type: ignore[arg-type]


def test_a_full_queue_of_the_driver_is_tried_again_and_then_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeBus([], refusals=3)
    with behind(monkeypatch, fake, send_timeout_s=0.05) as bus:
        bus.send(frame(5))
        assert (len(fake.sent), bus.counters) == (1, {"sent": 1, "retries": 3})
        fake.refusals = 10**9
        begin = time.monotonic()
        with pytest.raises(RigError, match=r"frame 0x120 was not sent: .*No buffer space"):
            bus.send(frame(6))
        assert time.monotonic() - begin < 5.0
        assert len(fake.sent) == 1
    assert fake.closed


def test_what_ends_the_receive_thread_is_raised_by_the_next_call(monkeypatch: pytest.MonkeyPatch) -> None:
    good = can.Message(arbitration_id=0x121, data=bytes(8), is_extended_id=False)
    fake = FakeBus([good, OSError(errno.ENETDOWN, "Network is down"), good])
    with behind(monkeypatch, fake) as bus:
        with pytest.raises(RigError, match=r"virtual:fake: receiving ended: .*Network is down"):
            [bus.receive(2.0) for _ in range(2)]
        with pytest.raises(RigError, match="Network is down"):
            bus.send(frame())
        bus.send(frame(3), final=True)  # the safe frames are tried whatever happened
        assert fake.sent[-1].data[0] == 3
        assert len(fake.incoming) == 1
    assert fake.closed


@pytest.mark.parametrize(
    ("identifier", "data", "text"),
    [(0x040, bytes(8), "bus_off"), (0x004, bytes([0, 0x10]) + bytes(6), "error_passive")],
)
def test_error_frames_that_end_it(monkeypatch: pytest.MonkeyPatch, identifier: int, data: bytes, text: str) -> None:
    fake = FakeBus([can.Message(arbitration_id=identifier, data=data, is_error_frame=True)])
    with behind(monkeypatch, fake) as bus:
        with pytest.raises(RigError, match=text):
            bus.receive(2.0)
        assert bus.counters[text] == 1


def test_error_frames_that_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = [(0x008, "protocol"), (0x020, "no_acknowledgement"), (0x100, "restarted"), (0x004, "controller")]
    fake = FakeBus([can.Message(arbitration_id=bits, data=bytes(8), is_error_frame=True) for bits, _ in kinds])
    with behind(monkeypatch, fake) as bus:
        assert bus.receive(0.2) is None
        assert bus.counters == dict.fromkeys((name for _, name in kinds), 1)
    assert error_classes(Frame(id=0x10, data=b"")) == ["transceiver"]


def test_another_sender_of_our_identifier_is_a_fault() -> None:
    with CanTransport("virtual", "mine") as bus, CanTransport("virtual", "mine") as other:
        bus.claim({(0x120, False)})
        bus.send(frame())
        other.send(frame(1, 0x120, extended=True))  # another identifier: it has 29 bits
        assert bus.receive(1.0) is not None
        other.send(frame())
        with pytest.raises(
            RigError, match=r"frame 0x120 arrived, which this host sends: two nodes have one identifier"
        ):
            bus.receive(1.0)


def test_unread_frames_are_bounded_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mgdd.rig.can.transport._QUEUE", 5)
    fake = FakeBus([can.Message(arbitration_id=1, data=[number], is_extended_id=False) for number in range(12)])
    with behind(monkeypatch, fake) as bus:
        until = time.monotonic() + 5.0
        while bus.counters.get("received", 0) < 12 and time.monotonic() < until:
            time.sleep(0.01)
        assert numbers(bus, 12, 0.0) == [7, 8, 9, 10, 11]
        assert bus.counters["overflows"] == 7


def test_a_hub_that_goes_away() -> None:
    with running_hub() as hub:
        bus = CanTransport.parse(bus_of(hub))
        bus.open()
    try:
        with pytest.raises(RigError, match=r"the hub has closed the connection|receiving ended"):
            bus.receive(5.0)
    finally:
        bus.close()


def test_the_age_of_a_frame_counts_from_its_arrival() -> None:
    """A bus with the clock of this machine says when a frame came; of another one the last look at it does."""
    with can.Bus(interface="virtual", channel="age", ignore_config=True) as other:
        host = can.Bus(interface="virtual", channel="age", ignore_config=True)
        reception, before_ns = Reception(host), time.monotonic_ns()
        other.send(can.Message(arbitration_id=1, is_extended_id=False))
        sent_ns = time.monotonic_ns()
        time.sleep(0.1)
        got = reception.receive()
        host.shutdown()
    assert got is not None
    assert before_ns - 10_000 <= got.monotonic_ns <= sent_ns + 10_000
    late = FakeBus([])
    reception = Reception(late)  # type: ignore[arg-type]
    made_ns = time.monotonic_ns()
    time.sleep(2.0 * STILL_S)
    late.incoming = [can.Message(arbitration_id=1, data=[k], is_extended_id=False) for k in range(3)]
    stamps = [frame.monotonic_ns for frame in (reception.receive(), reception.receive(), reception.receive()) if frame]
    assert [stamp <= made_ns for stamp in stamps] == [True] * 3
    assert reception.receive() is None
    late.incoming = [can.Message(arbitration_id=1, is_extended_id=False)]
    fresh = reception.receive()
    assert fresh is not None
    assert fresh.monotonic_ns > made_ns


def test_what_waited_before_the_hub_is_as_old_as_that() -> None:
    quiet = Hub()
    quiet._looked_s -= 2.0 * STILL_S
    assert quiet.arrival_s() == quiet._looked_s
    quiet._looked_s += 2.0 * STILL_S
    assert quiet.arrival_s() > quiet._looked_s


@contextmanager
def two_on(hub: Any) -> Iterator[tuple[CanTransport, CanTransport]]:
    with CanTransport.parse(bus_of(hub)) as one, CanTransport.parse(bus_of(hub)) as other:
        yield one, other


def wait_until_through(hub: Any, frames: int) -> None:
    """However loaded the machine: so many frames have passed the hub."""
    until = time.monotonic() + 10.0
    while hub.counts["frames"] < frames:
        assert time.monotonic() < until
        time.sleep(0.001)


def exchange(faults: list[str], count: int = 200, seed: int = 0) -> tuple[list[int], Any]:
    with running_hub(faults, seed=seed) as hub:
        with two_on(hub) as (one, other):
            for number in range(count):
                one.send(frame(number))
            wait_until_through(hub, count)
            got = numbers(other, 3 * count)
        return got, hub


Heard = list[tuple[int, bytes, bool]]


def conversation(faults: list[str], sent: list[tuple[int, Frame]]) -> tuple[list[Heard], Any]:
    """What each of three clients of a hub hears, and the hub; every frame is through before the next one is sent."""
    with running_hub(faults) as hub, contextlib.ExitStack() as left:
        clients = [left.enter_context(CanTransport.parse(bus_of(hub))) for _ in range(3)]
        for count, (sender, one) in enumerate(sent, 1):
            clients[sender].send(one)
            wait_until_through(hub, count)
        heard: list[Heard] = []
        for patience_s, client in zip((0.25, 0.05, 0.05), clients, strict=True):
            heard.append([])
            while (got := client.receive(patience_s)) is not None:
                heard[-1].append((got.id, got.data, got.extended))
    return heard, hub


def named(identifier: int, text: str) -> Frame:
    return Frame(id=identifier, data=text.encode(), extended=identifier > 0x7FF)


def said(heard: Heard) -> str:
    return " ".join(data.decode() for _, data, _ in heard)


# Two clients talk, one listens: A and C are of the first one, b and d of the second one, with an identifier of 29 bits.
TALK = [(0, named(0x120, "A")), (1, named(0x18FF0001, "b")), (0, named(0x122, "C")), (1, named(0x18FF0002, "d"))]


@pytest.mark.parametrize(
    ("fault", "first", "second", "listener", "strikes"),
    [
        ("drop:id=0x120", "b d", "C", "b C d", 1),
        ("drop:id=0x18ff0001", "d", "A C", "A C d", 1),
        ("duplicate:id=0x120", "b d", "A A C", "A A b C d", 1),
        ("duplicate", "b b d d", "A A C C", "A A b b C C d d", 4),
        ("delay:ms=100,id=0x120", "b d", "C A", "b C d A", 1),
        ("reorder:id=0x120", "b d", "A C", "b A C d", 1),  # behind b, of the other sender, and not back to its own
        ("reorder:id=0x18ff0001", "b d", "A C", "A C b d", 1),
        ("reorder", "b d", "A C", "b A d C", 4),
        ("reorder:id=0x18ff0002", "b", "A C", "A b C", 1),  # nothing follows: it waits for ever
        ("freeze:client=1", "", "", "b d", 4),
        ("freeze:client=2", "", "", "A C", 4),
    ],
)
def test_every_client_hears_a_fault_of_the_hub_as_it_is_told(
    fault: str, first: str, second: str, listener: str, strikes: int
) -> None:
    heard, hub = conversation([fault], TALK)
    assert [said(one) for one in heard] == [first, second, listener]
    for one in heard:  # with its own identifier, and in full
        assert all((Frame(id=i, data=d, extended=x) in [frame for _, frame in TALK]) for i, d, x in one)
    assert hub.counts[fault.partition(":")[0]] == strikes


def test_a_corrupt_frame_has_one_other_byte_for_all_who_hear_it() -> None:
    heard, hub = conversation(["corrupt:id=0x121"], [(0, named(0x121, "payload")), (1, named(0x121, ""))])
    assert [data for _, data, _ in heard[0]] == [b""]
    (_, spoilt, _), (_, empty, _) = heard[2]
    assert [spoilt] == [data for _, data, _ in heard[1]]
    assert (sum(a != b for a, b in zip(spoilt, b"payload", strict=True)), empty) == (1, b"")
    assert hub.counts["corrupt"] == 1


def test_faults_of_one_frame_add_up() -> None:
    heard, hub = conversation(["drop:id=0x120", "reorder:id=0x120", "duplicate:id=0x122", "reorder:id=0x122"], TALK)
    assert [said(one) for one in heard] == ["b d", "C C", "b d C C"]
    assert {name: hub.counts[name] for name in ("drop", "duplicate", "reorder")} == {
        "drop": 1, "duplicate": 1, "reorder": 1,
    }  # fmt: skip


def test_the_hub_drops_by_chance_and_its_seed() -> None:
    got, hub = exchange(["drop:p=0.2"], seed=3)
    assert sorted(set(got)) == got
    assert 10 < hub.counts["drop"] == 200 - len(got) < 90
    assert exchange(["drop:p=0.2"], seed=3)[0] == got
    assert exchange(["drop:from_s=3600"])[0] == list(range(200))


def test_the_hub_delays() -> None:
    with running_hub(["delay:ms=120"]) as hub, two_on(hub) as (one, other):
        begin = time.monotonic()
        for number in range(10):
            one.send(frame(number))
        assert numbers(other, 10, 2.0) == list(range(10))
        assert time.monotonic() - begin >= 0.12


def test_the_hub_reports_bus_errors() -> None:
    with running_hub(["error:class=0x40,id=0x7ff"]) as hub, two_on(hub) as (one, other):
        one.send(frame(1, 0x7FF))
        for client in (one, other):  # the sender stands on the same wire
            with pytest.raises(RigError, match="0x40: bus_off"):
                client.receive(2.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("dropp:p=1", "fault = 'dropp': must be one of drop"),
        ("drop:q=1", "must be KIND:KEY=VALUE"),
        ("drop:p=much", "fault drop: p = 'much': must be a number"),
        ("drop:p=2", r"p = 2: must be in \[0, 1\]"),
        ("delay:p=1", "must be given ms, for example delay:ms=1"),
        ("freeze:", "must be given client"),
    ],
)
def test_a_fault_that_cannot_be_is_named(text: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        BusFault.parse(text)
