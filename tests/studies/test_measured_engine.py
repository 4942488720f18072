"""The surrogate of a measured engine: it finds a known law, and says of the measured set what the set says."""

from __future__ import annotations

import json

import numpy as np
import pytest

from mgdd import datasets
from mgdd.datasets.files import path
from mgdd.errors import ConvergenceError, DataError, ParameterError
from mgdd.loop import run_seeker
from mgdd.optimize import GaussianProcessSeeking, Limit
from mgdd.results.labels import check_labels
from mgdd_studies.measured_engine import EngineSurrogate, SurrogatePlant, fit_surrogate, random_step_records

INPUTS = ("soi_cad", "doi_main_ms", "doi_h2_ms", "p2m_us")
AT = {"doi_main_ms": 0.42, "doi_h2_ms": 2.9, "p2m_us": 1200.0}


def law(s: np.ndarray, d_ms: float, h_ms: float, g_us: float) -> dict[str, np.ndarray]:
    """Write out the formulas that `random_step_records` promises."""
    d, h, g = (d_ms - 0.37) / 0.1, (h_ms - 3.2) / 0.4, (g_us - 1000.0) / 200.0
    return {
        "imep_bar": 7.0 + 0.5 * d + 0.4 * h - 0.005 * (s + 4.0) ** 2,
        "mfb50_cad": 10.0 + s - 0.4 * h + 0.02 * s**2,
        "mprr": 4.5 - 0.2 * s + 0.3 * h * d + 0.2 * g,
        "nox_ppm": 650.0 - 45.0 * s + 1.5 * s**2 + 60.0 * d + 40.0 * h,
    }


@pytest.fixture(scope="module")
def known():
    return fit_surrogate(random_step_records(4000))


@pytest.fixture(scope="module")
def exact():
    return fit_surrogate(random_step_records(2500, noise=0.0))


@pytest.fixture(scope="module")
def cycles():
    try:
        return datasets.read("h2df_502")
    except FileNotFoundError as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="module")
def measured(cycles):
    return fit_surrogate(cycles)


# --- a law that is known ------------------------------------------------------------------------------------
def test_fast_surfaces_are_recovered_exactly_without_noise(exact):
    soi = np.linspace(-7.0, 9.0, 9)
    found, truth = exact.predict(soi, AT), law(soi, **dict(zip(("d_ms", "h_ms", "g_us"), AT.values(), strict=True)))
    for name in ("imep_bar", "mfb50_cad", "mprr"):
        np.testing.assert_allclose(found[name], truth[name], rtol=0, atol=1e-8)
        assert exact.signals[name].lag_cycles == 1
        assert not exact.signals[name].lag_at_bound
    assert found["supported"].all()


