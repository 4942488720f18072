"""The safety gate in the node: it acts by itself, and never before the gate of a healthy host."""

import csv
from pathlib import Path

import numpy as np
import pytest

from bus_node import ETB
from mgdd.errors import RigError
from mgdd.loop import ThrottleFault, VirtualThrottle
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.rig import CanRig, GatedThrottle, SafetyEnvelope, SafetyGate, VirtualNode
from mgdd.rig.can.node import LocalBus
from rig_hazards import LIMP_HOME_DEG, NODE_HAZARDS, ONSET, OVER, SAMPLE_MS, NodeLoop


@pytest.mark.parametrize("name", NODE_HAZARDS)
def test_the_node_opens_the_bridge_by_itself_and_only_safe_frames_bring_it_back(name: str) -> None:
    hazard = NODE_HAZARDS[name]
    loop = NodeLoop(hazard)
    loop.until(60.0, safe=True)
    loop.until(ONSET)
    assert (loop.core.gate.mode, loop.core.gate.reason) == ("run", "requested")
    assert loop.angle_deg == pytest.approx(40.0, abs=1.0)
    while loop.core.driven and loop.ms < OVER:
        loop.step()
    opened = loop.ms
    assert opened - ONSET <= hazard.within_ms
    assert (loop.core.gate.mode, loop.core.gate.reason) == (hazard.mode, hazard.reason)
    assert loop.core.last is not None
    assert loop.core.last.applied == {"duty": 0.0}

    loop.until(opened + 400.0)
    if hazard.returns:
        assert loop.angle_deg == pytest.approx(LIMP_HOME_DEG, abs=1.0)
    loop.until(OVER + 500.0)  # the cause is gone, and the host drives on
    assert (loop.core.gate.mode, loop.core.gate.reason) == (hazard.mode, hazard.reason)
    assert loop.angle_deg == pytest.approx(LIMP_HOME_DEG, abs=1.0)
    loop.until(loop.ms + 30.0, safe=True)
    assert loop.core.gate.mode == "armed"
    loop.step()
    assert loop.core.driven


def test_a_host_that_rests_may_fall_silent() -> None:
    loop = NodeLoop(NODE_HAZARDS["host dies"])
    loop.until(ONSET, safe=True)
    loop.until(OVER)  # nothing arrives
    assert loop.core.gate.mode == "armed"
    assert loop.core.gate.cause == "none"
    loop.until(OVER + 25.0)  # the first one jumps in its counter, then three good ones
    assert loop.core.driven


def test_step_by_step_the_node_judges_its_sensors_and_the_log_says_why(tmp_path: Path) -> None:
    """No clock: the fault of a sensor comes after so many samples."""
    truth, samples = tmp_path / "truth.csv", 0
    faults = [f"offset:sensor=2,size=0.3,from_s={1e-3 * ONSET}"]
    with (
        VirtualNode("etb", step=True, seed=1, faults=faults, truth=truth) as node,
        CanRig("etb", node.bus, mode="hil", timeout_s=20.0) as rig,
    ):
        while rig.state != "fault":
            rig.apply({"duty": 0.2})
            try:
                rig.measure()
            except RigError:
                break
            samples += 1
        assert rig.state == "fault"
    assert round(ONSET / SAMPLE_MS) + 5 <= samples <= round(ONSET / SAMPLE_MS) + 8
    rows = list(csv.DictReader(truth.read_text(encoding="utf-8").splitlines()))
    told = [(row["mode"], row["driven"], row["reason"]) for row in rows]
    assert told[:samples] == [("run", "1", "requested")] * samples
    assert told[samples:] == [("fault", "0", "sensor_disagreement")]
    assert rows[samples]["time_s"] == rows[samples - 1]["time_s"]


