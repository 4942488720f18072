"""Records whose angles slip from cycle to cycle: a stated speed, a step or an encoder that is not the engine's."""

from __future__ import annotations

import numpy as np
import pytest

from independent_engine import draw
from independent_engine import record as foreign
from mgdd.engine import Cylinder, OperatingPoint, analyze, simulate
from mgdd.errors import DataError
from mgdd.io import pressure_trace, read_pressure
from mgdd.io.cycle_phase import phase_warnings

STEP, RPM = 0.5, 1500.0
FULL = np.arange(-360.0, 360.0, STEP)


def record(random, cycles, *, motored=False):
    """Give cycles of 720 degrees from gas-exchange TDC on, with scatter of fuel, charge, burn, level and sample."""
    parts = []
    for _ in range(cycles):
        point = OperatingPoint(
            fuel_mg=0.0 if motored else 20.0 * (1.0 + 0.03 * random.standard_normal()),
            intake_pressure_kpa=150.0 * (1.0 + 0.01 * random.standard_normal()),
        )
        cycle = simulate(Cylinder(), point, soc_cad=-4.0 + random.standard_normal(), step_cad=STEP)
        pressure = cycle["pressure_bar"].to_numpy()
        closed = np.interp(FULL, cycle["crank_angle_cad"], pressure, left=pressure[0], right=pressure[0])
        parts.append(closed + 0.02 * random.standard_normal() + 0.05 * random.standard_normal(FULL.size))
    return np.array(parts)


def over_time(folder, cycles, rpm=RPM):
    """Write a record over time; the speed may change from sample to sample."""
    bar = cycles.ravel()
    seconds = np.concatenate([[0.0], np.cumsum(STEP / (6.0 * np.broadcast_to(rpm, bar.shape)))[:-1]])
    path = folder / "time.csv"
    np.savetxt(path, np.column_stack([seconds, bar]), delimiter=",", header="time_s,p_bar", comments="", fmt="%.9f")
    return path


def imep(trace):
    return float(analyze(trace, Cylinder(), point=OperatingPoint(), quiet=True)["mean_imep_closed_bar"])


@pytest.mark.parametrize("motored", [False, True])
@pytest.mark.parametrize("error", [0.0003, -0.0003, 0.004])
def test_a_speed_that_is_told_slightly_wrong_is_corrected(tmp_path, error, motored):
    cycles = record(np.random.default_rng(3), 20, motored=motored)
    trace = read_pressure(over_time(tmp_path, cycles), speed_rpm=RPM * (1.0 + error), firing_tdc_deg=360.0)
    assert trace.attrs["speed_rpm"] == pytest.approx(RPM, rel=1e-5)
    assert "the engine ran at 1500" in trace.attrs["warnings"] or "the engine ran at 1499.9" in trace.attrs["warnings"]
    true = imep(pressure_trace(FULL, cycles))
    assert imep(trace) == pytest.approx(true, abs=0.015 * max(abs(true), 5.0))


def test_a_right_speed_is_left_alone(tmp_path):
    for seed in range(20):
        random = np.random.default_rng(seed)
        path = over_time(tmp_path, record(random, int(random.integers(2, 8))))
        trace = read_pressure(path, speed_rpm=RPM, firing_tdc_deg=360.0)
        assert (trace.attrs["speed_rpm"], trace.attrs["warnings"]) == (RPM, "")


@pytest.mark.parametrize("error", [0.03, 1.0, -0.5])
def test_a_speed_of_another_point_is_refused(tmp_path, error):
    path = over_time(tmp_path, record(np.random.default_rng(3), 6))
    with pytest.raises(DataError, match=r"speed_rpm=.*the engine ran at (1[45]99|1500)\.?\d* rpm: correct it"):
        read_pressure(path, speed_rpm=RPM * (1.0 + error), firing_tdc_deg=360.0)
    assert read_pressure(path, speed_rpm=RPM, firing_tdc_deg=360.0).sizes["cycle"] == 6


def test_a_speed_that_changes_within_the_record_is_doubted(tmp_path):
    cycles = record(np.random.default_rng(3), 20)
    rpm = RPM * (1.0 + 0.004 * np.linspace(-1.0, 1.0, cycles.size))  # the mean is right, the middle is 7 °CA off
    with pytest.raises(DataError, match=r"crank angle slips: .* the speed changes within the record"):
        read_pressure(over_time(tmp_path, cycles, rpm), speed_rpm=RPM, firing_tdc_deg=360.0)
    rpm = RPM * (1.0 + 0.0006 * np.linspace(-1.0, 1.0, cycles.size))
    trace = read_pressure(over_time(tmp_path, cycles, rpm), speed_rpm=RPM, firing_tdc_deg=360.0)
    assert "the speed changes within the record" in trace.attrs["warnings"]