def test_sensor_and_surface_of_the_slow_signal_are_recovered(exact):
    sensor = exact.signals["nox_ppm"].sensor
    assert sensor.delay_cycles == 3
    assert sensor.tau_cycles == pytest.approx(6.0, abs=0.1)  # the trial grid and its parabola
    assert sensor.delay_share == {3: 1.0}
    assert sensor.total_cycles == sensor.delay_cycles + sensor.tau_cycles
    assert not sensor.at_bound
    soi = np.linspace(-7.0, 9.0, 9)
    np.testing.assert_allclose(exact.predict(soi, AT)["nox_ppm"], law(soi, 0.42, 2.9, 1200.0)["nox_ppm"], atol=12.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_uncertainty_covers_the_truth(seed):
    sensor = fit_surrogate(random_step_records(3000, seed=seed, noise=3.0)).signals["nox_ppm"].sensor
    assert sensor.delay_cycles == 3
    assert 0.005 < sensor.tau_stderr_cycles < 0.5
    assert abs(sensor.tau_cycles - 6.0) < 3.0 * sensor.tau_stderr_cycles + 0.05


def test_a_static_surface_of_a_slow_signal_is_attenuated_and_says_so():
    records = random_step_records(4000)
    static = fit_surrogate(records, slow=()).signals["nox_ppm"]
    slow = fit_surrogate(records).signals["nox_ppm"]
    assert static.sensor is None
    assert static.lag_at_bound
    assert slow.r2 > 0.99 > 0.9 > static.r2


def test_residuals_are_the_noise(known):
    residuals = known.residuals[np.all(np.isfinite(known.residuals), axis=1)]
    np.testing.assert_allclose(residuals.std(axis=0), [0.1, 0.8, 0.6, 8.0], rtol=0.05)
    correlation = np.corrcoef(residuals.T)[np.triu_indices(4, 1)]
    np.testing.assert_allclose(correlation, 0.6, atol=0.05)
    for signal in known.signals.values():
        assert signal.cyclic_sd == pytest.approx(signal.residual_sd, rel=0.05)
        assert abs(signal.r2_held_out - signal.r2) < 0.1 * (1.0 - signal.r2) + 0.04


def test_what_the_surface_misses_is_no_cyclic_scatter():
    records = random_step_records(4000)
    records["imep_bar"] = records["imep_bar"] + 0.3 * np.sin(records["soi_cad"]).shift(cycle=1, fill_value=0.0)
    records["imep_bar"].attrs = {"units": "bar", "long_name": "IMEP"}
    imep = fit_surrogate(records).signals["imep_bar"]
    assert imep.cyclic_sd == pytest.approx(0.1, rel=0.1)
    assert imep.residual_sd > 0.18


def test_rows_that_are_not_excited_or_not_measured_are_left_out():
    records = random_step_records(3000)
    good = fit_surrogate(records)
    spoiled = records.copy(deep=True)
    spoiled["excited"] = ("cycle", np.arange(3000) >= 200)
    for name in good.signals:
        spoiled[name][:201] = 1e4
    spoiled["mfb50_cad"][500:520] = np.nan
    again = fit_surrogate(spoiled)
    assert again.signals["imep_bar"].residual_sd == pytest.approx(0.1, rel=0.05)
    assert np.isnan(again.residuals[:240, 3]).all()
    assert np.isnan(again.residuals[500:520, 1]).all()
    assert np.isfinite(again.residuals[500:520, 0]).all()


def test_the_held_out_part_has_no_say_in_the_lags():
    records = random_step_records(4000)
    other = records.copy(deep=True)
    for name in ("nox_ppm", "imep_bar"):
        other[name][3005:] = records[name].to_numpy()[3001:-4]
    found, truth = fit_surrogate(other), fit_surrogate(records)
    assert found.signals["nox_ppm"].sensor == truth.signals["nox_ppm"].sensor
    assert found.signals["imep_bar"].lag_scores == truth.signals["imep_bar"].lag_scores
    assert found.signals["imep_bar"].r2_held_out < 0.9 < truth.signals["imep_bar"].r2_held_out


def test_results_are_labelled(known):
    check_labels(known.predict([-2.0, 0.0]))
    check_labels(known.quality())
    check_labels(random_step_records(20))


# --- support and optimum ------------------------------------------------------------------------------------
def test_outside_is_flagged_or_refused(known):
    assert known.predict([-12.0, 0.0, 12.0])["supported"].values.tolist() == [False, True, False]
    with pytest.raises(ParameterError, match=r"soi_cad = 12: the point is outside the support"):
        known.predict([0.0, 12.0], outside="raise")
    corner = {"doi_main_ms": 0.499, "doi_h2_ms": 3.99, "p2m_us": 1395.0}
    inside_box = known.points(np.array([9.8]), corner)
    assert ((inside_box >= known.support.lower) & (inside_box <= known.support.upper)).all()
    assert not known.predict(9.8, corner)["supported"]


def test_leverage_of_the_records_sums_to_the_number_of_terms(known):
    records = random_step_records(4000)
    points = np.column_stack([records[name] for name in INPUTS])
    inside = np.all((points >= known.support.lower) & (points <= known.support.upper), axis=1)
    assert known.support.leverage(points[inside]).sum() == pytest.approx(15.0)
    assert known.support.contains(points[inside]).mean() == pytest.approx(0.99, abs=0.004)
    assert not known.support.contains(points[~inside]).any()


def test_the_optimum_stays_out_of_the_corners_of_the_box(known):
    corner = {"doi_main_ms": 0.49, "doi_h2_ms": 3.9, "p2m_us": 1350.0}
    best = known.find_optimum({"nox_ppm": -1.0}, at=corner)
    assert best.at_bound
    assert best["soi_cad"] < known.support.upper[0] - 0.1
    assert known.predict(best["soi_cad"] - 1e-6, corner)["supported"]
    assert not known.predict(best["soi_cad"] + 1e-6, corner)["supported"]


def test_optimum_is_that_of_the_law(exact):
    best = exact.find_optimum("imep_bar")
    assert best["soi_cad"] == pytest.approx(-4.0, abs=1e-6)
    assert not best.at_bound
    assert best.active_limits == ()
    held = exact.find_optimum("imep_bar", {"mprr": 4.9}, {"doi_main_ms": 0.37, "p2m_us": 1000.0})
    assert held["soi_cad"] == pytest.approx(-2.0, abs=1e-6)
    assert held.active_limits == ("mprr",)
    assert held.values["mprr"] == pytest.approx(4.9)


def test_weighted_objective_has_its_closed_form(known):
    weight = 0.002
    soi = np.linspace(*known.find_optimum().bounds["soi_cad"], 20001)
    table = known.predict(soi)
    goal = (table["imep_bar"] - weight * table["nox_ppm"]).to_numpy()
    best = known.find_optimum({"imep_bar": 1.0, "nox_ppm": -weight})
    assert best["soi_cad"] == pytest.approx(soi[goal.argmax()], abs=2e-3)
    assert best.value == pytest.approx(goal.max(), abs=1e-6)


def test_an_optimum_at_the_edge_says_so(known):
    late = known.find_optimum({"nox_ppm": -1.0})
    assert late.at_bound
    assert late["soi_cad"] == pytest.approx(late.bounds["soi_cad"][1])
    early = known.find_optimum("nox_ppm")
    assert early.at_bound
    assert early["soi_cad"] == pytest.approx(early.bounds["soi_cad"][0])
    for end in early.bounds["soi_cad"]:
        assert known.predict(end + 1e-6 * np.sign(1.0 - end))["supported"]
        assert not known.predict(end - 1e-6 * np.sign(1.0 - end))["supported"]


def test_limits_that_cannot_be_met(known):
    with pytest.raises(ConvergenceError, match=r"no supported soi_cad in .* each alone: mprr >= .* \(limit 1\)"):
        known.find_optimum("imep_bar", {"mprr": 1.0})
    with pytest.raises(ConvergenceError, match="is supported: change the other inputs"):
        known.find_optimum("imep_bar", at={"doi_h2_ms": 0.5})


# --- refusals -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"inputs": ("doi_main_ms",)}, "must begin with 'soi_cad'"),
        ({"slow": ("soot",)}, "slow: 'soot' is not an output"),
        ({"held_out": 1.0}, r"held_out = 1: must be in \(0, 1\)"),
        ({"max_lag": -1}, "max_lag = -1: must be >= 0"),
        ({"outputs": ("soi_cad",)}, "must name signals, each once, and no input"),
    ],
)
def test_a_wrong_request_is_refused(options, message):
    with pytest.raises(ParameterError, match=message):
        fit_surrogate(random_step_records(100), **options)


