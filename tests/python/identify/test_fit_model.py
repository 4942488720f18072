"""Any model of the user's own: several outputs, discrete time, simulators, errors ahead, stretches, profiles."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify import DiscreteModel, OdeModel, SimulatorModel, fit_model, profile_likelihood
from mgdd.identify.grey_box.search import Ties
from mgdd.optimize import FitOptions

TIME = 0.1 * np.arange(300)
INPUT = np.sign(np.sin(0.9 * TIME)) + 0.3 * np.sin(4.1 * TIME)


def mixer(x, u, p):
    """Two states, each with its own pole, the second driven by the first and a square of it."""
    return p[0] * x[0] + u[0], p[1] * x[1] + 0.4 * x[0] + p[2] * x[0] ** 2


TRUE = {"fast": 0.6, "slow": 0.9, "bend": -0.05}
NEAR = {"fast": 0.5, "slow": 0.8, "bend": 0.0}


def both(parameters, **more):
    return DiscreteModel(
        step=mixer, parameters=parameters, initial_state=(0.5, -1.0), output_names=("first", "second"), **more
    )


def record_of(model, noise=(0.0, 0.0), seed=1):
    record = {name: column.to_numpy() for name, column in model.simulate({"time_s": TIME, "u": INPUT}).items()}
    draw = np.random.default_rng(seed)
    for name, level in zip(model.output_names, noise, strict=False):
        record[name] = record[name] + level * draw.standard_normal(TIME.size)
    return {"time_s": TIME, **record}


# --- several outputs ------------------------------------------------------------------------------------------
def test_each_output_counts_by_its_noise():
    record = record_of(both(TRUE), noise=(0.001, 0.5))
    sigma = {"first": 0.001, "second": 0.5}
    weighted, alike = fit_model(both(NEAR), record, sigma=sigma), fit_model(both(NEAR), record)
    assert weighted.report.rmse == pytest.approx(1.0, abs=0.1)
    assert weighted.report.residual.size == 600
    assert weighted.stderr["fast"] < 0.1 * alike.stderr["fast"]
    assert np.all(np.abs(weighted.report.values - list(TRUE.values())) < 4.0 * weighted.report.stderr)
    with pytest.raises(ParameterError, match="a level for each of first, second"):
        fit_model(both(NEAR), record, sigma={"first": 1.0})


def test_an_output_with_gaps_and_one_without():
    record = record_of(both(TRUE))
    record["first"] = np.where(np.arange(300) % 5 == 0, record["first"], np.nan)
    found = fit_model(both(NEAR), record)
    np.testing.assert_allclose(found.report.values, list(TRUE.values()), rtol=1e-6)
    assert found.report.residual.size == 300 + 60
    run = found.model.simulate(record)
    np.testing.assert_allclose(run["second"], record["second"], atol=1e-6)
    ahead = found.model.predict(record_of(both(TRUE)), 7)
    np.testing.assert_allclose(ahead["first"], run["first"][7:], atol=1e-6)


def test_a_function_of_the_state_gives_outputs_of_an_equation():
    """Position and force of an oscillator, in other units; the force alone leaves the mass open, both do not."""

    def oscillator(_t, x, u, p):
        return x[1], (u[0] - p[1] * x[0] - 0.4 * x[1]) / p[0]

    def measured(x, _u, p):
        return 1e3 * x[0], p[1] * x[0]

    model = OdeModel(
        derivative=oscillator,
        output=measured,
        parameters={"mass_kg": 1.5, "stiffness_n_per_m": 6.0},
        initial_state=(0.1, 0.0),
        output_names=("position_mm", "force_n"),
        substeps=2,
    )
    run = model.simulate({"time_s": TIME, "u": INPUT})
    start = dataclasses.replace(model, parameters={"mass_kg": 1.0, "stiffness_n_per_m": 5.0})
    found = fit_model(start, run, sigma={"position_mm": 1.0, "force_n": 0.01})
    np.testing.assert_allclose(found.report.values, [1.5, 6.0], rtol=1e-6)


# --- discrete time and simulators -----------------------------------------------------------------------------
def test_a_simulator_of_whole_records_finds_what_its_recursion_finds():
    truth = DiscreteModel(
        step=lambda x, u, p: p[0] * x + (1.0 - p[0]) * p[1] * u[0],
        parameters={"pole": 0.8, "gain": 2.5},
        initial_state=(0.0,),
    )
    record = record_of(truth, noise=(0.05,))

    def filtered(_x, u, p):
        return lfilter([0.0, (1.0 - p[0]) * p[1]], [1.0, -p[0]], u[:, 0])

    start = {"pole": 0.5, "gain": 1.0}
    whole = fit_model(SimulatorModel(simulator=filtered, parameters=start), record)
    steps = fit_model(DiscreteModel(step=truth.step, parameters=start, initial_state=(0.0,)), record)
    np.testing.assert_allclose(whole.report.values, steps.report.values, rtol=1e-6)
    np.testing.assert_allclose(whole.report.stderr, steps.report.stderr, rtol=1e-4)
    again = SimulatorModel.from_toml(whole.to_toml(), simulator=filtered)
    assert again.simulate(record)["y"].identical(whole.model.simulate(record)["y"])
    read = DiscreteModel.from_toml(steps.to_toml(), step=truth.step)
    assert read.simulate(record)["y"].identical(steps.model.simulate(record)["y"])


def test_functions_for_one_state_run_one_by_one_or_are_refused():
    def scalar(x, u, p):
        return [p[0] * math.sin(x[0]) + u[0] if x[0] > -9.0 else 0.0]

    def summing(x, u, p):
        return p[0] * np.sin(np.sum(x)) + u[0] + 0.0 * x

    truth = DiscreteModel(step=lambda x, u, p: p[0] * np.sin(x) + u[0], parameters={"a": 0.7}, initial_state=(0.2,))
    record = record_of(truth, noise=(0.01,))
    columns = fit_model(DiscreteModel(step=truth.step, parameters={"a": 0.4}, initial_state=(0.2,)), record)
    alone = DiscreteModel(step=scalar, parameters={"a": 0.4}, initial_state=(0.2,), vectorized=False)
    np.testing.assert_allclose(fit_model(alone, record).report.values, columns.report.values, rtol=1e-9)
    for function, message in ((scalar, "step does not take columns"), (summing, "step mixes its columns")):
        with pytest.raises(ParameterError, match=rf"{message}.*vectorized=False"):
            fit_model(DiscreteModel(step=function, parameters={"a": 0.4}, initial_state=(0.2,)), record)


def test_the_measured_output_as_an_input_makes_a_one_step_predictor():
    """An ARX model, whose least squares have a closed form."""
    draw = np.random.default_rng(3)
    y = np.zeros(300)
    for k in range(299):
        y[k + 1] = 0.7 * y[k] + 0.5 * INPUT[k] + 0.1 * draw.standard_normal()
    predictor = DiscreteModel(
        step=lambda _x, u, p: (p[0] * u[1] + p[1] * u[0],),
        parameters={"a": 0.0, "b": 0.0},
        initial_state=(0.0,),
        input_names=("u", "y"),
        output_names=("y",),
    )
    found = fit_model(predictor, {"time_s": TIME, "u": INPUT, "y": y}, skip=1)
    closed = np.linalg.lstsq(np.column_stack([y[:-1], INPUT[:-1]]), y[1:], rcond=None)[0]
    np.testing.assert_allclose(found.report.values, closed, rtol=1e-7)


# --- errors ahead, and stretches ------------------------------------------------------------------------------
def slide(x, u, p):
    return x[0] + 0.1 * x[1], p[0] * x[1] + p[1] * u[0]


def test_an_error_ahead_is_that_of_predict_and_does_not_count_a_drift():
    truth = {"kept": 0.8, "push": 0.3}
    model = DiscreteModel(step=slide, parameters=truth, initial_state=(0.0, 0.0))
    start = DiscreteModel(step=slide, parameters={"kept": 0.6, "push": 0.2}, initial_state=(0.0, 0.0))
    off = {None: [], 5: []}
    for seed in range(8):
        record = record_of(model)
        record["y"] = record["y"] + 0.02 * np.cumsum(np.random.default_rng(seed).standard_normal(300))
        for horizon, errors in off.items():
            ahead = fit_model(start, record, horizon=horizon)
            errors.append(ahead.report.values - list(truth.values()))
    spread = {horizon: np.sqrt(np.mean(np.square(errors), axis=0)) for horizon, errors in off.items()}
    assert np.all(spread[5] < 0.7 * spread[None])
    error = ahead.model.predict(record, 5)["y"].to_numpy() - record["y"][5:]
    np.testing.assert_allclose(np.abs(ahead.report.residual), np.abs(error), atol=1e-12)
    with pytest.raises(ParameterError, match="horizon = 300"):
        fit_model(start, record, horizon=300)


def pendulum(_t, x, u, p):
    return x[1], u[0] - 0.05 * x[1] - p[0] * np.sin(x[0])


@pytest.mark.parametrize("several", [False, True])
def test_stretches_find_a_frequency_that_a_free_run_loses(several):
    """From a stiffness of half the true one the phase of a free run is lost within a few of its swings."""
    truth = OdeModel(derivative=pendulum, parameters={"stiffness": 9.0}, initial_state=(1.0, 0.0))
    inputs = {"time_s": TIME, "u": 0.3 * INPUT}
    runs = [truth.simulate(inputs, initial_state=start) for start in ((1.0, 0.0), (-0.4, 1.5))]
    record, starts = (runs, [[1.0, 0.0], [-0.4, 1.5]]) if several else (runs[0], [1.0, 0.0])
    model = OdeModel(derivative=pendulum, parameters={"stiffness": 4.5}, initial_state=(1.0, 0.0))
    alone = fit_model(model, record, initial_state=starts)
    cut = fit_model(model, record, initial_state=starts, shooting_samples=15)
    assert abs(alone.report.values[0] - 9.0) > 1.0
    np.testing.assert_allclose(cut.report.values, [9.0], rtol=1e-6)
    assert cut.report.residual.size == 300 * (1 + several)


def test_slopes_of_stretches_and_gaps_are_those_of_their_residual():
    model = both(TRUE)
    records = [record_of(model), {name: column[:170] for name, column in record_of(model, seed=2).items()}]
    free = {"free_state": [1], "bounds": {"fast": (0.0, 1.0)}, "horizon": 3}
    search = fit_model(both(NEAR), records, **free).search
    ties = Ties(length=60, weight=np.array([0.7, 2.0]))
    rng = np.random.default_rng(6)
    x = np.r_[0.55, 0.85, -0.02, -0.8, -1.2, rng.normal(size=2 * (4 + 2))]
    value, slopes = search.residual(x, ties)
    assert value.size == 2 * (297 + 167) + 2 * (4 + 2)
    for i in range(x.size):
        h = 1e-5 * np.eye(x.size)[i]
        numeric = (search.residual(x + h, ties)[0] - search.residual(x - h, ties)[0]) / 2e-5
        np.testing.assert_allclose(slopes[:, i], numeric, atol=1e-6 * max(1.0, np.abs(numeric).max()))


def test_stretches_that_a_model_cannot_have_are_refused():
    record = record_of(DiscreteModel(step=slide, parameters={"kept": 0.8, "push": 0.3}, initial_state=(0.0, 0.0)))
    model = DiscreteModel(step=slide, parameters={"kept": 0.8, "push": 0.3}, initial_state=(0.0, 0.0))
    for length in (2, 300):
        with pytest.raises(
            ParameterError, match=f"shooting_samples = {length}: must be more samples than the 2 states"
        ):
            fit_model(model, record, shooting_samples=length)
    simulator = SimulatorModel(simulator=lambda _x, u, p: p[0] * u[:, 0], parameters={"gain": 1.0})
    with pytest.raises(ParameterError, match="shooting_samples: a SimulatorModel runs whole records"):
        fit_model(simulator, record, shooting_samples=50)


# --- profiles ---------------------------------------------------------------------------------------------------
def parabola(_x, u, p):
    return p[0] + p[1] * u[:, 0] + p[2] * u[:, 0] ** 2


def test_the_profile_of_a_linear_model_is_the_interval_of_its_report():
    draw = np.random.default_rng(4)
    record = {"time_s": TIME, "u": INPUT, "y": 1.0 + 2.0 * INPUT + 0.3 * draw.standard_normal(300)}
    found = fit_model(SimulatorModel(simulator=parabola, parameters={"level": 0.0, "slope": 1.0, "bend": 0.0}), record)
    for level in (0.5, 0.95):
        for name, (low, high) in found.report.interval(level).items():
            profile = profile_likelihood(found, name, level=level)
            assert (profile.low, profile.high) == pytest.approx((low, high), rel=1e-6)
            assert profile.dataset["deviance"].min() == 0.0
    with pytest.raises(ParameterError, match="name = 'gain': must be one of the estimated level, slope, bend"):
        profile_likelihood(found, "gain")


def test_a_profile_is_one_sided_where_the_record_is():
    """Noise that hides how fast a step settles: any short lag will do, no long one, and the profile says so."""

    def lag(_x, u, p):
        pole = np.exp(-0.1 / p[0])
        return lfilter([1.0 - pole], [1.0, -pole], u[:, 0])

    draw = np.random.default_rng(5)
    step = np.where((TIME // 1.5) % 2 == 0, 1.0, -0.5)
    record = {"time_s": TIME, "u": step, "y": lag(None, step[:, None], [0.03]) + 0.2 * draw.standard_normal(300)}
    model = SimulatorModel(simulator=lag, parameters={"lag_s": 0.05})
    found = fit_model(model, record, bounds={"lag_s": (1e-3, 5.0)}, log_scaled=["lag_s"])
    profile = profile_likelihood(found, "lag_s")
    assert profile.low == 1e-3
    assert 0.03 < profile.high < 0.2
    rest = profile.dataset["deviance"].to_numpy()
    assert rest[0] < profile.quantile < rest[-1]


# --- bad input --------------------------------------------------------------------------------------------------
def test_what_a_model_returns_wrong_is_named():
    record = record_of(both(TRUE))
    start = {"initial_state": (0.5, -1.0), "output_names": ("first", "second"), "parameters": NEAR}
    with pytest.raises(ShapeError, match=r"step returned shape .*: must be \(2, 2\)"):
        fit_model(DiscreteModel(step=lambda x, _u, _p: x[0], **start), record)
    with pytest.raises(ShapeError, match=r"output returned shape"):
        fit_model(DiscreteModel(step=mixer, output=lambda x, _u, _p: (x[0], x[1], x[0]), **start), record)
    with pytest.raises(ShapeError, match=r"simulator returned shape \(300,\): must be \(300, 2\)"):
        fit_model(SimulatorModel(simulator=lambda _x, u, _p: u[:, 0], **start), record)
    with pytest.raises(ParameterError, match=r"first of record 0 is (nan|inf) from sample \d+ on"):
        fit_model(both(NEAR | {"fast": 1e200}), record)
    with pytest.raises(ShapeError, match="1 states for the outputs first, second: give output="):
        DiscreteModel(step=mixer, parameters=NEAR, initial_state=(0.5,), output_names=("first", "second"))
    with pytest.raises(KeyError, match="own fault"):
        fit_model(DiscreteModel(step=faulty, **start), record)
    assert fit_model(both(NEAR), record).success


def faulty(_x, _u, _p):
    raise KeyError("own fault")


def test_records_of_unlike_sampling_belong_to_no_discrete_model():
    record = record_of(both(TRUE))
    other = {**record, "time_s": 2.0 * TIME}
    with pytest.raises(DataError, match=r"record 1 is sampled every 0.2 s, record 0 every 0.1 s"):
        fit_model(both(NEAR), [record, other])
    found = fit_model(both(NEAR), record)
    assert found.model.sample_s == pytest.approx(0.1)
    with pytest.raises(DataError, match=r"sampled every 0.2 s: the parameters belong to sample_s = 0.1 s"):
        found.model.simulate(other)


def test_a_parameter_that_does_not_act_is_named():
    model = DiscreteModel(
        step=lambda x, u, p: p[0] * x + u[0] + 0.0 * p[1], parameters={"pole": 0.5, "idle": 1.0}, initial_state=(0.0,)
    )
    record = record_of(DiscreteModel(step=model.step, parameters={"pole": 0.7, "idle": 1.0}, initial_state=(0.0,)))
    found = fit_model(model, record)
    assert found.unidentifiable == ("idle",)
    assert found.report.values.tolist() == pytest.approx([0.7, 1.0])
    profile = profile_likelihood(found, "idle")
    assert (profile.low, profile.high) == (-np.inf, np.inf)


@pytest.mark.parametrize(("root", "edge", "box"), [("lower", 0.0, (0.0, 2.0)), ("upper", 2.0, (0.5, 2.0))])
def test_a_model_without_a_slope_at_a_bound_is_evaluated_inside_or_named(root, edge, box):
    def step(x, u, p):
        return 0.5 * x + np.sqrt(p[0] if root == "lower" else 2.0 - p[0]) * u[0]

    model = DiscreteModel(step=step, parameters={"power": edge}, initial_state=(0.0,))
    record = record_of(DiscreteModel(step=step, parameters={"power": 0.7}, initial_state=(0.0,)))
    with pytest.raises(ParameterError, match=rf"power = {edge:g}: the model has no slope.*bounds=\{{'power': ...\}}"):
        fit_model(model, record)
    found = fit_model(model, record, bounds={"power": box}, options=FitOptions(max_iterations=200))
    assert found.report.values[0] == pytest.approx(0.7, rel=1e-6)