def test_nothing_was_measured_yet_and_the_gate_knows_the_sensors() -> None:
    """A node that steps is armed before its first sample: a look at the sensors moves nothing and draws no noise."""
    looked, straight = (VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=5e-3, seed=3) for _ in range(2))
    with CanRig(ETB, plant=looked) as rig:
        rig.apply({"duty": 0.25})
        measured = rig.measure().values["sensed_angle_deg"]
    straight.apply({"duty": 0.25, "bridge_open": 0.0})
    assert measured == pytest.approx(straight.measure().values["sensed_angle_deg"], abs=5.001e-3)
    dead = VirtualThrottle(inputs=["duty", "bridge_open"], faults=[ThrottleFault(kind="nan_sample")], seed=3)
    with pytest.raises(RigError, match="cannot be armed"):
        CanRig(ETB, plant=dead).open()


def lively_reference(sample_s: float) -> np.ndarray:
    """Large and small steps, a fast sine."""
    time_s = np.arange(0.0, 1.8, sample_s)
    steps = np.select([time_s < 0.2, time_s < 0.5, time_s < 0.8], [20.0, 70.0, 30.0], 32.0)
    return np.where(time_s < 1.0, steps, 45.0 + 30.0 * np.sin(6.0 * np.pi * time_s))


@pytest.mark.parametrize("kind", ["pid", "sliding_mode", "guided", "mgdd1", "linear_mpc", "nmpc"])
@pytest.mark.parametrize(("sample_s", "host"), [(1e-3, True), (1e-3, False), (5e-3, True)])
def test_no_shipped_controller_meets_a_limit_of_the_node(kind: str, sample_s: float, host: bool) -> None:
    """Below the gate of a host, and at 1 ms without one too."""
    plant = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=sample_s, seed=4)
    with CanRig(ETB, plant=plant) as rig:
        assert isinstance(rig.bus, LocalBus)
        gate = rig.bus.core.gate
        driven: CanRig | GatedThrottle = rig
        if host:
            driven = GatedThrottle(rig, SafetyGate(SafetyEnvelope.load("etb").replace(cycle_s=sample_s)))
            driven.start()
        controller, angle_deg = tuned_with_doubts(kind, sample_s=sample_s)[0], 8.0
        for wanted in lively_reference(sample_s):
            driven.apply({"duty": controller.step(float(wanted), angle_deg)})
            angle_deg = driven.measure().values["sensed_angle_deg"]
        assert (gate.mode, gate.counts["clamped"], gate.counts["slewed"]) == ("run", 0, 0)
        assert [change.reason for change in gate.drain()] == ["requested", "requested"]


def test_the_envelope_of_the_node_is_the_wider_one() -> None:
    host, node = (SafetyEnvelope.load(name).to_dict() for name in ("etb", "etb_node"))
    assert host == SafetyEnvelope().to_dict()
    assert (host["sensor_sum_tolerance_v"], host["sensor_low_v"], host["sensor_high_v"]) == (0.2, 0.2, 4.8)
    names = ("stall_s", "largest_age_cycles", "held_cycles", "bad_frames", "missed_deadlines")
    assert [host[name] for name in names] == [0.2, 3.0, 1.0, 3.0, 3.0]
    wider = [
        "duty_limit", "slew_per_s", "rms_duty_limit", "rms_duty_to_arm", "stall_s", "sensor_sum_tolerance_v",
        "sensor_high_v", "sensor_slope_v_per_s", "sensor_cycles", "travel_margin_deg",
    ]  # fmt: skip
    assert [name for name in wider if not node[name] > host[name]] == []
    assert node["sensor_low_v"] < host["sensor_low_v"]
    assert node["largest_age_cycles"] * node["cycle_s"] == pytest.approx(ETB.commands["ETB_Cmd"].timeout_s)
    assert (node["ramp_s"], node["held_cycles"]) == (0.0, 0.0)
    same = ["stall_duty", "stall_move_deg", "heat_time_constant_s", "sensor_sum_v", "closed_deg", "open_deg"]
    assert [name for name in same if node[name] != host[name]] == []