def test_wrong_records_are_refused():
    records = random_step_records(600)
    with pytest.raises(DataError, match="records have no mprr"):
        fit_surrogate(records.drop_vars("mprr"))
    with pytest.raises(DataError, match="cycle 301 follows 299: must count up by one"):
        fit_surrogate(records.isel(cycle=[*range(300), *range(301, 600)]))
    flat = records.assign(p2m_us=("cycle", np.full(600, 1000.0)))
    with pytest.raises(DataError, match="p2m_us does not vary"):
        fit_surrogate(flat)
    with pytest.raises(DataError, match="usable cycles"):
        fit_surrogate(records.isel(cycle=slice(0, 60)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.predict(0.0, {"soi_cad": 1.0}), "at: 'soi_cad' is not another input"),
        (lambda s: s.predict(0.0, {"p2m_us": np.nan}), "p2m_us = nan: must be finite"),
        (lambda s: s.predict(np.nan), "soi_cad: must be"),
        (lambda s: s.predict(0.0, outside="clip"), "outside = 'clip'"),
        (lambda s: s.find_optimum("soot"), "objective: 'soot' is not a signal"),
        (lambda s: s.find_optimum("imep_bar", {"mprr": np.inf}), "limits: mprr = inf"),
        (lambda s: s.find_optimum({}), "must name at least one signal"),
        (lambda s: SurrogatePlant(s, block_cycles=0), "block_cycles = 0: must be >= 1"),
        (lambda s: SurrogatePlant(s, outside="no"), "outside = 'no'"),
        (lambda s: SurrogatePlant(s, "leverage_share"), "objective: 'leverage_share' is not a signal"),
        (lambda s: SurrogatePlant(s, at={"p2m_us": 9e3}, outside="clamp"), "at = .*: no command can be clamped"),
    ],
)
def test_a_wrong_question_is_refused(known, call, message):
    with pytest.raises(ParameterError, match=message):
        call(known)


