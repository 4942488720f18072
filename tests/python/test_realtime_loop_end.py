"""Every way in which a real-time loop ends: asked to, forgotten, Ctrl-C, a process that stood still or is over."""

from __future__ import annotations

import gc
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from mgdd.errors import RigError
from mgdd.rig.realtime import RingTransport
from realtime_loops import becomes, make_loop


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
sys.path[:0] = [{str(Path(__file__).parent)!r}, {str(Path(__file__).parent / "support")!r}]
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
