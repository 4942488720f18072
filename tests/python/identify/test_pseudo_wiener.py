"""Pseudo-Wiener models from Python: model face, files, fit, on-line update, and the study's table."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import xarray as xr

from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify import OnlineUpdate
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.optimize import FitOptions
from mgdd.results.fit import Model
from mgdd.throttle import PseudoWiener, Throttle

TIME = np.arange(4000) * 1e-3
DUTY = 0.15 + 0.2 * np.sin(2.0 * np.pi * (0.5 * TIME + 0.6 * TIME**2))
MAP = {f"rise_{i}_deg": 12.0 for i in range(1, 7)}
MODELS = [
    PseudoWiener.of_throttle(Throttle()),
    PseudoWiener("pw_r", {"delay_samples": 2.0}, switching="measured", friction="tanh"),
    PseudoWiener("pw_w", {**MAP, "map_start": 1.0}),
    PseudoWiener("pw_p", {"gain_1_deg_per_duty": 150.0, "radius_1_duty": 0.05}),
    PseudoWiener("pw_p", {"plays": 4.0, "gain_4_deg_per_duty": 50.0, "radius_4_duty": 0.1}),
]


def simulate(model: PseudoWiener, start_deg: float, time=TIME, duty=DUTY) -> xr.Dataset:
    return model.simulate({"time_s": time, "duty": duty}, initial_state={"angle_deg": start_deg})


@pytest.mark.parametrize("model", MODELS, ids=lambda model: f"{model.kind}-{len(model.parameters)}")
def test_a_model_survives_every_copy(model: PseudoWiener) -> None:
    assert isinstance(model, Model)
    for other in (PseudoWiener.from_toml(model.to_toml()), pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert other == model
        assert hash(other) == hash(model)
    assert model.replace(limp_home_deg=9.0) != model
    assert set(model.units) == set(model.parameters)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: f"{model.kind}-{len(model.parameters)}")
def test_prediction_joins_measurement_and_free_run(model: PseudoWiener) -> None:
    log = simulate(model, 20.0)
    free = log["angle_deg"].to_numpy()
    assert free.shape == TIME.shape
    ahead = model.predict(log, 20, speed_gain_per_s=0.0, bias_gain_duty_per_deg=0.0)["angle_deg"].to_numpy()
    assert ahead.shape == (TIME.size - 20,)
    if model.parameters["delay_samples"] == 0.0:
        np.testing.assert_allclose(ahead, free[20:], atol=1e-9)
    angle, slope = model.slopes(np.full(30, 0.3), initial_state={"angle_deg": 20.0})
    assert slope.shape == (30, 30)
    assert np.abs(np.triu(slope, 1)).max() == 0.0
    np.testing.assert_array_equal(angle[:0], [])


def test_slopes_are_the_differences() -> None:
    model = MODELS[0]
    duty, state = np.full(24, 0.35), {"angle_deg": 30.0}
    _, slope = model.slopes(duty, initial_state=state)
    for k in (0, 7, 23):
        up, down = duty.copy(), duty.copy()
        up[k] += 1e-6
        down[k] -= 1e-6
        difference = (model.slopes(up, initial_state=state)[0] - model.slopes(down, initial_state=state)[0]) / 2e-6
        np.testing.assert_allclose(slope[:, k], difference, rtol=1e-5, atol=1e-5)


def test_another_sample_time_keeps_seconds_and_steps() -> None:
    model = PseudoWiener("pw_r", {"delay_samples": 4.0})
    coarse = model.at_sample(2e-3)
    assert coarse.parameters["delay_samples"] == 2.0
    assert coarse.parameters["substeps"] == 4.0
    fine = simulate(model, 8.0, duty=np.repeat(DUTY[::2], 2))["angle_deg"]
    slow = simulate(coarse, 8.0, TIME[::2], DUTY[::2])["angle_deg"]
    np.testing.assert_allclose(slow, fine[::2], atol=1e-9)


def test_a_delay_keeps_its_time_at_any_sample_time() -> None:
    for kind in ("pw_r", "pw_w", "pw_p"):
        model = PseudoWiener(kind, {"delay_samples": 3.0})
        coarse = model.at_sample(2e-3)
        assert coarse.parameters["delay_samples"] == 1.5
        assert coarse.at_sample(1e-3) == model
        with pytest.raises(ParameterError, match=r"delay_samples = 6 .* take sample_s >= 0\.0006 s"):
            model.at_sample(5e-4)
    whole, half = PseudoWiener("pw_r", {"delay_samples": 1.0}), PseudoWiener("pw_r", {"delay_samples": 1.5})
    mixed = 0.5 * (DUTY + np.concatenate([[0.0], DUTY[:-1]]))
    np.testing.assert_array_equal(simulate(half, 8.0)["angle_deg"], simulate(whole, 8.0, duty=mixed)["angle_deg"])


def test_bad_input_says_what_and_leaves_things_alone() -> None:
    with pytest.raises(ParameterError, match=r"above_tau_s = -1 s: must be in \[0\.005, 0\.3\]"):
        PseudoWiener("pw_r", {"above_tau_s": -1.0})
    with pytest.raises(ParameterError, match="'mass' is not a parameter of pw_w"):
        PseudoWiener("pw_w", {"mass": 1.0})
    with pytest.raises(ParameterError, match="must be one of pw_r, pw_w, pw_p"):
        PseudoWiener("wiener")
    with pytest.raises(ParameterError, match=r"delay_samples = 5\.5: must be in \[0, 5\]"):
        PseudoWiener("pw_r", {"delay_samples": 5.5})
    for kind in ("pw_r", "pw_w", "pw_p"):
        for name in PseudoWiener(kind).parameters:
            with pytest.raises(ParameterError) as caught:
                PseudoWiener(kind, {name: np.nan})
            assert caught.value.field == name
    model = MODELS[0]
    with pytest.raises(DataError, match="uneven sampling"):
        simulate(model, 8.0, time=TIME**2)
    with pytest.raises(ShapeError, match="columns of one length"):
        simulate(model, 8.0, duty=DUTY[:-1])
    with pytest.raises(DataError, match="have no duty: needed are time_s, duty"):
        model.simulate({"time_s": TIME})
    with pytest.raises(DataError, match=r"duty: must be in \[-1, 1\]"):
        simulate(model, 8.0, duty=10.0 * DUTY)
    with pytest.raises(ParameterError, match="'angle' is not a state: must be one of angle_deg"):
        model.simulate({"time_s": TIME, "duty": DUTY}, initial_state={"angle": 8.0})
    with pytest.raises(ParameterError, match="horizon = 0"):
        model.predict(simulate(model, 8.0), 0)
    with pytest.raises(ParameterError, match=r"unit = 'rad': must be 'deg'"):
        PseudoWiener.from_toml(model.to_toml().replace('"deg"', '"rad"'))
    with pytest.raises(DataError, match=r"no table \[parameters\]"):
        PseudoWiener.from_toml('kind = "pw_r"\nformat = 1')


def test_the_fit_recovers_a_model_of_its_own_kind() -> None:
    truth = PseudoWiener("pw_r", {"above_coulomb_duty": 0.08, "below_coulomb_duty": 0.08, "above_tau_s": 0.025})
    truth = truth.replace(below_tau_s=0.025)
    log = simulate(truth, 8.0)
    fit = fit_pseudo_wiener(log, options=FitOptions(n_starts=3))
    for name in ("above_tau_s", "above_coulomb_duty", "below_coulomb_duty"):
        assert fit.parameters[name] == pytest.approx(truth.parameters[name], rel=1e-3)
    assert fit.train.nrmse_fit_percent > 99.9
    assert fit.model.kind == fit.kind == "pw_r"
    assert len(fit.start_rmse) == 3
    assert 1 <= fit.n_best <= 3
    assert "shared_sides" in {finding.code for finding in fit.findings}
    assert PseudoWiener.from_toml(fit.to_toml()) == fit.model
    with pytest.raises(ParameterError, match="must be a pw_w"):
        fit_pseudo_wiener(log, "pw_w", start_values=truth)
    with pytest.raises(DataError, match=r"log 2 is sampled every 0\.002 s, log 1 every 0\.001 s"):
        fit_pseudo_wiener([log, log.isel(time_s=slice(None, None, 2))])


@pytest.mark.parametrize("method", ["recursive_least_squares", "window", "gradient"])
def test_online_update_learns_the_gain_and_restarts(method: str) -> None:
    truth = PseudoWiener("pw_r", {"limp_home_deg": 8.0})
    time = np.arange(12000) * 1e-3
    duty = 0.14 + 0.20 * np.sin(2.0 * np.pi * 2.5 * time)
    angle = simulate(truth, 30.0, time, duty)["angle_deg"].to_numpy()
    # 15 % less gain: preload, spring and friction in duty are 15 % too high by the same factor.
    factor = 0.85
    wrong = truth.replace(
        above_gain_deg_per_s2_per_duty=factor * truth.parameters["above_gain_deg_per_s2_per_duty"],
        **{
            f"above_{name}": truth.parameters[f"above_{name}"] / factor
            for name in ("preload_duty", "spring_duty_per_deg", "coulomb_duty")
        },
    )
    # Without noise 15 % of gain is inside the gate of a difference of 5 ms: 10 ms shows four times as much.
    every = 10 if method == "recursive_least_squares" else 5
    update = OnlineUpdate(wrong, method=method, every=every)
    assert update.update([np.nan, 0.0, np.nan], [30.0, np.nan, np.nan]) == 0  # dropped before the first
    assert update.update(duty[:6000], angle[:6000]) > 0
    other = OnlineUpdate(wrong, method=method, every=every)
    other.restore(update.state())
    update.update(duty[6000:], angle[6000:])
    other.update(duty[6000:], angle[6000:])
    assert update.model == other.model
    gain = update.model.parameters["above_gain_deg_per_s2_per_duty"]
    assert gain == pytest.approx(truth.parameters["above_gain_deg_per_s2_per_duty"], rel=0.08)
    with pytest.raises(ParameterError):
        other.restore({"nothing": [1.0]})
    assert update.model == other.model


def test_online_update_refuses_what_it_cannot_do() -> None:
    with pytest.raises(ParameterError, match="must be a pw_r"):
        OnlineUpdate(MODELS[2])
    with pytest.raises(ParameterError, match="method = 'newton'"):
        OnlineUpdate(MODELS[0], method="newton")
    with pytest.raises(ParameterError, match="'mass' is not a parameter"):
        OnlineUpdate(MODELS[0], free=["mass"])


def test_an_update_starts_from_the_groups_of_a_fit() -> None:
    late = {**FirstPrincipleModel().parameters, "tau_s": 0.05, "delay_samples": 2.5}
    fit = FirstPrincipleModel(parameters=late | {"beta_below_duty": 0.21}, sample_s=5e-4)
    start = OnlineUpdate(fit).model.parameters
    assert start["above_tau_s"] == pytest.approx(0.05)
    assert start["below_preload_duty"] == pytest.approx(0.21)
    assert (start["sample_s"], start["delay_samples"]) == (5e-4, 2.5)
    with pytest.raises(ParameterError, match="delay_samples"):
        OnlineUpdate(FirstPrincipleModel(parameters=late | {"delay_samples": 9.0}))
