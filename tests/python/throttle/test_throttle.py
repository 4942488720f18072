"""The throttle plant at its Python face: closed forms, measured-like figures, lanes, sensors, refusals."""

import signal

import numpy as np
import pytest

from mgdd import presets
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.loop import ThrottleFault
from mgdd.results.labels import check_labels, labelled_dataset
from mgdd.throttle import SensorPair, Throttle, characteristics, simulate_throttle
from mgdd.throttle.characteristics import airflow_torque_nm
from mgdd.throttle.simulation import step_summary

P1 = Throttle()
BARE = P1.replace(coulomb_nm=0.0, stiction_nm=0.0, preload_above_nm=0.0, preload_below_nm=0.0, inductance_mh=0.0)


def ramp(rate_per_s, top, *, sample_s=1e-3):
    return np.linspace(0.0, top, round(abs(top) / rate_per_s / sample_s) + 1)


def first_time(run, condition):
    hit = np.asarray(condition)
    assert hit.any()
    return float(run["time_s"][int(np.argmax(hit))])


# --- laws ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("supply_v", "expected"), [(10.0, 0.2663), (12.0, 0.2219), (14.4, 0.1849)])
def test_breakaway_scales_with_the_supply(supply_v, expected):
    g = characteristics(P1.replace(supply_v=supply_v))
    assert float(g["preload_above"] + g["coulomb"]) == pytest.approx(expected, rel=5e-4)
    given, built = (
        simulate_throttle(P1, ramp(0.02, 0.3), supply_v=supply_v),
        simulate_throttle(P1.replace(supply_v=supply_v), ramp(0.02, 0.3)),
    )
    np.testing.assert_array_equal(given["angle_deg"], built["angle_deg"])
    left = np.abs(given["angle_deg"] - 8.0) > 0.3
    assert float(given["duty"][int(np.argmax(left.to_numpy()))]) == pytest.approx(expected, abs=0.003)


def test_holding_duty_has_twice_the_friction_between_its_branches():
    curve = characteristics(P1)
    check_labels(curve)
    width = curve["duty_rising"] - curve["duty_falling"]
    np.testing.assert_allclose(width, 2.0 * float(characteristics(P1)["coulomb"]), rtol=1e-12)
    assert float(width[0]) == pytest.approx(0.1854, abs=5e-5)
    at_45 = float(characteristics(P1, [45.0])["duty_spring"][0])
    assert at_45 == pytest.approx((0.396 + 0.087 * np.radians(37.0)) / 3.064, rel=1e-12)
    # A closing air flow asks for more duty, a dead band too; stiction widens the band of rest only.
    assert float(characteristics(P1.replace(pressure_drop_kpa=10.0), [45.0])["duty_spring"][0]) > at_45 + 0.02
    assert float(characteristics(P1.replace(dead_band=0.05), [45.0])["duty_spring"][0]) == pytest.approx(at_45 + 0.05)
    sticky = characteristics(P1.replace(friction="stiction", stiction_nm=0.3), [45.0])
    assert float(sticky["duty_breakaway_up"][0] - sticky["duty_rising"][0]) == pytest.approx(0.016 / 3.064)


def test_the_plate_stays_within_the_holding_band_and_leaves_it():
    throttle = presets.load("P2").throttle.replace(friction="coulomb", stiction_nm=0.1)
    curve = characteristics(throttle, [45.0])
    low, high = float(curve["duty_falling"][0]), float(curve["duty_rising"][0])
    for duty, stays in ((low + 1e-3, True), (high - 1e-3, True), (low - 1e-3, False), (high + 1e-3, False)):
        # The current builds up first: it starts where it will stay, at rest against the spring.
        run = simulate_throttle(throttle.replace(inductance_mh=0.0), duty, start_deg=45.0, duration_s=0.5)
        assert (abs(float(run["angle_deg"][-1]) - 45.0) < 1e-9) == stays, duty
    # In degrees: 2 T_d/k_s wide at one duty, or the whole travel where that is less.
    half = np.degrees(0.1 / 0.819)
    middle = float(curve["duty_spring"][0])
    starts = [45.0 - half + 0.05, 45.0 + half - 0.05, 45.0 - half - 0.2, 45.0 + half + 0.2]
    runs = simulate_throttle(throttle.replace(inductance_mh=0.0), middle, start_deg=starts, duration_s=0.5)
    moved = np.abs(runs["angle_deg"][:, -1].to_numpy() - starts)
    assert (moved < 1e-9).tolist() == [True, True, False, False]
    assert np.degrees(2.0 * 0.284 / 0.087) > 82.0


