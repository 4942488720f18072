"""Levels of the pressure: a tone has its level in its band, bands share out the square, weights are the standard's."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mgdd.engine import Indicating, simulate
from mgdd.engine.indicating import a_weighting_db
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.results.labels import check_labels

ANGLE = np.arange(-360.0, 360.0, 0.2)
SPEED = 1500.0  # lines are 12.5 Hz apart
# IEC 61672-1, table of design goals, from 20 Hz to 20 kHz.
A_TABLE = [
    -50.5, -44.7, -39.4, -34.6, -30.2, -26.2, -22.5, -19.1, -16.1, -13.4, -10.9, -8.6, -6.6, -4.8, -3.2, -1.9, -0.8,
    0.0, 0.6, 1.0, 1.2, 1.3, 1.2, 1.0, 0.5, -0.1, -1.1, -2.5, -4.3, -6.6, -9.3,
]  # fmt: skip


def indicating(angle: np.ndarray = ANGLE, speed_rpm: float = SPEED) -> Indicating:
    return Indicating("puma_single", angle, speed_rpm=speed_rpm)


def tone(hz: float, bar: float, phase: float = 0.3) -> np.ndarray:
    """A tone of the given RMS [bar], of the time that the crank angle takes at 1500 rpm."""
    return np.sqrt(2.0) * bar * np.sin(2.0 * np.pi * hz * ANGLE / (6.0 * SPEED) + phase)


@given(st.integers(8, 1400), st.floats(1e-4, 10.0), st.floats(0.0, 6.0))
def test_a_tone_has_its_level_in_its_band_alone(order: int, bar: float, phase: float) -> None:
    hz = 12.5 * order
    made = indicating().noise([30.0 + tone(hz, bar, phase)])
    level = made["pressure_level_db"].isel(cycle=0)
    band = int(np.floor(10.0 * np.log10(hz / 1e3) + 0.5))
    centres = np.round(10.0 * np.log10(made["frequency_hz"].to_numpy() / 1e3)).astype(int)
    own = centres == band
    assert own.sum() == 1
    assert float(level[own][0]) == pytest.approx(20.0 * np.log10(bar * 1e5 / 20e-6), abs=1e-6)
    assert float(level[~own].max()) < float(level[own][0]) - 150.0


def test_bands_share_out_the_mean_square() -> None:
    rng = np.random.default_rng(4)
    orders = rng.integers(8, 1400, 40)
    wave = sum(tone(12.5 * k, bar) for k, bar in zip(orders, rng.uniform(0.0, 0.1, 40), strict=True))
    made = indicating().noise([7.0 + wave])
    squares = (10.0 ** (0.1 * made["pressure_level_db"])).sum()
    assert float(squares) * (20e-6) ** 2 == pytest.approx(1e10 * np.mean(wave**2), rel=1e-10)


def test_bands_are_those_of_the_standard() -> None:
    hz = indicating().noise([tone(1e3, 1.0)])["frequency_hz"].to_numpy()
    np.testing.assert_allclose(hz, 1e3 * 10.0 ** (np.arange(-12, 14) / 10.0))  # to half the sampling rate, 22.5 kHz
    slow = indicating(ANGLE[::10]).noise([tone(1e3, 1.0)[::10]])["frequency_hz"].to_numpy()
    assert slow.max() == pytest.approx(1995.26, abs=0.01)
    fast = indicating(speed_rpm=6000.0).noise([tone(1e3, 1.0)])["frequency_hz"].to_numpy()
    assert fast.min() == pytest.approx(251.19, abs=0.01)


def test_a_weighting_is_that_of_the_standard() -> None:
    hz = 1e3 * 10.0 ** (np.arange(-17, 14) / 10.0)
    np.testing.assert_allclose(a_weighting_db(hz), A_TABLE, atol=0.051)
    assert a_weighting_db(np.array([1e3])) == 0.0


@pytest.mark.parametrize(("hz", "weight"), [(100.0, -19.1), (1e3, 0.0), (1e4, -2.5)])
def test_noise_is_the_level_less_attenuation_plus_weight(hz: float, weight: float) -> None:
    made = indicating().noise([tone(hz, 0.2)] * 2, attenuation_db={20.0: 80.0, 20000.0: 80.0})
    assert made["noise_level_dba"].values == pytest.approx([100.0 + weight] * 2, abs=0.06)
    assert float(made["mean_noise_level_dba"]) == pytest.approx(100.0 + weight, abs=0.06)


def test_attenuation_is_linear_over_the_logarithm_and_ends_with_its_table() -> None:
    table = {2500.0: 60.0, 630.0: 120.0}  # nominal, six bands apart
    for hz, loss in ((625.0, 120.0), (1250.0, 90.0), (2500.0, 60.0)):
        made = indicating().noise([tone(hz, 0.2)], attenuation_db=table)
        weight = a_weighting_db(1e3 * 10.0 ** (np.round(10.0 * np.log10(hz / 1e3)) / 10.0))
        assert float(made["noise_level_dba"][0]) == pytest.approx(180.0 - loss + weight, abs=1e-6)
    both = indicating().noise([tone(1250.0, 0.2) + tone(3150.0, 5.0)], attenuation_db=table)
    alone = indicating().noise([tone(1250.0, 0.2)], attenuation_db=table)
    assert float(both["noise_level_dba"][0]) == pytest.approx(float(alone["noise_level_dba"][0]), abs=1e-6)


def test_a_drift_of_the_sensor_is_no_sound() -> None:
    """A pressure that climbs by 0.4 bar a cycle would have 110 dB at 10 kHz, were it periodic."""
    time = np.arange(4 * ANGLE.size) / ANGLE.size
    climbing = (0.4 * time).reshape(4, -1) + tone(1e3, 0.2)
    made = indicating().noise(climbing)
    level = made["pressure_level_db"].sel(frequency_hz=1e4, method="nearest")
    assert float(level[:3].max()) < 0.0
    assert float(level[3]) > 100.0  # nothing tells where the last one would go on
    single = indicating().noise(climbing[0])["pressure_level_db"].sel(frequency_hz=1e4, method="nearest")
    assert float(single[0]) > 100.0


def test_mean_is_that_of_the_squares_and_the_last_sample_may_repeat_the_first() -> None:
    made = indicating().noise([tone(1e3, 0.2, 0.0), tone(1e3, 0.02, 0.0)])
    check_labels(made)
    at = {"frequency_hz": 1e3, "method": "nearest"}
    mean = float(made["mean_pressure_level_db"].sel(**at))
    assert mean == pytest.approx(180.0 + 10.0 * np.log10(0.505), abs=1e-6)
    closed = np.append(ANGLE, 360.0)
    again = indicating(closed).noise([np.append(tone(1e3, 0.2, 0.0), tone(1e3, 0.2, 0.0)[0])])
    np.testing.assert_allclose(again["pressure_level_db"].sel(**at)[0], made["pressure_level_db"].sel(**at)[0])


def test_a_steeper_burn_is_louder() -> None:
    table = {500.0: 90.0, 5000.0: 70.0}
    levels = []
    for duration in (60.0, 25.0):
        run = simulate("puma_single", {"fuel_mg": 20.0, "burn_duration_cad": duration}, soc_cad=-5.0, step_cad=0.2)
        whole = np.interp(ANGLE, run["crank_angle_cad"], run["pressure_bar"], period=720.0)
        levels.append(float(indicating().noise([whole], attenuation_db=table)["noise_level_dba"][0]))
    assert levels[1] > levels[0] + 3.0


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "two or more finite dB"),
        ({1e3: 80.0}, "two or more finite dB"),
        ({-1.0: 80.0, 1e3: 80.0}, "frequencies > 0 Hz"),
        ({1e3: float("nan"), 2e3: 80.0}, "two or more finite dB"),
        ({1.0: 80.0, 2.0: 80.0}, r"attenuation_db = '1 to 2 Hz': must be of the bands from 63.1 to 1.995e\+04 Hz"),
    ],
)
def test_a_table_that_cannot_be(table: dict[float, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        indicating().noise([tone(1e3, 1.0)], attenuation_db=table)


def test_what_is_no_whole_cycle() -> None:
    short = np.arange(-180.0, 180.0, 0.2)
    with pytest.raises(DataError, match="the crank angles span 360 of 720 degrees: record whole cycles"):
        indicating(short).noise([np.ones(short.size)])
    uneven = ANGLE + 0.05 * np.sin(ANGLE)
    with pytest.raises(DataError, match="in uneven steps"):
        indicating(uneven).noise([tone(1e3, 1.0)])
    with pytest.raises(ShapeError, match=r"shape \(1, 7\): must be \(cycle, 3600 angles\)"):
        indicating().noise([np.ones(7)])
    holed: Any = [tone(1e3, 1.0), tone(1e3, 1.0)]
    holed[1][40] = np.nan
    with pytest.raises(DataError, match=r"cycle 2: pressure_bar\[40\] = nan: must be finite"):
        indicating().noise(holed)
