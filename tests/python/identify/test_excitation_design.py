"""Excitation on the real plant: designed signals stay inside, and the check tells what a log of them would show."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mgdd.errors import ConvergenceError, ParameterError
from mgdd.identify import check_excitation, design_excitation
from mgdd.identify.throttle.excitation_design import EXCITATIONS
from mgdd.signals import chirp, triangle
from mgdd.throttle import Throttle, characteristics, simulate_throttle

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
    with pytest.raises(ParameterError, match="knows no limp-home angle and friction"):
        design_excitation("chirp", lambda t, u, s: t + u + s)
    with pytest.raises(ParameterError, match="staircase lasts"):
        design_excitation("staircase", P1, duration_s=5.0)