def test_without_friction_and_preload_the_plate_follows_the_closed_form():
    slow, fast = characteristics(BARE)["pole_real_per_s"].sel(side="above").values
    time = np.arange(5001) * 1e-3
    exact = 8.0 + 1.8 * (fast * np.exp(slow * time) - slow * np.exp(fast * time)) / (fast - slow)
    for step_s, tolerance in ((1e-4, 4e-5), (1e-3, 3.5e-4)):
        run = simulate_throttle(BARE, np.zeros(time.size), start_deg=9.8, step_s=step_s)
        assert np.abs(run["angle_deg"] - exact).max() < tolerance


def test_linear_part():
    part = characteristics(P1).sel(side="above")
    check_labels(part)
    np.testing.assert_allclose(part["pole_real_per_s"], [-0.8298, -49.929], rtol=1e-4)
    assert not part["pole_imag_rad_per_s"].any()
    assert float(part["gain_deg_per_duty"]) == pytest.approx(2017.9, rel=1e-4)
    assert float(part["natural_frequency_rad_per_s"]) == pytest.approx(6.437, rel=1e-3)
    assert float(part["damping_ratio"]) == pytest.approx(3.943, rel=1e-3)
    soft = characteristics(P1.replace(spring_below_nm_per_rad=0.0)).sel(side="below")
    assert np.isinf(soft["gain_deg_per_duty"])


# --- figures of P1 --------------------------------------------------------------------------------------------------


def test_full_duty_opens_and_closes():
    run = simulate_throttle(P1, 1.0, duration_s=0.3)
    summary = step_summary(run)
    assert summary["t10_s"] == pytest.approx(0.019, abs=0.002)
    assert summary["t90_s"] == pytest.approx(0.078, abs=0.002)
    assert first_time(run, run["angle_deg"] >= 90.0) == pytest.approx(0.085, abs=0.002)
    closing = simulate_throttle(P1, -1.0, start_deg=90.0, duration_s=0.3)
    assert first_time(closing, closing["angle_deg"] <= 0.0) == pytest.approx(0.071, abs=0.002)
    # On the stop: a peak, no rebound, and a penetration of what is left of the stall torque.
    assert summary["max_angle_deg"] - 90.0 == pytest.approx(0.37, abs=0.06)
    after = run["angle_deg"][run["time_s"] > 0.087]
    assert float(after.min()) > 90.0
    assert summary["final_angle_deg"] - 90.0 == pytest.approx(0.026, rel=0.15)


@pytest.mark.parametrize(
    ("bridge", "start", "end", "expected"),
    [("open", 90.0, 9.0, 0.191), ("brake", 90.0, 9.0, 0.905), ("brake", 0.0, 7.0, 0.128)],
)
def test_power_off(bridge, start, end, expected):
    run = simulate_throttle(P1, 0.0, start_deg=start, bridge=bridge, duration_s=1.5)
    hit = run["angle_deg"] <= end if start > end else run["angle_deg"] >= end
    assert first_time(run, hit) == pytest.approx(expected, rel=0.03)


# --- face -----------------------------------------------------------------------------------------------------------


def test_a_run_says_what_it_is():
    run = simulate_throttle(P1, [0.1, 0.2, 0.3], supply_v=13.0, airflow_torque_nm=[0.0, -0.1, -0.1], bridge="open")
    check_labels(run)
    assert set(run.data_vars) == {
        "duty", "angle_deg", "speed_deg_per_s", "current_a", "supply_v", "airflow_torque_nm"
    }  # fmt: skip
    assert (run.attrs["bridge"], run.attrs["start_deg"], run.attrs["coulomb_nm"]) == ("open", 8.0, 0.284)
    assert float(run["current_a"][0]) == 0.0
    assert set(simulate_throttle(P1, 0.1, duration_s=0.01).data_vars) == {
        "duty",
        "angle_deg",
        "speed_deg_per_s",
        "current_a",
    }
    assert simulate_throttle(P1, 0.0).sizes["time_s"] == 1001


def test_a_long_run_in_pieces_is_the_same_run():
    # More steps than between two looks for Ctrl-C.
    duty = 0.15 + 0.2 * np.sin(np.arange(45_000) * 2e-3)
    whole = simulate_throttle(P1, duty)
    halves = simulate_throttle([P1, P1], duty)
    np.testing.assert_array_equal(whole["angle_deg"], halves["angle_deg"][1])


