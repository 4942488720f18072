"""The tuner in Python: the seekers that it makes, and what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mgdd.optimize import ComponentLag, ExtremumSeeking, Limit, Spsa, tune

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SIGMA, BEND = 0.25, -0.051
METHODS = ["batch", "moving_average", "spsa"]


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
