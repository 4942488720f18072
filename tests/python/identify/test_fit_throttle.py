"""First-principle fit of a throttle log."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mgdd.errors import DataError, ParameterError
from mgdd.identify.throttle.automatic import fit_groups
from mgdd.identify.throttle.first_principle_model import REFINEMENTS, TYPICAL, FirstPrincipleModel
from mgdd.identify.throttle.first_principle_problem import regression_start
from mgdd.identify.throttle.nuisances import TYPICAL_SHARE, delay_weights
from mgdd.identify.throttle.whole_delay import FINE
from mgdd.io import throttle_log
from mgdd.loop import VirtualThrottle, track, tuned_controller
from mgdd.optimize import FitOptions
from mgdd.results.fit import Model
from mgdd.throttle import simulate_throttle

TRUTH = {
    "tau_s": 0.0197,
    "gain_deg_per_s2_per_duty": 83_597.0,
    "beta_above_duty": 0.1292,
    "kappa_above_duty_per_deg": 4.96e-4,
    "delta_duty": 0.0927,
    "beta_below_duty": 0.15,
    "kappa_below_duty_per_deg": 1.5e-3,
    "limp_home_deg": 8.0,
    "electrical_s": 0.0,
}


def fit_plain(log, **how):
    """Fit without a delay, from one start."""
    return fit_groups(log, **how, delays=[0.0], options=FitOptions(n_starts=1, max_iterations=12))


def simulate(time, duty, start_deg):
    inputs = {"time_s": time, "duty": duty}
    return FirstPrincipleModel(parameters=TRUTH, substeps=FINE).simulate(
        inputs, initial_state={"angle_deg": start_deg}
    )["angle_deg"]


def make_log(span_s=8.0, offset=0.15, amplitude=0.2, start_deg=40.0, noise_deg=0.0, seed=1, f_end=6.0):
    time = 1e-3 * np.arange(round(1e3 * span_s))
    duty = offset + amplitude * np.sin(2 * np.pi * (0.2 * time + 0.5 * (f_end - 0.2) / span_s * time**2))
    angle = simulate(time, duty, start_deg)
    noise = noise_deg * np.random.default_rng(seed).standard_normal(time.size)
    return throttle_log(time, duty, angle + noise)


def two_sided_log(noise_deg=0.03):
    time = 1e-3 * np.arange(9000)
    levels = np.random.default_rng(3).uniform(-0.33, 0.36, 60)
    duty = np.repeat(levels, 150)
    angle = simulate(time, duty, 8.0)
    return throttle_log(time, duty, angle + noise_deg * np.random.default_rng(4).standard_normal(time.size))


def test_noise_free_log_gives_the_visited_side_back():
    fit = fit_plain(make_log(), fixed={"limp_home_deg": 8.0})
    for name in ("tau_s", "gain_deg_per_s2_per_duty", "beta_above_duty", "kappa_above_duty_per_deg", "delta_duty"):
        assert fit.parameters[name] == pytest.approx(TRUTH[name], rel=1e-5), name
    assert fit.train.nrmse_fit_percent > 99.99


@pytest.mark.parametrize("amplitude", [0.25, 0.4])
def test_the_start_leaves_out_windows_that_hold_a_reversal_or_a_rest(amplitude):
    time = 1e-3 * np.arange(6000)
    duty = 0.15 + amplitude * np.sin(2 * np.pi * 4.0 * time) + 0.1 * np.sin(2 * np.pi * 0.4 * time)
    run = FirstPrincipleModel(parameters=TRUTH, substeps=4).simulate(
        {"time_s": time, "duty": duty}, initial_state={"angle_deg": 40.0}
    )
    angle = run["angle_deg"].to_numpy()
    known = dict(TYPICAL) | {"limp_home_deg": 8.0}
    free = [name for name in TRUTH if name not in ("limp_home_deg", "electrical_s")]
    found = regression_start(1e-3, duty, angle, known, free, 0.0, 90.0)
    for name in ("tau_s", "gain_deg_per_s2_per_duty", "beta_above_duty", "delta_duty"):
        assert found[name] == pytest.approx(TRUTH[name], rel=0.03), name


def test_a_one_sided_log_names_the_other_side_and_an_excitation():
    fit = fit_plain(make_log(noise_deg=0.03), fixed={"limp_home_deg": 8.0})
    assert {"beta_below_duty", "kappa_below_duty_per_deg"} <= set(fit.unidentifiable)
    kept = next(finding for finding in fit.findings if finding.code == "start_value_kept")
    assert set(kept.names) == {"beta_below_duty", "kappa_below_duty_per_deg"}
    assert "excitation" in kept.remedy
    assert fit.parameters["beta_below_duty"] == TYPICAL["beta_below_duty"]


def test_a_two_sided_log_with_noise_gives_both_sides():
    fit = fit_plain(two_sided_log())
    assert isinstance(fit.model, Model)
    assert fit.kind == "first_principle"
    for name in ("tau_s", "gain_deg_per_s2_per_duty", "beta_above_duty", "delta_duty", "beta_below_duty"):
        assert fit.parameters[name] == pytest.approx(TRUTH[name], rel=0.03), name
    assert fit.parameters["limp_home_deg"] == pytest.approx(8.0, abs=0.1)
    assert fit.train.nrmse_fit_percent > 98.0
    assert FirstPrincipleModel.from_toml(fit.to_toml()) == fit.model


def test_the_throttle_of_a_model_has_its_numbers_from_either_known_one():
    model = FirstPrincipleModel(parameters=TRUTH, substeps=4)
    one = model.to_throttle(resistance_ohm=1.5, supply_v=12.0, inertia_kgm2=0.0021)
    # A passenger-car throttle with 0.383 N m/A, 0.087 N m/rad, 0.396 and 0.284 N m.
    assert one.torque_constant_nm_per_a == pytest.approx(0.383, rel=2e-3)
    assert one.spring_above_nm_per_rad == pytest.approx(0.087, rel=5e-3)
    assert one.preload_above_nm == pytest.approx(0.396, rel=5e-3)
    assert one.coulomb_nm == pytest.approx(0.284, rel=5e-3)
    other = model.to_throttle(resistance_ohm=1.5, supply_v=12.0, torque_constant_nm_per_a=one.torque_constant_nm_per_a)
    numbers, others = one.to_dict(), other.to_dict()
    assert {name: others[name] for name in others if isinstance(others[name], float)} == pytest.approx(
        {name: numbers[name] for name in numbers if isinstance(numbers[name], float)}
    )
    with pytest.raises(ParameterError, match="exactly one"):
        model.to_throttle(resistance_ohm=1.5, supply_v=12.0)
    with pytest.raises(ParameterError, match="resistance_ohm"):
        model.to_throttle(resistance_ohm=-1.0, supply_v=12.0, inertia_kgm2=0.002)


@pytest.mark.parametrize(
    ("groups", "least"),
    [
        ({}, 99.5),
        ({"limp_home_deg": 15.0, "beta_above_duty": 0.06, "tau_s": 0.08, "gain_deg_per_s2_per_duty": 2e4}, 98.0),
        ({"electrical_s": 0.002, "viscous_share": 0.3}, 99.5),
        ({"stribeck_drop": 0.4, "stribeck_deg_per_s": 20.0}, 99.5),
        ({"presliding_deg": 0.3}, 99.0),
        ({"stop_duty_per_deg": 20.0, "stop_damping": 0.6}, 99.5),
        ({"tau_s": 0.25, "gain_deg_per_s2_per_duty": 1e4}, 97.0),
        ({"half_gap_deg": 0.5}, 98.5),
    ],
)
def test_the_throttle_of_a_model_moves_as_it_does(groups, least):
    model = FirstPrincipleModel(parameters={**TYPICAL, **groups}, substeps=4)
    duty = np.repeat(np.random.default_rng(3).uniform(-0.35, 0.55, 40), 200)
    angle = model.simulate({"time_s": 1e-3 * np.arange(duty.size), "duty": duty})["angle_deg"].to_numpy()
    throttle = model.to_throttle(resistance_ohm=1.2, supply_v=13.0, torque_constant_nm_per_a=0.5)
    own = simulate_throttle(throttle, duty, sample_s=1e-3)["angle_deg"].to_numpy()
    assert 100.0 * (1.0 - np.linalg.norm(own - angle) / np.linalg.norm(angle - angle.mean())) > least


def test_a_model_is_no_throttle_with_currents_until_the_rest_is_known():
    fit = fit_plain(two_sided_log())
    for given in (fit, fit.model):
        with pytest.raises(ParameterError, match=r"to_throttle\(\.\.\.\)"):
            VirtualThrottle(given, inputs=("duty", "supply_v"))
    throttle = fit.model.to_throttle(resistance_ohm=1.5, supply_v=12.0, torque_constant_nm_per_a=0.383)
    run = track(tuned_controller("guided", throttle), np.repeat([20.0, 60.0], 500), throttle=throttle)
    assert abs(float(run["angle_deg"][-1]) - 60.0) < 0.5


def test_wrong_calls_name_the_remedy_and_a_right_one_follows():
    log = make_log(span_s=1.0)
    with pytest.raises(ParameterError, match="no throttle group"):
        fit_plain(log, fixed={"tau": 0.02})
    with pytest.raises(ParameterError, match="tau_s"):
        fit_plain(log, fixed={"tau_s": 9.0})
    with pytest.raises(DataError, match="at least 100"):
        fit_plain(log.isel(time_s=slice(0, 50)))
    with pytest.raises(DataError, match="drive the plate"):
        fit_plain(log.assign(angle_deg=log.angle_deg * 0.0 + 40.0))
    with pytest.raises(ParameterError, match="horizon"):
        FirstPrincipleModel(parameters=TRUTH, substeps=4).predict(log, 0)
    assert fit_plain(log, fixed={"limp_home_deg": 8.0}).train.nrmse_fit_percent > 99.0


def test_prediction_is_corrected_by_the_measurement():
    log = make_log(span_s=2.0)
    model = FirstPrincipleModel(parameters=TRUTH, substeps=FINE)
    ahead = model.predict(log, 20)["angle_deg"]
    np.testing.assert_allclose(ahead, log.angle_deg.values[20:], atol=1e-9)


GROUPS = TRUTH | {"electrical_s": 1e-3}
MOVING = ("tau_s", "gain_deg_per_s2_per_duty", "electrical_s")


def log_of(seed: int = 3, levels: tuple[float, float] = (-0.33, 0.36), **more: float) -> Any:
    """Levels across limp-home, simulated finely, with the noise of a sensor."""
    rng = np.random.default_rng(seed)
    duty = np.repeat(rng.uniform(*levels, 40), 150)
    time = 1e-3 * np.arange(duty.size)
    truth = FirstPrincipleModel(parameters=GROUPS | more, substeps=40)
    angle = truth.simulate({"time_s": time, "duty": duty}, initial_state={"angle_deg": 8.0})["angle_deg"].to_numpy()
    return throttle_log(time, duty, angle + 0.03 * rng.standard_normal(time.size))


REFINED = ("stribeck_drop", "stribeck_deg_per_s", "presliding_deg", "presliding_damping", "half_gap_deg")
PLAIN = {name: REFINEMENTS[name] for name in (*REFINED, "ramp_deg")}


def codes(fit: Any) -> set[str]:
    return {finding.code for finding in fit.findings}


@pytest.mark.parametrize("share", [0.02, 0.48])
def test_the_interval_holds_whatever_share_of_the_damping_is_not_back_emf(share: float) -> None:
    log = log_of(viscous_share=share)
    fit = fit_plain(log, fixed=PLAIN)
    assert fit.parameters["viscous_share"] == TYPICAL_SHARE
    intervals = fit.report.interval()
    for name in MOVING:
        assert intervals[name][0] <= GROUPS[name] <= intervals[name][1], name
    known = fit_plain(log, fixed=PLAIN | {"viscous_share": share})
    assert known.report.stderr[0] < 0.75 * fit.report.stderr[0]  # what is known is not considered
    assert fit.stderr["tau_s"] < 0.02 * GROUPS["tau_s"]
    assert "below_ceiling" not in codes(fit)


def test_what_the_model_lacks_widens_the_interval_and_what_it_has_does_not() -> None:
    """Friction that drops counts blocks of a second in a fit without the drop, which it takes for something else."""
    log = log_of(viscous_share=TYPICAL_SHARE, stribeck_drop=0.5, stribeck_deg_per_s=25.0)
    lacks = fit_plain(log, fixed=PLAIN)
    has = fit_plain(log, fixed={"ramp_deg": PLAIN["ramp_deg"]})
    assert lacks.report.rmse > 1.5 * has.report.rmse
    assert lacks.report.residual_blocks == pytest.approx(6.0)
    assert has.report.residual_blocks > 20.0
    for name in ("tau_s", "gain_deg_per_s2_per_duty", "delta_duty"):
        low, high = lacks.report.interval()[name]
        own = has.report.interval()[name]
        assert own[0] <= GROUPS[name] <= own[1], name
        assert high - low > 2.0 * (own[1] - own[0]), name


def test_a_fit_says_itself_that_it_stays_far_below_the_noise() -> None:
    harsh = log_of(half_gap_deg=2.0, stribeck_drop=1.0, stribeck_deg_per_s=40.0)
    poor = fit_plain(harsh, fixed=PLAIN)
    assert poor.train.nrmse_fit_percent < 96.0
    assert "below_ceiling" in codes(poor)


def test_a_rival_delay_weighs_by_its_likelihood() -> None:
    weights = delay_weights({0.0: 0.030, 1.0: 0.0303, 2.0: 0.06}, 0.0, 200.0)
    assert weights[0.0] == 1.0
    assert weights[1.0] == pytest.approx(math.exp(-200.0 * math.log(1.01)))
    assert weights[2.0] < 1e-50
    assert delay_weights({0.0: 0.03, 1.0: 0.02}, 0.0, 200.0)[1.0] == 1.0  # not kept for its error: an equal
