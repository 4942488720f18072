"""One question: how punctual is the real-time loop of the core on this machine, and what does it do with what is late.

    python benchmarks/rig_loop.py [--seconds 60] [--period-ms 1] [--controller guided] [--busy] [--json FILE]

The loop drives a virtual throttle that a second thread of Python serves over a `RingTransport`, so frames, codec,
protection, controller, safety gate and sending are all in a cycle. `--busy` keeps a third thread of Python computing.
The gate is patient here: misses are counted and the loop goes on, so that the whole time is measured. Whether the loop
tracks is checked before its times are printed.
"""

from __future__ import annotations

import argparse
import json
import threading
import time
from pathlib import Path
from typing import Any

from support import machine

from mgdd._core.rig import protect
from mgdd.control import GuidedPredictive, Pid, SlidingMode
from mgdd.loop import VirtualThrottle
from mgdd.rig import SafetyEnvelope
from mgdd.rig.realtime import E2eSettings, Frame, LoopMessage, RealtimeLoop, RingTransport, SignalLayout

KINDS = {"guided": GuidedPredictive, "pid": Pid, "sliding": SlidingMode}
DUTY = SignalLayout(start=16, length=16, raw_type="signed", scale=5e-5)
ENABLE = SignalLayout(start=32, length=1)
ANGLE = SignalLayout(start=16, length=16, scale=0.01, offset=-10.0)
VOLTS = [SignalLayout(start=32, length=12, scale=0.00125), SignalLayout(start=44, length=12, scale=0.00125)]
STATUS = E2eSettings(data_id=0x121)


def serve(transport: RingTransport, sample_s: float, stop: threading.Event) -> None:
    """Answer every command with the sensors after one sample of the plant."""
    plant, counter = VirtualThrottle(inputs=("duty", "bridge_open"), sample_s=sample_s, seed=1), 0
    while not stop.is_set():
        frame = transport.take(0.02)
        if frame is None:
            continue
        plant.apply({"duty": DUTY.unpack(frame.data), "bridge_open": 1.0 - ENABLE.unpack(frame.data)})
        values = plant.measure().values
        payload = ANGLE.pack(bytes(8), values["sensed_angle_deg"])
        payload = VOLTS[1].pack(VOLTS[0].pack(payload, values["first_v"]), values["second_v"])
        counter = (counter + 1) % 16
        transport.feed(Frame(id=0x121, data=protect(STATUS, counter, payload)))


def compute(stop: threading.Event) -> None:
    while not stop.is_set():
        sum(range(1000))


def measure(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    period_s = options.period_ms * 1e-3
    transport, stop = RingTransport(), threading.Event()
    patient = dict.fromkeys(("missed_deadlines", "unsent_cycles", "largest_age_cycles"), 1000000.0)
    loop = RealtimeLoop(
        KINDS[options.controller](sample_s=period_s),
        transport,
        command=LoopMessage(
            can_id=0x120, signals={"duty": DUTY, "enable": ENABLE}, protection=E2eSettings(data_id=0x120)
        ),
        measurements=[
            LoopMessage(
                can_id=0x121,
                signals={"angle_deg": ANGLE, "first_v": VOLTS[0], "second_v": VOLTS[1]},
                protection=STATUS,
            )
        ],
        envelope=SafetyEnvelope(cycle_s=period_s, **patient),
        reference_deg=30.0,
    )
    threads = [threading.Thread(target=serve, args=(transport, period_s, stop))]
    threads += [threading.Thread(target=compute, args=(stop,))] if options.busy else []
    for thread in threads:
        thread.start()
    try:
        with loop:
            loop.arm(20.0)
            loop.drive(20.0)
            until, last = time.monotonic() + options.seconds, None
            while time.monotonic() < until:
                loop.set_reference(30.0 if int(until - time.monotonic()) % 2 else 50.0)
                loop.wait(min(0.5, max(until - time.monotonic(), 0.0)))
                last = loop.samples()
            loop.set_reference(40.0)
            loop.wait(1.0)
            last = loop.samples()
            error_deg = abs(float(last["sensed_angle_deg"][-1]) - 40.0)
    finally:
        stop.set()
        for thread in threads:
            thread.join()
    if error_deg > 1.0:
        raise SystemExit(f"the plate is {error_deg:.2f} deg off its reference: the loop does not track")
    return loop.report(), loop.summary()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the run (default 60)")
    parser.add_argument("--period-ms", type=float, default=1.0, help="period of the loop (default 1)")
    parser.add_argument("--controller", choices=sorted(KINDS), default="guided", help="default guided")
    parser.add_argument("--busy", action="store_true", help="a thread of Python computes beside")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    head = machine.versions()
    for name, words in head.items():
        print(f"{name}: {words}")
    report, summary = measure(options)
    print(summary)
    if options.json:
        options.json.write_text(json.dumps({"machine": head, "report": report}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
