"""Excitation: what the signals are, that they stay within the duty, and what a check says before they are sent."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd import identify, signals
from mgdd.errors import ConvergenceError, DataError, ParameterError
from mgdd.identify import check_excitation, design_excitation
from mgdd.identify.throttle.excitation import EXCITATIONS, _signal_of
from mgdd.signals import chirp, triangle
from mgdd.throttle import Throttle, characteristics, simulate_throttle

SIGNALS: dict[str, Callable[..., Any]] = {
    "chirp": signals.chirp,
    "multisine": signals.multisine,
    "prbs": signals.prbs,
    "amplitude_random_steps": signals.amplitude_random_steps,
    "staircase": signals.staircase,
    "triangle": signals.triangle,
}


def duty(signal: Any) -> np.ndarray:
    return np.asarray(signal["duty"].to_numpy())


@pytest.mark.parametrize("name", SIGNALS)
@settings(max_examples=8, deadline=None)
@given(offset=st.floats(-0.9, 0.9), share=st.floats(0.05, 1.0))
def test_every_signal_keeps_its_swing_and_its_clock(name: str, offset: float, share: float) -> None:
    amplitude = share * (1.0 - abs(offset))
    signal = SIGNALS[name](offset=offset, amplitude=amplitude, sample_s=2e-3)
    values = duty(signal)
    assert np.abs(values - offset).max() <= amplitude * (1.0 + 1e-12) + 1e-12
    assert np.abs(values - offset).max() >= 0.85 * amplitude
    np.testing.assert_allclose(signal["time_s"], 2e-3 * np.arange(values.size), rtol=1e-12)
    assert signal.attrs["kind"] == name
    assert signal["duty"].attrs["units"] == "1"


@pytest.mark.parametrize("name", SIGNALS)
def test_a_duty_beyond_one_is_refused_with_the_largest_amplitude(name: str) -> None:
    with pytest.raises(ParameterError, match=r"amplitude = 0.6: with offset = 0.5 the duty passes ±1; at most 0.5"):
        SIGNALS[name](offset=0.5, amplitude=0.6)
    SIGNALS[name](offset=0.5, amplitude=0.5)
    for bad in (float("nan"), -0.1):
        with pytest.raises(ParameterError, match="amplitude"):
            SIGNALS[name](offset=0.0, amplitude=bad)
    with pytest.raises(ParameterError, match="sample_s"):
        SIGNALS[name](offset=0.0, amplitude=0.1, sample_s=-1e-3)


def test_the_chirp_sweeps_between_its_frequencies() -> None:
    values = duty(signals.chirp(20.0, offset=0.1, amplitude=0.2, low_hz=0.5, high_hz=8.0)) - 0.1
    rising = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    period = np.diff(rising) * 1e-3
    at = 0.5 * (rising[1:] + rising[:-1]) * 1e-3
    np.testing.assert_allclose(1.0 / period, 0.5 + 7.5 * at / 20.0, rtol=0.02)


def test_frequencies_above_half_the_sampling_rate_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"high_hz = 6: must be below half the sampling rate, 5 Hz"):
        signals.chirp(offset=0.0, amplitude=0.1, sample_s=0.1)
    signals.chirp(offset=0.0, amplitude=0.1, sample_s=0.05)
    with pytest.raises(ParameterError, match="half the sampling rate"):
        signals.multisine(offset=0.0, amplitude=0.1, sample_s=0.1)
    with pytest.raises(ParameterError, match="low <= high"):
        signals.chirp(offset=0.0, amplitude=0.1, low_hz=7.0)
    with pytest.raises(ParameterError, match="hold_s"):
        signals.prbs(offset=0.0, amplitude=0.1, hold_s=1e-4)


def test_the_multisine_has_its_odd_lines_and_nothing_else() -> None:
    signal = signals.multisine(10.0, offset=0.0, amplitude=0.2)
    spectrum = np.abs(np.fft.rfft(duty(signal))) / duty(signal).size
    lines = np.flatnonzero(spectrum > 1e-3 * spectrum.max())
    assert lines.size == 20
    assert np.all(lines % 2 == 1)
    assert lines[-1] * 0.1 <= 8.0
    np.testing.assert_allclose(spectrum[lines], spectrum[lines[0]], rtol=1e-6)
    ac = duty(signal)
    assert np.abs(ac).max() / np.sqrt(np.mean(ac**2)) == pytest.approx(signal.attrs["crest_factor"], rel=1e-3)
    assert signal.attrs["crest_factor"] < 2.0
    with pytest.raises(ParameterError, match=r"harmonics = 41: must be in \[1, 40\]"):
        signals.multisine(offset=0.0, amplitude=0.2, harmonics=41)
    alone = signals.multisine(10.0, offset=0.0, amplitude=0.2, harmonics=1)
    time_s = alone["time_s"].to_numpy()
    np.testing.assert_allclose(duty(alone), 0.2 * np.cos(2.0 * np.pi * 0.1 * time_s), atol=1e-12)
    with pytest.raises(ParameterError, match=r"harmonics = 0: must be in \[1, 40\]"):
        signals.multisine(offset=0.0, amplitude=0.2, harmonics=0)


@pytest.mark.parametrize("name", ["chirp", "multisine"])
def test_a_signal_has_a_thousand_samples_in_a_second(name: str) -> None:
    time_s = SIGNALS[name](offset=0.0, amplitude=0.2)["time_s"].to_numpy()
    np.testing.assert_allclose(np.diff(time_s), 1e-3, rtol=1e-9)
    with pytest.raises(ParameterError, match="one period"):
        signals.multisine(5.0, offset=0.0, amplitude=0.2)


def test_random_steps_follow_the_golden_ratio_or_a_seed() -> None:
    steps = duty(signals.amplitude_random_steps(6.0, offset=0.15, amplitude=0.20))[::150]
    k = np.arange(steps.size)
    np.testing.assert_allclose(steps, 0.15 + 0.20 * (2.0 * np.mod(0.6180339887 * k, 1.0) - 1.0), rtol=1e-12)
    seeded = [
        duty(signals.amplitude_random_steps(6.0, offset=0.0, amplitude=0.3, hold_s=(0.05, 0.3), seed=s))
        for s in (1, 1, 2)
    ]
    assert np.array_equal(seeded[0], seeded[1])
    assert not np.array_equal(seeded[0], seeded[2])
    holds = np.diff(np.flatnonzero(np.diff(seeded[0])))
    assert holds.min() >= 50
    assert holds.max() <= 300
    with pytest.raises(ParameterError, match="seed"):
        signals.amplitude_random_steps(6.0, offset=0.0, amplitude=0.3, hold_s=(0.05, 0.3))
    with pytest.raises(ParameterError, match="first must not exceed"):
        signals.amplitude_random_steps(6.0, offset=0.0, amplitude=0.3, hold_s=(0.3, 0.05), seed=1)
    for seed in (-1, 1.5, True):
        with pytest.raises(ParameterError, match=f"seed = {seed}: must be a whole number >= 0"):
            signals.amplitude_random_steps(6.0, offset=0.0, amplitude=0.3, seed=seed)  # type: ignore[arg-type]


def test_the_staircase_climbs_and_returns() -> None:
    signal = signals.staircase(offset=0.05, amplitude=0.1, cycles=2)
    levels = duty(signal)[::250]
    assert levels.size == 81
    np.testing.assert_allclose(np.abs(np.diff(levels)), 0.01, rtol=1e-9)
    np.testing.assert_allclose(levels[[0, 20, 40, 60, 80]], [-0.05, 0.15, -0.05, 0.15, -0.05], atol=1e-12)


def test_the_triangle_is_one() -> None:
    values = duty(signals.triangle(20.0, offset=0.1, amplitude=0.3, frequency_hz=0.1))
    np.testing.assert_allclose(values[[0, 2500, 5000, 7500, 10000]], [0.1, 0.4, 0.1, -0.2, 0.1], atol=1e-12)
    np.testing.assert_allclose(np.abs(np.diff(values)), 4.0 * 0.3 * 0.1 * 1e-3, rtol=1e-6, atol=1e-12)


def lazy(time_s: Any, duty: Any, start_deg: float) -> dict[str, Any]:
    """A plate that follows its duty at once, and a motor that takes 10 A at full duty."""
    assert len(time_s) == len(duty)
    return {"angle_deg": start_deg + 100.0 * np.asarray(duty), "current_a": 10.0 * np.asarray(duty)}


def test_a_check_reports_what_it_simulated() -> None:
    signal = signals.chirp(offset=0.1, amplitude=0.2)
    check = identify.check_excitation(signal, lazy, start_deg=20.0)
    assert check.passed
    assert check.content.angle_high_deg == pytest.approx(50.0, abs=0.01)
    assert check.content.angle_low_deg == pytest.approx(10.0, abs=0.01)
    assert check.content.peak_speed_deg_per_s == pytest.approx(20.0 * 2.0 * np.pi * 6.0, rel=0.05)
    assert check.peak_current_a == pytest.approx(3.0, abs=0.01)
    assert check.rms_current_a == pytest.approx(10.0 * np.sqrt(0.1**2 + 0.5 * 0.2**2), rel=0.03)
    np.testing.assert_array_equal(check.prediction["angle_deg"], 20.0 + 100.0 * signal["duty"])
    assert "inside the limits" in check.summary()
    assert check.to_dict()["peak_current_a"] == check.peak_current_a


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"angle_window_deg": (1.0, 40.0)}, "opens to 50.0 deg, beyond 40; lower offset or amplitude"),
        ({"angle_window_deg": (15.0, 60.0)}, "closes to 10.0 deg, beyond 15; raise the offset"),
        ({"max_rate_deg_per_s": 300.0}, "deg/s, above 300; lower the amplitude"),
        ({"max_current_a": 2.0}, "the motor takes 3.00 A, above 2; lower the amplitude"),
    ],
)
def test_every_limit_is_told_with_its_remedy(limits: dict[str, Any], said: str) -> None:
    check = identify.check_excitation(signals.chirp(offset=0.1, amplitude=0.2), lazy, start_deg=20.0, **limits)
    assert not check.passed
    (found,) = check.findings
    assert (found.code, found.names) == ("limit_exceeded", tuple(limits))
    assert said in str(found)
    assert "outside the limits" in check.summary()
    assert identify.check_excitation(signals.chirp(offset=0.1, amplitude=0.05), lazy, start_deg=20.0, **limits).passed


def test_the_columns_of_a_signal_are_a_pair_that_can_be_read_twice() -> None:
    columns = _signal_of(signals.chirp(offset=0.1, amplitude=0.1))
    assert isinstance(columns, tuple)
    assert [column.dtype for column in columns] == [np.float64, np.float64]


def test_a_check_refuses_what_it_cannot_judge() -> None:
    signal = signals.chirp(offset=0.1, amplitude=0.2)
    with pytest.raises(ParameterError, match=r"angle_window_deg = \(40, 10\)"):
        identify.check_excitation(signal, lazy, angle_window_deg=(40.0, 10.0))
    with pytest.raises(ParameterError, match="max_current_a = -1"):
        identify.check_excitation(signal, lazy, max_current_a=-1.0)
    with pytest.raises(ParameterError, match="no current"):
        identify.check_excitation(signal, lambda t, u, s: 20.0 + 0.0 * t + 0.0 * u + 0.0 * s, max_current_a=1.0)
    with pytest.raises(ParameterError, match="must be a Throttle"):
        identify.check_excitation(signal, 3.0)
    with pytest.raises(ParameterError, match="shape"):
        identify.check_excitation(signal, lambda t, u, s: t[:-1] + u[:-1] + s)
    with pytest.raises(ParameterError, match="not finite"):
        identify.check_excitation(signal, lambda t, u, s: t * np.nan + u + s)
    with pytest.raises(DataError, match=r"no duty\(time_s\)"):
        identify.check_excitation(signal.drop_vars("duty"), lazy)


P1 = Throttle()
STIFF = Throttle(
    spring_above_nm_per_rad=0.819, spring_below_nm_per_rad=0.819, preload_above_nm=0.2, preload_below_nm=0.2,
    coulomb_nm=0.1, stiction_nm=0.11,
)  # fmt: skip


@pytest.mark.parametrize("side", ["above", "below", "both"])
@pytest.mark.parametrize("kind", EXCITATIONS)
@pytest.mark.parametrize("throttle", [P1, STIFF], ids=["weak spring", "stiff spring"])
def test_designed_signals_move_the_plate_inside_its_limits(throttle: Throttle, kind: str, side: str) -> None:
    signal, check = design_excitation(kind, throttle, side=side)
    assert check.passed
    assert min(check.content.travel_open_deg, check.content.travel_closed_deg) > 5.0
    angle = simulate_throttle(throttle, signal["duty"], time_s=signal["time_s"])["angle_deg"].to_numpy()
    np.testing.assert_array_equal(check.prediction["angle_deg"], angle)
    assert angle.min() >= -0.5
    assert angle.max() <= 90.5
    if side == "above" and kind not in ("staircase", "triangle"):
        assert angle.max() <= 89.0
        assert angle.max() > 35.0, "a window that is not used teaches little"
    if side == "both":
        assert check.content.limp_home_crossings >= 2
    if side == "below":
        assert angle.min() < 3.0


def test_offset_and_amplitude_follow_the_groups() -> None:
    g = characteristics(P1)
    balance = float(g["preload_above"] + g["spring_above_per_deg"] * (0.5 * (89.0 + 8.0) - 8.0))
    signal, _ = design_excitation("multisine", P1)
    assert signal.attrs["offset"] == pytest.approx(balance, rel=1e-9)
    assert signal.attrs["amplitude"] == pytest.approx(float(2.2 * g["coulomb"]), rel=1e-9)


def test_a_drifting_plate_is_centred() -> None:
    signal, check = design_excitation("chirp", P1)
    rule = design_excitation("multisine", P1)[0].attrs["offset"]
    assert signal.attrs["offset"] < rule, "the rule alone drifts into the stop"
    assert not check_excitation(chirp(offset=rule, amplitude=signal.attrs["amplitude"]), P1).passed
    assert check.content.angle_high_deg <= 89.0


def test_limits_shape_the_design() -> None:
    free = design_excitation("chirp", P1)[1]
    slow_signal, slow = design_excitation("chirp", P1, max_rate_deg_per_s=120.0)
    assert free.content.peak_speed_deg_per_s > 120.0 >= slow.content.peak_speed_deg_per_s
    assert slow_signal.attrs["amplitude"] < 0.2
    narrow = design_excitation("chirp", P1, angle_window_deg=(5.0, 60.0))[1]
    assert narrow.content.angle_high_deg <= 60.0
    weak = design_excitation("chirp", P1, max_current_a=2.0)[1]
    assert weak.peak_current_a <= 2.0
    with pytest.raises(ConvergenceError, match=r"no chirp above limp-home stays inside: .*the motor takes"):
        design_excitation("chirp", P1, max_current_a=0.5)


def test_the_check_of_the_plant_says_what_stays_open() -> None:
    slow = check_excitation(triangle(40.0, offset=0.0, amplitude=0.26), P1, angle_window_deg=(-0.5, 90.5))
    assert slow.passed
    assert slow.content.limp_home_crossings >= 2
    assert "one_way" not in {found.code for found in slow.unanswered}
    one_way = check_excitation(
        triangle(8.0, offset=0.24, amplitude=0.05, frequency_hz=1.0 / 32.0), P1, angle_window_deg=(-0.5, 90.5)
    )
    found = {finding.code: finding for finding in one_way.unanswered}
    assert found["one_way"].text.startswith("the plate only opens: Coulomb torque and preload")
    assert found["side_not_visited"].names == ("below",)
    assert "±0.25 duty" in found["one_way"].remedy, "breakaway is at 0.222"
    still = check_excitation(triangle(10.0, offset=0.0, amplitude=0.1), P1)
    assert still.passed
    assert [finding.code for finding in still.unanswered] == ["no_motion"]


def test_a_check_knows_the_current_of_the_plant() -> None:
    check = check_excitation(chirp(offset=0.15, amplitude=0.20), P1, angle_window_deg=(-0.5, 90.5))
    run: Any = simulate_throttle(P1, check.prediction["duty"], time_s=check.prediction["time_s"])
    assert check.peak_current_a == float(np.abs(run["current_a"]).max())
    assert check.rms_current_a == pytest.approx(float(np.sqrt((run["current_a"] ** 2).mean())), rel=1e-12)


def test_unknown_signals_and_priors_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"kind = 'square'"):
        design_excitation("square", P1)
    with pytest.raises(ParameterError, match=r"side = 'left'"):
        design_excitation("chirp", P1, side="left")
    with pytest.raises(ParameterError, match="has no limp-home angle and friction"):
        design_excitation("chirp", lambda t, u, s: t + u + s)
    with pytest.raises(ParameterError, match="staircase lasts"):
        design_excitation("staircase", P1, duration_s=5.0)