# --- the virtual engine -------------------------------------------------------------------------------------
def test_engine_without_residuals_is_surface_and_lag(known):
    engine = SurrogatePlant(known, start_soi_cad=4.0, residuals=False)
    before, after = (known.predict(soi)["nox_ppm"].item() for soi in (4.0, -2.0))
    readings = [engine.step(-2.0) for _ in range(40)]
    model = known.signals["nox_ppm"]
    wait, decay = model.lag_cycles - 1, np.exp(-1.0 / model.sensor.tau_cycles)
    step = np.r_[np.zeros(wait), 1.0 - decay ** np.arange(1, 41 - wait)]
    np.testing.assert_allclose([r["nox_ppm"] for r in readings], before + (after - before) * step, rtol=1e-12)
    assert readings[0]["imep_bar"] == pytest.approx(known.predict(-2.0)["imep_bar"].item())
    assert all(r["supported"] is True for r in readings)


def test_engine_draws_rows_of_the_log_for_all_signals_together(known):
    block, still = 50, SurrogatePlant(known, residuals=False)
    engine = SurrogatePlant(known, seed=3, block_cycles=block)
    drawn = []
    for _ in range(4 * block):
        noisy, clean = engine.step(0.0), still.step(0.0)
        drawn.append([noisy[name] - clean[name] for name in known.signals])
    for stretch in np.array(drawn).reshape(4, block, 4):
        row = int(np.nanargmin(np.abs(known.residuals[:, 0] - stretch[0, 0])))
        np.testing.assert_allclose(stretch, known.residuals[row : row + block], atol=1e-9)


def test_engine_is_reproducible_and_resumes(known):
    def run(engine, commands):
        return [engine.step(soi) for soi in commands]

    commands = np.linspace(5.0, -5.0, 120)
    first, other = SurrogatePlant(known, seed=1), SurrogatePlant(known, seed=2)
    whole = run(first, commands)
    assert whole == run(SurrogatePlant(known, seed=1), commands)
    assert whole != run(other, commands)
    half = SurrogatePlant(known, seed=1)
    run(half, commands[:70])
    saved = json.loads(json.dumps(half.state))
    assert saved["cycles"] == half.cycles == 70
    run(half, commands[:30])
    other.state = saved
    assert run(other, commands[70:]) == whole[70:]


