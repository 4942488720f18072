"""The tuner in Python: the measured map behind it, the seekers that it makes, and what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mgdd.errors import DataError, ShapeError
from mgdd.optimize import ComponentLag, ExtremumSeeking, Limit, Spsa, measure_map, tune

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SIGMA, BEND = 0.25, -0.051
METHODS = ["batch", "moving_average", "spsa"]


# --- the measured map ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("theta", "j", "error", "message"),
    [
        ([0, 1, 2, 3], [0, 1, 1, 0], DataError, "4 points at 4 distinct inputs: must be at least 5 at 3"),
        ([0, 1, 0, 1, 0, 1], [0, 1, 0, 1, 0, 1], DataError, "6 points at 2 distinct inputs"),
        ([0, 1, 2, 3, 4], [4, 1, 0, 1, 4], DataError, "bends up over theta .*no maximum; widen"),
        ([0, 1, 2, 3, 4], [0, 1, 2, 3, 4], DataError, "bends up|no maximum"),
        ([0, 1, 2, 3, np.nan], [4, 1, 0, 1, 4], DataError, "must be finite; leave misfired cycles out"),
        ([0, 1, 2, 3, 4], [4, 1, 0, 1, np.inf], DataError, "must be finite"),
        ([0, 1, 1 + 1e-15, 0, 1], [0, 1, 1, 0, 1], DataError, "do not show the curvature of theta; spread them"),
        ([0, 1, 2], [0, 1], ShapeError, r"theta has shape \(3,\), J \(2,\)"),
        ([[0, 1, 2]], [[0, 1, 2]], ShapeError, "in one dimension"),
    ],
)
def test_measurements_without_an_optimum_are_refused(theta: Any, j: Any, error: type[Exception], message: str) -> None:
    if message == "bends up|no maximum":
        j = np.array(j) + np.array([1e-9, 0, 0, 0, 0])
    with pytest.raises(error, match=message):
        measure_map(theta, j)


def test_a_minimum_is_refused_as_a_maximum_and_taken_as_a_minimum() -> None:
    with pytest.raises(DataError, match="no minimum"):
        measure_map([-2, -1, 0, 1, 2], [-4, -1, 0, -1, -4], maximize=False)
    assert measure_map([-2, -1, 0, 1, 2], [4, 1, 0, 1, 4], maximize=False).curvature == pytest.approx(2.0)


SKEWED: dict[str, Callable[[Array], Array]] = {  # J'' = -0.045 at the optimum 0
    "exponential": lambda u: 50.0 - 2.0 * (np.exp(0.15 * u) - 0.15 * u - 1.0),
    "cubic": lambda u: 50.0 - 0.0225 * u**2 - 0.0008 * u**3,
}


@pytest.mark.parametrize(("distinct", "repeats"), [(9, 8), (5, 8), (11, 4), (41, 1)])
@pytest.mark.parametrize("name", SKEWED)
def test_a_skewed_map_is_no_noise(name: str, distinct: int, repeats: int) -> None:
    j = SKEWED[name]
    theta = np.repeat(np.linspace(-20.0, 20.0, distinct), repeats)
    maps = [measure_map(theta, j(theta) + np.random.default_rng(k).normal(0.0, 0.3, theta.size)) for k in range(100)]
    assert np.mean(["lack_of_fit" in [finding.code for finding in found.findings] for found in maps]) > 0.95
    assert np.mean([found.noise_sd for found in maps]) == pytest.approx(0.3, rel=0.1 if repeats > 1 else 0.4)
    assert np.median([found.curvature for found in maps]) == pytest.approx(-0.045, rel=0.45)
    assert np.mean([abs(found.optimum) < 1.96 * found.optimum_stderr for found in maps]) > 0.9


@pytest.mark.parametrize("repeats", [1, 4])
def test_a_parabola_fits_at_the_rate_of_the_test(repeats: int) -> None:
    theta = np.repeat(np.linspace(-20.0, 20.0, 11), repeats)
    rng = np.random.default_rng(8)
    maps = [measure_map(theta, 0.5 * BEND * theta**2 + rng.normal(0.0, SIGMA, theta.size)) for _ in range(400)]
    assert np.mean([bool(found.findings) for found in maps]) < 0.025
    narrow = next((found for found in maps if found.findings), None)
    assert narrow is None or narrow.points < theta.size


def test_a_line_has_no_optimum_and_says_so() -> None:
    said = refused = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        theta = np.repeat(np.linspace(-10.0, 10.0, 7), 6)
        try:
            found = measure_map(theta, 0.3 * theta + rng.normal(0.0, 0.3, theta.size))
        except DataError:
            refused += 1
            continue
        codes = [finding.code for finding in found.findings]
        said += "no_bend" in codes
        assert ("beyond_range" in codes) == (abs(found.optimum) > 10.0)
    assert said + refused >= 38  # two standard errors
    assert 10 <= said <= 30  # as often as the noise bends it down

    rng = np.random.default_rng(1)
    several = {name: rng.uniform(-1.0, 1.0, 80) for name in ("x", "y")}
    j = 2.0 * several["x"] - 5.0 * several["y"] ** 2 - 0.01 * several["x"] ** 2 + rng.normal(0.0, 0.01, 80)
    found = measure_map(several, j)
    assert {(finding.code, finding.names) for finding in found.findings} >= {("beyond_range", ("x",))}
    assert "y" not in {name for finding in found.findings for name in finding.names}


def test_a_peak_off_which_no_parabola_can_be_read_is_refused() -> None:
    theta = np.repeat([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], 3)
    noise = np.tile([-0.01, 0.0, 0.01], 6)
    with pytest.raises(DataError, match=r"bends up over theta in \[2, 5\], over the whole of it J is not a parabola"):
        measure_map(theta, np.repeat([0.0, 8.0, 9.0, 9.5, 9.6, 10.5], 3) + noise)


# --- the tuner ----------------------------------------------------------------------------------------------


def test_the_seeker_carries_what_was_tuned() -> None:
    tuning = tune(SIGMA, BEND, delay_cycles=38.0, lag_cycles=25.0)
    seeker = tuning.seeker(start=-15.0, bounds=(-30.0, 10.0), limits=[Limit("p", 9.0)], hold_cycles=7)
    assert isinstance(seeker, ExtremumSeeking)
    settings = seeker.settings
    assert settings["amplitude"] == [tuning.amplitude]
    assert (settings["period"], settings["curvature"], settings["hold_cycles"]) == (tuning.period, BEND, 7)
    assert settings["components"] == [ComponentLag(delay_cycles=38.0, lag_cycles=25.0)]
    assert seeker.limit_names == ["p"]
    slow = tune(SIGMA, BEND, delay_cycles=38.0, lag_cycles=25.0, compensated=False)
    assert slow.period >= 378
    seen = slow.sensor_gain * np.cos(np.radians(slow.sensor_phase_deg))
    assert slow.gain == pytest.approx(2.0 / (slow.amplitude * -BEND * slow.time_constant_cycles * seen))
    blind = slow.seeker(start=0.0)  # no warning: the gain is judged by the curvature that the sensor lets through
    assert isinstance(blind, ExtremumSeeking)
    assert blind.settings["components"][0].delay_cycles == 0.0
    spsa = tune(SIGMA, BEND, method="spsa").seeker(start=0.0, seed=5, maximize=False)
    assert isinstance(spsa, Spsa)
    assert [spsa.settings[name] for name in ("schedule", "seed", "maximize")] == ["constant", 5, False]


def test_summary_says_plainly_whether_the_wish_is_met() -> None:
    text = tune(SIGMA, BEND, distance=12.0, arrival=1.0, cycles=100.0).summary()
    assert text.endswith("The specification is met.")
    hopeless = tune(SIGMA, BEND, rms=0.01, amplitude_max=1.0, cycles=20.0)
    assert not hopeless.met
    assert "The specification cannot be met:" in hopeless.summary()
    assert "out of reach with amplitude_max = 1" in hopeless.summary()
    assert "cycles = 20 is too few" in hopeless.summary()
    assert "turned back" in tune(SIGMA, BEND, delay_cycles=5.0).summary()
    assert "not compensated" in tune(SIGMA, BEND, delay_cycles=5.0, compensated=False).summary()
    assert "measurements per iteration" in tune(SIGMA, BEND, method="spsa").summary()


@given(
    noise=st.floats(1e-3, 1e3),
    bend=st.floats(1e-3, 1e3),
    method=st.sampled_from(["batch", "moving_average"]),
    lag=st.floats(0.0, 40.0),
)
def test_every_tuning_keeps_to_the_bounds_of_averaging(noise: float, bend: float, method: str, lag: float) -> None:
    tuning = tune(noise, bend, method=method, lag_cycles=lag)
    assert tuning.time_constant_cycles >= 2.0 * tuning.period
    assert tuning.amplitude <= 1.8 * np.sqrt(noise / bend) * (1.0 + 1e-9)
    tuning.seeker(start=0.0)  # warnings are errors here: no advice against it
