"""The front of identification on the real plant: fits, tests, sentences, and fits that go through a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd.errors import DataError, ParameterError
from mgdd.identify import identify_throttle, load_throttle_model, validate_throttle
from mgdd.io import throttle_log
from mgdd.io.parameters import ParameterFile
from mgdd.optimize import FitOptions
from mgdd.results.fit import Model
from mgdd.signals import amplitude_random_steps, chirp, triangle
from mgdd.throttle import PseudoWiener, Throttle, simulate_throttle

P1 = Throttle()


def measured(signal: Any, name: str, seed: int) -> Any:
    run = simulate_throttle(P1, signal["duty"], time_s=signal["time_s"])
    noise = 0.03 * np.random.default_rng(seed).standard_normal(run.sizes["time_s"])
    return throttle_log(run["time_s"], run["duty"], run["angle_deg"] + noise, name=name)


@pytest.fixture(scope="module")
def train() -> Any:
    return measured(chirp(4.0, offset=0.01, amplitude=0.34, high_hz=5.0), "chirp.csv", 1)


@pytest.fixture(scope="module")
def test_log() -> Any:
    return measured(amplitude_random_steps(3.0, offset=0.0, amplitude=0.33), "steps.csv", 2)


@pytest.mark.parametrize("kind", ["pw_r", "first_principle"])
def test_a_fit_says_how_good_it_is(kind: str, train: Any, test_log: Any, tmp_path: Path) -> None:
    fit = identify_throttle(train, kind, test=test_log, options=FitOptions(n_starts=3))
    assert fit.kind == kind
    assert isinstance(fit.model, Model)
    assert fit.train.nrmse_fit_percent > 98.5
    assert fit.test.nrmse_fit_percent > (97.0 if kind == "pw_r" else 99.0), "PW-R knows no inductance"
    assert fit.test.rmse < 0.5
    assert (fit.test.unit, fit.test.n) == ("deg", test_log.sizes["time_s"] - 50)
    assert fit.source == "chirp.csv"
    assert list(fit.start_rmse) == sorted(fit.start_rmse)
    assert len(fit.start_rmse) == 3 if kind == "pw_r" else fit.n_best >= 3
    assert f"{kind} fitted to chirp.csv" in fit.summary()
    assert "<b>" in fit._repr_html_()

    validation = validate_throttle(fit, test_log)
    assert validation.quality == fit.test
    ahead = validation.n_step["n_step_rms_deg"]
    assert float(ahead.sel(predictor=kind).max()) < 0.5
    assert float(ahead.sel(predictor="persistence").max()) > 1.0

    saved = ParameterFile.from_toml(fit.to_toml())
    assert ParameterFile.from_toml(saved.to_toml()) == saved
    assert saved.notes["source"] == "fitted to chirp.csv"
    assert saved.tables["fit"]["fit_percent_train"].value == fit.train.nrmse_fit_percent
    errors = {name: error for name, error in fit.stderr.items() if not name.startswith("start_")}
    kept = {name: entry.stderr for name, entry in saved.tables["parameters"].items() if entry.stderr is not None}
    assert set(kept.values()) == {error for error in errors.values() if np.isfinite(error)}
    file = tmp_path / "fit.toml"
    file.write_text(fit.to_toml(), encoding="utf-8")
    again = load_throttle_model(file)
    start = {"angle_deg": 8.0}
    xr.testing.assert_identical(
        again.simulate(test_log, initial_state=start), fit.model.simulate(test_log, initial_state=start)
    )


@pytest.mark.slow
def test_a_lag_of_the_current_is_kept_only_where_it_pays() -> None:
    signal = chirp(4.0, offset=0.01, amplitude=0.34, high_hz=5.0)
    run = simulate_throttle(P1, signal["duty"], time_s=signal["time_s"])  # 1 ms of lag, worth 0.08 deg RMS
    noise = np.random.default_rng(1).standard_normal(run.sizes["time_s"])
    for noise_deg, kept in ((0.03, True), (0.7, False)):
        log = throttle_log(run["time_s"], run["duty"], run["angle_deg"] + noise_deg * noise)
        fit = identify_throttle(log, "first_principle", options=FitOptions(n_starts=1))
        assert (fit.parameters["electrical_s"] > 0.0) is kept
        assert fit.parameters["delay_samples"] == 0.0
        assert fit.parameters["stribeck_drop"] == fit.parameters["half_gap_deg"] == 0.0
        assert fit.report.rmse == pytest.approx(noise_deg, rel=0.05)
        if kept:
            assert fit.parameters["electrical_s"] == pytest.approx(1e-3, rel=0.05)
        told = next(finding for finding in fit.findings if finding.code == "structure_chosen")
        assert ("with lag" in told.text) is kept


def test_a_slow_opening_fits_itself_and_nothing_else(test_log: Any) -> None:
    slow = measured(triangle(8.0, offset=0.19, amplitude=0.08, frequency_hz=1.0 / 32.0), "slow", 3)
    fit = identify_throttle(slow, "pw_r", test=test_log, options=FitOptions(n_starts=3))
    assert fit.train.nrmse_fit_percent > 99.0
    assert fit.test.nrmse_fit_percent < 90.0
    assert {"preload_duty", "coulomb_duty"} <= set(fit.unidentifiable)
    found = {finding.code: finding for finding in fit.findings}
    assert found["one_way"].text.startswith("the plate only opens: Coulomb torque and preload push the same way")
    assert found["one_way"].remedy.startswith("add a triangle of ±0.25 duty at 0.05 Hz across limp-home")
    assert found["side_not_visited"].names == ("below",)
    assert found["overfitted"].text.endswith("what it has learned does not carry over")
    assert all(str(finding) in fit.summary() for finding in fit.findings)


def test_each_side_gets_its_set(train: Any) -> None:
    fit = identify_throttle(train, "pw_r", two_sided=True, limp_home_deg=8.0, options=FitOptions(n_starts=2))
    assert {"above_coulomb_duty", "below_coulomb_duty"} <= set(fit.report.names)
    assert fit.train.nrmse_fit_percent > 98.5
    assert fit.parameters["above_coulomb_duty"] == pytest.approx(0.0927, rel=0.05)
    with pytest.raises(ParameterError, match="only pw_r has one per side"):
        identify_throttle(train, "pw_p", two_sided=True)


@pytest.mark.parametrize("kind", ["pw_w", "pw_p"])
def test_models_without_friction_inside_are_told_so(kind: str, train: Any, test_log: Any) -> None:
    fit = identify_throttle(train, kind, options=FitOptions(n_starts=2))
    validation = validate_throttle(fit, test_log)
    assert validation.quality.nrmse_fit_percent < 60.0
    poor = next(finding for finding in validation.findings if finding.code == "poor_free_run")
    assert "take a model with friction" in poor.remedy


def test_what_cannot_be_fitted_is_refused(train: Any) -> None:
    with pytest.raises(ParameterError, match=r"model = 'arx': must be one of"):
        identify_throttle(train, "arx")
    above = measured(chirp(3.0, offset=0.15, amplitude=0.15), "above", 4)
    with pytest.raises(DataError, match="below limp-home"):
        identify_throttle(above, two_sided=True)
    moving = train.isel(time_s=slice(int(np.argmax(np.abs(np.diff(train["angle_deg"].to_numpy()[::20])))) * 20, None))
    with pytest.raises(ParameterError, match="does not start at rest"):
        identify_throttle(moving, "pw_r")


def test_saved_parameters_are_checked(tmp_path: Path) -> None:
    model, file = PseudoWiener("pw_r", {"above_tau_s": 0.02}), tmp_path / "fit.toml"
    good = model.to_toml()
    for old, new, error, match in (
        ('"s"', '"ms"', ParameterError, r"fit\.toml: \[parameters\] above_tau_s: unit = 'ms': must be 's'"),
        ("kind = ", "kind ", DataError, "not valid TOML"),
        ("pw_r", "arx", DataError, "kind = 'arx': must be 'first_principle' or 'pw_r'"),
        ("value = 0.02,", "value = nan,", ParameterError, r"fit\.toml: above_tau_s = nan"),
        ("above_tau_s", "above_tua_s", ParameterError, "above_tua_s: unknown key: did you mean 'above_tau_s'"),
        ("switching = ", "switch = ", ParameterError, "switch: unknown key: did you mean 'switching'"),
        ('"predicted"', '"guessed"', ParameterError, r"fit\.toml: .*guessed"),
    ):
        file.write_text(good.replace(old, new), encoding="utf-8")
        with pytest.raises(error, match=match):
            load_throttle_model(file)
    lines = [line for line in good.splitlines() if not line.startswith("above_tau_s")]
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(DataError, match=r"\[parameters\] lacks above_tau_s: write above_tau_s = "):
        load_throttle_model(file)
    file.write_text(good, encoding="utf-8")
    assert load_throttle_model(file) == model
    with pytest.raises(FileNotFoundError):
        load_throttle_model(tmp_path / "none.toml")
