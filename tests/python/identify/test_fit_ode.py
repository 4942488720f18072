"""The user's own ODE through the fit of the package."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from mgdd.errors import DataError, Interrupted, ParameterError, ShapeError
from mgdd.identify import OdeModel, fit_model
from mgdd.optimize import FitOptions


def pendulum(_t, x, u, p):
    return x[1], p[0] * u[0] - p[1] * x[1] - p[2] * np.sin(x[0])


SWINGING = OdeModel(
    derivative=pendulum, parameters={"gain": 3.0, "damping": 0.4, "stiffness": 2.0}, initial_state=(0.2, -0.1)
)
START = {"gain": 2.0, "damping": 0.2, "stiffness": 1.0}


def record(n=600, noise=0.0, seed=1):
    rng = np.random.default_rng(seed)
    time = 0.02 * np.arange(n)
    u = np.repeat(rng.uniform(-1, 1, n // 20 + 1), 20)[:n]
    y = SWINGING.simulate({"time_s": time, "u": u})["y"].to_numpy() + noise * rng.standard_normal(n)
    return {"time_s": time, "u": u, "y": y}


def fit(measured, parameters=START, model=SWINGING, **options):
    settings = {
        "initial_state": [measured["y"][0], 0.0],
        "free_state": [0, 1],
        "bounds": {"gain": (0.1, 20.0), "damping": (0.01, 5.0), "stiffness": (0.1, 20.0)},
        "log_scaled": list(START),
    }
    return fit_model(replace(model, parameters=parameters), measured, **(settings | options))


def test_exact_data_give_back_parameters_and_start():
    measured = record()
    found = fit(measured)
    assert found.report.success
    np.testing.assert_allclose(found.report.values, [3.0, 0.4, 2.0, 0.2, -0.1], rtol=1e-6)
    np.testing.assert_allclose(found.model.simulate(measured)["y"], measured["y"], atol=1e-7)


def test_noise_gives_honest_errors_and_fixed_parameters_stay():
    found = fit(record(noise=0.01, seed=3), START | {"damping": 0.4}, sigma=0.01, free=["gain", "stiffness"])
    assert found.report.names == ("gain", "stiffness", "state_0", "state_1")
    assert found.model.parameters["damping"] == 0.4
    assert found.report.rmse == pytest.approx(1.0, abs=0.1)
    assert np.all(np.abs(found.report.values - [3.0, 2.0, 0.2, -0.1]) < 4 * found.report.stderr)


def test_many_starts_report_how_many_arrived():
    box = {"gain": (1.0, 6.0), "damping": (0.1, 1.0), "stiffness": (0.5, 5.0), "state_0": (-1, 1), "state_1": (-1, 1)}
    found = fit(record(200), options=FitOptions(n_starts=3), bounds=box)
    assert len(found.start_reports) == len(found.start_rmse) == 3
    assert 1 <= found.n_best <= 3


def test_ctrl_c_leaves_the_best_of_the_finished_starts():
    measured, calls, most = record(n=200), [], 10**9

    def counted(*arguments):
        calls.append(None)
        if len(calls) == most + 1:
            raise KeyboardInterrupt
        return pendulum(*arguments)

    model = replace(SWINGING, derivative=counted, parameters=START)
    box = {"gain": (1.0, 5.0), "damping": (0.1, 1.0), "stiffness": (1.0, 3.0)}
    alone = fit_model(model, measured, bounds=box)
    searched, most = len(calls), 10
    calls.clear()
    with pytest.raises(KeyboardInterrupt) as nothing:
        fit_model(model, measured, bounds=box)
    assert not isinstance(nothing.value, Interrupted)
    calls.clear()
    most = searched
    with pytest.raises(Interrupted) as stop:
        fit_model(model, measured, bounds=box, options=FitOptions(n_starts=3))
    np.testing.assert_array_equal(stop.value.partial.report.values, alone.report.values)
    assert len(stop.value.partial.start_reports) == 1


def test_wrong_calls_name_the_remedy_and_a_right_one_follows():
    good, seventh = record(100), np.arange(100) == 7
    for wrong, error, message in (
        ({"y": good["y"][:-1]}, ShapeError, "one length"),
        ({"time_s": good["time_s"] ** 2}, DataError, "uneven sampling"),
        ({"y": np.where(seventh, np.inf, good["y"])}, DataError, "y: sample 7"),
        ({"u": np.where(seventh, np.nan, good["u"])}, DataError, "u: sample 7"),
        ({"y": np.full(100, np.nan)}, DataError, "y: every sample is missing"),
    ):
        with pytest.raises(error, match=message):
            fit(good | wrong, initial_state=[0.0, 0.0])
    for name, value, error in (
        ("log_scaled", ["gane"], ParameterError),
        ("input_delay_s", -0.1, ParameterError),
        ("input_delay_s", (0.2, 0.1), ParameterError),
        ("sigma", [0.1, 0.2], ShapeError),
        ("sigma", np.where(seventh, 0.0, 1.0), ParameterError),
        ("initial_state", [[0.0, 0.0], [0.0, 0.0]], ShapeError),
    ):
        with pytest.raises(error, match="gane" if name == "log_scaled" else name):
            fit(good, **{name: value})
    with pytest.raises(ParameterError, match="interpolation"):
        fit(good, model=replace(SWINGING, interpolation="spline"))
    with pytest.raises(ParameterError, match="no finite simulation"):
        fit(good, START | {"damping": -1e9}, bounds={}, log_scaled=[])
    assert fit(good).report.success


# --- what lies between the samples, before them, and in place of some -----------------------------------------
def chirp(t):
    return np.sin(2 * np.pi * (0.4 * t + 0.08 * t**2))


def shaken(n=400, sample_s=0.05, delay_s=0.0, seed=None, noise=0.0, start=(0.3, 0.0)):
    """An oscillator with a cubic spring under a chirp, by another integrator; damping, stiffness, cubic part."""
    time = sample_s * np.arange(n)

    def slope(t, x):
        u = chirp(t - delay_s) if t > delay_s else chirp(0.0)
        return [x[1], u - 0.5 * x[1] - 9.0 * x[0] - 4.0 * x[0] ** 3]

    run = solve_ivp(slope, (0.0, time[-1]), start, t_eval=time, rtol=1e-10, atol=1e-12, max_step=sample_s)
    draw = np.random.default_rng(seed)
    return {"time_s": time, "u": chirp(time), "y": run.y[0] + noise * draw.standard_normal(n)}


def spring(_t, x, u, p):
    return x[1], u[0] - p[0] * x[1] - p[1] * x[0] - p[2] * x[0] ** 3


TRUE = [0.5, 9.0, 4.0]
GUESS = OdeModel(
    derivative=spring, parameters={"damping": 0.3, "stiffness": 8.0, "cubic": 1.0}, initial_state=(0.3, 0.0),
    substeps=2, interpolation="cubic",
)  # fmt: skip


def test_a_measured_input_is_read_between_its_samples():
    measured = shaken()
    lost = {
        how: fit_model(replace(GUESS, interpolation=how), measured).train.rmse for how in ("hold", "linear", "cubic")
    }
    assert lost["linear"] < lost["hold"] / 10
    assert lost["cubic"] < lost["linear"] / 20


@pytest.mark.parametrize("how", ["linear", "cubic"])
def test_a_delay_of_no_whole_samples_is_found_with_its_interval(how):
    measured, model = shaken(delay_s=0.187, seed=2, noise=0.003), replace(GUESS, interpolation=how)
    found = fit_model(model, measured, input_delay_s=(0.0, 0.5))
    assert found.report.names[-1] == "input_delay_s"
    low, high = found.report.interval(0.999)["input_delay_s"]
    assert low < 0.187 < high
    assert high - low < 0.02
    again = fit_model(model, measured, input_delay_s=found.model.input_delay_s)
    np.testing.assert_allclose(again.report.values, found.report.values[:3], rtol=1e-3)
    with pytest.raises(ParameterError, match="input_delay_s"):
        replace(found.model, input_delay_s=-0.1)
    read = OdeModel.from_toml(found.model.to_toml(), derivative=spring)
    assert read.simulate(measured)["y"].identical(found.model.simulate(measured)["y"])


def test_a_delay_of_held_inputs_moves_them_as_they_were_held():
    """By the exact solution of a lag whose input steps between two samples."""
    time = 0.1 * np.arange(80)
    u = np.where((np.arange(80) // 9) % 2 == 0, 1.0, -0.5)
    fine = 1e-4 * np.arange(79000 // 10 * 10 + 1)
    held = u[np.maximum(np.floor((fine - 0.237) / 0.1 + 1e-9).astype(int), 0)]
    y = np.zeros(fine.size)
    for k in range(fine.size - 1):
        y[k + 1] = held[k] * 2.0 + (y[k] - held[k] * 2.0) * np.exp(-1e-4 / 0.6)
    lag = OdeModel(
        derivative=lambda _t, x, u, p: (p[0] * u[0] - x) / p[1],
        parameters={"gain": 1.0, "time_constant_s": 1.0},
        initial_state=(0.0,),
        substeps=8,
    )
    found = fit_model(lag, {"time_s": time, "u": u, "y": np.interp(time, fine, y)}, input_delay_s=(0.0, 0.8))
    np.testing.assert_allclose(found.report.values, [2.0, 0.6, 0.237], rtol=2e-3)


def test_missing_samples_and_surer_ones_count_as_they_should():
    measured = shaken(seed=4, noise=0.002)
    draw = np.random.default_rng(5)
    poor = np.arange(400) % 3 == 1
    measured["y"] = np.where(poor, measured["y"] + 0.2 * draw.standard_normal(400), measured["y"])
    weighted = fit_model(GUESS, measured, sigma=np.where(poor, 0.2, 0.002))
    alike = fit_model(GUESS, measured)
    without = fit_model(GUESS, {**measured, "y": np.where(poor, np.nan, measured["y"])}, sigma=0.002)
    assert np.abs(weighted.report.values - TRUE).max() < 0.2 * np.abs(alike.report.values - TRUE).max()
    np.testing.assert_allclose(weighted.report.values, without.report.values, rtol=2e-3)
    assert without.report.rmse == pytest.approx(1.0, abs=0.15)
    assert without.train.n == 267


def test_several_records_share_parameters_and_each_has_its_start():
    starts = [(0.3, 0.0), (-0.6, 1.0), (0.0, -0.4)]
    records = [shaken(70 * k + 90, seed=k, noise=0.002, start=at) for k, at in enumerate(starts)]
    settings = {"initial_state": np.zeros((3, 2)), "free_state": [0, 1]}
    found = fit_model(GUESS, records, **settings)
    assert found.report.names[3:5] == ("state_0_of_0", "state_1_of_0")
    assert np.all(np.abs(found.report.values - [*TRUE, *np.ravel(starts)]) < 5 * found.report.stderr)
    whole = np.concatenate([each["y"] for each in records])
    left = np.linalg.norm(found.report.residual) / np.linalg.norm(whole - whole.mean())
    assert found.report.nrmse_fit_percent == pytest.approx(100.0 * (1.0 - left), rel=1e-9)
    levels = [np.full(each["y"].size, 0.002) for each in records]
    known = fit_model(GUESS, records, sigma=levels, **settings)
    np.testing.assert_allclose(known.report.values, found.report.values, rtol=1e-6)
    assert known.report.rmse == pytest.approx(1.0, abs=0.1)
    with pytest.raises(ShapeError, match="sigma"):
        fit_model(GUESS, records, sigma=levels[:2], **settings)
    one = fit_model(GUESS, records[0], initial_state=[0.0, 0.0], free_state=[0, 1])
    assert np.all(found.report.stderr[:3] < one.report.stderr[:3])
    reversed_ = fit_model(GUESS, records[::-1], **settings)
    np.testing.assert_allclose(reversed_.report.values[:3], found.report.values[:3], rtol=1e-6)


@pytest.mark.slow
def test_intervals_hold_where_the_residual_is_correlated():
    """Noise of an autoregression with 16 samples of memory, and white: at least 85 % of the intervals of 95 % hold."""
    clean = shaken(600)
    held, records = {0.0: [], 0.94: []}, {0.0: 20, 0.94: 60}
    for memory, inside in held.items():
        for seed in range(records[memory]):
            draw = 0.01 * np.random.default_rng(seed).standard_normal(600)
            noise = lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], draw)
            found = fit_model(GUESS, {**clean, "y": clean["y"] + noise})
            ends = np.array([found.report.interval(0.95)[name] for name in GUESS.parameters])
            inside.append((ends[:, 0] < TRUE) & (ends[:, 1] > TRUE))
    assert np.mean(held[0.0]) > 0.85
    assert np.mean(held[0.94]) > 0.85
