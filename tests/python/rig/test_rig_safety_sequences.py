"""Random faults and requests on the safety gate: no actuator is driven outside run, no fault ends by itself."""

import math
from collections import Counter
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mgdd.rig import SafetyEnvelope, SafetyGate

ENVELOPE = SafetyEnvelope(
    cycle_s=1e-3,
    duty_limit=0.7,
    slew_per_s=150.0,
    ramp_s=0.004,
    good_frames=3.0,
    heat_time_constant_s=0.006,
    rms_duty_limit=0.45,
    rms_duty_to_arm=0.3,
    stall_s=0.01,
    stall_duty=0.4,
    sensor_cycles=2.0,
)
WELL: dict[str, Any] = {"good_frames": 1, "age_s": 0.0, "sensor_v": (1.5, 3.5), "angle_deg": 22.5}


def well(**changed: Any) -> dict[str, Any]:
    return {**WELL, **changed}


# One letter is one cycle: facts and the duty asked for. Healthy ones and requests are many, so that runs come about.
LETTERS: list[tuple[dict[str, Any], float]] = [
    *[(WELL, duty) for duty in (0.0, 0.1, 0.42, -0.2, 0.65, -0.65)],
    *[(well(good_frames=2, angle_deg=angle), 0.5) for angle in (20.0, 25.0, 30.0)],
    *[(well(request=name), 0.2) for name in ("arm", "run", "arm", "run", "reset", "reset", "stop", "disarm", "abort")],
    (well(request="run"), 5.0),
    (WELL, 5.0),
    (WELL, -math.inf),
    (WELL, math.nan),
    ({}, 0.2),
    ({}, 0.3),
    ({"age_s": 0.0045}, 0.2),
    (well(bad_frames=1), 0.2),
    ({"bad_frames": 3}, 0.2),
    (well(bus="warning"), 0.2),
    (well(bus="passive"), 0.2),
    ({"bus": "off", "sent": False, "request": "run"}, 0.2),
    (well(sent=False), 0.2),
    (well(missed_deadlines=1), 0.2),
    (well(missed_deadlines=4, request="run"), 0.2),
    (well(sensor_v=(1.5, 3.9)), 0.2),
    (well(sensor_v=(0.0, 3.5), request="reset"), 0.2),
    (well(sensor_v=(4.0, 1.0)), 0.2),
    (well(angle_deg=120.0), 0.2),
    (well(angle_deg=math.nan, request="arm"), 0.2),
]
BLIND = len(LETTERS)  # a duty without facts before it
seen: Counter[str] = Counter()


TIMES = (1, 1, 1, 2, 4, 12)  # a byte is a letter and how often it comes: heat and a stall need many of one


def spelled(sequence: bytes) -> list[int]:
    """Give the letters of a sequence."""
    size = BLIND + 1
    return [byte % size for byte in sequence for _ in range(TIMES[min(byte // size, len(TIMES) - 1)])]


def started() -> dict[str, list[float]]:
    gate = SafetyGate(ENVELOPE)
    for k in range(12):
        gate.observe(**well(request={5: "arm", 6: "run"}.get(k, "none")))
        gate.command(0.1)
    assert gate.mode == "run"
    return gate.state


RUNNING = started()


def allowed(before: str, after: str, facts: dict[str, Any] | None) -> bool:
    """Return whether the operator's request or a cause may lead from one mode to the other."""
    request = None if facts is None else facts.get("request")
    asked = {
        ("init", "armed"): "arm",
        ("armed", "run"): "run",
        ("run", "armed"): "stop",
        ("armed", "init"): "disarm",
        ("run", "init"): "disarm",
        ("limp", "armed"): "reset",
        ("fault", "init"): "reset",
    }
    if after == before or (after == "limp" and before in ("armed", "run")) or after == "fault":
        return True
    return request == asked.get((before, after), "never")


def check(gate: SafetyGate, before: str, duty_before: float, letter: int) -> None:
    facts, asked = (None, 0.1) if letter == BLIND else LETTERS[letter]
    drive, mode = gate.drive, gate.mode
    assert drive.bridge_open == (mode != "run")
    assert allowed(before, mode, facts), (before, mode, facts)
    if mode != "run":
        assert drive.duty == 0.0
    else:
        assert abs(drive.duty) <= ENVELOPE.duty_limit
        assert abs(drive.duty - duty_before) <= ENVELOPE.slew_per_s * ENVELOPE.cycle_s + 1e-12
        assert facts is not None
        assert math.isfinite(asked)
        assert facts.get("bus", "active") in ("active", "warning")
        assert facts.get("missed_deadlines", 0) < ENVELOPE.missed_deadlines
        assert gate.rms_duty <= ENVELOPE.rms_duty_limit
    if before == "fault" and mode == "init":
        assert gate.cause == "none"
    if not math.isfinite(asked):
        assert mode == "fault"
    assert facts is None or drive.send == (facts.get("bus") != "off")


def step(gate: SafetyGate, letter: int) -> None:
    if letter == BLIND:
        gate.command(0.1)
        return
    facts, duty = LETTERS[letter]
    gate.observe(**facts)
    gate.command(duty)


@pytest.mark.slow
@settings(max_examples=10_000)
@given(letters=st.binary(min_size=1, max_size=60), runs=st.booleans())
@example(letters=bytes(range(BLIND + 1)), runs=True)
def test_no_sequence_drives_outside_run_or_leaves_a_fault_by_itself(letters: bytes, runs: bool) -> None:
    gate = SafetyGate(ENVELOPE)
    if runs:
        gate.state = RUNNING
    silent = 0
    for letter in spelled(letters):
        before, duty_before = gate.mode, gate.drive.duty
        step(gate, letter)
        check(gate, before, duty_before, letter)
        heard = letter != BLIND and LETTERS[letter][0].get("good_frames", 0) > 0
        silent = 0 if heard else silent + 1
        assert gate.mode != "run" or silent <= ENVELOPE.largest_age_cycles + ENVELOPE.held_cycles
        seen[gate.mode] += 1
        seen[gate.reason] += 1


def test_the_sequences_reached_every_mode_and_every_reason() -> None:
    """After the test above, in the same process."""
    reasons = (
        "requested aborted stale bad_frames bus_fault not_sent deadlines not_observed heat stall sensor_range"
        " sensor_disagreement sensor_slope travel invalid_duty"
    )
    if seen:
        missing = [name for name in ("init armed run limp fault " + reasons).split() if seen[name] < 20]
        assert missing == []
        assert seen["run"] > 10_000


@given(letters=st.lists(st.integers(0, BLIND), max_size=40))
@settings(max_examples=300)
def test_after_any_sequence_a_healthy_rig_and_its_operator_come_back_to_run(letters: list[int]) -> None:
    gate = SafetyGate(ENVELOPE)
    gate.state = RUNNING
    for letter in letters:
        step(gate, letter)
    for _ in range(60):  # long enough to cool
        gate.observe(**WELL)
        gate.command(0.0)
    if gate.mode in ("limp", "fault"):
        gate.reset()
    if gate.mode == "init":
        gate.arm()
    if gate.mode == "armed":
        gate.run()
    for _ in range(10):
        gate.observe(**WELL)
        drive = gate.command(0.1)
    assert (gate.mode, drive.duty, drive.bridge_open) == ("run", 0.1, False)