def test_ctrl_c_ends_a_long_run():
    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        for run in (
            lambda: simulate_throttle(P1, np.full(4_000_000, 0.1), step_s=1e-5),
            lambda: simulate_throttle([P1] * 20_000, np.full(2000, 0.1), step_s=1e-5),
        ):
            signal.setitimer(signal.ITIMER_REAL, 0.3)
            with pytest.raises(KeyboardInterrupt):
                run()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_summary_of_a_falling_step_and_of_none():
    summary = step_summary(simulate_throttle(P1, -0.6, start_deg=80.0, duration_s=0.5))
    assert summary["min_angle_deg"] == pytest.approx(0.0, abs=0.3)
    assert 0.0 < summary["t10_s"] < summary["t90_s"] < 0.5
    still = step_summary(simulate_throttle(P1, 0.0, duration_s=0.1))
    assert np.isnan(still["t10_s"])
    assert np.isnan(still["t90_s"])
    with pytest.raises(DataError, match="run has no variable 'angle_deg'"):
        step_summary(labelled_dataset({"time_s": ("time_s", [0.0])}))


def test_air_flow():
    throttle = P1.replace(pressure_drop_kpa=10.0)
    torque = airflow_torque_nm(throttle, [[0.0, 55.0], [75.0, 90.0]])
    np.testing.assert_allclose(torque, [[0.0, -0.108], [-0.085 * 2.16, 0.0]], atol=1e-12)
    with pytest.raises(ParameterError, match="angle_deg holds a value that is not finite"):
        airflow_torque_nm(throttle, [np.nan])


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"duty": [0.0, 1.5]}, DataError, r"duty = 1.5 at sample 1: must be in \[-1, 1\]"),
        ({"duty": [0.0, np.nan]}, DataError, "duty is nan at sample 1"),
        ({"duty": [[0.0, 0.1]]}, ShapeError, r"duty has shape \(1, 2\)"),
        ({"duty": []}, ShapeError, "duty has no samples"),
        ({"duty": [0.0, 0.1], "duration_s": 1.0}, ParameterError, "goes with a constant duty only"),
        ({"duty": 0.1, "duration_s": 0.0}, ParameterError, "duration_s = 0 s: must be finite and >= sample_s"),
        ({"duty": 0.1, "sample_s": np.inf}, ParameterError, "sample_s = inf s: must be > 0"),
        ({"duty": [0.1], "time_s": [0.0, 0.1]}, ShapeError, "duty has 1 samples, time_s has 2"),
        ({"duty": 0.1, "time_s": [0.0]}, ShapeError, "at least two samples"),
        ({"duty": 0.1, "time_s": [0.0, np.nan]}, DataError, "time_s, sample 1: time is not finite"),
        ({"duty": 0.1, "time_s": [0.0, 0.0]}, DataError, "sample 1: 0 s does not exceed the time before"),
        ({"duty": 0.1, "time_s": [0.0, 0.1, 0.3]}, DataError, "the mean 0.15 s: resample the duty first"),
        ({"duty": 0.1, "time_s": [0.0, 0.1], "duration_s": 1.0}, ParameterError, "contradicts time_s"),
        ({"duty": 0.1, "start_deg": 91.0}, ParameterError, r"start_deg = 91 deg: must be in \[0, 90\]"),
        ({"duty": 0.1, "bridge": "closed"}, ParameterError, "bridge = 'closed': must be one of brake, open"),
        ({"duty": 0.1, "supply_v": -1.0}, DataError, "supply_v = -1 V at sample 0"),
        ({"duty": [0.1, 0.1], "supply_v": [12.0] * 3}, ShapeError, "supply_v has 3 samples, duty has 2"),
        ({"duty": [0.1] * 3, "airflow_torque_nm": [0.1]}, ShapeError, "airflow_torque_nm has 1 samples, duty has 3"),
        ({"duty": 0.1, "supply_v": [[12.0]]}, ShapeError, r"supply_v has shape \(1, 1\)"),
        ({"duty": 0.1, "airflow_torque_nm": np.inf}, DataError, "airflow_torque_nm is inf at sample 0"),
        ({"duty": 0.1, "step_s": 1e-7}, ParameterError, r"step_s = 1e-07 s: must be in \[1e-06, 0.005\]"),
        ({"duty": 0.1, "step_s": 3e-4}, ParameterError, "must go a whole number of times"),
    ],
)
def test_bad_input_is_refused_by_one_and_many(options, error, message):
    with pytest.raises(error, match=message):
        simulate_throttle(P1, **options)
    with pytest.raises(error, match=message):
        simulate_throttle([P1, P1], **options)
    assert simulate_throttle(P1, 0.0, duration_s=0.01).sizes["time_s"] == 11


