"""Measured benchmarks: loaders, models and fits; those on measured data are skipped where the sets are missing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from mgdd.datasets.files import path
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify import DiscreteModel, SimulatorModel
from mgdd.optimize import FitOptions
from mgdd.results.labels import labelled_dataset
from mgdd_studies import run_study
from mgdd_studies.benchmarks import records
from mgdd_studies.benchmarks.drive_axis import drive_free_run, drive_inverse_dynamics, fit_drive, slide, slide_model
from mgdd_studies.benchmarks.two_tanks import fit_two_tanks, start_levels, two_tanks
from mgdd_studies.benchmarks.wiener_hammerstein import Circuit, fit_linear, fit_wiener_hammerstein

SETS = ("emps", "cascaded_tanks", "wh2009")
needs = {
    name: pytest.mark.skipif(name not in records.names(), reason=f"MGDD_DATA_DIR holds no folder {name}")
    for name in SETS
}
SLIDE = {"mass_kg": 90.0, "viscous_ns_per_m": 200.0, "coulomb_n": 21.0, "offset_n": 1.0}
TANKS = {
    "pump_per_s": 0.05,
    "upper_outflow_per_s": 0.01,
    "upper_exponent": 1.0,
    "lower_outflow_per_s": 0.05,
    "lower_exponent": 0.5,
    "lower_datum_v": 0.0,
    "upper_brim_v": 12.0,
    "overflow_share": 0.5,
}


def slide_record(parameters: dict[str, float]) -> xr.Dataset:
    time = np.arange(3000) * 1e-3
    drive = 2.0 * np.sign(np.sin(4.0 * time)) + 0.5 * np.sin(11.0 * time)
    model = slide_model(parameters, force_n_per_v=35.0)
    return model.simulate({"time_s": time, "drive_v": drive}).assign(force_n_per_v=35.0)


def tanks_record(pump: Any = None, levels: tuple[float, float] = (7.0, 3.0)) -> xr.Dataset:
    n = np.arange(300)
    inputs = {"time_s": n * 4.0, "pump_v": 2.0 + np.sin(0.05 * n) if pump is None else np.full(300, pump)}
    return two_tanks(TANKS, initial_state=levels).simulate(inputs)


def rms(values: np.ndarray[Any, Any]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_a_slide_is_found_again() -> None:
    fit = fit_drive(slide_record(SLIDE), friction="coulomb", drift=False, options=FitOptions(max_iterations=40))
    for name, value in SLIDE.items():
        assert fit.model.parameters[name] == pytest.approx(value, rel=0.02, abs=0.05), name
    assert fit.train.nrmse_fit_percent > 99.8
    assert fit.report.names[0] == "mass_kg"
    assert fit.plot(ax=Figure().add_subplot()).get_ylabel() == "position_m, measured [unit of position_m]"
    assert DiscreteModel.from_toml(fit.to_toml(), step=slide).parameters == fit.model.parameters


def test_a_slide_rests_under_its_friction() -> None:
    time = np.arange(100) * 1e-3
    model = slide_model(SLIDE, force_n_per_v=35.0)
    weak, strong = (model.simulate({"time_s": time, "drive_v": np.full(100, v)})["position_m"] for v in (0.5, 0.7))
    assert not weak.any()
    assert strong[-1] > 0.0


def test_a_slide_moves_as_newton_and_its_friction_have_it() -> None:
    """The closed form of a constant push: speed rises to (push - friction) / viscous, other in each direction."""
    time = np.arange(8000) * 1e-3
    model = slide_model(SLIDE | {"viscous_asymmetry_ns_per_m": -40.0, "offset_n": 0.0}, force_n_per_v=35.0)
    for volt, viscous in ((2.0, 160.0), (-2.0, 240.0)):
        position = model.simulate({"time_s": time, "drive_v": np.full(8000, volt)})["position_m"].to_numpy()
        speed = np.diff(position) / 1e-3
        steady = np.sign(volt) * (70.0 - 21.0) / viscous
        expected = steady * (1.0 - np.exp(-time[1:] * viscous / 90.0))
        np.testing.assert_allclose(speed, expected, atol=2e-3 * abs(steady))


def test_wrong_drive_input_is_named_then_right_works() -> None:
    record = slide_record(SLIDE)
    with pytest.raises(ParameterError, match="friction = 'dry': must be one of coulomb"):
        fit_drive(record, friction="dry")
    with pytest.raises(ParameterError, match="n_starts = 0"):
        fit_drive(record, options=FitOptions(n_starts=0))
    with pytest.raises(ParameterError, match="'weight_kg': must be one of mass_kg"):
        slide_model({"weight_kg": 1.0}, force_n_per_v=1.0)
    model = slide_model(SLIDE, force_n_per_v=35.0)
    with pytest.raises(DataError, match="uneven sampling"):
        model.simulate({"time_s": [0.0, 0.1, 0.3], "drive_v": [0.0, 0.0, 0.0]})
    with pytest.raises(DataError, match=r"sample_s = 0\.001"):
        model.simulate({"time_s": [0.0, 0.1, 0.2], "drive_v": [0.0, 0.0, 0.0]})
    with pytest.raises(ShapeError, match="columns of one length"):
        model.simulate({"time_s": [0.0, 0.1, 0.2], "drive_v": [0.0, 0.0]})
    assert model.simulate({"time_s": [0.0, 1e-3, 2e-3], "drive_v": [0.0] * 3})["position_m"].shape == (3,)


def test_two_tanks_know_their_start_and_their_names() -> None:
    model, record = two_tanks(TANKS), tanks_record()
    assert start_levels(model, record) == pytest.approx((7.0, 3.0), abs=1e-4)
    with pytest.raises(DataError, match="window = 400"):
        start_levels(model, record, window=400)
    with pytest.raises(ParameterError, match="form = 'cube_root'"):
        fit_two_tanks(record, form="cube_root")
    with pytest.raises(ParameterError, match="must be pump_per_s"):
        two_tanks({"pump_per_s": 1.0})


def test_two_tanks_come_to_rest_where_in_and_outflow_are_one() -> None:
    """Below the brim the pump feeds both outflows; above it the share of the overflow reaches the lower tank."""
    low = tanks_record(1.0, (1.0, 1.0))["level_v"].to_numpy()
    assert low[-1] == pytest.approx((0.05 / 0.05) ** 2, rel=1e-2)
    high = tanks_record(2.8, (12.0, 4.0))["level_v"].to_numpy()
    outflow = 0.01 * 12.0 + 0.5 * (0.05 * 2.8 - 0.01 * 12.0)
    assert high[-1] == pytest.approx((outflow / 0.05) ** 2, rel=1e-2)
    assert tanks_record(9.0, (12.0, 9.0))["level_v"].max() == 10.0


def test_a_circuit_is_its_two_filters_and_its_curve() -> None:
    """By the recursion of the filters, sample by sample, and a curve that is a cubic where its coefficients are one."""
    circuit = Circuit(first_order=1, last_order=2, n_curve=9, lower=-1.5, upper=1.5)
    u = 1.2 * np.sin(0.05 * np.arange(400))
    at = -1.5 + 0.5 * np.arange(-1, 8)
    filters = [-0.6, 0.1, -1.1, 0.4, 0.05, 0.1]
    x, w, y = (np.zeros(402) for _ in range(3))
    for k in range(2, 402):
        now, before = u[k - 2], u[k - 3] if k > 2 else 0.0
        x[k] = 0.6 * x[k - 1] + 0.1 * now + 0.3 * before
        w[k] = x[k] ** 3 - x[k] * 0.25  # whose coefficients on steps of 0.5 are the cubes of the places
        y[k] = 1.1 * y[k - 1] - 0.4 * y[k - 2] + 0.05 * w[k] + 0.1 * w[k - 1] + 0.15 * w[k - 2]
    run = circuit.model(np.r_[filters, at**3 - 0.5 * at]).simulate({"time_s": np.arange(400.0), "input_v": u})
    np.testing.assert_allclose(run["output_v"], y[2:], atol=1e-12)


def test_the_circuit_needs_orders_that_fit() -> None:
    rng = np.random.default_rng(1)
    values = {"input_v": rng.standard_normal(2000), "output_v": rng.standard_normal(2000)}
    record = labelled_dataset(
        {"time_s": ("time_s", np.arange(2000) * 1.0, "s", "time")}
        | {name: ("time_s", value, "V", name) for name, value in values.items()}
    )
    with pytest.raises(ParameterError, match="order = 11"):
        fit_linear(record, order=11)
    with pytest.raises(ParameterError, match="follow = 0"):
        fit_wiener_hammerstein(record, follow=0)
    with pytest.raises(DataError, match="raise the orders"):
        fit_wiener_hammerstein(record, linear_order=6, first_order=1, last_order=1)
    with pytest.raises(DataError, match="at least 1000"):
        fit_linear(record.isel(time_s=slice(0, 500)))


def test_missing_sets_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MGDD_DATA_DIR", raising=False)
    for name in ("emps", "cascaded_tanks", "wh2009"):
        with pytest.raises(FileNotFoundError, match="MGDD_DATA_DIR"):
            records.read(name)
    with pytest.raises(DataError, match="at least one of emps, cascaded_tanks, wh2009"):
        run_study("identification-benchmarks", quick=True)


def test_a_file_that_is_another_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    (tmp_path / "wh2009").mkdir()
    file = tmp_path / "wh2009" / "WienerHammerBenchmark.csv"
    file.write_text("a,b\n1,2\n")
    with pytest.raises(DataError, match="uBenchMark, yBenchMark were expected"):
        records.read("wh2009")
    file.write_text('"uBenchMark","yBenchMark",\n1,2,\n1,2,\n')
    with pytest.raises(DataError, match="needs 184000"):
        records.read("wh2009")


@needs["emps"]
def test_emps_inverse_dynamics() -> None:
    found = drive_inverse_dynamics(records.read("emps")[0], directional=False)
    # Figures of an independent inverse-dynamics fit with the same filter.
    assert found["mass_kg"] == pytest.approx(95.138, abs=0.1)
    assert found["viscous_ns_per_m"] == pytest.approx(204.08, abs=1.0)
    assert found["coulomb_n"] == pytest.approx(20.326, abs=0.1)
    assert found["offset_n"] == pytest.approx(-3.193, abs=0.02)


@pytest.mark.slow
@needs["emps"]
def test_emps_free_run() -> None:
    train, test = records.read("emps")
    fit = fit_drive(train)
    percent = {}
    for name, record in (("train", train), ("test", test)):
        measured = record["position_m"].to_numpy()[20:]
        error = drive_free_run(fit.model, record) - measured
        percent[name] = 100.0 * (1.0 - np.linalg.norm(error) / np.linalg.norm(measured - measured.mean()))
    assert percent["train"] > 99.4
    # 95.1 where this was written; the valley between mass and friction is this wide on the other record.
    assert percent["test"] > 94.0


@needs["cascaded_tanks"]
def test_cascaded_tanks_from_the_stated_window() -> None:
    train, test = records.read("cascaded_tanks")
    fit = fit_two_tanks(train)
    assert fit.train.rmse == pytest.approx(0.1533, abs=5e-4)
    assert fit.report.rmse == pytest.approx(fit.train.rmse, rel=1e-9)
    state = start_levels(fit.model, test, window=50)
    run = fit.model.simulate(test, initial_state=state)["level_v"]
    assert rms((run - test["level_v"]).to_numpy()) == pytest.approx(0.209, abs=2e-3)
    # The estimate of the start sees the window only.
    blind = test.copy(deep=True)
    blind["level_v"][50:] = 0.0
    assert start_levels(fit.model, blind, window=50) == state


@pytest.mark.slow
@needs["wh2009"]
def test_the_circuit_below_a_millivolt() -> None:
    train, test = records.read("wh2009")
    assert (train.sizes["time_s"], test.sizes["time_s"]) == (100_000, 78_800)
    some = train.isel(time_s=slice(0, 10_000))
    fit = fit_wiener_hammerstein(some)
    error = (fit.model.simulate(test)["output_v"] - test["output_v"]).to_numpy()[50:]
    assert rms(error) < 0.5e-3
    linear = (fit_linear(some).simulate(test)["output_v"] - test["output_v"]).to_numpy()[50:]
    assert 0.040 < rms(linear) < 0.050
    again = SimulatorModel.from_toml(fit.to_toml(), simulator=fit.model.simulator)
    assert again.simulate(test)["output_v"].identical(fit.model.simulate(test)["output_v"])


@needs["cascaded_tanks"]
def test_study_rows(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    source = path("cascaded_tanks", "dataBenchmark.csv")
    (tmp_path / "cascaded_tanks").symlink_to(source.parent)
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    result = run_study("identification-benchmarks", quick=True)
    rows = result.summary["rows"]
    assert result.summary["missing"] == ["emps", "wh2009"]
    assert [row["set"] for row in rows] == ["cascaded_tanks"] * 4
    for row in rows:
        assert {"set", "model", "train", "test", "metric", "unit", "published", "window"} <= set(row)
    assert rows[0]["test"] > 2.0 * rows[2]["test"]
    assert len(result.figures) == 1
    assert len(next(iter(result.figures.values())).axes) == 2
