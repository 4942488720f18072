"""The user's own ODE through the fit of the package."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from mgdd.errors import DataError, Interrupted, ParameterError, ShapeError
from mgdd.identify import OdeModel, fit_ode
from mgdd.optimize import FitOptions


def pendulum(_t, x, u, p):
    return x[1], p[0] * u[0] - p[1] * x[1] - p[2] * np.sin(x[0])


def record(n=600, noise=0.0, seed=1):
    rng = np.random.default_rng(seed)
    time = 0.02 * np.arange(n)
    u = np.repeat(rng.uniform(-1, 1, n // 20 + 1), 20)[:n]
    model = OdeModel(
        derivative=pendulum,
        output=lambda x, _u, _p: x[0],
        parameters={"gain": 3.0, "damping": 0.4, "stiffness": 2.0},
        initial_state=(0.2, -0.1),
    )
    return time, u, model.simulate({"time_s": time, "u": u})["y"].to_numpy() + noise * rng.standard_normal(n)


def fit(time, u, y, **options):
    settings = {
        "parameters": {"gain": 2.0, "damping": 0.2, "stiffness": 1.0},
        "initial_state": [y[0], 0.0],
        "free_state": [0, 1],
        "bounds": {"gain": (0.1, 20.0), "damping": (0.01, 5.0), "stiffness": (0.1, 20.0)},
        "log_scaled": ["gain", "damping", "stiffness"],
    }
    return fit_ode(pendulum, {"time_s": time, "u": u, "y": y}, **(settings | options))


def test_exact_data_give_back_parameters_and_start():
    time, u, y = record()
    found = fit(time, u, y)
    assert found.report.success
    np.testing.assert_allclose(found.report.values, [3.0, 0.4, 2.0, 0.2, -0.1], rtol=1e-6)
    np.testing.assert_allclose(found.model.simulate({"time_s": time, "u": u})["y"], y, atol=1e-7)


def test_noise_gives_honest_errors_and_fixed_parameters_stay():
    time, u, y = record(noise=0.01, seed=3)
    found = fit(
        time, u, y, sigma=0.01, free=["gain", "stiffness"], parameters={"gain": 2.0, "damping": 0.4, "stiffness": 1.0}
    )
    assert found.report.names == ("gain", "stiffness", "state_0", "state_1")
    assert found.model.parameters["damping"] == 0.4
    assert found.report.rmse == pytest.approx(1.0, abs=0.1)
    assert np.all(np.abs(found.report.values - [3.0, 2.0, 0.2, -0.1]) < 4 * found.report.stderr)


def test_many_starts_report_how_many_arrived():
    time, u, y = record(200)
    found = fit(
        time,
        u,
        y,
        options=FitOptions(n_starts=3),
        bounds={
            "gain": (1.0, 6.0),
            "damping": (0.1, 1.0),
            "stiffness": (0.5, 5.0),
            "state_0": (-1, 1),
            "state_1": (-1, 1),
        },
    )
    assert len(found.start_reports) == len(found.start_rmse) == 3
    assert 1 <= found.n_best <= 3


def test_ctrl_c_leaves_the_best_of_the_finished_starts():
    time, u, y = record(n=200)
    calls = []

    def counted(*arguments):
        calls.append(None)
        if len(calls) == most + 1:
            raise KeyboardInterrupt
        return pendulum(*arguments)

    box = {"gain": (1.0, 5.0), "damping": (0.1, 1.0), "stiffness": (1.0, 3.0)}
    settings = {
        "parameters": {"gain": 2.0, "damping": 0.2, "stiffness": 1.0},
        "initial_state": [0.2, -0.1],
        "bounds": box,
    }
    most = 10**9
    alone = fit_ode(counted, {"time_s": time, "u": u, "y": y}, **settings)
    searched, most = len(calls), 10
    calls.clear()
    with pytest.raises(KeyboardInterrupt) as nothing:
        fit_ode(counted, {"time_s": time, "u": u, "y": y}, **settings)
    assert not isinstance(nothing.value, Interrupted)
    calls.clear()
    most = searched
    with pytest.raises(Interrupted) as stop:
        fit_ode(counted, {"time_s": time, "u": u, "y": y}, **settings, options=FitOptions(n_starts=3))
    np.testing.assert_array_equal(stop.value.partial.report.values, alone.report.values)
    assert len(stop.value.partial.start_reports) == 1


def test_wrong_calls_name_the_remedy_and_a_right_one_follows():
    time, u, y = record(100)
    with pytest.raises(ParameterError, match="no parameter of this model"):
        fit(time, u, y, log_scaled=["gane"])
    with pytest.raises(ShapeError, match="one length"):
        fit(time, u, y[:-1])
    with pytest.raises(DataError, match="uneven sampling"):
        fit(time**2, u, y)
    with pytest.raises(DataError, match="y: sample 7"):
        fit(time, u, np.where(np.arange(100) == 7, np.inf, y))
    with pytest.raises(DataError, match="u: sample 7"):
        fit(time, np.where(np.arange(100) == 7, np.nan, u), y)
    with pytest.raises(DataError, match="y: every sample is missing"):
        fit(time, u, np.full(100, np.nan), initial_state=[0.0, 0.0])
    for name, value, error in (
        ("interpolation", "spline", ParameterError),
        ("input_delay_s", -0.1, ParameterError),
        ("input_delay_s", (0.2, 0.1), ParameterError),
        ("sigma", [0.1, 0.2], ShapeError),
        ("sigma", np.where(np.arange(100) == 3, 0.0, 1.0), ParameterError),
        ("initial_state", [[0.0, 0.0], [0.0, 0.0]], ShapeError),
    ):
        with pytest.raises(error, match=name):
            fit(time, u, y, **{name: value})
    with pytest.raises(ParameterError, match="no finite simulation"):
        fit(time, u, y, parameters={"gain": 2.0, "damping": -1e9, "stiffness": 1.0}, bounds={}, log_scaled=[])
    assert fit(time, u, y).report.success


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
GUESS = {"damping": 0.3, "stiffness": 8.0, "cubic": 1.0}


def test_a_measured_input_is_read_between_its_samples():
    record = shaken()
    lost = {
        how: fit_ode(
            spring, record, parameters=GUESS, initial_state=[0.3, 0.0], interpolation=how, substeps=2
        ).train.rmse
        for how in ("hold", "linear", "cubic")
    }
    assert lost["linear"] < lost["hold"] / 10
    assert lost["cubic"] < lost["linear"] / 20


@pytest.mark.parametrize("how", ["linear", "cubic"])
def test_a_delay_of_no_whole_samples_is_found_with_its_interval(how):
    record = shaken(delay_s=0.187, seed=2, noise=0.003)
    settings = {"parameters": GUESS, "initial_state": [0.3, 0.0], "interpolation": how, "substeps": 2}
    found = fit_ode(spring, record, input_delay_s=(0.0, 0.5), **settings)
    assert found.report.names[-1] == "input_delay_s"
    low, high = found.report.interval(0.999)["input_delay_s"]
    assert low < 0.187 < high
    assert high - low < 0.02
    again = fit_ode(spring, record, input_delay_s=found.model.input_delay_s, **settings)
    np.testing.assert_allclose(again.report.values, found.report.values[:3], rtol=1e-3)
    with pytest.raises(ParameterError, match="input_delay_s"):
        dataclasses.replace(found.model, input_delay_s=-0.1)
    read = OdeModel.from_toml(found.model.to_toml(), derivative=spring)
    assert read.simulate(record)["y"].identical(found.model.simulate(record)["y"])


def test_a_delay_of_held_inputs_moves_them_as_they_were_held():
    """By the exact solution of a lag whose input steps between two samples."""
    time = 0.1 * np.arange(80)
    u = np.where((np.arange(80) // 9) % 2 == 0, 1.0, -0.5)
    fine = 1e-4 * np.arange(79000 // 10 * 10 + 1)
    held = u[np.maximum(np.floor((fine - 0.237) / 0.1 + 1e-9).astype(int), 0)]
    y = np.zeros(fine.size)
    for k in range(fine.size - 1):
        y[k + 1] = held[k] * 2.0 + (y[k] - held[k] * 2.0) * np.exp(-1e-4 / 0.6)
    y = np.interp(time, fine, y)
    found = fit_ode(
        lambda _t, x, u, p: (p[0] * u[0] - x) / p[1],
        {"time_s": time, "u": u, "y": y},
        parameters={"gain": 1.0, "time_constant_s": 1.0},
        initial_state=[0.0],
        input_delay_s=(0.0, 0.8),
        substeps=8,
    )
    np.testing.assert_allclose(found.report.values, [2.0, 0.6, 0.237], rtol=2e-3)


def test_missing_samples_and_surer_ones_count_as_they_should():
    record = shaken(seed=4, noise=0.002)
    draw = np.random.default_rng(5)
    poor = np.arange(400) % 3 == 1
    record["y"] = np.where(poor, record["y"] + 0.2 * draw.standard_normal(400), record["y"])
    settings = {"parameters": GUESS, "initial_state": [0.3, 0.0], "interpolation": "cubic", "substeps": 2}
    weighted = fit_ode(spring, record, sigma=np.where(poor, 0.2, 0.002), **settings)
    alike = fit_ode(spring, record, **settings)
    without = fit_ode(spring, {**record, "y": np.where(poor, np.nan, record["y"])}, sigma=0.002, **settings)
    assert np.abs(weighted.report.values - TRUE).max() < 0.2 * np.abs(alike.report.values - TRUE).max()
    np.testing.assert_allclose(weighted.report.values, without.report.values, rtol=2e-3)
    assert without.report.rmse == pytest.approx(1.0, abs=0.15)
    assert without.train.n == 267


def test_several_records_share_parameters_and_each_has_its_start():
    starts = [(0.3, 0.0), (-0.6, 1.0), (0.0, -0.4)]
    records = [shaken(70 * k + 90, seed=k, noise=0.002, start=at) for k, at in enumerate(starts)]
    settings = {"parameters": GUESS, "interpolation": "cubic", "substeps": 2, "free_state": [0, 1]}
    found = fit_ode(spring, records, initial_state=np.zeros((3, 2)), **settings)
    assert found.report.names[3:5] == ("state_0_of_0", "state_1_of_0")
    assert np.all(np.abs(found.report.values - [*TRUE, *np.ravel(starts)]) < 5 * found.report.stderr)
    levels = [np.full(each["y"].size, 0.002) for each in records]
    known = fit_ode(spring, records, initial_state=np.zeros((3, 2)), sigma=levels, **settings)
    np.testing.assert_allclose(known.report.values, found.report.values, rtol=1e-6)
    assert known.report.rmse == pytest.approx(1.0, abs=0.1)
    with pytest.raises(ShapeError, match="sigma"):
        fit_ode(spring, records, initial_state=np.zeros((3, 2)), sigma=levels[:2], **settings)
    one = fit_ode(spring, records[0], initial_state=[0.0, 0.0], **settings)
    assert np.all(found.report.stderr[:3] < one.report.stderr[:3])
    reversed_ = fit_ode(spring, records[::-1], initial_state=np.zeros((3, 2)), **settings)
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
            record = {**clean, "y": clean["y"] + noise}
            found = fit_ode(
                spring, record, parameters=GUESS, initial_state=[0.3, 0.0], interpolation="cubic", substeps=2
            )
            ends = np.array([found.report.interval(0.95)[name] for name in GUESS])
            inside.append((ends[:, 0] < TRUE) & (ends[:, 1] > TRUE))
    assert np.mean(held[0.0]) > 0.85
    assert np.mean(held[0.94]) > 0.85
