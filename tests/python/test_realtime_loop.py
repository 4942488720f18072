"""The real-time loop from Python: drives a throttle behind a bus, ends in every way it should, says what was late.

No test here asserts how late anything is: a busy machine may be late, and must count it.
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode
from mgdd.errors import ParameterError, RigError
from mgdd.results.labels import check_labels
from mgdd.rig import BusBridge, Frame, LoopMessage, RealtimeLoop, RingTransport, SocketCanTransport
from throttle_node import (
    ANGLE,
    COMMAND,
    MEASUREMENTS,
    PERIOD_S,
    SENSORS,
    STATUS,
    ThrottleNode,
    patient_envelope,
)


def make_loop(transport: RingTransport, controller: Any = None, **changes: Any) -> RealtimeLoop:
    settings: dict[str, Any] = {
        "command": COMMAND,
        "measurements": MEASUREMENTS,
        "envelope": patient_envelope(),
        "realtime": False,
        "lock_memory": False,
    }
    return RealtimeLoop(controller or Pid(sample_s=PERIOD_S), transport, **{**settings, **changes})


def becomes(condition: Callable[[], bool], within_s: float = 20.0) -> bool:
    until = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.005)
    return True


def go(loop: RealtimeLoop) -> None:
    loop.arm(20.0)
    loop.drive(20.0)


def test_drives_a_throttle_and_leaves_it_open() -> None:
    transport = RingTransport()
    with ThrottleNode.on(transport) as node:
        with make_loop(transport, reference_deg=30.0) as loop:
            assert loop.running
            go(loop)
            assert becomes(lambda: abs(node.angle_deg - 30.0) < 1.0)
            loop.set_reference(55.0)
            assert becomes(lambda: abs(node.angle_deg - 55.0) < 1.0)
            assert loop.mode == "run"
            assert node.commands[-1][1] == 1.0
        assert not loop.running
        assert becomes(lambda: transport.waiting_to_send == 0)
    assert node.commands[-5:] == [(0.0, 0.0)] * 5
    assert node.check.counts["wrong_crc"] == 0
    assert [(e.before, e.after, e.reason) for e in loop.events()] == [
        ("init", "armed", "requested"),
        ("armed", "run", "requested"),
        ("run", "init", "requested"),
    ]


@pytest.mark.parametrize("kind", ["guided", "sliding", "mgdd1"])
def test_every_controller_runs(kind: str) -> None:
    controllers: dict[str, Callable[[], Any]] = {
        "guided": lambda: GuidedPredictive(sample_s=PERIOD_S),
        "sliding": lambda: SlidingMode(sample_s=PERIOD_S),
        "mgdd1": Mgdd1,
    }
    transport, period_s = RingTransport(), 0.001 if kind == "mgdd1" else PERIOD_S
    envelope = patient_envelope(cycle_s=period_s)
    with (
        ThrottleNode.on(transport),
        make_loop(transport, controllers[kind](), envelope=envelope, reference_deg=40.0) as loop,
    ):
        go(loop)
        assert becomes(lambda: loop.report()["fresh_cycles"] > 30)
        samples = loop.samples()
    driven = samples["asked_duty"].values[samples["mode"].values == "run"]
    assert driven.size > 0
    assert np.isfinite(driven).all()


def test_samples_are_labelled_and_continue() -> None:
    transport = RingTransport()
    with ThrottleNode.on(transport), make_loop(transport, reference_deg=20.0) as loop:
        go(loop)
        assert becomes(lambda: loop.report()["cycles"] > 50)
        first = loop.samples()
        assert becomes(lambda: loop.report()["cycles"] > 80)
    second = loop.samples()
    for dataset in (first, second):
        check_labels(dataset)
    assert float(second["time_s"][0]) > float(first["time_s"][-1]) > float(first["time_s"][0]) == 0.0
    cycles = np.concatenate([first["cycle"].values, second["cycle"].values])
    assert (np.diff(cycles) >= 1).all()
    assert int((np.diff(cycles) - 1).sum()) <= loop.report()["missed"]
    np.testing.assert_allclose(first["time_s"].values / PERIOD_S, first["cycle"].values - cycles[0], atol=1e-6)
    assert set(np.unique(first["mode"])) >= {"init", "run"}
    assert loop.samples().sizes["time_s"] == 0


def test_the_report_adds_up() -> None:
    transport = RingTransport()
    with ThrottleNode.on(transport), make_loop(transport, sample_capacity=4) as loop:
        assert becomes(lambda: loop.report()["cycles"] > 40)
    report = loop.report()
    assert report["compute_us"]["count"] == report["cycles"]
    assert report["lateness_us"]["count"] >= report["cycles"]
    assert report["late"] <= report["missed"]
    for name in ("lateness_us", "compute_us", "age_us", "send_us"):
        h = report[name]
        assert 0.0 <= h["p50"] <= h["p99"] <= h["p99_9"] <= h["max"], name
    assert report["dropped_samples"] == report["cycles"] - 4
    assert report["bus"]["sent"] + report["bus"]["full"] == report["cycles"]
    assert report["schedule"]["realtime"] is False
    assert f"{report['cycles']} cycles of 2 ms" in loop.summary()


def test_queued_references_are_followed_in_order() -> None:
    transport = RingTransport()
    track = 20.0 + 0.1 * np.arange(1.0, 201.0)
    with ThrottleNode.on(transport), make_loop(transport, reference_deg=20.0) as loop:
        loop.queue_references(track)
        assert loop.queued_references == 200
        go(loop)
        assert becomes(lambda: loop.queued_references == 0)
        assert becomes(lambda: loop.samples()["reference_deg"].values[-1:].tolist() == [track[-1]])
        loop.set_reference(11.0)
        assert becomes(lambda: loop.samples()["reference_deg"].values[-1:].tolist() == [11.0])


def test_what_a_controller_learnt_comes_back() -> None:
    transport, pid = RingTransport(), Pid(sample_s=PERIOD_S)
    before = dict(pid.state)
    with ThrottleNode.on(transport), make_loop(transport, pid, reference_deg=40.0) as loop:
        go(loop)
        assert becomes(lambda: loop.report()["fresh_cycles"] > 50)
        assert dict(pid.state) == before
    assert dict(pid.state) != before


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


def test_a_reference_that_is_not_renewed_aborts() -> None:
    transport = RingTransport()
    with ThrottleNode.on(transport), make_loop(transport, reference_timeout_s=0.3, reference_deg=30.0) as loop:
        go(loop)
        loop.set_reference(31.0)
        assert becomes(lambda: loop.mode == "limp")
        assert loop.reason == "aborted"
        assert loop.report()["reference_timeouts"] >= 1


def test_bad_arguments_are_refused() -> None:
    transport = RingTransport()
    with pytest.raises(ParameterError, match=r"sample_s = 0\.001 s: must be 0\.002 s, the period of the loop"):
        make_loop(transport, Pid())
    with pytest.raises(ParameterError, match="angle_deg is read from no signal"):
        make_loop(transport, measurements=[SENSORS])
    with pytest.raises(ParameterError, match="must belong to one message"):
        make_loop(transport, measurements=[STATUS, SENSORS, LoopMessage(can_id=0x120, signals={})])
    with pytest.raises(ParameterError, match="signals"):
        make_loop(transport, measurements=[STATUS, LoopMessage(can_id=0x122, signals={"speed": ANGLE})])
    with pytest.raises(ParameterError, match="fixed"):
        make_loop(transport, measurements=[STATUS, SENSORS, LoopMessage(can_id=1, signals={}, fixed=[(ANGLE, 1.0)])])
    with pytest.raises(ParameterError, match="controller"):
        make_loop(transport, object())
    with pytest.raises(ParameterError, match="transport"):
        make_loop("can0")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="stop_frames"):
        make_loop(transport, stop_frames=0)
    loop = make_loop(transport)  # what was refused has taken nothing
    with pytest.raises(RigError, match="serves another loop"):
        make_loop(transport)
    with pytest.raises(ParameterError, match="finite"):
        loop.set_reference(float("nan"))
    with pytest.raises(ParameterError, match="finite"):
        loop.queue_references([1.0, float("inf")])
    with pytest.raises(RigError, match="do not fit"):
        loop.queue_references(np.zeros(70_000))
    assert loop.queued_references == 0


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


def test_an_interface_that_is_not_there_is_named() -> None:
    with pytest.raises(RigError, match=r"this kernel has no CAN sockets|no interface 'mgdd_none'"):
        SocketCanTransport("mgdd_none")
    with pytest.raises(ParameterError, match="interface"):
        SocketCanTransport("")


PRELUDE = f"""
import sys
sys.path[:0] = [{str(Path(__file__).parent)!r}, {str(Path(__file__).parent / "support")!r}]
from test_realtime_loop import *
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
