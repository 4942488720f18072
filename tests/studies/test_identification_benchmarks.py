"""Measured benchmarks: loaders, models and fits; those on measured data are skipped where the sets are missing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from mgdd import _core
from mgdd.datasets.files import path
from mgdd.errors import DataError, Interrupted, ParameterError, ShapeError
from mgdd.optimize import FitOptions
from mgdd.results import Fit
from mgdd.results.labels import labelled_dataset
from mgdd_studies import run_study
from mgdd_studies.benchmarks import records
from mgdd_studies.benchmarks.drive_axis import DriveModel, drive_free_run, drive_inverse_dynamics, fit_drive
from mgdd_studies.benchmarks.two_tanks import TwoTanksModel, fit_two_tanks
from mgdd_studies.benchmarks.wiener_hammerstein import (
    LinearApproximation,
    WienerHammersteinFit,
    fit_linear,
    fit_wiener_hammerstein,
)

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
    "delay_samples": 0.0,
}
LEVELS = {"upper_level_v": 7.0, "lower_level_v": 3.0}
THREE = FitOptions(n_starts=3)
FITS: dict[str, tuple[Any, Callable[[], Fit], type[Fit]]] = {
    "drive": (
        _core.systems.DriveAxis,
        lambda: fit_drive(slide_record(SLIDE), friction="coulomb", drift=False, options=THREE),
        Fit,
    ),
    "tanks": (_core.systems.TwoTanks, lambda: fit_two_tanks(tanks_record(), options=THREE), Fit),
    "circuit": (
        _core.systems.WienerHammerstein,
        lambda: fit_wiener_hammerstein(
            circuit_record(), linear_order=2, first_order=1, last_order=1, n_curve=6, scan_samples=1500
        ),
        WienerHammersteinFit,
    ),
}


def slide_record(parameters: dict[str, float]) -> xr.Dataset:
    time = np.arange(3000) * 1e-3
    drive = 2.0 * np.sign(np.sin(4.0 * time)) + 0.5 * np.sin(11.0 * time)
    model = DriveModel(parameters=parameters, force_n_per_v=35.0)
    return model.simulate({"time_s": time, "drive_v": drive}).assign(force_n_per_v=35.0)


def tanks_record() -> xr.Dataset:
    pump = 2.0 + np.sin(0.05 * np.arange(300))
    inputs = {"time_s": np.arange(300) * 4.0, "pump_v": pump}
    return TwoTanksModel(parameters=TANKS).simulate(inputs, initial_state=LEVELS)


def circuit_record() -> xr.Dataset:
    u = np.convolve(np.random.default_rng(1).standard_normal(2003), np.ones(4) / 4.0, "valid")
    x, y = np.zeros(2000), np.zeros(2000)
    for k in range(1, 2000):
        x[k] = 0.9 * x[k - 1] + 0.1 * u[k]
        y[k] = 0.3 * y[k - 1] + 0.7 * np.tanh(4.0 * x[k])
    values = {"input_v": ("time_s", u, "V", "input"), "output_v": ("time_s", y, "V", "output")}
    return labelled_dataset({"time_s": ("time_s", np.arange(2000) * 1e-3, "s", "time"), **values})


def rms(values: np.ndarray[Any, Any]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_a_slide_is_found_again() -> None:
    fit = fit_drive(slide_record(SLIDE), friction="coulomb", drift=False, options=FitOptions(n_starts=2))
    for name, value in SLIDE.items():
        assert fit.model.parameters[name] == pytest.approx(value, rel=0.02, abs=0.05), name
    assert fit.train.nrmse_fit_percent > 99.8
    assert fit.report.names[0] == "mass_kg"
    assert fit.report.nrmse_fit_percent == pytest.approx(fit.train.nrmse_fit_percent, abs=1e-9)
    assert fit.start_rmse == tuple(sorted(fit.start_rmse))
    assert fit.plot(ax=Figure().add_subplot()).get_ylabel() == "position, measured [m]"


def test_a_slide_rests_under_its_friction() -> None:
    time = np.arange(100) * 1e-3
    model = DriveModel(parameters=SLIDE, force_n_per_v=35.0)
    weak, strong = (model.simulate({"time_s": time, "drive_v": np.full(100, v)})["position_m"] for v in (0.5, 0.7))
    assert not weak.any()
    assert strong[-1] > 0.0


def test_wrong_drive_input_is_named_then_right_works() -> None:
    record = slide_record(SLIDE)
    with pytest.raises(ParameterError, match="friction = 'dry': must be one of coulomb"):
        fit_drive(record, friction="dry")
    with pytest.raises(ParameterError, match="n_starts = 0"):
        fit_drive(record, options=FitOptions(n_starts=0))
    with pytest.raises(ParameterError, match="'weight_kg': must be one of mass_kg"):
        DriveModel(parameters={"weight_kg": 1.0}, force_n_per_v=1.0).simulate(record)
    model = DriveModel(parameters=SLIDE, force_n_per_v=35.0)
    with pytest.raises(DataError, match="uneven sampling"):
        model.simulate({"time_s": [0.0, 0.1, 0.3], "drive_v": [0.0, 0.0, 0.0]})
    with pytest.raises(ShapeError, match="columns of one length"):
        model.simulate({"time_s": [0.0, 0.1, 0.2], "drive_v": [0.0, 0.0]})
    assert model.simulate({"time_s": [0.0, 0.1, 0.2], "drive_v": [0.0, 0.0, 0.0]})["position_m"].shape == (3,)


def test_two_tanks_know_their_start_and_their_names() -> None:
    model, record = TwoTanksModel(parameters=TANKS), tanks_record()
    assert model.estimate_state(record) == pytest.approx(LEVELS, abs=1e-4)
    with pytest.raises(DataError, match="window = 400"):
        model.estimate_state(record, window=400)
    with pytest.raises(ParameterError, match="form = 'cube_root'"):
        fit_two_tanks(record, form="cube_root")
    with pytest.raises(ParameterError, match="unknown or missing"):
        TwoTanksModel(parameters={"pump_per_s": 1.0}).simulate(record)


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


def press_ctrl_c(monkeypatch: pytest.MonkeyPatch, system: Any, at: int, *, within: bool) -> None:
    """Let the search of a number be cut short, with its part or before it has any."""
    whole, calls = system.fit, []

    def fit(self: Any, **how: Any) -> Any:
        calls.append(how)
        if len(calls) < at:
            return whole(self, **how)
        raise Interrupted("interrupted", whole(self, **how) if within else None)

    monkeypatch.setattr(system, "fit", fit)


@pytest.mark.parametrize("within", [True, False])
@pytest.mark.parametrize("name", FITS)
def test_ctrl_c_leaves_the_fit_so_far(monkeypatch: pytest.MonkeyPatch, name: str, within: bool) -> None:
    system, call, kind = FITS[name]
    press_ctrl_c(monkeypatch, system, 2, within=within)
    with pytest.raises(Interrupted, match=r"what was finished is in \.partial") as stop:
        call()
    fit = stop.value.partial
    assert type(fit) is kind
    assert len(fit.start_rmse) == (2 if within else 1)
    assert fit.run is not None
    assert fit.summary()
    assert fit.to_toml()


@pytest.mark.parametrize("name", FITS)
def test_a_model_reads_what_its_fit_wrote(name: str) -> None:
    fit = FITS[name][1]()
    assert type(fit.model).from_toml(fit.to_toml()).to_toml() == fit.model.to_toml()


def test_a_linear_approximation_comes_back() -> None:
    poles = {"numerator": np.array([0.5, 0.1]), "denominator": np.array([1.0, -1 / 3])}
    model = LinearApproximation(**poles, input_mean=0.1, output_mean=1.0, rmse=0.2)
    assert LinearApproximation.from_toml(model.to_toml()).to_toml() == model.to_toml()


@pytest.mark.parametrize("name", FITS)
def test_ctrl_c_before_anything_is_found_leaves_nothing(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    system, call, _ = FITS[name]
    press_ctrl_c(monkeypatch, system, 1, within=False)
    with pytest.raises(Interrupted) as stop:
        call()
    assert stop.value.partial is None
    monkeypatch.undo()
    assert call().report.success


def test_ctrl_c_in_the_last_fit_of_the_circuit(monkeypatch: pytest.MonkeyPatch) -> None:
    system, call, kind = FITS["circuit"]
    searches = len(call().start_rmse) + 1
    for within in (True, False):
        press_ctrl_c(monkeypatch, system, searches, within=within)
        with pytest.raises(Interrupted) as stop:
            call()
        monkeypatch.undo()
        assert type(stop.value.partial) is kind
        assert stop.value.partial.report.residual.size == (1900 if within else 1400)


def test_ctrl_c_leaves_the_levels_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    press_ctrl_c(monkeypatch, _core.systems.TwoTanks, 2, within=False)
    with pytest.raises(Interrupted) as stop:
        TwoTanksModel(parameters=TANKS).estimate_state(tanks_record())
    assert set(stop.value.partial) == set(LEVELS)


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
def test_emps_inverse_dynamics_and_free_run() -> None:
    train, test = records.read("emps")
    found = drive_inverse_dynamics(train, directional=False)
    # Figures of an independent inverse-dynamics fit with the same filter.
    assert found["mass_kg"] == pytest.approx(95.138, abs=0.1)
    assert found["viscous_ns_per_m"] == pytest.approx(204.08, abs=1.0)
    assert found["coulomb_n"] == pytest.approx(20.326, abs=0.1)
    assert found["offset_n"] == pytest.approx(-3.193, abs=0.02)
    fit = fit_drive(train, friction="directional", drift=True, options=FitOptions(n_starts=2))
    measured = test["position_m"].to_numpy()[20:]
    error = drive_free_run(fit.model, test) - measured
    percent = 100.0 * (1.0 - np.linalg.norm(error) / np.linalg.norm(measured - measured.mean()))
    assert fit.train.nrmse_fit_percent > 99.3
    assert 88.0 < percent < 97.0  # the valley between mass and friction is this wide on the other record


@needs["cascaded_tanks"]
def test_cascaded_tanks_from_the_stated_window() -> None:
    train, test = records.read("cascaded_tanks")
    fit = fit_two_tanks(train)
    assert fit.train.rmse == pytest.approx(0.1537, abs=5e-4)
    assert fit.report.rmse == pytest.approx(fit.train.rmse, rel=1e-9)
    state = fit.model.estimate_state(test, window=50)
    run = fit.model.simulate(test, initial_state=state)["level_v"]
    assert rms((run - test["level_v"]).to_numpy()) == pytest.approx(0.210, abs=2e-3)
    # The estimate of the start sees the window only.
    blind = test.copy(deep=True)
    blind["level_v"][50:] = 0.0
    assert fit.model.estimate_state(blind, window=50) == state


@pytest.mark.slow
@needs["wh2009"]
def test_the_circuit_below_a_millivolt() -> None:
    train, test = records.read("wh2009")
    assert (train.sizes["time_s"], test.sizes["time_s"]) == (100_000, 78_800)
    fit = fit_wiener_hammerstein(train.isel(time_s=slice(0, 20_000)), scan_samples=8000, follow=8)
    error = (fit.model.simulate(test)["output_v"] - test["output_v"]).to_numpy()[50:]
    assert rms(error) < 0.5e-3
    linear = (fit.linear.simulate(test)["output_v"] - test["output_v"]).to_numpy()[50:]
    assert 0.040 < rms(linear) < 0.050


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
