"""Faults of a throttle in the loop under its supervisor: safe in time, for the right reason, until it is told."""

import copy
import math
import pickle

import numpy as np
import pytest

from mgdd.control import Pid, SlidingMode, SupervisedController, ThrottleSupervisor
from mgdd.errors import ParameterError
from mgdd.loop import ThrottleFault, VirtualThrottle
from mgdd.throttle import SensorPair, Throttle, simulate_throttle
from mgdd_studies.throttle_cases import baselines, controller_of, supervisor_of, throttle_of
from mgdd_studies.throttle_faults import CASES, SENSORS, run_case

NORMAL, HOLDING, LIMITED, LIMP_HOME = range(4)
TOLD = 2900  # sample of the acknowledgement


@pytest.fixture(scope="module", params=list(baselines()))
def baseline(request):
    return baselines()[request.param]


@pytest.fixture(scope="module")
def run_of(baseline):
    done = {}

    def run(name):
        if name not in done:
            supervisor = supervisor_of(baseline.preset)
            done[name] = run_case(
                CASES[name], throttle_of(baseline.preset), controller_of(baseline), supervisor, seed=3
            )
        return done[name]

    return run


def sample_of(time_s: float) -> int:
    return round(time_s / 1e-3)


OPENING = [name for name, case in CASES.items() if case.mode == "limp_home"]
LIMITING = [name for name, case in CASES.items() if case.mode == "limited"]


@pytest.mark.parametrize("name", OPENING)
def test_the_bridge_is_open_within_50_ms_of_what_can_be_seen_and_stays_so_until_told(run_of, name):
    case, run = CASES[name], run_of(name)
    visible = case.seen_s(run)
    assert 1.0 <= visible < 1.5
    opened = int(np.argmax(run.bridge_open))
    assert opened >= 1000
    assert opened - sample_of(visible) <= 50
    assert run.reason[opened] == case.reason
    assert (run.mode[opened:TOLD] == LIMP_HOME).all()
    assert run.bridge_open[opened:TOLD].all()
    assert (run.duty[opened:TOLD] == 0.0).all()
    assert set(run.reason[opened:TOLD]) == {case.reason}
    assert run.refused == case.reason


@pytest.mark.parametrize("name", [name for name in OPENING if CASES[name].returns])
def test_the_springs_bring_the_plate_to_limp_home_in_time(run_of, baseline, name):
    run = run_of(name)
    rest = throttle_of(baseline.preset).limp_home_deg
    opened = int(np.argmax(run.bridge_open))
    in_time = opened + sample_of(0.8 if baseline.preset == "P3" else 0.4)
    assert (np.abs(run.angle_deg[in_time:TOLD] - rest) <= 1.0).all()


@pytest.mark.parametrize("name", [name for name in OPENING if not CASES[name].returns])
def test_a_plate_that_cannot_return_does_not_and_is_not_believed_to(run_of, name):
    run = run_of(name)
    opened = int(np.argmax(run.bridge_open))
    assert np.abs(run.angle_deg[1990] - run.angle_deg[opened + 100]) < 1e-6
    assert run.refused == CASES[name].reason


@pytest.mark.parametrize("name", CASES)
def test_it_recovers_once_it_is_told_and_the_cause_is_gone(run_of, name):
    run = run_of(name)
    assert run.accepted == "none"
    assert (run.mode[TOLD + 1 :] == NORMAL).all()
    assert run.angle_deg[-1] == pytest.approx(40.0, abs=0.5)


@pytest.mark.parametrize("name", LIMITING)
def test_a_limit_is_reported_and_stays_until_told(run_of, name):
    case, run = CASES[name], run_of(name)
    first = int(np.argmax(run.mode == LIMITED))
    assert 1000 <= first <= 1050
    assert (run.mode[first:TOLD] == LIMITED).all()
    assert set(run.reason[first:TOLD]) == {case.reason}
    assert not run.bridge_open.any()
    assert run.refused == case.reason
    ends = {"supply 8 V": 40.0, "reference above the travel": 90.0, "reference below the travel": 0.0}
    assert run.angle_deg[1900] == pytest.approx(ends[name], abs=0.7)


