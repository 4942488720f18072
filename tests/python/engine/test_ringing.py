"""Ringing of a record: its frequency is found, a record without it has none; who knocks; the figures of cycles."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

from mgdd import plot
from mgdd.engine import Indicating, analyze, simulate
from mgdd.errors import DataError, ParameterError
from mgdd.io import pressure_trace
from mgdd.results.labels import check_labels

RINGING_HZ = 6500.0
KNOCKS_BAR = 0.2


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


def record(
    ringing_bar: float, *, n: int = 20, speed_rpm: float = 1400.0, step_cad: float = 0.2, noise_bar: float = 0.0
) -> xr.Dataset:
    """Cycles of a small diesel that ring after the start of the burn for about a millisecond, each at its own phase."""
    rng = np.random.default_rng(5)
    angle = np.arange(-180.0, 180.0, step_cad)
    rows = []
    for fuel_mg in 18.0 * rng.normal(1.0, 0.03, n):
        run = simulate(
            "puma_single", {"fuel_mg": fuel_mg, "speed_rpm": speed_rpm}, soc_cad=-5.0, step_cad=min(step_cad, 0.5)
        )
        smooth = np.interp(angle, run["crank_angle_cad"], run["pressure_bar"], left=1.3, right=1.7)
        ms = np.maximum(angle - rng.normal(4.0, 0.7), 0.0) / (6e-3 * speed_rpm)
        wave = np.exp(-ms) * np.sin(2e-3 * np.pi * RINGING_HZ * ms)
        rows.append(
            smooth + ringing_bar * rng.lognormal(0.0, 0.3) * wave + rng.normal(0.0, 1.0, angle.size) * noise_bar
        )
    return pressure_trace(angle, np.array(rows), name="bench 3").assign_attrs(speed_rpm=speed_rpm)


def figures(trace: xr.Dataset, **options: object) -> xr.Dataset:
    return analyze(trace, "puma_single", quiet=True, **options)


@pytest.mark.parametrize("noise_bar", [0.0, 0.05])
@pytest.mark.parametrize("step_cad", [0.1, 0.5])
@pytest.mark.parametrize("speed_rpm", [1400.0, 3000.0])
def test_ringing_is_found_within_a_percent(speed_rpm: float, step_cad: float, noise_bar: float) -> None:
    trace = record(0.5, speed_rpm=speed_rpm, step_cad=step_cad, noise_bar=noise_bar)
    assert float(figures(trace)["ringing_frequency_khz"]) == pytest.approx(6.5, rel=0.01)


@pytest.mark.parametrize("n", [2, 3, 20])
@pytest.mark.parametrize("noise_bar", [0.0, 0.01, 0.3])
def test_without_ringing_there_is_no_frequency(n: int, noise_bar: float) -> None:
    for step_cad in (0.1, 0.5):
        assert np.isnan(figures(record(0.0, n=n, step_cad=step_cad, noise_bar=noise_bar))["ringing_frequency_khz"])


def test_noise_of_few_cycles_passes_for_ringing_in_a_few_of_a_hundred_records_at_most() -> None:
    rng = np.random.default_rng(8)
    calm = record(0.0, n=2)
    angle, rows = calm["crank_angle_cad"], calm["pressure_bar"].to_numpy()
    noisy = (pressure_trace(angle, rows + rng.normal(0.0, 0.03, rows.shape)) for _ in range(100))
    found = [
        float(figures(trace.assign_attrs(speed_rpm=1400.0), keep_traces=False)["ringing_frequency_khz"])
        for trace in noisy
    ]
    assert np.count_nonzero(np.isfinite(found)) <= 3


def test_ringing_outside_the_band_or_beyond_the_sampling_is_not_reported() -> None:
    trace = record(0.5)
    assert np.isnan(figures(trace, knock_band_hz=(8000.0, 20000.0))["ringing_frequency_khz"])
    coarse = figures(record(0.5, step_cad=1.0), knock_threshold_bar=KNOCKS_BAR)  # half the sampling is 4.2 kHz
    assert np.isnan(coarse["mapo_bar"]).all()
    assert np.isnan(coarse["ringing_frequency_khz"])
    assert np.isnan(coarse["knock_share_percent"])
    assert "pressure_psd_bar2_per_khz" not in coarse


def test_the_density_of_white_noise_is_its_variance_over_its_bandwidth() -> None:
    rng = np.random.default_rng(2)
    angle = np.arange(-180.0, 180.0, 0.2)
    calm = record(0.0, n=1)["pressure_bar"].to_numpy()
    rows = calm + rng.normal(0.0, 0.05, (200, angle.size))
    made = figures(pressure_trace(angle, rows).assign_attrs(speed_rpm=1400.0))
    density, khz = made["pressure_psd_bar2_per_khz"].to_numpy(), made["frequency_khz"].to_numpy()
    # White noise of variance 0.0025 bar² up to half the sampling, 21 kHz.
    assert density[:, khz > 5.0].mean() == pytest.approx(0.0025 / 21.0, rel=0.02)
    assert (khz[0], khz[-1]) == pytest.approx((2.0, 21.0), abs=0.05)


def test_the_tangential_mode_is_that_of_draper() -> None:
    made = figures(record(0.5))
    sound_m_per_s = np.sqrt(1.3 * 287.05 * float(made["t_max_k"].median()))
    assert float(made["tangential_mode_khz"]) == pytest.approx(1.841 * sound_m_per_s / (np.pi * 86.0), rel=1e-3)


def test_the_share_of_knocking_cycles_is_given_with_a_threshold_only() -> None:
    trace = record(0.5)
    made = figures(trace, knock_threshold_bar=KNOCKS_BAR)
    check_labels(made)
    mapo = made["mapo_bar"].to_numpy()
    threshold = float(np.median(mapo))
    assert float(made["knock_share_percent"]) == 100.0 * np.mean(mapo > KNOCKS_BAR)
    assert float(figures(trace, knock_threshold_bar=threshold)["knock_share_percent"]) == 50.0
    assert float(figures(trace, knock_threshold_bar=2.0 * mapo.max())["knock_share_percent"]) == 0.0
    assert "knock_share_percent" not in figures(trace)
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(ParameterError, match="knock_threshold_bar"):
            figures(trace, knock_threshold_bar=wrong)
    with pytest.raises(ParameterError, match="knock_threshold_bar is for a record"):
        figures(trace.isel(cycle=0, drop=True), knock_threshold_bar=1.0)


def test_the_spectrum_is_a_trace() -> None:
    trace = record(0.5)
    short, whole = figures(trace, keep_traces=False), figures(trace)
    assert "frequency_khz" not in short.variables
    assert float(short["ringing_frequency_khz"]) == float(whole["ringing_frequency_khz"])
    assert whole.attrs["knock_band_hz"] == (4000.0, 20000.0)


def lines_of(ax: plt.Axes) -> dict[str, plt.Line2D]:
    return {str(line.get_label()): line for line in ax.get_lines()}


def test_the_spectrum_is_drawn_with_band_ringing_and_mode() -> None:
    made = figures(record(0.5))
    ax = plot.cycles(made, "pressure_psd_bar2_per_khz")
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "frequency [kHz]", "power spectral density of the pressure [bar²/kHz]",
    )  # fmt: skip
    drawn = lines_of(ax)
    np.testing.assert_allclose(
        drawn["mean of 20 cycles"].get_ydata(), made["pressure_psd_bar2_per_khz"].mean("cycle").to_numpy()
    )
    ends = [float(line.get_xdata()[0]) for line in ax.get_lines() if line.get_label() == "ends of the knock band"]
    assert ends == [4.0, 20.0]
    assert drawn["frequency of ringing: 6.50 kHz"].get_xdata()[0] == float(made["ringing_frequency_khz"])
    mode = float(made["tangential_mode_khz"])
    assert drawn[f"first tangential mode of the bore: {mode:.2f} kHz"].get_xdata()[0] == mode
    written = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(written) == len(set(written)) == 5
    calm = plot.cycles(figures(record(0.0, noise_bar=0.01)), "pressure_psd_bar2_per_khz")
    assert not any("ringing" in text for text in lines_of(calm))


def test_traces_of_cycles_are_drawn_as_colours() -> None:
    made = figures(record(0.5))
    made["misfire"][3] = True
    ax = plot.cycles(made, "pressure_bar")
    (mesh,) = ax.collections
    angle = made["crank_angle_cad"]
    inside = made["pressure_bar"].sel(crank_angle_cad=angle[(angle >= -40.0) & (angle <= 100.0)])
    np.testing.assert_allclose(np.ravel(mesh.get_array()), np.ravel(inside - inside.mean("cycle")), atol=1e-9)
    low, high = mesh.get_clim()
    assert low == -high
    assert ax.figure.axes[-1].get_ylabel() == "cylinder pressure less its mean [bar]"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("crank angle [°CA aTDC]", "engine cycle")
    assert lines_of(ax)["nothing burned: 1 cycles"].get_ydata().tolist() == [4]
    heat = plot.cycles(made, "heat_release_net_j_per_cad")
    assert heat.figure.axes[-1].get_ylabel() == "net heat release rate [J/°CA]"
    assert heat.collections[0].get_array().max() == pytest.approx(
        float(made["heat_release_net_j_per_cad"].sel(crank_angle_cad=inside["crank_angle_cad"]).max())
    )
    trace = record(0.5)
    sound = Indicating("puma_single", trace["crank_angle_cad"], speed_rpm=1400.0).oscillation(trace["pressure_bar"])
    assert plot.cycles(sound, "oscillation_bar").get_legend() is None
    motored = made.assign(heat_release_net_j_per_cad=np.nan * made["heat_release_net_j_per_cad"])
    motored["heat_release_net_j_per_cad"].attrs = made["heat_release_net_j_per_cad"].attrs
    with pytest.raises(DataError, match="none of the 20 cycles"):
        plot.cycles(motored, "heat_release_net_j_per_cad")
    with pytest.raises(DataError, match="over cycle alone, or with crank_angle_cad or frequency_khz"):
        plot.cycles(made, "mean_mapo_bar")


def test_burn_angles_stand_on_the_heat_release() -> None:
    made = figures(record(0.0))
    ax = plot.pressure(made)
    burn = [float(made[name].mean()) for name in ("ca10_cad", "ca50_cad", "ca90_cad")]
    (text,) = [each for each in lines_of(ax.figure.axes[1]) if each.startswith("CA10")]
    marks = lines_of(ax.figure.axes[1])[text]
    assert marks.get_xdata().tolist() == pytest.approx(burn)
    mean = made["heat_release_net_j_per_cad"].mean("cycle")
    np.testing.assert_allclose(marks.get_ydata(), np.interp(burn, made["crank_angle_cad"], mean))
    assert text == f"CA10, CA50, CA90: {burn[0]:.1f}, {burn[1]:.1f}, {burn[2]:.1f} °CA"
