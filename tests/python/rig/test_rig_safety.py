"""Every hazard of a rig on the virtual throttle: bridge open in time, reason named, no way back but the operator."""

import copy
import math
import pickle
from importlib import resources

import pytest

from mgdd.control import Pid
from mgdd.errors import DataError, ParameterError, RigError
from mgdd.io.parameters import ParameterFile
from mgdd.loop import Plant, VirtualThrottle, tuned_controller
from mgdd.rig import GatedThrottle, SafetyEnvelope, SafetyGate
from mgdd.rig.safety import SafetyChange
from rig_hazards import HAZARDS, LIMP_HOME_DEG, ONSET, OVER, Hazard, Loop, at


@pytest.mark.parametrize("name", HAZARDS)
def test_a_hazard_opens_the_bridge_in_time_and_only_the_operator_brings_it_back(name):
    hazard = HAZARDS[name]
    loop = Loop(hazard).started()
    assert loop.gate.mode == "run"
    assert loop.angle_deg == pytest.approx(40.0, abs=0.5)
    while loop.gate.mode == "run" and loop.k < OVER:
        loop.step()
    opened = loop.k
    assert opened - ONSET <= hazard.within
    assert (loop.gate.mode, loop.gate.reason) == (hazard.mode, hazard.reason)
    first = loop.gate.drain()[0]
    assert (first.before, first.after, first.reason, first.times) == ("run", hazard.mode, hazard.reason, 1)

    for _ in range(200):
        loop.step()
        if hazard.reason not in ("stall", "heat", "aborted"):  # these the open bridge clears
            with pytest.raises(RigError, match=r"reset refused in mode '(limp|fault)': "):
                loop.gate.reset()
    loop.until(opened + 400)
    if hazard.returns:
        assert loop.angle_deg == pytest.approx(LIMP_HOME_DEG, abs=1.0)
    loop.until(OVER + 500)  # the cause is gone for half a second
    assert (loop.gate.mode, loop.gate.reason) == (hazard.mode, hazard.reason)
    assert loop.angle_deg == pytest.approx(LIMP_HOME_DEG, abs=1.0)
    assert loop.gate.drain() == []
    with pytest.raises(RigError, match="run refused in mode"):
        loop.gate.run()

    loop.gate.reset()
    if hazard.mode == "fault":
        assert loop.gate.mode == "init"
        loop.gate.arm()
    loop.until(loop.k + 50)
    assert (loop.gate.mode, loop.gate.drive.bridge_open) == ("armed", True)
    loop.controller.reset()
    loop.gate.run()
    loop.until(loop.k + 700)
    assert loop.gate.mode == "run"
    assert loop.angle_deg == pytest.approx(at(hazard.reference_deg, loop.k - ONSET), abs=0.7)