def test_a_short_gap_is_held_and_ends_by_itself(run_of):
    run = run_of("three samples missing")
    assert run.mode.max() == HOLDING
    assert np.flatnonzero(run.mode).tolist() == [1016, 1017, 1018]
    assert run.reason[1990] == "none"  # acknowledged meanwhile
    assert run.reason[1500] == "missing_sample"
    assert not run.bridge_open.any()
    assert run.angle_deg[1600] == pytest.approx(60.0, abs=0.5)


def test_a_spring_lost_below_limp_home_is_seen_while_the_plate_opens_slowly(baseline):
    """Mirrored: below limp-home a whole spring opens by itself, so that a slow opening needs no duty."""
    lost = ThrottleFault(kind="spring_below", from_s=0.2)
    plant = VirtualThrottle(
        throttle_of(baseline.preset),
        inputs=("duty", "bridge_open"),
        sensors=SENSORS,
        faults=[lost],
        start_deg=1.0,
        seed=1,
    )
    loop = SupervisedController(controller_of(baseline), supervisor_of(baseline.preset))
    values, order, opened = {"first_angle_deg": 1.0, "second_angle_deg": 1.0}, {"duty": 0.0, "bridge_open": 0.0}, None
    for k in range(600):
        acting, order = order, loop.step(1.0 + min(max(0.01 * (k - 300), 0.0), 3.0), values)
        plant.apply(acting)
        values = plant.measure().values
        if opened is None and order["bridge_open"]:
            opened = k
    assert opened is not None
    assert 200 <= opened <= 400
    assert loop.supervisor.reason == "spring_lost"
    assert values["angle_deg"] < 6.0  # nothing opens it


@pytest.mark.parametrize(("preset", "limit_s"), [("P1", 0.4), ("P2", 0.4), ("P3", 0.8)])
@pytest.mark.parametrize("start_deg", [0.0, 90.0])
def test_from_either_stop_the_open_bridge_brings_the_plate_to_limp_home_in_time_and_a_brake_does_not(
    preset, limit_s, start_deg
):
    throttle = throttle_of(preset)
    ends = []
    for bridge_open in (1.0, 0.0):
        plant = VirtualThrottle(throttle, inputs=("duty", "bridge_open"), start_deg=start_deg)
        for _ in range(sample_of(limit_s)):
            plant.apply({"duty": 0.0, "bridge_open": bridge_open})
            values = plant.measure().values
        ends.append(abs(values["angle_deg"] - throttle.limp_home_deg))
    assert ends[0] <= 1.0
    if preset == "P1" and start_deg == 90.0:
        assert ends[1] > 20.0


def test_every_fault_of_the_list_is_a_case():
    """NaN or stale, sensors that disagree, jam, spring, supply, missing sample, reference outside the travel."""
    reasons = {case.reason for case in CASES.values()}
    assert {
        "missing_sample",
        "stale_sample",
        "sensor_disagreement",
        "sensor_range",
        "jammed",
        "spring_lost",
        "supply_low",
        "supply_lost",
        "reference_range",
        "missing_reference",
    } <= reasons


def plain_loop(controller, plant, samples):
    angles, measured = [], 8.0
    for k in range(samples):
        plant.apply({"duty": controller.step(30.0 + 20.0 * math.sin(0.01 * k), measured)})
        values = plant.measure().values
        measured = values["sensed_angle_deg"]
        angles.append(values["angle_deg"])
    return angles


def supervised_loop(loop, plant, samples):
    angles, values = [], {"first_angle_deg": 8.0, "second_angle_deg": 8.0}
    for k in range(samples):
        plant.apply(loop.step(30.0 + 20.0 * math.sin(0.01 * k), values))
        values = plant.measure().values
        angles.append(values["angle_deg"])
    return angles


# Signs of what inertia, damping, motor, resistance, springs, preload and friction are off by.
BODIES = [(-1, -1, 1, 1, -1, -1, 1), (1, 1, -1, -1, 1, 1, -1), (1, -1, -1, 1, -1, 1, 1)]


