"""Trouble of a bus below the real-time loop: a silent node, error frames, a bus that is gone or is not there."""

from __future__ import annotations

import os
import sys
import threading
import time
from typing import Any

import pytest

from mgdd.errors import ParameterError, RigError
from mgdd.rig.can.bus_bridge import BusBridge
from mgdd.rig.realtime import Frame, RingTransport, SocketCanTransport
from realtime_loops import becomes, go, make_loop
from throttle_node import ThrottleNode, patient_envelope


def test_a_silent_node_opens_the_bridge_and_a_reset_needs_it_back() -> None:
    transport = RingTransport()
    envelope = patient_envelope(largest_age_cycles=100.0)
    with make_loop(transport, envelope=envelope, reference_deg=40.0) as loop:
        with ThrottleNode.on(transport):
            go(loop)
        assert becomes(lambda: loop.mode == "limp")
        assert loop.reason == "stale"
        with pytest.raises(RigError, match="no 'reset' within"):
            loop.reset(0.1)


def test_error_frames_reach_the_gate() -> None:
    transport = RingTransport()
    with make_loop(transport, reference_deg=30.0) as loop:
        with ThrottleNode.on(transport):
            go(loop)
        transport.feed(Frame(id=0x004, data=bytes([0, 0x20, 0, 0, 0, 0, 0, 0]), error=True))
        assert becomes(lambda: loop.mode == "limp")
        assert loop.reason == "bus_fault"
        assert loop.bus_state == "passive"
        assert transport.counts["controller_errors"] == 1


def test_the_virtual_bus_of_python_can_carries_a_loop() -> None:
    can = pytest.importorskip("can")
    transport = RingTransport()
    settings = {"interface": "virtual", "channel": f"loop {os.getpid()}", "ignore_config": True}
    with can.Bus(**settings) as host, can.Bus(**settings) as far:

        def take() -> Frame | None:
            message = far.recv(0.02)
            return message and Frame(id=message.arbitration_id, data=bytes(message.data))

        def feed(frame: Frame) -> None:
            far.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=frame.extended))

        with ThrottleNode(take, feed) as node:
            with BusBridge(host, transport) as bridge, make_loop(transport, reference_deg=35.0) as loop:
                go(loop)
                assert becomes(lambda: abs(node.angle_deg - 35.0) < 1.0)
            assert bridge.error is None
            sent = transport.counts["sent"]
            assert becomes(lambda: len(node.commands) == sent)
        assert node.commands[-1] == (0.0, 0.0)
        assert not any("bus bridge" in thread.name for thread in threading.enumerate())


class DeadBus:
    def recv(self, _: float) -> None:
        time.sleep(0.02)
        raise OSError("unplugged")

    def send(self, _: Any) -> None:
        raise OSError("unplugged")


def test_a_dead_bus_is_off_for_the_loop() -> None:
    pytest.importorskip("can")
    transport = RingTransport()
    with BusBridge(DeadBus(), transport) as bridge, make_loop(transport) as loop:  # type: ignore[arg-type]
        assert becomes(lambda: loop.bus_state == "off")
        assert isinstance(bridge.error, OSError)
        with pytest.raises(RigError, match="bus_fault"):
            loop.arm(0.1)


def test_without_python_can_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(RigError, match=r'pip install "mgdd\[can\]"'):
        BusBridge(None, RingTransport())  # type: ignore[arg-type]


def test_an_interface_that_is_not_there_is_named() -> None:
    with pytest.raises(RigError, match=r"this kernel has no CAN sockets|no interface 'mgdd_none'"):
        SocketCanTransport("mgdd_none")
    with pytest.raises(ParameterError, match="interface"):
        SocketCanTransport("")
