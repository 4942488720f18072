"""The study of model validation: laws of its stages and draws on traces that the model itself made, and a quick run."""

import functools
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from mgdd import datasets, presets
from mgdd.engine import OperatingPoint, find_optimum, simulate
from mgdd.identify.engine.records import CylinderFit
from mgdd.io import pressure_trace
from mgdd.results.labels import ANGLE
from mgdd_studies.base import StudyResult
from mgdd_studies.validation_fits import LAWS, Burn, Law, best_slopes, burns_of, meet, redraw

CYLINDER = presets.load("hd_diesel_128x144").cylinder
SINGLE = Law("Wiebe, linear gamma", {"burn_shape": "wiebe", "wall_heat_scale": 1.0})
TRUTH = CYLINDER.replace(**SINGLE.changes)


def made(fuel_mg: float, soi_cad: float, inlet_kpa: float, *, noise_bar: float = 0.0, seed: int = 0) -> xr.Dataset:
    """One load: it burns 2 °CA after the injection, for longer the more fuel it has."""
    length = 30.0 * (fuel_mg / 100.0) ** 0.4
    point = OperatingPoint(speed_rpm=1200.0, fuel_mg=fuel_mg, burn_duration_cad=length, intake_pressure_kpa=inlet_kpa)
    run = simulate(TRUTH, point, soc_cad=soi_cad + 2.0, step_cad=1.0)
    noise = noise_bar * np.random.default_rng(seed).standard_normal(run.sizes[ANGLE])
    noise[0] = 0.0
    trace = pressure_trace(run[ANGLE].to_numpy(), run["pressure_bar"].to_numpy() + noise, name=f"{fuel_mg:g} mg")
    mass = float(run.attrs["trapped_mass_g"])
    return trace.assign_attrs(speed_rpm=1200.0, trapped_mass_g=mass, soi_cad=soi_cad)


LOADS = ((60.0, -5.0, 170.0), (95.0, -8.0, 215.0), (130.0, -7.0, 260.0), (180.0, -11.0, 320.0))


@functools.cache
def noisy() -> CylinderFit:
    traces = [made(*load, noise_bar=0.3, seed=at) for at, load in enumerate(LOADS[1:3])]
    return Law("wall heat free", SINGLE.changes, ("wall_heat_scale",)).fit(traces, CYLINDER)


@functools.cache
def measured() -> CylinderFit:
    return LAWS[0].fit(datasets.read("hd_diesel_128x144"), CYLINDER)


def test_a_calibrated_model_meets_its_trace_as_the_fit_says() -> None:
    for load in measured().loads:
        met = meet(Burn.of(load), load)
        assert met.rmse_percent == pytest.approx(load.rmse_percent, rel=1e-9)
        assert met.imep_closed_error_percent == pytest.approx(load.imep_closed_error_percent, abs=0.7)  # to 123 °CA
        assert abs(met.largest_error_bar) == pytest.approx(abs(load.largest_error_bar), rel=1e-9)


def test_a_load_is_foretold_by_others_that_follow_one_law() -> None:
    traces = [made(*load) for load in LOADS]
    fit = SINGLE.fit(traces, CYLINDER)
    burns = burns_of(SINGLE, fit, traces, CYLINDER)
    for at, (burn, load) in enumerate(zip(burns["other loads"], fit.loads, strict=True)):
        fuel, soi, _ = LOADS[at]
        assert burn.soc_cad == pytest.approx(soi + 2.0, abs=0.1)
        assert burn.point.burn_duration_cad == pytest.approx(30.0 * (fuel / 100.0) ** 0.4, rel=0.02)
        assert burn.point.fuel_mg == pytest.approx(fuel, rel=0.02)
        assert meet(burn, load).rmse_percent < 0.3
        assert meet(burns["calibrated"][at], load).rmse_percent < 0.02
        assert meet(burns["heat release"][at], load).rmse_percent > 0.5


def test_the_loss_is_that_of_the_curvature_near_the_best_timing() -> None:
    burn = Burn.of(measured().loads[2])
    best, bend = burn.best
    assert burn.lost_percent(best) == pytest.approx(0.0, abs=1e-9)
    two_sided = 0.5 * (burn.lost_percent(best + 3.0) + burn.lost_percent(best - 3.0))
    assert two_sided == pytest.approx(-0.5 * bend * 9.0, rel=0.02)
    assert burn.moved("soc_cad", 4.0).best == pytest.approx(burn.best, abs=1e-6)