def test_a_refused_command_or_state_changes_nothing(known):
    engine = SurrogatePlant(known, outside="raise")
    engine.step(0.0)
    saved = engine.state
    with pytest.raises(ParameterError, match="soi_cad = 30: outside the support"):
        engine.step(30.0)
    with pytest.raises(ParameterError, match="soi_cad: must be"):
        engine.step(np.nan)
    with pytest.raises(ParameterError, match="state: generator is missing"):
        engine.state = {name: value for name, value in saved.items() if name != "generator"}
    with pytest.raises(ParameterError, match="state: row = "):
        engine.state = {**saved, "row": 10**7}
    assert engine.state == saved
    assert SurrogatePlant(known).step(30.0)["supported"] is False


def test_a_clamped_command_goes_as_far_as_the_support_reaches(known):
    names, support = known.inputs, known.support
    medians = np.array([known.medians[name] for name in names])
    plant = SurrogatePlant(known, limits=["leverage_share"], inputs=names, outside="clamp", residuals=False)
    rng = np.random.default_rng(4)
    for wanted in rng.uniform(support.lower - 0.3 * (support.upper - support.lower), support.upper, (60, 4)):
        plant.apply(dict(zip(names, wanted.tolist(), strict=True)))
        measured = plant.measure()
        applied = np.array([measured.applied[name] for name in names])
        assert known.evaluate(applied[None])[1][0]
        share = support.leverage(applied[None])[0] / support.leverage_limit
        assert measured.limits["leverage_share"] == measured.noise_free_limits["leverage_share"] == share
        if known.evaluate(wanted[None])[1][0]:
            np.testing.assert_array_equal(applied, wanted)
        else:
            shares = (applied - medians) / (wanted - medians)
            np.testing.assert_allclose(shares, shares[0], rtol=1e-9)
            assert not known.evaluate((applied + 1e-6 * (wanted - medians))[None])[1][0]


def test_a_stretch_longer_than_the_records_is_refused(known):
    with pytest.raises(DataError, match="no 5000 cycles in a row"):
        SurrogatePlant(known, block_cycles=5000)


def test_readings_that_cannot_be_negative_are_not(known):
    engine = SurrogatePlant(known, at={"doi_main_ms": 0.0}, start_soi_cad=30.0, residuals=False)
    reading = engine.step(30.0)
    assert reading["supported"] is False
    assert min(reading["nox_ppm"], reading["mprr"]) >= 0.0


# --- the measured set ---------------------------------------------------------------------------------------
def test_the_set_is_read_with_its_units_and_signs(cycles):
    check_labels(cycles)
    assert cycles.sizes["cycle"] == 24998
    assert int(cycles["excited"].sum()) == 24893
    soi = cycles["soi_cad"]
    assert (float(soi.min()), float(soi.max())) == (-7.9938, 9.9965)
    assert "sign turned" in soi.attrs["note"]
    assert np.corrcoef(soi[1000:-1], cycles["mfb50_cad"][1001:].fillna(11.6))[0, 1] > 0.8  # later SOI burns later
    assert cycles["mprr"].attrs["note"] == "unit not documented, most likely bar/deg"
    assert cycles.attrs["licence"] == "Apache-2.0"
    assert "10.5281/zenodo.16902579" in cycles.attrs["citation"]


def test_held_burn_angles_are_no_measurements(cycles):
    raw = datasets.read("h2df_502", mask_held=False)
    held = cycles["burn_angles_held"].to_numpy()
    assert held.sum() == 2962
    assert np.isnan(cycles["mfb50_cad"].to_numpy()[held]).all()
    assert raw["mfb50_cad"].notnull().all()
    kept = fit_surrogate(raw, outputs=("mfb50_cad",), slow=()).signals["mfb50_cad"]
    assert kept.r2 == pytest.approx(0.911, abs=0.001)
    assert kept.residual_sd == pytest.approx(1.3, abs=0.02)


