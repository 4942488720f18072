"""The front of identification on the real plant: fits, tests, sentences, and fits that go through a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.errors import DataError, ParameterError
from mgdd.identify import (
    ThrottleModel,
    amplitude_random_steps,
    chirp,
    identify_throttle,
    load_throttle_model,
    triangle,
    validate_throttle,
)
from mgdd.io import ParameterFile, throttle_log
from mgdd.throttle import PseudoWiener, Throttle, simulate

P1 = Throttle()


def measured(signal: Any, name: str, seed: int) -> Any:
    run = simulate(P1, signal["duty"], time_s=signal["time_s"])
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
    fit = identify_throttle(train, kind, test=test_log, starts=3)
    assert fit.kind == kind
    assert isinstance(fit.model, ThrottleModel)
    assert fit.fit_percent_train > 98.5
    assert fit.fit_percent_test is not None
    assert fit.fit_percent_test > (97.0 if kind == "pw_r" else 92.0), "the groups know no inductance"
    assert fit.rmse_test_deg is not None
    assert fit.rmse_test_deg < 0.5
    assert fit.source == "chirp.csv"
    assert fit.x is fit.report.x
    assert (fit.cost, fit.nfev, fit.message) == (fit.report.cost, fit.report.nfev, fit.report.message)
    assert f"{kind} fitted to chirp.csv" in fit.summary()
    assert "<b>" in fit._repr_html_()

    validation = validate_throttle(fit, test_log)
    assert validation.fit_percent == pytest.approx(fit.fit_percent_test, rel=1e-12)
    ahead = validation.n_step["n_step_rms_deg"]
    assert float(ahead.sel(predictor=kind).max()) < 0.5
    assert float(ahead.sel(predictor="persistence").max()) > 1.0

    saved = ParameterFile.from_toml(fit.to_toml())
    assert ParameterFile.from_toml(saved.to_toml()) == saved
    assert saved.notes["source"] == "fitted to chirp.csv"
    assert saved.tables["fit"]["fit_percent_train"].value == fit.fit_percent_train
    errors = dict(zip(fit.report.names, fit.report.stderr, strict=True))
    kept = {name: entry.stderr for name, entry in saved.tables["parameters"].items() if entry.stderr is not None}
    assert set(kept.values()) == {error for error in errors.values() if np.isfinite(error)}
    file = tmp_path / "fit.toml"
    file.write_text(fit.to_toml(), encoding="utf-8")
    again = load_throttle_model(file)
    time, duty = test_log["time_s"].to_numpy(), test_log["duty"].to_numpy()
    np.testing.assert_array_equal(
        again.simulate(time, duty, start_deg=8.0), fit.model.simulate(time, duty, start_deg=8.0)
    )


def test_a_slow_opening_fits_itself_and_nothing_else(test_log: Any) -> None:
    slow = measured(triangle(8.0, offset=0.19, amplitude=0.08, frequency_hz=1.0 / 32.0), "slow", 3)
    fit = identify_throttle(slow, test=test_log, starts=3)
    assert fit.fit_percent_train > 99.0
    assert fit.fit_percent_test is not None
    assert fit.fit_percent_test < 90.0
    assert {"preload_duty", "coulomb_duty"} <= set(fit.unidentifiable)
    said = "\n".join(fit.findings)
    assert "the plate only opens: Coulomb torque and preload push the same way and are indistinguishable" in said
    assert "add a triangle of ±0.25 duty at 0.05 Hz across limp-home" in said
    assert "never goes below limp-home" in said
    assert "what it has learned does not carry over" in said
    assert all(finding in fit.summary() for finding in fit.findings)


def test_each_side_gets_its_set(train: Any) -> None:
    fit = identify_throttle(train, two_sided=True, limp_home_deg=8.0, starts=2)
    assert {"above_coulomb_duty", "below_coulomb_duty"} <= set(fit.report.names)
    assert fit.fit_percent_train > 98.5
    assert fit.parameters["above_coulomb_duty"] == pytest.approx(0.0927, rel=0.05)
    with pytest.raises(ParameterError, match="only pw_r has one per side"):
        identify_throttle(train, "pw_p", two_sided=True)


@pytest.mark.parametrize("kind", ["pw_w", "pw_p"])
def test_models_without_friction_inside_are_told_so(kind: str, train: Any, test_log: Any) -> None:
    fit = identify_throttle(train, kind, starts=2)
    validation = validate_throttle(fit, test_log)
    assert validation.fit_percent < 60.0
    assert "take a model with friction" in "\n".join(validation.findings)


def test_what_cannot_be_fitted_is_refused(train: Any) -> None:
    with pytest.raises(ParameterError, match=r"model = 'arx': must be one of"):
        identify_throttle(train, "arx")
    above = measured(chirp(3.0, offset=0.15, amplitude=0.15), "above", 4)
    with pytest.raises(DataError, match="below limp-home"):
        identify_throttle(above, two_sided=True)
    moving = train.isel(time_s=slice(int(np.argmax(np.abs(np.diff(train["angle_deg"].to_numpy()[::20])))) * 20, None))
    with pytest.raises(ParameterError, match="does not start at rest"):
        identify_throttle(moving)


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