@pytest.mark.parametrize("signs", BODIES, ids=str)
def test_no_false_alarm_on_plants_that_are_13_percent_off_with_noise_and_air(baseline, signs):
    """Steps to both stops and of 2 deg, sines, one through limp-home, in gusts."""
    inertia, damping, motor, resistance, spring, preload, friction = (1.0 + 0.13 * sign for sign in signs)
    nominal, rng = throttle_of(baseline.preset), np.random.default_rng(7)
    scales = {"inertia": inertia, "viscous": damping, "torque_constant": motor, "back_emf": motor,
              "resistance": resistance, "spring": spring, "preload": preload, "coulomb": friction,
              "stiction": friction}  # fmt: skip
    body = {
        name: value * next((by for what, by in scales.items() if name.startswith(what)), 1.0)
        for name, value in nominal.to_dict().items()
        if isinstance(value, float)
    }
    inputs = ("duty", "bridge_open", "airflow_torque_nm")
    plant = VirtualThrottle(nominal.replace(**body), inputs=inputs, sensors=SENSORS, start_deg=10.0, seed=7)
    loop = SupervisedController(controller_of(baseline), supervisor_of(baseline.preset))
    values, order, gust = {"first_angle_deg": 10.0, "second_angle_deg": 10.0}, {"duty": 0.0, "bridge_open": 0.0}, 0.0
    steps = np.repeat([10.0, 90.0, 10.0, 90.0, 50.0, 52.0, 49.0, 4.0, 20.0, 0.0, 60.0], 350)
    time = np.arange(2000) * 1e-3
    sines = np.where(time < 1.0, 40.0 + 10.0 * np.sin(6.0 * np.pi * time), 8.0 + 6.0 * np.sin(2.0 * np.pi * time))
    for k, reference in enumerate([*steps.tolist(), *sines.tolist()]):
        gust += 0.118 * (4.0 * rng.standard_normal() - gust)
        acting, order = order, loop.step(reference, values)
        plant.apply({**acting, "airflow_torque_nm": -0.1 * (1.0 + 0.3 * gust) if k > 1000 else 0.0})
        values = plant.measure().values
        assert loop.supervisor.mode == "normal", (k, loop.supervisor.reason)


@pytest.mark.parametrize("kind", [Pid, SlidingMode])
def test_a_supervisor_without_a_fault_changes_no_bit(kind):
    plain = plain_loop(kind(), VirtualThrottle(seed=2), 2000)
    loop = SupervisedController(kind())
    assert supervised_loop(loop, VirtualThrottle(inputs=("duty", "bridge_open"), seed=2), 2000) == plain
    assert (loop.supervisor.mode, loop.supervisor.reason) == ("normal", "none")


class Mine:
    """A controller of a user: proportional, without reset; it keeps what left."""

    def __init__(self) -> None:
        self.sent: list[float] = []

    def set_sent(self, duty: float) -> None:
        self.sent.append(duty)

    def step(self, reference_deg: float, measured_deg: float) -> float:
        return 0.15 + 0.02 * (reference_deg - measured_deg) if measured_deg < 35.0 else math.nan


def test_any_controller_can_be_watched_and_its_nan_opens_the_bridge():
    plant = VirtualThrottle(inputs=("duty", "bridge_open"), seed=2)
    mine, orders = Mine(), []
    loop, values, modes = SupervisedController(mine), {"first_angle_deg": 8.0, "second_angle_deg": 8.0}, []
    for _ in range(1000):
        orders.append(loop.step(60.0, values))
        plant.apply(orders[-1])
        values = plant.measure().values
        modes.append(loop.supervisor.mode)
    assert loop.supervisor.reason == "invalid_duty"
    assert modes.count("holding") == 19
    assert mine.sent == [order["duty"] for order in orders if not order["bridge_open"]]
    assert np.isfinite(mine.sent).all()  # the controller had asked for NaN
    assert values["angle_deg"] == pytest.approx(8.0, abs=1.0)
    assert loop.acknowledge() == "none"
    with pytest.raises(ParameterError, match="controller"):
        SupervisedController(object())


