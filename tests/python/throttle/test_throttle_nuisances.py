"""What a fit of the throttle groups holds fixed or lacks counts in its intervals, and a poor one is doubted aloud."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mgdd.identify.throttle.first_principle import fit_first_principle
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.nuisances import TYPICAL_SHARE, delay_weights
from mgdd.io import throttle_log
from mgdd.optimize import FitOptions

GROUPS = {
    "tau_s": 0.0197,
    "gain_deg_per_s2_per_duty": 83_597.0,
    "beta_above_duty": 0.1292,
    "kappa_above_duty_per_deg": 4.96e-4,
    "delta_duty": 0.0927,
    "beta_below_duty": 0.15,
    "kappa_below_duty_per_deg": 1.5e-3,
    "limp_home_deg": 8.0,
    "electrical_s": 1e-3,
}
MOVING = ("tau_s", "gain_deg_per_s2_per_duty", "electrical_s")


def log_of(seed: int = 3, levels: tuple[float, float] = (-0.33, 0.36), **more: float) -> Any:
    """Levels across limp-home, simulated finely, with the noise of a sensor."""
    rng = np.random.default_rng(seed)
    duty = np.repeat(rng.uniform(*levels, 40), 150)
    time = 1e-3 * np.arange(duty.size)
    truth = FirstPrincipleModel(parameters=GROUPS | more, substeps=40)
    angle = truth.simulate({"time_s": time, "duty": duty}, initial_state={"angle_deg": 8.0})["angle_deg"].to_numpy()
    return throttle_log(time, duty, angle + 0.03 * rng.standard_normal(time.size))


def fit_of(log: Any, free: tuple[str, ...] = ("electrical_s",), **how: Any) -> Any:
    start = {**GROUPS, "tau_s": 0.022}
    return fit_first_principle(log, start_values=start, free=free, options=FitOptions(n_starts=1), **how)


def codes(fit: Any) -> set[str]:
    return {finding.code for finding in fit.findings}


@pytest.mark.parametrize("share", [0.02, 0.48])
def test_the_interval_holds_whatever_share_of_the_damping_is_not_back_emf(share: float) -> None:
    log = log_of(viscous_share=share)
    fit = fit_of(log)
    assert fit.parameters["viscous_share"] == TYPICAL_SHARE
    intervals = fit.report.interval()
    for name in MOVING:
        assert intervals[name][0] <= GROUPS[name] <= intervals[name][1], name
    known = fit_of(log, fixed={"viscous_share": share})
    assert known.report.stderr[0] < 0.75 * fit.report.stderr[0]  # what is known is not considered
    assert fit.stderr["tau_s"] < 0.02 * GROUPS["tau_s"]
    assert "below_ceiling" not in codes(fit)


def test_what_the_model_lacks_widens_the_interval_and_what_it_has_does_not() -> None:
    """Friction that drops counts blocks of a second in a fit without the drop, which it takes for something else."""
    log = log_of(viscous_share=TYPICAL_SHARE, stribeck_drop=0.5, stribeck_deg_per_s=25.0)
    lacks = fit_of(log)
    has = fit_of(log, free=("electrical_s", "stribeck_drop", "stribeck_deg_per_s"))
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
    poor = fit_of(harsh)
    assert poor.train.nrmse_fit_percent < 96.0
    assert "below_ceiling" in codes(poor)


def test_a_rival_delay_weighs_by_its_likelihood() -> None:
    weights = delay_weights({0.0: 0.030, 1.0: 0.0303, 2.0: 0.06}, 0.0, 200.0)
    assert weights[0.0] == 1.0
    assert weights[1.0] == pytest.approx(math.exp(-200.0 * math.log(1.01)))
    assert weights[2.0] < 1e-50
    assert delay_weights({0.0: 0.03, 1.0: 0.02}, 0.0, 200.0)[1.0] == 1.0  # not kept for its error: an equal