def test_bad_cases_of_many_are_refused():
    with pytest.raises(ParameterError, match="start_deg are empty: give at least one"):
        simulate_throttle([], 0.1)
    with pytest.raises(ShapeError, match="start_deg has 3 entries, there are 2 throttles"):
        simulate_throttle([P1, P1], 0.1, start_deg=[1.0, 2.0, 3.0])
    with pytest.raises(ParameterError, match="throttle 1: friction and backlash must have the same form"):
        simulate_throttle([P1, P1.replace(friction="tanh")], 0.1)
    assert simulate_throttle([P1, P1], 0.1, start_deg=5.0)["start_deg"].values.tolist() == [5.0, 5.0]
    with pytest.raises(ParameterError, match="angle_deg = 91 deg: must lie within the travel, 0 to 90 deg"):
        characteristics(P1, [91.0])


# --- sensors --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sweep():
    return simulate_throttle(P1, 0.26 * np.sin(np.arange(3000) * 2.1e-3))


def test_healthy_sensors_follow_the_plate(sweep):
    seen = SensorPair().sense(sweep)
    check_labels(seen)
    assert not seen["fault"].any()
    assert np.isnan(seen["detected_s"])
    np.testing.assert_allclose(seen["sum_error_v"], 0.0, atol=0.0138)
    error = seen["sensed_angle_deg"] - sweep["angle_deg"]
    assert float(error.std()) == pytest.approx(0.045, abs=0.02)
    assert seen.identical(SensorPair().sense(sweep, seed=0))
    assert not seen["first_v"].equals(SensorPair().sense(sweep, seed=1)["first_v"])


@pytest.mark.parametrize("sensor", [1, 2])
@pytest.mark.parametrize(
    ("kind", "size"), [("open_wire", 0.0), ("short_to_ground", 0.0), ("short_to_supply", 0.0), ("offset", 0.25)]
)
def test_faults_are_detected_in_200_ms(sweep, kind, size, sensor):
    seen = SensorPair().sense(sweep, faults=[ThrottleFault(kind=kind, sensor=sensor, from_s=0.4, size=size)])
    assert float(seen["detected_s"]) <= 0.2 + 1e-9
    assert bool(seen["fault"][-1])
    assert not seen["fault"][:400].any()


def test_bad_sensors_and_faults_are_refused(sweep):
    for bad, message in (
        ({"kind": "rust"}, "kind = 'rust': must be one of open_wire"),
        ({"kind": "stuck", "sensor": 3}, "sensor = 3: must be 1 or 2"),
        ({"kind": "stuck", "size": 1.0}, "size = 1: must be given with 'offset'"),
        ({"kind": "offset"}, "size = None: must be given with 'offset'"),
        ({"kind": "offset", "size": 0.0}, "size = 0: must be given with 'offset'"),
        ({"kind": "jammed", "sensor": 1}, "sensor = 1: must be left out with 'jammed'"),
    ):
        with pytest.raises(ParameterError, match=message):
            ThrottleFault(**bad)
    stuck = ThrottleFault(kind="stuck")
    with pytest.raises(ParameterError, match="sensor 1 has two"):
        SensorPair().sense(sweep, faults=[stuck, stuck])
    with pytest.raises(ParameterError, match="jammed is not a fault of a sensor"):
        SensorPair().sense(sweep, faults=[ThrottleFault(kind="jammed")])
    with pytest.raises(ParameterError, match="from_s = -1 s"):
        SensorPair().sense(sweep, faults=[ThrottleFault(kind="stuck", from_s=-1.0)])
    with pytest.raises(ParameterError, match="seed = -1"):
        SensorPair().sense(sweep, seed=-1)
    with pytest.raises(DataError, match="run has no variable 'angle_deg'"):
        SensorPair().sense(sweep.drop_vars("angle_deg"))
    with pytest.raises(ShapeError, match="at least two"):
        SensorPair().sense(sweep.isel(time_s=[0]))
    with pytest.raises(DataError, match="uneven sampling"):
        SensorPair().sense(sweep.isel(time_s=[0, 1, 3]))
    with pytest.raises(ParameterError, match="adc_bits = 2: must be in"):
        SensorPair(adc_bits=2)
    assert SensorPair(closed_v=0.0, span_v=5.0) == SensorPair(span_v=5.0, closed_v=0.0)
    assert eval(repr(SensorPair(noise_v=0.001))) == SensorPair(noise_v=0.001)