def test_a_controller_beyond_the_limits_is_limited_and_counted():
    wild = Hazard("run", "requested", 0, duty=lambda k: 5.0 if k // 40 % 2 else -5.0)
    loop = Loop(wild).started()
    before, largest, fastest = loop.gate.drive.duty, 0.0, 0.0
    counted = loop.gate.counts["clamped"]
    envelope = loop.gate.envelope
    for _ in range(400):
        loop.step()
        duty = loop.gate.drive.duty
        largest, fastest, before = max(largest, abs(duty)), max(fastest, abs(duty - before)), duty
    assert loop.gate.mode == "run"
    assert largest == envelope.duty_limit
    assert fastest == pytest.approx(envelope.slew_per_s * envelope.cycle_s)
    assert loop.gate.counts["clamped"] == counted + 400
    assert loop.gate.counts["slewed"] > 50


def lively_reference(k: int) -> float:
    """Large and small steps, sines of 1 and 3 Hz, both stops."""
    time_s = 1e-3 * k
    if k < 3000:
        return (8.0, 70.0, 20.0, 90.0, 0.0, 45.0, 44.0, 46.0, 90.0, 8.0)[k // 300]
    if k < 6000:
        return 45.0 + 40.0 * math.sin(2.0 * math.pi * (1.0 if k < 4500 else 3.0) * time_s)
    return 90.0 if k < 7500 else 0.0


@pytest.mark.parametrize("kind", ["pid", "sliding_mode", "guided"])
def test_a_healthy_rig_is_never_stopped(kind):
    plant = GatedThrottle(VirtualThrottle(inputs=("duty", "bridge_open"), seed=4))
    plant.start()
    controller, measured, hottest = tuned_controller(kind), plant.measure(), 0.0
    for k in range(9000):
        duty = controller.step(lively_reference(k), measured.values["sensed_angle_deg"])
        plant.apply({"duty": duty})
        measured = plant.measure()
        hottest = max(hottest, plant.gate.rms_duty)
        assert plant.gate.mode == "run", (k, plant.gate.reason)
    assert measured.values["angle_deg"] == pytest.approx(0.0, abs=0.5)
    assert hottest < 0.3  # of 0.5


def test_zero_duty_with_a_closed_bridge_is_not_the_safe_state():
    """Why every mode but run opens the bridge: a brake needs far longer than what the six ways to die allow."""
    fallen = {}
    for bridge_open in (0.0, 1.0):
        plant = VirtualThrottle(inputs=("duty", "bridge_open"), start_deg=90.0, seed=1)
        for _ in range(400):
            plant.apply({"duty": 0.0, "bridge_open": bridge_open})
            fallen[bridge_open] = plant.measure().values["angle_deg"]
    assert fallen[1.0] == pytest.approx(LIMP_HOME_DEG, abs=1.0)
    assert fallen[0.0] > 30.0


def test_a_gated_throttle_is_a_plant_that_says_what_was_applied():
    plant = GatedThrottle(VirtualThrottle(inputs=("duty", "bridge_open"), seed=2))
    assert isinstance(plant, Plant)
    with pytest.raises(RigError, match="apply a duty first"):
        plant.measure()
    with pytest.raises(ParameterError, match="must be duty"):
        plant.apply({"duty": 0.1, "bridge_open": 0.0})
    plant.apply({"duty": 0.5})
    assert plant.measure().applied == {"duty": 0.0, "bridge_open": 1.0}
    plant.start()
    controller, measured = Pid(), plant.measure()
    for _ in range(600):
        plant.apply({"duty": controller.step(40.0, measured.values["sensed_angle_deg"])})
        measured = plant.measure()
    assert measured.values["angle_deg"] == pytest.approx(40.0, abs=0.5)
    assert measured.applied["bridge_open"] == 0.0
    plant.apply({"duty": math.nan})
    assert plant.measure().applied == {"duty": 0.0, "bridge_open": 1.0}
    assert plant.gate.reason == "invalid_duty"
    with pytest.raises(ParameterError, match="must take duty, or duty and bridge_open"):
        GatedThrottle(VirtualThrottle(inputs=("duty", "supply_v")))


@pytest.mark.parametrize("shadow", [False, True])
def test_where_the_bridge_cannot_be_opened_the_run_ends(shadow):
    plant = GatedThrottle(VirtualThrottle(seed=2), shadow=shadow)
    assert plant.start() == pytest.approx(LIMP_HOME_DEG, abs=1.0)
    for _ in range(250):  # beyond the ramp of the first 0.2 s
        plant.apply({"duty": 0.3})
        measured = plant.measure()
    assert measured.applied == {"duty": 0.3}
    plant.gate.abort()
    if shadow:
        plant.apply({"duty": 0.3})
        assert plant.measure().applied == {"duty": 0.0}
        return
    with pytest.raises(RigError, match="the safety gate went to 'limp': aborted"):
        plant.apply({"duty": 0.3})
    assert plant.measure().applied == {"duty": 0.3}, "a refused duty is not sent"


def well() -> dict[str, object]:
    return {"good_frames": 1, "age_s": 0.0, "sensor_v": (1.5, 3.5), "angle_deg": 22.5}


def running(envelope: SafetyEnvelope | None = None) -> SafetyGate:
    gate = SafetyGate(envelope)
    for _ in range(30):
        gate.observe(**well())
        gate.command(0.0)
    gate.arm()
    gate.run()
    gate.observe(**well())
    gate.command(0.0)
    return gate


def test_an_exception_aborts_and_the_end_disarms():
    gate = running()
    with pytest.raises(ZeroDivisionError), gate:
        1 / 0  # noqa: B018
    assert (gate.mode, gate.reason, gate.drive) == ("limp", "aborted", gate.drive)
    assert gate.drive.bridge_open
    with pytest.raises(KeyboardInterrupt), running() as other:
        raise KeyboardInterrupt
    assert other.reason == "aborted"
    with running() as third:
        pass
    assert (third.mode, third.drive.bridge_open) == ("init", True)
    with SafetyGate() as fourth:
        pass
    assert fourth.mode == "init"


def test_bad_facts_are_refused_and_change_nothing():
    gate = running()
    before = gate.state
    for wrong in ({"good_frames": -1}, {"bad_frames": -1}, {"missed_deadlines": -1}, {"bus": "of"}, {"request": "go"}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            gate.observe(**wrong)
        assert gate.state == before
    gate.observe(**well())
    with pytest.raises(ParameterError):
        gate.command("0.3")
    assert gate.mode == "run"


def test_copies_and_saved_states_go_on_alike():
    gate = running()
    other = SafetyGate(gate.envelope)
    other.state = gate.state
    third = pickle.loads(pickle.dumps(gate))
    fourth = copy.deepcopy(gate)
    for k in range(300):
        drives = []
        for each in (gate, other, third, fourth):
            each.observe(**well(), bad_frames=int(k == 250) * 3)
            drives.append(each.command(0.3 * math.sin(0.05 * k)))
        assert len(set(drives)) == 1
    assert gate.state == other.state == third.state == fourth.state
    assert gate.mode == "limp"
    assert gate.drain() == fourth.drain() != []


def test_the_audit_list_is_of_fixed_size_and_counts_what_it_lost():
    gate = running()
    gate.drain()
    for _ in range(50):
        gate.stop()
        gate.run()
        gate.observe(**well())
    changes = gate.drain()
    assert len(changes) == 64
    assert gate.counts["dropped"] == 36
    assert changes[0] == SafetyChange(31, "run", "armed", "requested", 3)
    assert gate.counts["requested"] == 102


def test_an_envelope_is_written_and_read_exactly_and_refused_by_name(tmp_path):
    odd = SafetyEnvelope(duty_limit=0.1 + 0.2, slew_per_s=1.0 / 3.0, bus_fault_from="off", closed_deg=-1e-7)
    assert SafetyEnvelope.from_toml(odd.to_toml()) == odd
    assert isinstance(odd.replace(stall_s=0.3), SafetyEnvelope)
    assert pickle.loads(pickle.dumps(odd)) == odd
    file = tmp_path / "mine.toml"
    text = odd.to_toml()

    def refused(old: str, new: str, error: type[Exception], message: str) -> None:
        assert text.count(old) == 1
        file.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(error, match=message) as caught:
            SafetyEnvelope.load(file)
        assert "mine.toml" in str(caught.value)

    refused('stall_s = { value = 0.2, unit = "s" }', "", DataError, "lacks stall_s")
    refused("stall_s =", "stal_s =", ParameterError, "stal_s: unknown key: did you mean 'stall_s'")
    refused(
        'stall_s = { value = 0.2, unit = "s"',
        'stall_s = { value = 200.0, unit = "ms"',
        ParameterError,
        "stall_s: unit = 'ms': must be 's'",
    )
    refused('kind = "safety_envelope"', 'kind = "engine"', DataError, "kind = 'engine'")
    refused('value = "off"', 'value = "on"', ParameterError, "bus_fault_from = 'on': must be one of")
    refused('value = "off"', "value = 3", ParameterError, "bus_fault_from: value = 3: must be text")
    refused("stall_s = { value = 0.2,", "stall_s = { value = -0.2,", ParameterError, "stall_s = -0.2 s: must be > 0")
    file.write_text(text, encoding="utf-8")
    assert SafetyEnvelope.load(file) == odd
    with pytest.raises(FileNotFoundError):
        SafetyEnvelope.load(tmp_path / "none.toml")
    with pytest.raises(DataError, match="no shipped envelope 'etbb': did you mean 'etb'"):
        SafetyEnvelope.load("etbb")


def test_every_value_of_a_shipped_envelope_says_where_it_comes_from():
    for file in resources.files("mgdd.rig").joinpath("envelopes").iterdir():
        entries = ParameterFile.from_toml(file.read_text(encoding="utf-8")).tables["parameters"]
        assert [name for name, entry in entries.items() if not entry.source] == []
