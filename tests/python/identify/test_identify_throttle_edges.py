"""Logs that are not the easy case: other sample times, other stops, other limp-home angles, delays, inductance."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from independent_throttle import FAMILIES
from mgdd import presets
from mgdd.cli import main
from mgdd.errors import ParameterError
from mgdd.identify import design_excitation, identify_throttle, validate_throttle
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.identify import doubts
from mgdd.identify.throttle.record_content import moves_against
from mgdd.io import throttle_log, write_csv
from mgdd.optimize import FitOptions
from mgdd.signals import amplitude_random_steps, chirp
from mgdd.throttle import Throttle, characteristics, simulate_throttle
from throttle_bodies import draw_body, make_logs

NOISE_DEG = 0.03


def measured(throttle: Throttle, duty: np.ndarray, *, start_deg: float | None = None, delay: int = 0) -> xr.Dataset:
    acting = np.concatenate([np.full(delay, duty[0]), duty[: duty.size - delay]])
    run = simulate_throttle(throttle, acting, start_deg=start_deg)
    noise = np.random.default_rng(3).normal(0.0, NOISE_DEG, duty.size)
    return throttle_log(run["time_s"].to_numpy(), duty, run["angle_deg"].to_numpy() + noise)


def swing(seconds: float = 6.0, offset: float = 0.15, amplitude: float = 0.2) -> np.ndarray:
    return chirp(seconds, offset=offset, amplitude=amplitude)["duty"].to_numpy()


@pytest.fixture(scope="module")
def p1() -> Throttle:
    return presets.load("P1", kind="throttle").throttle


@pytest.mark.parametrize("every", [2, 5])
def test_a_coarser_log_is_fitted_and_validated(p1: Throttle, tmp_path: Path, every: int) -> None:
    log = measured(p1, swing()).isel(time_s=slice(None, None, every))
    file, out = tmp_path / "log.csv", tmp_path / "fit.toml"
    write_csv(log, file)
    assert main(["throttle", "identify", str(file), "--output", str(out)]) == 0
    assert main(["throttle", "validate", str(out), str(file), "--json", "--output", str(tmp_path / "v.json")]) == 0
    report = validate_throttle(FirstPrincipleModel(), log)
    step = 1e-3 * every
    np.testing.assert_allclose(report.n_step["horizon_s"] / step, np.rint(report.n_step["horizon_s"] / step))
    assert json.loads((tmp_path / "v.json").read_text())["fit_percent"] > 95.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pw_r", "first_principle"])
def test_another_stop_is_named_and_can_be_given(p1: Throttle, kind: str) -> None:
    log = measured(p1.replace(open_deg=70.0), swing(8.0, 0.16, 0.22))
    blind = identify_throttle(log, kind)
    stop = next(finding for finding in blind.findings if finding.code == "unknown_stop")
    assert stop.names == ("open_deg",)
    seeing = identify_throttle(log, kind, open_deg=70.0)
    assert seeing.train.nrmse_fit_percent > 99.0 > blind.train.nrmse_fit_percent
    assert "unknown_stop" not in {finding.code for finding in seeing.findings}


def test_limp_home_is_read_off_a_record_that_starts_there() -> None:
    p3 = presets.load("P3", kind="throttle").throttle
    signal, _ = design_excitation("chirp", p3)
    fit = identify_throttle(measured(p3, signal["duty"].to_numpy()), "first_principle")
    assert fit.parameters["limp_home_deg"] == pytest.approx(12.0, abs=0.1)
    truth = characteristics(p3)
    assert fit.parameters["gain_deg_per_s2_per_duty"] == pytest.approx(float(truth["gain_deg_per_s2"]), rel=0.03)


@pytest.mark.slow
def test_a_rest_elsewhere_is_doubted(p1: Throttle) -> None:
    duty = np.concatenate([np.full(200, 0.145), swing(offset=0.12)])
    log = measured(p1, duty, start_deg=40.0)
    fit = identify_throttle(log, "pw_r")
    found = {finding.code: finding for finding in fit.findings}
    assert "first samples: 40" in found["limp_home_read_off"].text
    assert "at 40 deg under a duty of 0.145" in found["limp_home_stuck"].text
    assert found["limp_home_stuck"].remedy.startswith("give limp_home_deg")
    # The groups estimate it, and say that the record began elsewhere.
    groups = identify_throttle(log, "first_principle", options=FitOptions(n_starts=1))
    assert groups.parameters["limp_home_deg"] == pytest.approx(8.0, abs=0.2)
    told = next(finding for finding in groups.findings if finding.code == "limp_home_stuck")
    assert "begins at rest at 40 deg, and limp-home is 8" in told.text


def test_friction_above_the_preload_makes_every_rest_a_doubt(p1: Throttle) -> None:
    log = measured(p1, np.concatenate([np.zeros(100), swing(1.0)]), start_deg=8.0)
    groups = FirstPrincipleModel().parameters
    for static, codes in ((0.09, ["limp_home_read_off"]), (0.11, ["limp_home_read_off", "limp_home_stuck"])):
        drop = {"delta_duty": 0.08, "stribeck_drop": static / 0.08 - 1.0}  # the preloads are 0.1
        found = doubts(log, FirstPrincipleModel(parameters=groups | drop), 8.0)
        assert [finding.code for finding in found] == codes
    assert found[1].text.startswith("friction is 1.1 times the preload, so the plate may rest anywhere")


@pytest.mark.slow
def test_inductance_is_taken_in_where_it_shows(p1: Throttle) -> None:
    duty = amplitude_random_steps(12.0, offset=0.0, amplitude=0.45, seed=4)["duty"].to_numpy()
    test = amplitude_random_steps(6.0, offset=0.15, amplitude=0.2, seed=5)["duty"].to_numpy()
    fit = identify_throttle(measured(p1, duty), "first_principle", test=measured(p1, test))
    assert fit.parameters["electrical_s"] > 0.0
    assert fit.test.nrmse_fit_percent > 85.0


def test_a_delay_is_found_from_a_list(p1: Throttle) -> None:
    log = measured(p1, swing(), delay=3)
    late = identify_throttle(log, "pw_r", delay_samples=[0, 2, 3, 4], options=FitOptions(n_starts=3))
    assert late.parameters["delay_samples"] in (3.0, 4.0)  # the inductance is worth about one sample
    assert ("delay_at_end" in {found.code for found in late.findings}) == (late.parameters["delay_samples"] == 4.0)
    prompt = identify_throttle(log, "pw_r", options=FitOptions(n_starts=3))
    assert late.train.nrmse_fit_percent > 99.0 > prompt.train.nrmse_fit_percent
    for asked, found in ((None, 3.0), ([2, 3], 3.0), (2, 2.0)):
        fit = identify_throttle(log, "first_principle", delay_samples=asked, options=FitOptions(n_starts=1))
        assert fit.parameters["delay_samples"] == found


def test_what_a_kind_lacks_is_refused_first(p1: Throttle) -> None:
    log = measured(p1, swing(2.0))
    with pytest.raises(ParameterError, match="pw_w has one set of parameters"):
        identify_throttle(log, "pw_w", two_sided=True)
    for kind, delay, longest in (("first_principle", 21, 20), ("pw_r", 6, 5)):
        with pytest.raises(ParameterError, match=rf"delay_samples = {delay}: must be within \[0, {longest}\]"):
            identify_throttle(log, kind, delay_samples=[2, delay])
    with pytest.raises(ParameterError, match="must be at least one delay"):
        identify_throttle(log, delay_samples=[])
    with pytest.raises(ParameterError, match=r"seed = -1: must be >= 0"):
        identify_throttle(log, options=FitOptions(seed=-1))
    with pytest.raises(ParameterError, match=r"open_deg = -5: must be above closed_deg"):
        identify_throttle(log, open_deg=-5.0)


@pytest.mark.parametrize(("name", "value"), [("tau_s", 0.0), ("delta_duty", -0.1), ("beta_above_duty", float("nan"))])
def test_groups_outside_their_domain_are_refused(name: str, value: float) -> None:
    with pytest.raises(ParameterError, match=f"^{name} = "):
        FirstPrincipleModel(parameters={**FirstPrincipleModel().parameters, name: value})


def test_a_fit_far_below_its_noise_ceiling_is_doubted(p1: Throttle) -> None:
    """A strict Wiener model has no friction: 81 % where the noise would leave 99 says so, the groups do not."""
    log = measured(p1, swing())
    poor = identify_throttle(log, "pw_w", options=FitOptions(n_starts=2))
    said = [str(found) for found in poor.findings if found.code == "below_ceiling"]
    assert len(said) == 1
    assert f"meets its own log at {poor.train.nrmse_fit_percent:.1f} %" in said[0]
    assert "would leave 99." in said[0]
    good = identify_throttle(log, "first_principle", options=FitOptions(n_starts=1))
    assert good.train.nrmse_fit_percent > 98.0
    assert "below_ceiling" not in {found.code for found in good.findings}
    # Where the test log holds what the first did not, that one decides; a loss of ten points has a finding of its own.
    other = measured(p1.replace(coulomb_nm=1.03 * p1.coulomb_nm), swing())
    tested = identify_throttle(log, "first_principle", test=other, options=FitOptions(n_starts=1))
    assert 3.0 < tested.train.nrmse_fit_percent - tested.test.nrmse_fit_percent < 10.0
    said = [str(found) for found in tested.findings if found.code in ("below_ceiling", "overfitted")]
    assert len(said) == 1
    assert f"meets the test log at {tested.test.nrmse_fit_percent:.1f} %" in said[0]


@pytest.mark.parametrize("family", FAMILIES)
def test_a_plate_that_moves_against_the_duty_is_named(family: str) -> None:
    for seed in (2, 7):
        time, duty, angle = make_logs(draw_body(family, seed), seed)[0]
        assert moves_against(time, duty, angle, (0.0, 88.0)) == ()
        for turned in ((time, -duty, angle), (time, duty, 88.0 - angle)):
            (finding,) = moves_against(*turned, (0.0, 88.0))
            assert finding.code == "moves_against_duty"
            assert "negate" in finding.remedy


def test_a_fit_of_a_turned_log_says_so_first(p1: Throttle) -> None:
    log = measured(p1, swing(3.0))
    log["duty"] = -log["duty"]
    fit = identify_throttle(log, "pw_r", options=FitOptions(n_starts=1))
    assert fit.findings[0].code == "moves_against_duty"
