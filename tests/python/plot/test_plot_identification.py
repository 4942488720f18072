"""Figures of throttle logs and of their identification: branches, free run, residuals, correlations."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from mgdd import plot
from mgdd.errors import DataError
from mgdd.plot.identification import error_growth, residual_correlation
from mgdd.plot.throttle import free_run
from mgdd.results.labels import labelled_dataset

TIME = np.arange(400) * 0.05
DUTY = 0.3 * np.sin(0.6 * TIME)
DEG = 30.0 + 80.0 * DUTY - 5.0 * np.cos(0.6 * TIME)


def log():
    return labelled_dataset({"time_s": ("time_s", TIME), "duty": ("time_s", DUTY), "angle_deg": ("time_s", DEG)})


def run():
    return labelled_dataset({
        "time_s": ("time_s", TIME), "angle_deg": ("time_s", DEG), "model_deg": ("time_s", DEG + 0.1),
        "residual_deg": ("time_s", 0.0 * TIME + 0.1, "deg", "model minus measured angle"),
    }, attrs={"kind": "pw_r"})  # fmt: skip


def n_step(names=("pw_r", "persistence")):
    rms = np.outer(1.0 + np.arange(len(names)), [0.03, 0.05, 0.08])
    return labelled_dataset({
        "predictor": ("predictor", list(names), "-", "predictor"),
        "horizon_s": ("horizon_s", [0.005, 0.02, 0.05], "s", "horizon"),
        "n_step_rms_deg": (("predictor", "horizon_s"), rms, "deg", "RMS error ahead"),
    })  # fmt: skip


def correlations():
    lag = np.arange(1, 26)
    return labelled_dataset({
        "lag": ("lag", lag, "samples", "lag"),
        "autocorrelation": ("lag", 0.5**lag, "-", "autocorrelation of the residual"),
        "cross_correlation": ("lag", 0.01 * np.cos(lag), "-", "correlation of residual and earlier duty"),
        "limit": ((), 0.03, "-", "95 % limit"),
    })  # fmt: skip


def matrix(value=-0.99):
    names = ["preload_duty", "coulomb_duty", "tau_s"]
    values = [[1.0, value, 0.1], [value, 1.0, np.nan], [0.1, np.nan, 1.0]]
    return labelled_dataset({
        "parameter": ("parameter", names, "-", "parameter"), "other": ("other", names, "-", "parameter"),
        "correlation": (("parameter", "other"), values, "-", "correlation"),
    })  # fmt: skip


ALL = {
    plot.holding_duty: (log, "plate angle [deg]", "duty [-]"),
    free_run: (run, "", "plate angle [deg]"),
    error_growth: (n_step, "horizon [ms]", "RMS error ahead [deg]"),
    residual_correlation: (correlations, "", "residual with itself [-]"),
    plot.correlation_matrix: (matrix, "", ""),
}


@pytest.mark.parametrize("draw", ALL, ids=lambda f: f.__name__)
def test_axes_say_their_units_and_given_axes_are_used(draw):
    make, x, y = ALL[draw]
    figure, panes = plt.subplots(1, 2, layout="constrained")
    ax = draw(make(), ax=panes[1])
    assert ax is panes[1]
    assert (ax.get_xlabel(), ax.get_ylabel()) == (x, y)
    assert not panes[0].lines
    figure.canvas.draw()
    assert draw(make()).figure is not figure


@pytest.mark.parametrize("draw", ALL, ids=lambda f: f.__name__)
def test_a_missing_variable_is_named(draw):
    dataset = ALL[draw][0]()
    name = next(n for n in ("angle_deg", "n_step_rms_deg", "autocorrelation", "correlation") if n in dataset)
    with pytest.raises(DataError, match=f"no variable '{name}'"):
        draw(dataset.drop_vars(name))


def test_branches_follow_the_direction_of_the_duty():
    ax = plot.holding_duty(log(), limp_home_deg=8.0)
    rising, falling = ax.lines[0].get_ydata(), ax.lines[1].get_ydata()
    slope = np.diff(DUTY, prepend=DUTY[0])
    np.testing.assert_array_equal(np.isfinite(rising)[1:], slope[1:] > 0.0)
    np.testing.assert_array_equal(np.isnan(rising), np.isfinite(falling))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "duty rising",
        "duty falling",
        "limp-home 8 deg",
    ]
    staircase = log().assign(duty=("time_s", np.repeat([0.0, 0.1, 0.2, 0.1], 100), log()["duty"].attrs))
    held = plot.holding_duty(staircase).lines[0].get_ydata()
    assert np.isfinite(held[:300]).all()
    assert np.isnan(held[300:]).all(), "where the duty holds, the last direction counts"


def test_a_model_lies_over_the_branches():
    ax = plot.holding_duty(log().assign(model_deg=("time_s", DEG + 1.0, {"units": "deg", "long_name": "model"})))
    np.testing.assert_array_equal(ax.lines[-1].get_xdata(), DEG + 1.0)


def test_the_free_run_has_its_residual_below():
    ax = free_run(run())
    panel = ax.figure.axes[-1]
    assert panel.get_xlabel() == "time [s]"
    np.testing.assert_allclose(panel.lines[0].get_ydata(), 0.1)
    assert ax.get_legend().get_texts()[1].get_text() == "model, free run (pw r)"


def test_lags_outside_the_limit_are_squares():
    ax = residual_correlation(correlations())
    lower = ax.figure.axes[-1]
    assert ax.lines[1].get_xdata().tolist() == [1, 2, 3, 4, 5]
    assert ax.lines[1].get_marker() == "s"
    assert lower.lines[1].get_xdata().size == 0


def test_the_matrix_frames_what_cannot_be_told_apart():
    from matplotlib.patches import Rectangle

    ax = plot.correlation_matrix(matrix())
    assert [text.get_text() for text in ax.texts] == [
        "1.00",
        "−0.99",
        "0.10",
        "−0.99",
        "1.00",
        "–",
        "0.10",
        "–",
        "1.00",
    ]
    assert sum(isinstance(patch, Rectangle) for patch in ax.patches) == 2
    assert not plot.correlation_matrix(matrix(0.9)).patches


def test_five_lines_are_the_most():
    with pytest.raises(DataError, match="at most 5"):
        error_growth(n_step(tuple("abcdef")))
    assert len(error_growth(n_step(tuple("abcde"))).lines) == 5