def test_slopes_say_how_far_the_best_timing_moves() -> None:
    law = LAWS[1]
    fit = law.fit(datasets.read("hd_diesel_128x144"), CYLINDER)
    slopes = best_slopes(fit)
    names = list(fit.report.names)
    heat = names.index("wall_heat_scale")
    for at, load in enumerate(fit.loads):
        scale = load.cylinder.wall_heat_scale
        moved = [load.cylinder.replace(wall_heat_scale=scale + by) for by in (-0.1, 0.1)]
        low, high = (find_optimum(own, load.point, "imep_closed_bar", step_cad=0.25)["ca50_cad"] for own in moved)
        assert slopes[at, heat] == pytest.approx((high - low) / 0.2, rel=0.1)
        strange = [k for k, name in enumerate(names) if "[" in name and f"[{load.file}]" not in name]
        assert strange
        assert not slopes[at, strange].any()


def covered(fit: CylinderFit, block_cad: float | None) -> tuple[float, float]:
    """Say how often stated intervals hold the parameters and the best timing of 60 draws."""
    slopes, known = best_slopes(fit), np.isfinite(fit.report.stderr)
    best = np.array([Burn.of(load).best[0] for load in fit.loads])
    draws = [redraw(fit, np.random.default_rng(seed), block_cad=block_cad, slopes=slopes) for seed in range(60)]
    values = [np.abs(one.values - fit.report.values)[known] <= 1.96 * one.stderr[known] for one in draws]
    return float(np.mean(values)), float(
        np.mean([np.abs(one.best_ca50_cad - best) <= 1.96 * one.stated_sd_cad for one in draws])
    )


def test_stated_intervals_hold_for_white_noise() -> None:
    assert covered(noisy(), None) == pytest.approx((0.95, 0.95), abs=0.05)


def test_stated_intervals_do_not_hold_for_what_a_wrong_burn_law_leaves() -> None:
    parameters, best = covered(SINGLE.fit(datasets.read("hd_diesel_128x144")[1:3], CYLINDER), 30.0)
    assert parameters < 0.7
    assert best < 0.7


def test_redrawn_errors_have_the_size_of_the_residual_and_bartletts_memory() -> None:
    from mgdd_studies.validation_fits import _disturbed

    load, trace = measured().loads[1], measured().request.traces[1]
    model, error = (load.overlay[name].to_numpy() for name in ("model_bar", "residual_bar"))
    rng = np.random.default_rng(5)
    factors = np.array([
        (_disturbed(trace, load, rng, 30.0)["pressure_bar"].to_numpy() - model)[5:] / error[5:] for _ in range(2000)
    ])  # fmt: skip
    assert factors.std(axis=0) == pytest.approx(np.ones(factors.shape[1]), abs=0.08)
    for apart, correlation in ((10, 2.0 / 3.0), (20, 1.0 / 3.0), (40, 0.0)):
        assert np.mean(factors[:, 100] * factors[:, 100 + apart]) == pytest.approx(correlation, abs=0.08)


@pytest.fixture(scope="module")
def result(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("model-validation")


@pytest.mark.slow
def test_what_a_quick_run_shows(result: StudyResult) -> None:
    rows = {(row["law"], row["stage"], row["file"]): row for row in result.summary["rows"]}
    assert len(rows) == 4 * 3 * 4
    reference = LAWS[0].name
    for (law, stage, file), row in rows.items():
        assert row["lost_percent"] >= -1e-9
        assert row["curvature_ratio"] == pytest.approx(1.0, abs=0.2)  # the shape carries over, calibrated or not
        if stage == "calibrated":
            assert row["rmse_percent"] < rows[law, "heat release", file]["rmse_percent"]
        if (law, stage) == (reference, "calibrated"):
            assert row["best_ca50_error_cad"] == 0.0
    spread = {(row["law"], row["file"]): row for row in result.summary["spread"]}
    assert len(spread) == 16
    assert all(
        row["redrawn_sd_cad_low"] < row["redrawn_sd_cad"] < row["redrawn_sd_cad_high"] for row in spread.values()
    )
    calibrated = result.dataset.sel(stage="calibrated")
    away = result.dataset["redrawn_ca50_cad"] - calibrated["best_ca50_cad"]
    lost = (-0.5 * calibrated["curvature_percent"] * away**2).quantile(0.95, dim="draw")
    for (law, file), row in spread.items():
        assert row["lost_p95_percent"] == pytest.approx(float(lost.sel(law=law, file=file)), rel=1e-9)
    for row in result.summary["coverage"]:
        assert row["block_parameters_share"] < row["white_parameters_share"]
