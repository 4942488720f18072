"""The model that identification chooses: throttles from a program of its own, each friction and a gap."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.errors import ParameterError
from mgdd.identify import identify_throttle, load_throttle_model
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.free_run import noise_of
from mgdd.identify.throttle.whole_delay import block_losses, certainly_less, with_delay
from mgdd.io import throttle_log
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.optimize import FitOptions, least_squares
from mgdd.signals import amplitude_random_steps, chirp
from mgdd.throttle import PseudoWiener, Throttle, simulate_throttle

sys.path.append(str(Path(__file__).parents[1] / "support"))
from throttle_bodies import draw_body, make_logs

HAS = {
    "coulomb": "Coulomb friction with lag (",
    "stribeck": "Coulomb friction with lag, Stribeck drop (",
    "lugre": "Coulomb friction with lag, Stribeck drop, presliding (",
    "backlash": "gap (",
}


def said(fit: Any, code: str) -> str:
    return next(finding.text for finding in fit.findings if finding.code == code)


def one_of(*cases: Any) -> list[Any]:
    """Take the first case always, the others where the time does not matter."""
    others = [case if isinstance(case, tuple) else (case,) for case in cases[1:]]
    return [cases[0], *(pytest.param(*other, marks=pytest.mark.slow) for other in others)]


@pytest.mark.parametrize(("family", "seed"), one_of(("coulomb", 2), ("stribeck", 2), ("lugre", 4), ("backlash", 9)))
def test_an_independent_throttle_is_followed_on_a_fresh_log(family: str, seed: int, tmp_path: Path) -> None:
    body = draw_body(family, seed)
    train, test = (throttle_log(*log) for log in make_logs(body, seed))
    fit = identify_throttle(train, test=test, closed_deg=body.closed_deg, open_deg=body.open_deg)
    assert fit.kind == "first_principle"
    assert fit.test is not None
    assert fit.test.nrmse_fit_percent is not None
    assert fit.test.nrmse_fit_percent > 98.5
    assert fit.parameters["delay_samples"] == body.delay_samples
    assert HAS[family] in said(fit, "structure_chosen")
    assert "the groups were taken" in said(fit, "model_chosen")
    assert fit.parameters["limp_home_deg"] == pytest.approx(body.limp_home_deg, abs=0.15)
    truth = body.groups()
    names = ["beta_above_duty", "delta_duty", "gain_deg_per_s2_per_duty", "tau_s"]
    for name in names[:2] if family == "backlash" else names:
        assert fit.parameters[name] == pytest.approx(truth[name], rel=0.03), name
    if family != "backlash":
        assert fit.parameters["electrical_s"] == pytest.approx(truth["electrical_s"], rel=0.05, abs=1e-4)
    if family == "stribeck":
        assert fit.parameters["stribeck_drop"] == pytest.approx(body.static_nm / body.coulomb_nm - 1.0, rel=0.05)
        assert fit.parameters["stribeck_deg_per_s"] == pytest.approx(np.degrees(body.stribeck_rad_per_s), rel=0.05)
    if family == "lugre":
        bent = np.degrees(body.coulomb_nm / body.bristle_nm_per_rad)
        assert fit.parameters["presliding_deg"] == pytest.approx(bent, rel=0.1)
    if family == "coulomb":  # asked for, the groups are those that the choice has kept, errors included
        asked = identify_throttle(train, "first_principle", closed_deg=body.closed_deg, open_deg=body.open_deg)
        np.testing.assert_array_equal(asked.report.covariance, fit.report.covariance)
    file = tmp_path / "fit.toml"
    file.write_text(fit.to_toml(), encoding="utf-8")
    assert load_throttle_model(file) == fit.model


@pytest.mark.parametrize(
    ("family", "seed"),
    one_of(("coulomb", 8), ("coulomb", 4), ("coulomb", 7), ("lugre", 101), ("lugre", 4), ("backlash", 1)),
)
def test_intervals_hold_what_is_fixed_or_missed_and_what_few_samples_below_limp_home_show(
    family: str, seed: int
) -> None:
    body = draw_body(family, seed)
    train, _ = (throttle_log(*log) for log in make_logs(body, seed))
    fit = identify_throttle(train, "first_principle", closed_deg=body.closed_deg, open_deg=body.open_deg)
    intervals, truth = fit.report.interval(), body.groups()
    names = ("tau_s", "gain_deg_per_s2_per_duty", "electrical_s", "beta_below_duty", "kappa_below_duty_per_deg")
    for name in names:
        assert intervals[name][0] <= truth[name] <= intervals[name][1], name
    assert intervals["tau_s"][1] < {"coulomb": 1.04, "lugre": 1.1, "backlash": 1.3}[family] * truth["tau_s"]
    if family == "coulomb":
        assert intervals["electrical_s"][1] < 1.05 * truth["electrical_s"]
    assert fit.parameters["viscous_share"] == 0.25
    assert "below_ceiling" not in {finding.code for finding in fit.findings}


@pytest.mark.slow
def test_an_independent_throttle_that_the_groups_do_not_describe_is_doubted() -> None:
    """Bristles that bend by degrees: 87 % of the log, where its noise would leave 99.8."""
    body = draw_body("lugre", 1)
    body = replace(body, bristle_nm_per_rad=0.02 * body.bristle_nm_per_rad, static_nm=1.9 * body.coulomb_nm)
    train, _ = (throttle_log(*log) for log in make_logs(body, 5))
    fit = identify_throttle(train, closed_deg=body.closed_deg, open_deg=body.open_deg)
    assert fit.train.nrmse_fit_percent < 96.0
    assert "would leave 99.8 %" in said(fit, "below_ceiling")


@pytest.mark.slow
@pytest.mark.parametrize("seed", one_of(2, 4))
def test_where_the_model_misses_the_gap_the_delay_is_that_of_the_rest_of_the_log(seed: int) -> None:
    body = draw_body("backlash", seed)
    train, _ = (throttle_log(*log) for log in make_logs(body, seed))
    fit = identify_throttle(train, "first_principle", closed_deg=body.closed_deg, open_deg=body.open_deg)
    assert fit.parameters["delay_samples"] == body.delay_samples
    assert fit.parameters["half_gap_deg"] > body.half_gap_deg
    assert fit.parameters["tau_s"] == pytest.approx(body.groups()["tau_s"], rel=0.05)


def test_a_block_counts_up_to_a_quarter_above_the_usual_error_and_one_at_rest_not_at_all() -> None:
    angle = np.repeat(np.arange(8.0), 50) + np.tile(np.linspace(0.0, 3.0, 50), 8)
    angle[300:350] = 6.0
    sign = np.where(np.arange(400) % 2, 0.1, -0.1)
    ours = sign * np.repeat([1.0, 1.05, 1.0, 4.0, 1.0, 0.95, 9.0, 1.0], 50)
    theirs = sign * np.repeat([1.2, 1.2, 1.15, 1.0, 1.2, 1.1, 0.5, 1.2], 50)
    loss = block_losses({0.0: ours, 1.0: theirs}, angle, 2e-3, 0.05)
    most = (1.25 * 0.1) ** 2
    np.testing.assert_allclose(loss[0.0], [0.01, 0.105**2, 0.01, most, 0.01, 0.095**2, 0.01])
    np.testing.assert_allclose(loss[1.0][:3], [0.12**2, 0.12**2, 0.115**2])
    assert np.mean(ours**2) > np.mean(theirs**2), "the block that it misses would decide"
    assert loss[0.0].mean() < loss[1.0].mean()
    noisy = block_losses({0.0: ours, 1.0: theirs}, angle, 2e-3, 0.2)
    assert noisy[0.0].max() == pytest.approx((1.25 * 0.2) ** 2)


def test_less_is_certain_by_twice_the_standard_error_over_blocks() -> None:
    ours = np.full(8, 0.01)
    theirs = ours + np.array([0.004, 0.005, 0.003, 0.004, -0.001, 0.005, 0.004, 0.004])
    assert certainly_less(ours, theirs)
    assert not certainly_less(theirs, ours)
    assert not certainly_less(ours, ours)
    lucky = ours + np.array([0.0, 0.0, 0.05, 0.0, -0.001, 0.0, 0.0, 0.0])
    assert not certainly_less(ours, lucky)


@pytest.mark.parametrize(("noise_deg", "step_deg"), [(0.02, 0.0), (0.02, 0.022), (0.047, 0.022), (0.031, 0.04)])
def test_noise_is_told_from_motion_whatever_the_step_of_the_converter(noise_deg: float, step_deg: float) -> None:
    rng = np.random.default_rng(5)
    time = 1e-3 * np.arange(8000)
    angle = 30.0 + 20.0 * np.sin(2.0 * np.pi * 4.0 * time) + noise_deg * rng.standard_normal(time.size)
    angle[4000:] += 15.0  # a step that no second difference of noise explains
    measured = np.round(angle / step_deg) * step_deg if step_deg else angle
    assert noise_of(measured) == pytest.approx(math.hypot(noise_deg, step_deg / math.sqrt(12.0)), rel=0.05)


def two_kinds_of_sides() -> PseudoWiener:
    """A plate whose friction and damping differ between the sides: no groups have that, PW-R has."""
    below = {"below_tau_s": 0.05, "below_coulomb_duty": 0.03, "below_gain_deg_per_s2_per_duty": 4e4}
    return PseudoWiener("pw_r", {**below, "limp_home_deg": 20.0})


def log_of(model: Any, duty: np.ndarray, seed: int, start_deg: float) -> Any:
    time = 1e-3 * np.arange(duty.size)
    run = model.simulate({"time_s": time, "duty": duty}, initial_state={"angle_deg": start_deg})
    noise = 0.03 * np.random.default_rng(seed).standard_normal(duty.size)
    return throttle_log(time, duty, run["angle_deg"].to_numpy() + noise)


@pytest.mark.slow
def test_pw_r_is_taken_where_it_runs_better_on_what_neither_has_seen() -> None:
    plant = two_kinds_of_sides()
    duty = amplitude_random_steps(6.0, offset=0.0, amplitude=0.4, seed=3)["duty"].to_numpy()
    log = log_of(plant, np.concatenate([np.zeros(300), duty]), 1, 20.0)
    fit = identify_throttle(log, options=FitOptions(n_starts=1))
    assert fit.kind == "pw_r"
    assert "PW-R was taken" in said(fit, "model_chosen")
    assert fit.parameters["below_coulomb_duty"] < 0.6 * fit.parameters["above_coulomb_duty"]
    assert fit.parameters["delay_samples"] == 0.0


def test_the_same_log_gives_the_same_bits_and_a_refused_call_changes_nothing() -> None:
    duty = np.concatenate([np.zeros(200), chirp(2.5, offset=0.02, amplitude=0.3)["duty"].to_numpy()])
    log = log_of(FirstPrincipleModel(substeps=8), duty, 2, 8.0)
    once = identify_throttle(log, options=FitOptions(n_starts=2))
    with pytest.raises(ParameterError, match="model = 'automatic': must be one of 'auto', 'first_principle'"):
        identify_throttle(log, "automatic")
    again = identify_throttle(log, options=FitOptions(n_starts=2))
    assert dict(again.parameters) == dict(once.parameters)
    assert again.findings == once.findings


def test_a_delay_among_several_has_the_error_of_the_costs_beside_it() -> None:
    report = least_squares(lambda x: ([x[0] - 1.0, x[1], x[0] + x[1]], [[1, 0], [0, 1], [1, 1]]), [0.0, 0.0])
    n, rmse = 400.0, {1.0: 0.05, 2.0: 0.04, 3.0: 0.044}
    known = with_delay(report, 2.0, rmse, n, range(6))
    # A parabola c (1 + (d - 2)^2 / (n s^2)) about the minimum, through the flatter neighbour.
    assert known.stderr[-1] == pytest.approx((2.0 * n * np.log(0.044 / 0.04)) ** -0.5)
    assert known.names == (*report.names, "delay_samples")
    assert known.values[-1] == 2.0
    assert known.values.flags.writeable is False
    np.testing.assert_array_equal(known.stderr[:-1], report.stderr)
    low, high = known.interval()["delay_samples"]
    assert low < 2.0 < high
    assert with_delay(report, 2.0, {2.0: 0.04, 3.0: 0.04}, n, range(6)).stderr[-1] == 1.0
    for end, side in ((3.0, 1), (1.0, -1)):
        at_end = with_delay(report, end, {1.0: 0.05, 2.0: 0.05, 3.0: 0.05} | {end: 0.04}, n)
        assert math.isnan(at_end.stderr[-1])
        assert at_end.bounds_active[-1] == side
    assert with_delay(report, 0.0, {0.0: 0.04, 1.0: 0.05}, n).bounds_active[-1] == 0
    assert known.dataset.sizes["parameter"] == 3


def test_a_short_noise_free_log_keeps_the_lag_of_the_motor_and_no_delay() -> None:
    signal = chirp(2.0, offset=0.02, amplitude=0.3)
    run = simulate_throttle(Throttle(), signal["duty"], time_s=signal["time_s"])
    fit = identify_throttle(throttle_log(run["time_s"], run["duty"], run["angle_deg"]), options=FitOptions(n_starts=1))
    assert fit.parameters["delay_samples"] == 0.0
    assert fit.parameters["electrical_s"] == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize(
    "change",
    one_of(
        {"delta_duty": 0.001}, {"delta_duty": 0.35, "beta_above_duty": 0.2, "beta_below_duty": 0.2},
        {"beta_above_duty": 0.55, "beta_below_duty": 0.5}, {"tau_s": 0.004}, {"tau_s": 0.4},
        {"gain_deg_per_s2_per_duty": 5e3}, {"gain_deg_per_s2_per_duty": 6e5},
    ),
    ids=str,
)  # fmt: skip
def test_a_throttle_that_the_rival_cannot_be_is_identified_all_the_same(change: dict[str, float]) -> None:
    groups = {
        "tau_s": 0.03, "gain_deg_per_s2_per_duty": 8e4, "beta_above_duty": 0.13, "kappa_above_duty_per_deg": 1e-3,
        "delta_duty": 0.05, "beta_below_duty": 0.11, "kappa_below_duty_per_deg": 2e-3, "limp_home_deg": 9.0,
        "electrical_s": 0.001, "delay_samples": 2.0, **change,
    }  # fmt: skip
    model = FirstPrincipleModel(parameters=groups, sample_s=1e-3)
    rng, time = np.random.default_rng(5), np.arange(6000) * 1e-3
    duty = np.repeat(rng.uniform(-0.75, 0.95, 40), 150)
    blank = throttle_log(time, duty, np.linspace(9.0, 10.0, time.size))
    angle = model.simulate(blank, initial_state={"angle_deg": 9.0})["angle_deg"].to_numpy()
    log = throttle_log(time, duty, angle + rng.normal(0.0, 0.02, time.size))
    fit = identify_throttle(log, delay_samples=[1, 2], options=FitOptions(n_starts=1))
    assert fit.kind == "first_principle"
    assert fit.train is not None
    assert fit.train.nrmse_fit_percent is not None
    assert fit.train.nrmse_fit_percent > 99.0
    for name in ("gain_deg_per_s2_per_duty", "tau_s", *change):
        assert fit.parameters[name] == pytest.approx(groups[name], rel=0.03), name
    assert "without a comparison: PW-R is not made for such a throttle (" in said(fit, "model_chosen")


@pytest.mark.parametrize("delay", one_of(12, 7, 20))
def test_a_long_delay_is_found_and_its_controller_takes_it(delay: int) -> None:
    """Beyond five samples, where the first look ends: the search goes on while the longest are the best."""
    rng, time = np.random.default_rng(3), np.arange(4000) * 1e-3
    duty = np.repeat(rng.uniform(-0.6, 0.9, 25), 160)
    late = np.concatenate([np.full(delay, duty[0]), duty[:-delay]])
    angle = simulate_throttle(Throttle(), late, time_s=time)["angle_deg"].to_numpy()
    log = throttle_log(time, duty, angle + rng.normal(0.0, 0.02, time.size))
    fit = identify_throttle(log, options=FitOptions(n_starts=1))
    assert fit.kind == "first_principle"
    assert fit.parameters["delay_samples"] == delay
    assert fit.parameters["tau_s"] == pytest.approx(0.0197, rel=0.1)
    assert ("delay_at_end" in {found.code for found in fit.findings}) == (delay == 20)
    for kind in ("guided", "mgdd1"):
        assert tuned_with_doubts(kind, fit)[0].settings["delay_samples"] == delay


@pytest.mark.parametrize(
    ("delay", "tried", "end"),
    one_of((6, [3, 4, 5], "longest"), (12, [3, 4, 5], "longest"), (5, [3, 4, 5], "longest"),
           (2, [3, 4, 5], "shortest")),
)  # fmt: skip
def test_a_delay_at_the_end_of_the_search_is_doubted_and_has_no_interval(
    delay: int, tried: list[float], end: str
) -> None:
    rng, time = np.random.default_rng(3), np.arange(4000) * 1e-3
    duty = np.repeat(rng.uniform(-0.6, 0.9, 25), 160)
    late = np.concatenate([np.full(delay, duty[0]), duty[:-delay]])
    angle = simulate_throttle(Throttle(), late, time_s=time)["angle_deg"].to_numpy()
    log = throttle_log(time, duty, angle + rng.normal(0.0, 0.02, time.size))
    fit = identify_throttle(log, "first_principle", delay_samples=tried, options=FitOptions(n_starts=1))
    assert fit.parameters["delay_samples"] == (tried[-1] if end == "longest" else tried[0])
    for name in ("delay_samples", "electrical_s", "tau_s"):
        assert math.isnan(fit.report.stderr[fit.report.names.index(name)]), name
    assert f"the {end} that was tried: the true one may be" in said(fit, "delay_at_end")
