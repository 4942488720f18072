"""Figures of merit, residual tests, blocks of time, and sentences about what a log does not identify."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mgdd import identify, signals
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.identify.throttle.record_content import open_questions, record_content
from mgdd.identify.throttle.validation import ThrottleValidation, n_step_rms
from mgdd.io import throttle_log
from mgdd.optimize import FitOptions
from mgdd.signals.metrics import mse, residual_tests, rmse, vaf_percent
from mgdd.signals.model import RunInputs, SampledModel
from mgdd.throttle import Throttle, simulate_throttle

TIME = np.arange(6000) * 1e-3
RNG = np.random.default_rng(7)

records = arrays(np.float64, 40, elements=st.floats(-1e3, 1e3)).filter(lambda y: float(np.ptp(y)) > 1e-3)


@settings(max_examples=50, deadline=None)
@given(y=records, offset=st.floats(-100.0, 100.0))
def test_the_metrics_have_their_fixed_points(y: np.ndarray, offset: float) -> None:
    assert signals.nrmse_fit_percent(y, y) == 100.0
    assert signals.nrmse_fit_percent(y, np.full_like(y, y.mean())) == pytest.approx(0.0, abs=1e-9)
    assert signals.nrmse_fit_percent(y - y.mean(), -(y - y.mean())) == pytest.approx(-100.0, abs=1e-9)
    assert vaf_percent(y, y + offset) == pytest.approx(100.0, abs=1e-9)
    assert rmse(y, y + offset) == pytest.approx(abs(offset), rel=1e-9, abs=1e-9)
    assert mse(y, y + offset) == pytest.approx(offset**2, rel=1e-9, abs=1e-9)


def test_the_metrics_refuse_what_has_no_answer() -> None:
    with pytest.raises(DataError, match="constant"):
        signals.nrmse_fit_percent(np.ones(5), np.ones(5))
    with pytest.raises(DataError, match="second signal, sample 2: nan"):
        rmse(np.zeros(4), [0.0, 0.0, np.nan, 0.0])
    with pytest.raises(ShapeError, match="must be equal"):
        mse(np.zeros(4), np.zeros(5))
    with pytest.raises(ShapeError, match="not empty"):
        mse([], [])


def test_white_residuals_pass_as_often_as_they_should() -> None:
    rng = np.random.default_rng(11)
    passed, inside = 0, []
    for _ in range(200):
        noise = rng.standard_normal((2, 1500))
        tests = residual_tests(noise[0], noise[1])
        passed += tests.white
        inside += [tests.share_white, tests.share_independent]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.01)
    assert 0.55 < passed / 200 < 0.75, "one of 25 lags is forgiven: 64 of 100"


def test_memory_and_what_the_input_explains_are_found() -> None:
    noise = RNG.standard_normal((2, 4000))
    slow = np.convolve(noise[0], [1.0, 0.8, 0.4])[:4000]
    assert not residual_tests(slow, noise[1]).white
    driven = noise[0] + 0.3 * np.roll(noise[1], 5)
    tests = residual_tests(driven, noise[1])
    assert tests.share_independent < 1.0
    assert int(np.argmax(np.abs(tests.correlations["cross_correlation"].to_numpy()))) + 1 == 5
    assert float(tests.correlations["cross_correlation"][4]) == pytest.approx(0.3 / np.hypot(1.0, 0.3), abs=0.05)
    assert tests.limit == pytest.approx(1.96 / np.sqrt(4000.0))


def test_residual_tests_refuse_too_little() -> None:
    with pytest.raises(DataError, match="100 samples"):
        residual_tests(np.arange(99.0), np.arange(99.0))
    with pytest.raises(DataError, match="residual is constant"):
        residual_tests(np.ones(200), np.arange(200.0))
    with pytest.raises(DataError, match="duty is constant"):
        residual_tests(np.arange(200.0), np.ones(200))
    with pytest.raises(ParameterError, match="lags = 0"):
        residual_tests(np.arange(200.0), np.arange(200.0), lags=0)


def log(angle: np.ndarray | None = None, duty: np.ndarray | None = None) -> Any:
    u = 0.25 * np.sin(2.0 * np.pi * TIME) if duty is None else duty
    return throttle_log(TIME, u, 20.0 + 60.0 * u if angle is None else angle, name="bench.csv")


def test_a_log_is_split_by_time() -> None:
    for block in (slice(0, 3600), slice(3600, 4800), slice(4800, None)):
        part = log().isel(time_s=block)
        np.testing.assert_array_equal(part["time_s"], TIME[block])
        assert identify.validate_throttle(Proportional(), part).quality.nrmse_fit_percent == pytest.approx(100.0)
    with pytest.raises(DataError, match="log more"):
        identify.validate_throttle(Proportional(), log().isel(time_s=slice(5700, None)))


class Proportional(SampledModel):
    """A plate that follows its duty at once: exact on the logs made here."""

    kind = "pw_r"
    input_names = ("duty",)
    output_name = observed_state = "angle_deg"
    state_names = ("angle_deg",)

    def __init__(self, gain: float = 60.0) -> None:
        self.parameters = {"gain": gain, "limp_home_deg": 8.0}

    def _rest(self) -> list[float]:
        return [8.0]

    def _run(self, run: RunInputs) -> np.ndarray:
        return np.asarray(run.state[0] + self.parameters["gain"] * (run.columns[0] - run.columns[0][0]))


class Runaway(Proportional):
    """A fit that has failed."""

    def _run(self, run: RunInputs) -> np.ndarray:
        return np.full(run.time_s.size, np.nan)


def test_a_validation_reports_free_run_and_steps_ahead() -> None:
    noisy = log()["angle_deg"].to_numpy() + 0.05 * RNG.standard_normal(TIME.size)
    noisy[0] = 20.0  # a free run starts at the first sample, noise and all
    validation = identify.validate_throttle(Proportional(), log(noisy))
    assert validation.quality.nrmse_fit_percent > 99.0
    assert validation.quality.rmse == pytest.approx(0.05, rel=0.2)
    assert validation.to_dict()["mse_deg2"] == pytest.approx(validation.quality.rmse**2)
    rms = validation.n_step["n_step_rms_deg"]
    assert rms.sel(predictor="pw_r").to_numpy() == pytest.approx(0.05 * np.sqrt(2.0), rel=0.1)
    travelled = 60.0 * 0.25 * 2.0 * np.sin(np.pi * 0.05) / np.sqrt(2.0)
    assert float(rms.sel(predictor="persistence")[2]) == pytest.approx(np.hypot(travelled, 0.05 * 1.41), rel=0.02)
    assert validation.tests.share_white < 1.0
    text = validation.summary()
    assert "free-run fit 99" in text
    assert "50 ms ahead" in text
    assert validation.to_dict()["n_step_rms"]["20"] == pytest.approx(float(rms[0, 1]))
    np.testing.assert_allclose(validation.free_run["residual_deg"], validation.free_run["model_deg"] - noisy)


class Wrong(Proportional):
    """A model that is right but for some samples, by as many degrees; both in the free run and ahead."""

    def __init__(self, error_deg: np.ndarray) -> None:
        super().__init__()
        self.error_deg = error_deg

    def _run(self, run: RunInputs) -> np.ndarray:
        return super()._run(run) + self.error_deg

    def predict(self, record: Any, horizon: int) -> Any:
        state = {"angle_deg": float(record["angle_deg"][0])}
        right = Proportional().simulate(record, initial_state=state).isel(time_s=slice(horizon, None))
        return right.assign(angle_deg=right["angle_deg"] + self.error_deg[:-horizon])


def test_the_first_50_ms_count_for_nothing_and_the_next_sample_counts() -> None:
    def validated(first: int, last: int) -> ThrottleValidation:
        error = np.zeros(TIME.size)
        error[first:last] = 6.0
        # A little noise in the log keeps the residual tests defined.
        noisy = log()["angle_deg"].to_numpy() + 1e-6 * np.sin(np.arange(TIME.size))
        return identify.validate_throttle(Wrong(error), log(noisy))

    start, later = validated(0, 50), validated(50, 51)
    assert start.quality.rmse < 1e-5
    assert start.quality.nrmse_fit_percent > 99.99
    assert float(start.n_step["n_step_rms_deg"].sel(predictor="pw_r").max()) < 1e-5
    counted = TIME.size - 50
    assert later.quality.rmse == pytest.approx(6.0 / np.sqrt(counted), rel=1e-3)
    for horizon, rms in zip((5, 20, 50), later.n_step["n_step_rms_deg"].sel(predictor="pw_r").to_numpy(), strict=True):
        assert rms == pytest.approx(6.0 / np.sqrt(counted - horizon), rel=1e-3)


def test_the_residual_is_compared_with_the_duty_that_was_held_while_it_arose() -> None:
    duty = 0.1 * RNG.standard_normal(TIME.size).clip(-2.0, 2.0)
    late = 3  # samples between the duty that the model misses and the one that is held
    missed = np.zeros(TIME.size)
    missed[late + 1 :] = 20.0 * duty[: -late - 1]
    noise = 0.05 * RNG.standard_normal(TIME.size)

    class Held(Proportional):
        def predict(self, record: Any, horizon: int) -> Any:
            ahead = super().predict(record, horizon)
            return ahead.assign(angle_deg=ahead["angle_deg"] - (missed + noise)[horizon:])

    tests = identify.validate_throttle(Held(), log(duty=duty)).tests
    correlation = tests.correlations["cross_correlation"]
    assert float(correlation["lag"][int(np.argmax(np.abs(correlation.to_numpy())))]) == late
    assert float(np.abs(correlation).max()) > 0.95


def test_n_steps_can_be_compared_with_the_truth() -> None:
    noisy = log()["angle_deg"].to_numpy() + 0.05 * RNG.standard_normal(TIME.size)
    rms = n_step_rms(Proportional(), log(noisy), true_deg=log()["angle_deg"])["n_step_rms_deg"]
    assert rms.sel(predictor="pw_r").to_numpy() == pytest.approx(0.05, rel=0.1)
    with pytest.raises(ParameterError, match="not a whole number of samples"):
        n_step_rms(Proportional(), log(), horizons_s=(0.0055,))
    with pytest.raises(ParameterError, match="more than half"):
        n_step_rms(Proportional(), log(), horizons_s=(5.0,))


def test_a_poor_fit_is_named() -> None:
    validation = identify.validate_throttle(Proportional(30.0), log())
    assert validation.quality.nrmse_fit_percent < 60.0
    poor = next(finding for finding in validation.findings if finding.code == "poor_free_run")
    assert "below the 85 %" in poor.text


def test_a_model_that_runs_away_is_an_error() -> None:
    with pytest.raises(DataError, match=r"runs away on bench\.csv"):
        identify.validate_throttle(Runaway(), log())


# --- what a log does not identify ---------------------------------------------------------------------------------


def questions(angle: np.ndarray, **options: Any) -> str:
    content = record_content(TIME, angle, limp_home_deg=8.0, stops_deg=(0.0, 90.0))
    return "\n".join(map(str, open_questions(content, swing=0.25, **options)))


def test_a_rich_log_leaves_nothing_open() -> None:
    assert questions(10.0 + 9.0 * np.sin(2.0 * np.pi * 2.0 * TIME)) == ""


def test_one_direction_only() -> None:
    said = questions(2.0 + 14.0 * TIME)
    assert "the plate only opens: Coulomb torque and preload" in said
    assert "add a triangle of ±0.25 duty at 0.05 Hz across limp-home (8 deg)" in said
    assert "only closes" in questions(85.0 - 14.0 * TIME)


def test_one_side_only() -> None:
    said = questions(40.0 + 15.0 * np.sin(2.0 * np.pi * 2.0 * TIME))
    assert "never goes below limp-home (8 deg), the lowest angle is 25.0 deg" in said
    assert "above" not in said
    assert "never goes above" in questions(4.0 + 3.0 * np.sin(2.0 * np.pi * 8.0 * TIME))


def test_slow_still_and_stopped() -> None:
    assert "at most" in questions(10.0 + 9.0 * np.sin(2.0 * np.pi * 0.5 * TIME))
    assert "hardly moves" in questions(8.0 + 1e-3 * TIME)
    stopped = np.clip(60.0 + 60.0 * np.sin(2.0 * np.pi * 1.0 * TIME), 2.0, 90.0)
    assert "end stop 3" in questions(np.where(stopped < 8.0, 4.0, stopped))


def test_entangled_pairs_get_their_own_remedy() -> None:
    rich = 10.0 + 9.0 * np.sin(2.0 * np.pi * 2.0 * TIME)
    said = questions(rich, pairs=[("preload_duty", "coulomb_duty", -0.993)])
    assert (
        "preload_duty and coulomb_duty are indistinguishable in this log (correlation -0.993); add a triangle" in said
    )
    assert "add a chirp to 6 Hz" in questions(rich, pairs=[("tau_s", "gain_deg_per_s2_per_duty", 0.99)])
    one_way = questions(2.0 + 14.0 * TIME, pairs=[("preload_duty", "coulomb_duty", -0.999)])
    assert one_way.count("indistinguishable") == 1, "said once"


def test_crossings_are_counted_with_a_band() -> None:
    noise = 0.05 * RNG.standard_normal(TIME.size)
    content = record_content(TIME, 8.0 + 5.0 * np.sin(2.0 * np.pi * TIME) + noise, limp_home_deg=8.0)
    assert content.limp_home_crossings == 11
    assert content.time_above_s == pytest.approx(content.time_below_s, abs=0.05)


@pytest.mark.parametrize("how", ["identify_throttle", "fit_pseudo_wiener"])
def test_a_fit_in_percent_has_one_definition(how: str) -> None:
    """Every way to a fit says the figure that its validation says: the free run without its first 50 ms."""
    rng = np.random.default_rng(0)
    train, test = (
        throttle_log(run["time_s"], run["duty"], run["angle_deg"] + 0.03 * rng.standard_normal(run.sizes["time_s"]))
        for run in (
            simulate_throttle(Throttle(), signals.chirp(4.0, offset=0.15, amplitude=swing)["duty"])
            for swing in (0.2, 0.15)
        )
    )
    once = FitOptions(n_starts=1)
    fits = {
        "identify_throttle": lambda: identify.identify_throttle(train, test=test, options=once),
        "fit_pseudo_wiener": lambda: fit_pseudo_wiener(train, limp_home_deg=8.0, options=once),
    }
    fit = fits[how]()
    assert fit.train == identify.validate_throttle(fit.model, train).quality
    if fit.test is not None:
        assert fit.test == identify.validate_throttle(fit.model, test).quality
