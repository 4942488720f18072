"""Trouble of a bus below the real-time loop, and every way in which a loop ends."""

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
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


def test_waiting_lets_other_threads_run_and_says_whether_it_ended() -> None:
    loop = make_loop(RingTransport())
    assert loop.wait(0.0)
    loop.start()
    ended: list[bool] = []
    waiter = threading.Thread(target=lambda: ended.append(loop.wait(20.0)))
    waiter.start()
    assert not loop.wait(0.01)  # this thread goes on beside the one that waits
    assert not ended
    loop.stop()
    waiter.join()
    assert ended == [True]
    loop.stop()  # a second time does nothing
    with pytest.raises(RigError, match="started before"):
        loop.start()
    with pytest.raises(RigError, match="does not run"):
        loop.arm()


def test_a_forgotten_loop_ends_with_an_open_bridge() -> None:
    transport = RingTransport()
    loop = make_loop(transport)
    loop.start()
    assert transport.in_use
    del loop
    gc.collect()
    assert becomes(lambda: not transport.in_use)
    frames = []
    while (frame := transport.take()) is not None:
        frames.append(frame)
    assert len(frames) >= 5
    assert all(frame.data[4] & 0b1000 == 0 for frame in frames)


PRELUDE = f"""
import signal, sys
sys.path[:0] = [{str(Path(__file__).parent)!r}, {str(Path(__file__).parents[1] / "support")!r}]
from realtime_loops import *
from throttle_node import *
transport = RingTransport()
"""


def script(body: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", PRELUDE + body], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def said(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdout is not None
    assert process.stdout.readline().strip() == line, process.communicate(timeout=30)[1]


def finish(process: subprocess.Popen[str]) -> str:
    out, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    return out


def test_ctrl_c_ends_the_wait_and_the_loop_goes_on() -> None:
    process = script("""
signal.signal(signal.SIGINT, signal.default_int_handler)
with make_loop(transport) as loop:
    print("waiting", flush=True)
    try:
        loop.wait()
    except KeyboardInterrupt as stop:
        print(type(stop).__name__, loop.running, flush=True)
print(loop.running)
""")
    said(process, "waiting")
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    assert finish(process).split() == ["Interrupted", "True", "False"]


def test_a_process_that_stood_still_counts_it_and_opens_the_bridge() -> None:
    process = script("""
envelope = patient_envelope(missed_deadlines=100.0)
with ThrottleNode.on(transport), make_loop(transport, envelope=envelope, reference_deg=30.0) as loop:
    go(loop)
    print("driving", flush=True)
    becomes(lambda: loop.mode == "limp")
    report = loop.report()
    print(loop.mode, loop.reason, report["longest_row"] >= 150, report["lateness_us"]["max"] > 3e5)
""")
    said(process, "driving")
    process.send_signal(signal.SIGSTOP)
    time.sleep(0.5)
    process.send_signal(signal.SIGCONT)
    assert finish(process).split() == ["limp", "deadlines", "True", "True"]


def test_the_end_of_the_interpreter_ends_a_running_loop() -> None:
    process = script("""
loop = make_loop(transport)
loop.start()
becomes(lambda: loop.report()["cycles"] > 5)
print("leaving", flush=True)
""")
    said(process, "leaving")
    assert finish(process) == ""