@pytest.mark.usefixtures("cycles")
def test_another_export_is_refused(monkeypatch, tmp_path):
    original = path("h2df_502", "h2df_test502_cycles.csv")
    rows = original.read_text(encoding="ascii").splitlines()[:400]
    own = tmp_path / "h2df_502" / original.name
    own.parent.mkdir()
    own.write_text("\n".join(rows) + "\n")
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    with pytest.raises(DataError, match="the file is another export; pass checked=False"):
        datasets.read("h2df_502")
    assert datasets.read("h2df_502", checked=False).sizes["cycle"] == 399
    own.write_text("\n".join([*rows[:50], *rows[51:]]) + "\n")
    with pytest.raises(DataError, match="cycle 52 follows 50: must count up by one"):
        datasets.read("h2df_502", checked=False)
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path / "nowhere"))
    with pytest.raises(FileNotFoundError, match="set MGDD_DATA_DIR"):
        datasets.read("h2df_502")


def test_quality_of_the_measured_surfaces(measured):
    imep, mfb50, mprr, nox = measured.signals.values()
    assert [signal.lag_cycles for signal in (imep, mfb50, mprr, nox)] == [1, 1, 1, 4]
    np.testing.assert_allclose([imep.r2, mfb50.r2, mprr.r2, nox.r2], [0.959, 0.979, 0.664, 0.940], atol=0.001)
    held_out = [signal.r2_held_out for signal in (imep, mfb50, mprr, nox)]
    np.testing.assert_allclose(held_out, [0.952, 0.977, 0.637, 0.944], atol=0.002)
    assert imep.residual_sd == pytest.approx(0.22, abs=0.005)
    assert mprr.residual_sd == pytest.approx(0.79, abs=0.005)
    assert imep.cyclic_sd == pytest.approx(0.094, abs=0.003)
    assert nox.sensor.tau_cycles == pytest.approx(5.2, abs=0.1)
    assert nox.sensor.tau_stderr_cycles == pytest.approx(0.10, abs=0.03)


def test_static_surface_of_measured_nox(cycles):
    static = fit_surrogate(cycles, outputs=("nox_ppm",), slow=(), nonnegative=(), max_lag=3)
    nox = static.signals["nox_ppm"]
    assert nox.lag_cycles == 3
    assert nox.lag_at_bound
    assert nox.r2 == pytest.approx(0.694, abs=0.001)
    assert nox.residual_sd == pytest.approx(96.0, abs=0.5)
    late, early = static.predict([2.0, -2.0])["nox_ppm"].to_numpy()
    assert (early - late) / 4.0 == pytest.approx(30.0, abs=0.5)


def test_the_sensor_lag_hid_two_fifths_of_the_nox_slope(measured):
    late, early = measured.predict([2.0, -2.0])["nox_ppm"].to_numpy()
    assert (early - late) / 4.0 == pytest.approx(50.0, abs=3.0)


def test_optima_of_the_measured_engine(measured):
    late, early = measured.predict([10.0, -6.0])["imep_bar"].to_numpy()
    assert (late, early) == pytest.approx((6.53, 7.30), abs=0.01)
    assert measured.predict([10.0, -7.0, -6.0])["supported"].values.tolist() == [False, False, True]
    best = measured.find_optimum("imep_bar")
    assert best["soi_cad"] == pytest.approx(-5.9, abs=0.1)
    assert best.values["mfb50_cad"] == pytest.approx(5.0, abs=0.3)
    assert best["soi_cad"] - best.bounds["soi_cad"][0] < 1.1
    held = measured.find_optimum("imep_bar", {"mprr": 5.0})
    assert held["soi_cad"] == pytest.approx(-2.2, abs=0.1)
    assert held.active_limits == ("mprr",)
    for weight in (0.0005, 0.001, 0.002):
        assert not measured.find_optimum({"imep_bar": 1.0, "nox_ppm": -weight}).at_bound