def test_a_wrong_step_of_samples_is_refused(tmp_path):
    cycles = record(np.random.default_rng(3), 10)
    path = tmp_path / "count.csv"
    np.savetxt(path, cycles.ravel(), header="p_bar", comments="")
    with pytest.raises(DataError, match=r"angle_step_deg=0\.(5|49999|500000)"):
        read_pressure(path, angle_step_deg=0.502, firing_tdc_deg=360.0)
    assert read_pressure(path, angle_step_deg=0.5, firing_tdc_deg=360.0).attrs["warnings"] == ""
    angles = 0.502 * np.arange(cycles.size)
    with pytest.raises(DataError, match=r"repeats every 722\.\d+ degrees, not every 720"):
        pressure_trace(angles, cycles.ravel(), firing_tdc_deg=360.0)


def test_two_cycles_tell_no_period_finer_than_half_a_sample():
    two = record(np.random.default_rng(3), 2)[:, ::2].ravel()
    shifted = 1.0 * np.arange(two.size) * (720.45 / 720.0)
    assert pressure_trace(shifted, two, firing_tdc_deg=360.0).sizes["cycle"] == 2
    with pytest.raises(DataError, match=r"repeats every 721\.\d+ degrees"):
        pressure_trace(1.0 * np.arange(two.size) * (721.4 / 720.0), two, firing_tdc_deg=360.0)


def test_an_encoder_that_loses_pulses_is_doubted():
    cycles = record(np.random.default_rng(3), 12)
    slipping = np.array([np.roll(pressure, k // 3) for k, pressure in enumerate(cycles)])
    assert "compression moves by +1.7" in pressure_trace(FULL, slipping).attrs["warnings"]
    one = cycles.copy()
    one[4] = np.roll(one[4], 3)
    assert "compression of cycle 5 lies +1." in pressure_trace(FULL, one).attrs["warnings"]
    assert pressure_trace(FULL, cycles).attrs["warnings"] == ""


@pytest.mark.parametrize("step", [0.2, 0.5, 1.0])
def test_forty_degrees_of_compression_are_enough(step):
    whole = foreign(np.random.default_rng(2), draw(np.random.default_rng(1), "diesel"), 20, step=step, noise_bar=0.02)
    cycles = whole.bar.copy()
    cycles[7] = np.roll(cycles[7], round(2.0 / step))
    late = whole.angle > -100.0 - 0.5 * step
    assert "compression of cycle 8 lies +" in " ".join(
        phase_warnings(whole.angle[late], cycles[:, late], over_time=False, source="x")
    )
    assert phase_warnings(whole.angle[late], whole.bar[:, late], over_time=False, source="x") == []


def test_lost_samples_are_placed_and_the_step_of_the_encoder_stays():
    for kind in ("spark", "diesel"):
        random = np.random.default_rng(4)
        engine = draw(random, kind)
        whole = foreign(random, engine, 40, step=0.5).bar
        torn = np.delete(whole.ravel(), 20 * 1440 + 900 + np.arange(4))
        trace = pressure_trace(0.5 * np.arange(torn.size), torn, firing_tdc_deg=360.0)
        assert "4 samples are missing between the compressions of cycles 21 and 22" in trace.attrs["warnings"]
        assert "the crank angle slips" not in trace.attrs["warnings"]
        kept = trace["pressure_bar"].to_numpy()
        assert np.array_equal(kept[:20], whole[:20])
        assert np.array_equal(kept[20:], whole[22:39][: len(kept) - 20])
        untouched = pressure_trace(0.5 * np.arange(whole.size), whole.ravel(), firing_tdc_deg=360.0)
        assert (untouched.sizes["cycle"], untouched.attrs["warnings"]) == (40, "")


def test_burns_that_scatter_do_not_hide_the_cycle_behind_a_multiple():
    random = np.random.default_rng(5)
    engine = draw(random, "spark")
    few = foreign(random, engine, 2, step=1.0, scatter=3.0).bar
    five = np.concatenate([few[:1], 0.55 * few[1:], few[1:], 0.6 * few[:1], few[1:]])
    bar = np.tile(five, (2, 1)).ravel() + random.normal(0.0, 0.02, 7200)
    trace = pressure_trace(1.0 * np.arange(bar.size), bar, firing_tdc_deg=360.0)
    assert trace.sizes["cycle"] == 10


def test_a_noisy_spark_record_has_no_slip_beyond_its_error():
    for seed in range(4):
        random = np.random.default_rng(seed)
        whole = foreign(random, draw(random, "spark"), 100, step=0.5, noise_bar=0.1)
        assert pressure_trace(whole.angle, whole.bar).attrs["warnings"] == ""


@pytest.mark.parametrize("at", [1, 5, 38])
def test_one_cycle_that_stands_apart_is_no_step_of_all_behind_it(at: int) -> None:
    cycles = foreign(np.random.default_rng(2), draw(np.random.default_rng(1), "diesel"), 40, noise_bar=0.02).bar
    cycles[at] = np.roll(cycles[at], 4)
    (text,) = phase_warnings(FULL, cycles, over_time=False, source="record")
    assert f"compression of cycle {at + 1} lies +2" in text