def test_no_values_are_no_measurement():
    loop = SupervisedController(Pid())
    for _ in range(30):
        order = loop.step(40.0, {})
    assert order == {"duty": 0.0, "bridge_open": 1.0}
    assert loop.supervisor.reason == "missing_sample"
    assert loop.acknowledge() == "missing_sample"


@pytest.mark.parametrize("way", ["state", "deepcopy", "pickle"])
def test_a_saved_supervisor_goes_on_bit_for_bit(way):
    first = ThrottleSupervisor(preload_below=0.17, jam_s=0.03)
    for k in range(300):
        first.observe(40.0, (30.0 + 0.01 * k, math.nan if k % 50 < 5 else 30.0 + 0.01 * k), supply_v=8.5)
        first.decide(0.2)
    if way == "state":
        second = ThrottleSupervisor(**first.settings)
        second.state = first.state
    else:
        second = copy.deepcopy(first) if way == "deepcopy" else pickle.loads(pickle.dumps(first))
    assert second.settings == first.settings
    for k in range(300):
        for one in (first, second):
            one.observe(40.0, (33.0 + 0.02 * k, 33.0), age_s=0.0)
            one.decide(0.2)
        assert first.state == second.state
        assert (first.mode, first.reason, first.return_test) == (second.mode, second.reason, second.return_test)
    assert first.reason == "sensor_disagreement"


def test_faults_are_refused_by_name():
    with pytest.raises(ParameterError, match=r"kind = 'stiff': must be one of open_wire, .*, jammed, jammed_at"):
        ThrottleFault(kind="stiff")
    with pytest.raises(ParameterError, match=r"size = None: must be given with .*'jammed_at'"):
        ThrottleFault(kind="supply_sag")
    with pytest.raises(ParameterError, match="size"):
        ThrottleFault(kind="jammed", size=3.0)
    with pytest.raises(ParameterError, match="until_s"):
        VirtualThrottle(faults=[ThrottleFault(kind="jammed", from_s=1.0, until_s=0.5)])
    with pytest.raises(ParameterError, match="number of faults"):
        VirtualThrottle(faults=[ThrottleFault(kind="jammed")] * 33)
    with pytest.raises(ParameterError, match="two"):
        VirtualThrottle(faults=[ThrottleFault(kind="stuck", sensor=1)] * 2)
    assert ThrottleFault(kind="spring_below").size == 1.0


def test_faults_of_both_kinds_share_the_keyword_and_a_restart_goes_on_with_them():
    faults = [
        ThrottleFault(kind="stuck", sensor=2, from_s=0.1, until_s=0.2),
        ThrottleFault(kind="supply_sag", size=8.0, from_s=0.05),
        ThrottleFault(kind="stale_sample", from_s=0.15, until_s=0.3),
    ]
    first = VirtualThrottle(faults=faults, seed=4)
    seen = []
    for _ in range(170):
        first.apply({"duty": 0.4})
        seen.append(first.measure().values)
    assert [row["supply_v"] for row in seen[48:52]] == [12.0, 12.0, 8.0, 8.0]
    assert seen[160]["first_v"] == seen[149]["first_v"]
    assert seen[160]["age_s"] == pytest.approx(0.011)
    second = VirtualThrottle(faults=faults, seed=4)
    second.state = first.state
    for _ in range(200):
        for plant in (first, second):
            plant.apply({"duty": 0.4})
        assert first.measure().values == second.measure().values


def test_a_sensor_fault_that_ends_is_forgotten_by_a_run():
    run = simulate_throttle(Throttle(), 0.3, duration_s=0.6)
    lasting = SensorPair().sense(run, faults=[ThrottleFault(kind="open_wire", sensor=1, from_s=0.1)])
    short = SensorPair().sense(run, faults=[ThrottleFault(kind="open_wire", sensor=1, from_s=0.1, until_s=0.25)])
    assert float(lasting["detected_s"]) == pytest.approx(0.2, abs=0.005)
    assert math.isnan(float(short["detected_s"]))