def test_nox_without_hydrogen_is_refused_not_negative(measured):
    starved = measured.predict(np.arange(-6.0, 10.0), {"doi_h2_ms": 0.5})
    assert not starved["supported"].any()
    assert (starved["nox_ppm"] >= 0.0).all()
    with pytest.raises(ParameterError, match=r"doi_h2_ms \[2\.5"):
        measured.predict(0.0, {"doi_h2_ms": 0.5}, outside="raise")


def test_the_virtual_engine_scatters_like_the_log(measured):
    engine, still = SurrogatePlant(measured, seed=5), SurrogatePlant(measured, residuals=False)
    drawn = []
    for _ in range(4000):
        noisy, clean = engine.step(0.0), still.step(0.0)
        drawn.append([noisy[name] - clean[name] for name in measured.signals])
    spread = np.array(drawn).std(axis=0) / [signal.residual_sd for signal in measured.signals.values()]
    assert ((spread > 0.7) & (spread < 1.3)).all()


def test_a_search_that_keeps_the_leverage_stays_inside_the_records(measured):
    names, support = measured.inputs, measured.support
    bounds = dict(zip(names, zip(support.lower, support.upper, strict=True), strict=True))
    asked_outside = []
    for seed in range(4):
        for keeps in (True, False):
            limits = [Limit("leverage_share", 1.0)] if keeps else []
            plant = SurrogatePlant(measured, limits=limits, inputs=names, outside="clamp", seed=seed)
            seeker = GaussianProcessSeeking(start=measured.medians, inputs=bounds, limits=limits, seed=seed)
            run = run_seeker(plant, seeker, 60)
            assert run.dataset["supported"].to_numpy().all()
            assert measured.evaluate(run.dataset["applied"].to_numpy())[1].all()
            inside = measured.evaluate(run.dataset["asked"].to_numpy())[1]
            asked_outside.append((keeps, 1.0 - inside.mean()))
            imep = measured.evaluate(run.dataset["applied"].to_numpy()[-10:])[0][:, 0].mean()
            assert imep > 8.0, "the medians give 7.0 bar, the best input 9.5"
    shares = np.array([[share for keeps, share in asked_outside if keeps is kept] for kept in (True, False)])
    assert shares[0].mean() < 0.1 < 0.3 < shares[1].mean()


def test_commands_of_the_records_hold_for_1_to_30_cycles() -> None:
    records = random_step_records(20_000)
    soi = records["soi_cad"].to_numpy()
    changes = np.flatnonzero(np.diff(soi)) + 1
    holds = np.diff(changes)  # two draws are never alike
    assert (holds.min(), holds.max()) == (1, 30)
    assert np.mean(holds) == pytest.approx(15.5, abs=4.0 * 8.66 / np.sqrt(holds.size))


# --- its file ----------------------------------------------------------------------------------------------
def test_a_surrogate_predicts_and_runs_bit_for_bit_after_a_file(known):
    again = EngineSurrogate.from_toml(known.to_toml())
    assert again.to_toml() == known.to_toml()
    grid = np.linspace(-8.0, 12.0, 41)
    one, two = known.predict(grid), again.predict(grid)
    assert one.equals(two)
    assert one.attrs == two.attrs
    assert again.quality().equals(known.quality())
    assert again.source == known.source
    assert again.signals["nox_ppm"].sensor == known.signals["nox_ppm"].sensor
    first, then = (SurrogatePlant(model, seed=3) for model in (known, again))
    assert [first.step(-4.0) for _ in range(150)] == [then.step(-4.0) for _ in range(150)]


def test_a_surrogate_file_is_checked(known):
    text = known.to_toml()
    with pytest.raises(DataError, match=r"\[signals\] names .*: each needs its table"):
        EngineSurrogate.from_toml(text.replace("[signal_imep_bar]", "[signal_work]"))
    at = text.index("lower = { value = [") + len("lower = { value = [")
    short = text[:at] + text[text.index(",", at) + 1 :]
    with pytest.raises(DataError, match=r"mine: \[support\] lower: has shape \(3,\): must be \(4,\)"):
        EngineSurrogate.from_toml(short, origin="mine")
