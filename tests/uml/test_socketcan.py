"""On a kernel with CAN: run inside User-Mode Linux by tests/python/test_rig_uml.py, or by hand where vcan0 exists."""

from __future__ import annotations

import time
from collections.abc import Iterator

import can
import pytest

CHANNEL = "vcan0"
BUS_OFF, CONTROLLER, RESTARTED = 0x40, 0x04, 0x100


def open_bus(**settings: object) -> can.BusABC:
    return can.Bus(interface="socketcan", channel=CHANNEL, ignore_config=True, **settings)  # type: ignore[arg-type]


@pytest.fixture
def peer() -> Iterator[can.BusABC]:
    with open_bus() as bus:
        yield bus


def error_frame(kind: int) -> can.Message:
    return can.Message(arbitration_id=kind, data=bytes(8), is_error_frame=True, is_extended_id=False)


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
