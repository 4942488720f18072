"""The user's own ODE through the fit of the package."""

from __future__ import annotations

import numpy as np
import pytest

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
        fit(time, u, np.where(np.arange(100) == 7, np.nan, y))
    with pytest.raises(ParameterError, match="no finite simulation"):
        fit(time, u, y, parameters={"gain": 2.0, "damping": -1e9, "stiffness": 1.0}, bounds={}, log_scaled=[])
    assert fit(time, u, y).report.success
