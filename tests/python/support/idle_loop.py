"""A real-time loop on a bus where nobody speaks."""

from __future__ import annotations

from mgdd.control import Pid
from mgdd.rig import SafetyEnvelope
from mgdd.rig.realtime import LoopMessage, RealtimeLoop, RingTransport, SignalLayout


def idle_loop() -> RealtimeLoop:
    names = ("angle_deg", "first_v", "second_v")
    measured = {name: SignalLayout(start=16 * place, length=12) for place, name in enumerate(names)}
    return RealtimeLoop(
        Pid(sample_s=0.002),
        RingTransport(),
        command=LoopMessage(can_id=0x120, signals={"duty": SignalLayout(start=0, length=16, raw_type="signed")}),
        measurements=[LoopMessage(can_id=0x121, signals=measured)],
        envelope=SafetyEnvelope(cycle_s=0.002),
        realtime=False,
        lock_memory=False,
    )
