"""Models of one response: closed forms against brute force, coverage, outliers, and what the fit says of itself."""

from __future__ import annotations

import builtins
import io
import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.stats import t

from mgdd.design import design_points
from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.plot.identification import response_diagnostics
from mgdd.results import Fit
from mgdd.results.labels import check_labels
from mgdd.surrogate import ResponseModel, fit_response
from mgdd.surrogate.polynomial import leverage_of
from mgdd.surrogate.process import ProcessSurface
from mgdd.surrogate.response_diagnostics import outlier_bound
from mgdd.sweep import sweep

FACTORS = {"speed_rpm": (1000.0, 3000.0), "fuel_mg": (5.0, 40.0), "soi_cad": (-20.0, 5.0)}
PLAN = design_points(FACTORS, 48, method="lhs", seed=2)
POINTS = np.column_stack([PLAN[name] for name in FACTORS])


def truth(points):
    s, f, soi = (np.asarray(points[name], dtype=float) for name in FACTORS)
    return 0.3 * f - 0.004 * (soi + 6.0) ** 2 + 1e-3 * s + 2e-5 * s * f


def measured(seed, sd=0.1, plan=PLAN):
    return truth(plan) + np.random.default_rng(seed).normal(0.0, sd, plan.sizes["point"])


def codes(fit):
    return [finding.code for finding in fit.findings]


# --- polynomial: closed forms -------------------------------------------------------------------------------
def test_a_polynomial_without_noise_is_recovered_with_its_terms():
    fit = fit_response(PLAN, truth(PLAN))
    assert fit.model.terms == ("1", "speed_rpm", "fuel_mg", "soi_cad", "speed_rpm*fuel_mg", "soi_cad^2")
    asked = design_points(FACTORS, 32, seed=9)
    np.testing.assert_allclose(fit.model.predict(asked)["mean"], truth(asked), rtol=1e-9)
    assert isinstance(fit, Fit)


@pytest.mark.parametrize("select", ["bic", "press"])
def test_selection_finds_the_terms_in_noise_and_keeps_factors_of_products(select):
    kept = [set(fit_response(PLAN, measured(seed), select=select).model.terms) for seed in range(20)]
    wanted = {"1", "speed_rpm", "fuel_mg", "soi_cad", "speed_rpm*fuel_mg", "soi_cad^2"}
    assert all(wanted <= terms for terms in kept)
    assert np.mean([len(terms - wanted) for terms in kept]) < 1.5
    for terms in kept:
        for term in terms:
            assert {part.split("^")[0] for part in term.split("*")} <= terms


def test_a_pure_product_brings_its_factors():
    y = (PLAN["fuel_mg"] - 22.5) * (PLAN["soi_cad"] + 7.5)
    assert {"fuel_mg", "soi_cad", "fuel_mg*soi_cad"} <= set(fit_response(PLAN, y.values).model.terms)


@pytest.mark.parametrize("select", ["bic", "all"])
def test_left_out_points_are_those_of_fits_without_them(select):
    y = measured(1)
    fit = fit_response(PLAN, y, select=select)
    basis = fit.model.surface.support.basis
    terms = basis(POINTS)
    n, p = terms.shape
    brute, studentised = np.empty(n), np.empty(n)
    for k in range(n):
        others = np.delete(np.arange(n), k)
        c, rss, *_ = np.linalg.lstsq(terms[others], y[others], rcond=None)
        brute[k] = terms[k] @ c
        spread = terms[k] @ np.linalg.inv(terms[others].T @ terms[others]) @ terms[k]
        studentised[k] = (y[k] - brute[k]) / np.sqrt(rss[0] / (n - 1 - p) * (1.0 + spread))
    np.testing.assert_allclose(fit.diagnostics["left_out"], brute, rtol=1e-9)
    np.testing.assert_allclose(fit.diagnostics["studentised"], studentised, rtol=1e-8)
    assert fit.test.rmse == pytest.approx(np.sqrt(np.mean((y - brute) ** 2)))
    assert fit.test.rmse > fit.train.rmse
    np.testing.assert_allclose(fit.diagnostics["leverage"].sum(), p)


def test_folds_repeat_the_whole_fit():
    y = measured(3)
    fit = fit_response(PLAN, y, folds=6, seed=4)
    order, out = np.random.default_rng(4).permutation(48), np.empty(48)
    for part in np.array_split(order, 6):
        others = np.setdiff1d(order, part)
        out[part] = fit_response(PLAN.isel(point=others), y[others]).model.predict(PLAN.isel(point=part))["mean"]
    assert fit.test.rmse == pytest.approx(np.sqrt(np.mean((y - out) ** 2)))
    assert fit.checked_by == "6-fold"
    assert "6-fold fit train" in fit.summary()


def test_mean_and_interval_are_those_of_the_textbook():
    """One factor, straight line: prediction interval of Bates and Watts, section 1.3, by its closed form."""
    x, y = np.array([1.0, 2.0, 4.0, 5.0, 9.0]), np.array([2.1, 3.7, 8.4, 9.6, 18.5])
    slope = np.cov(x, y, bias=True)[0, 1] / x.var()
    s = np.sqrt(np.sum((y - y.mean() - slope * (x - x.mean())) ** 2) / 3.0)
    at = np.array([3.0, 8.0])
    mean_sd = s * np.sqrt(1.0 / 5.0 + (at - x.mean()) ** 2 / np.sum((x - x.mean()) ** 2))
    found = fit_response({"x_mm": x}, y, degree=1, select="all").model.predict({"x_mm": at}, level=0.9)
    np.testing.assert_allclose(found["mean"], y.mean() + slope * (at - x.mean()))
    np.testing.assert_allclose(found["mean_sd"], mean_sd)
    np.testing.assert_allclose(found["sd"], np.hypot(mean_sd, s))
    np.testing.assert_allclose(found["upper"] - found["mean"], t.ppf(0.95, 3) * np.hypot(mean_sd, s))


def many_sets(n_sets, sd=0.1):
    """Residuals, noise estimates and coefficients of many noisy sets at once, by the normal equations."""
    basis = fit_response(PLAN, measured(0), select="all").model.surface.support.basis
    terms = basis(POINTS)
    sets = truth(PLAN)[:, None] + np.stack([measured(seed, sd) - truth(PLAN) for seed in range(n_sets)], axis=1)
    coefficients = np.linalg.solve(terms.T @ terms, terms.T @ sets)
    residual = sets - terms @ coefficients
    return basis, coefficients, residual, np.sum(residual**2, axis=0)


def test_intervals_hold_95_percent_of_new_measurements():
    basis, coefficients, _, rss = many_sets(3000)
    asked = design_points(FACTORS, 64, seed=11)
    points = np.column_stack([asked[name] for name in FACTORS])
    mean = basis(points) @ coefficients
    model = fit_response(PLAN, measured(0), select="all").model
    wide = t.ppf(0.975, 38) * np.sqrt(rss / 38.0) * np.sqrt(1.0 + model.surface.support.leverage(points))[:, None]
    for seed in range(3):
        found = fit_response(PLAN, measured(seed), select="all").model.predict(asked)
        np.testing.assert_allclose(found["lower"], (mean - wide)[:, seed], rtol=1e-7)
        np.testing.assert_allclose(found["upper"], (mean + wide)[:, seed], rtol=1e-7)
    new = truth(asked)[:, None] + np.random.default_rng(1).normal(0.0, 0.1, mean.shape)
    assert 0.947 < np.mean(np.abs(new - mean) < wide) < 0.953


def test_after_a_choice_of_terms_the_interval_is_only_a_little_short():
    asked = design_points(FACTORS, 64, seed=11)
    inside = []
    for seed in range(40):
        found = fit_response(PLAN, measured(seed)).model.predict(asked)
        new = truth(asked) + np.random.default_rng(10_000 + seed).normal(0.0, 0.1, 64)
        inside.append(np.mean((new > found["lower"]) & (new < found["upper"])))
    assert 0.91 < np.mean(inside) < 0.97


# --- findings -----------------------------------------------------------------------------------------------
def test_an_outlier_is_found_and_no_other_point():
    for seed in range(10):
        y = measured(seed)
        y[17] += 0.8
        fit = fit_response(PLAN, y)
        (found,) = [finding for finding in fit.findings if finding.code == "outlier"]
        assert "point 17" in found.names
        assert np.flatnonzero(fit.diagnostics["outlier"]).tolist()[0:1] == [17] or len(found.names) > 1


def test_clean_data_show_outliers_at_the_nominal_rate():
    basis, _, residual, rss = many_sets(3000)
    room = 1.0 - leverage_of(basis(POINTS))[:, None]
    studentised = residual / np.sqrt(room) / np.sqrt((rss - residual**2 / room) / 37.0)
    for seed in range(3):
        own = fit_response(PLAN, measured(seed), select="all").diagnostics
        np.testing.assert_allclose(own["studentised"], studentised[:, seed], rtol=1e-6)
    bound = float(own["outlier_bound"])
    assert bound == pytest.approx(t.isf(0.05 / 96.0, 37))
    assert 0.037 < np.mean(np.abs(studentised).max(axis=0) > bound) < 0.055


def test_clean_data_show_few_patterns():
    found = [codes(fit_response(PLAN, measured(seed), select="all")) for seed in range(150)]
    share = {code: np.mean([code in one for one in found]) for code in ("heteroscedastic", "structured")}
    assert share["heteroscedastic"] < 0.04
    assert share["structured"] < 0.07
    assert not any({"few_points", "poor_prediction", "high_leverage", "no_hull", "lack_of_fit"} & set(o) for o in found)


def test_without_freedom_no_point_is_called_an_outlier():
    assert np.isnan(outlier_bound(3, 1.0))
    fit = fit_response({"x": [0.0, 1.0, 3.0]}, [0.0, 1.1, 9.0], degree=1, select="all")
    assert not fit.diagnostics["outlier"].any()


def test_patterns_in_the_residuals_are_said():
    generator = np.random.default_rng(5)
    plan = design_points(FACTORS, 200, method="lhs", seed=5)
    y, order = truth(plan), np.arange(200.0)
    assert "heteroscedastic" in codes(fit_response(plan, y + 0.03 * y * generator.normal(size=200)))
    drift = fit_response(plan, y + 0.002 * order + generator.normal(0.0, 0.1, 200))
    assert any(f.code == "structured" and f.names == ("run order",) and "drift" in f.text for f in drift.findings)
    wave = fit_response(plan, y + 0.2 * np.sin(order / 5.0) + generator.normal(0.0, 0.1, 200))
    assert any(f.code == "structured" and "neighbours" in f.text for f in wave.findings)
    bent = fit_response(plan, np.exp(0.2 * y) + generator.normal(0.0, 0.1, 200), degree=1)
    assert any(f.code == "structured" and f.names == ("fitted",) for f in bent.findings)
    noise = fit_response(plan, generator.normal(size=200) + 0.1 * y)
    assert "poor_prediction" in codes(noise)


def test_lack_of_fit_is_judged_by_repeated_points():
    twice = xr.concat([PLAN, PLAN], "point")
    noise = np.random.default_rng(6).normal(0.0, 0.02, 96)
    assert "lack_of_fit" not in codes(fit_response(twice, truth(twice) + noise))
    assert "lack_of_fit" in codes(fit_response(twice, truth(twice) + noise, degree=1))


def test_few_points_and_points_that_stand_alone_are_said():
    x = np.r_[np.linspace(0.0, 1.0, 9), 40.0]
    y = x + np.random.default_rng(1).normal(0.0, 0.05, 10)
    alone = fit_response({"x": x}, y, select="all")
    (found,) = [finding for finding in alone.findings if finding.code == "high_leverage"]
    assert found.names == ("point 9",)
    assert "few_points" in codes(fit_response({"x": x[2:6]}, y[2:6], select="all"))
    plane = {"a": np.arange(12.0), "b": 2.0 * np.arange(12.0)}
    flat = fit_response(plane, np.sin(np.arange(12.0)))
    assert "no_hull" in codes(flat)
    assert flat.model.predict({"a": [3.0, 12.0], "b": [9.0, 9.0]})["extrapolated"].values.tolist()[1]


def test_extrapolation_is_flagged_outside_the_hull_inside_the_ranges():
    corner = {"a": [0.0, 1.0, 0.0, 0.5, 0.2, 0.1, 0.6], "b": [0.0, 0.0, 1.0, 0.5, 0.3, 0.7, 0.2]}
    model = fit_response(corner, np.array([0.0, 1.1, 2.0, 1.4, 0.9, 1.4, 1.1]), degree=1).model
    found = model.predict({"a": [0.3, 0.9, 2.0], "b": [0.3, 0.9, 0.0]})
    assert found["extrapolated"].values.tolist() == [False, True, True]
    assert found.attrs["remark"].startswith("2 of 3 points are extrapolated")
    assert "remark" not in model.predict({"a": 0.3, "b": 0.3}).attrs
    assert not model.predict(corner)["extrapolated"].any()


# --- forms --------------------------------------------------------------------------------------------------
def test_tables_of_all_kinds_give_the_same_fit_and_labels():
    y = measured(1)
    table = PLAN.assign(imep_bar=("point", y, {"units": "bar", "long_name": "IMEP of the run"}))
    one = fit_response(table, "imep_bar")
    assert one.model.label == ("bar", "IMEP of the run")
    frame = pd.DataFrame({name: PLAN[name].values for name in FACTORS} | {"imep_bar": y, "odd": np.arange(48.0)})
    for other in (
        fit_response(frame, "imep_bar", factors=list(FACTORS)),
        fit_response({name: PLAN[name].values.tolist() for name in FACTORS}, table["imep_bar"]),
        fit_response(PLAN, table["imep_bar"]),
    ):
        np.testing.assert_array_equal(other.report.values, one.report.values)
        assert other.model.name == "imep_bar"
    kept = PLAN["fuel_mg"] + y  # arithmetic may keep name and unit of a factor
    assert fit_response(PLAN, kept).model.name in ("response", "fuel_mg")
    assert "fuel_mg" in fit_response(PLAN, kept).model.factors
    assert fit_response(PLAN, kept).model.name == "response"


def test_a_sweep_is_fitted_over_its_inputs_and_over_nothing_else():
    axes = {"soc_cad": np.linspace(-14.0, 2.0, 7), "fuel_mg": np.linspace(8.0, 30.0, 5)}
    grid = sweep(Cylinder(), OperatingPoint(), axes)
    fits = {"grid": fit_response(grid, "efficiency_gross")}
    cases = {
        name: column.ravel() for name, column in zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True)
    }
    listed = sweep(Cylinder(), OperatingPoint(), cases, pointwise=True)
    fits["points"] = fit_response(listed, "efficiency_gross")
    table = pd.DataFrame({**cases, "efficiency_gross": listed["efficiency_gross"].to_numpy()})
    fits["told"] = fit_response(table, "efficiency_gross", factors=["soc_cad", "fuel_mg"])
    for fit in fits.values():
        assert tuple(fit.model.factors) == ("soc_cad", "fuel_mg")
        at = {"soc_cad": -5.0, "fuel_mg": 21.0}
        expected = fits["told"].model.predict(at)["mean"].item()
        assert fit.model.predict(at)["mean"].item() == pytest.approx(expected, rel=1e-9)
    assert tuple(fit_response(listed, listed["efficiency_gross"]).model.factors) == ("soc_cad", "fuel_mg")
    one = fit_response(grid, "efficiency_gross", factors=["soc_cad"])
    assert tuple(one.model.factors) == ("soc_cad",)
    assert tuple(fit_response(PLAN.assign(y=("point", truth(PLAN))), "y").model.factors) == tuple(FACTORS)


def test_a_fit_shows_writes_and_draws_itself(tmp_path):
    fit = fit_response(PLAN.assign(imep_bar=("point", measured(1))), "imep_bar")
    assert "polynomial fitted to imep_bar: leave-one-out fit train" in fit.summary()
    assert "soi_cad^2" in fit._repr_html_()
    json.dumps(fit.to_dict(), allow_nan=False)
    assert fit.to_dict()["test"]["rmse"] == fit.test.rmse
    fit.to_netcdf(tmp_path / "fit.nc")
    back = xr.load_dataset(tmp_path / "fit.nc")
    np.testing.assert_array_equal(back["left_out"], fit.diagnostics["left_out"])
    check_labels(fit.diagnostics)
    ax = fit.plot()
    assert len(ax.figure.axes) == 7
    assert [panel.get_xlabel() for panel in ax.figure.axes[-3:]][1] == "fuel [mg]"


def test_a_figure_marks_outliers_and_takes_given_axes():
    import matplotlib.pyplot as plt

    y = measured(1)
    y[5] += 1.0
    data = fit_response(PLAN, y).diagnostics
    figure, axes = plt.subplots(1, 2, figsize=(12, 8))
    drawn = response_diagnostics(data, ax=axes[1])
    assert drawn is axes[1]
    odd = next(line for line in figure.axes[2].lines if line.get_label() == "outlier")
    assert odd.get_xdata().tolist() == [5]
    assert odd.get_ydata()[0] == data["studentised"].values[5]
    cut = figure.axes[-1].lines[0]
    np.testing.assert_array_equal(cut.get_ydata(), data["cut_mean"].values[2])
    free = plt.figure().add_axes((0.1, 0.1, 0.8, 0.8))
    assert response_diagnostics(data, ax=free) is free
    with pytest.raises(DataError, match="no variable 'left_out'"):
        response_diagnostics(data.drop_vars("left_out"))


def test_a_polynomial_is_the_same_after_a_file():
    model = fit_response(PLAN.assign(imep_bar=("point", measured(1))), "imep_bar").model
    again = ResponseModel.from_toml(model.to_toml())
    assert again.to_toml() == model.to_toml()
    asked = design_points({name: (low - 1.0, high) for name, (low, high) in FACTORS.items()}, 64, seed=3)
    assert again.predict(asked).identical(model.predict(asked))
    assert repr(again) == repr(model)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('kind = "response"', 'kind = "engine"', "kind = 'engine'"),
        ("[polynomial]", "[spline]", "holds neither"),
        ("monomials = { value = [[0.0, 0.0]", "monomials = { value = [[0.0, 9.0]", "monomials: must be"),
        ("fuel_mg = { value = [", "fuel_mg = { value = [1.0, ", "fuel_mg: has shape"),
        ('unit = "bar"', 'unit = "Pa"', "unit = 'Pa'"),
    ],
)
def test_a_damaged_file_is_refused(old, new, text):
    toml = fit_response(PLAN.assign(imep_bar=("point", measured(1))), "imep_bar").model.to_toml()
    assert old in toml
    with pytest.raises((DataError, ParameterError), match=text):
        ResponseModel.from_toml(toml.replace(old, new))


# --- Gaussian process ---------------------------------------------------------------------------------------
def process_points(n=40, seed=1):
    plan = design_points({"x_mm": (0.0, 10.0), "y_bar": (1.0, 3.0)}, n, method="lhs", seed=seed)
    return plan, np.sin(plan["x_mm"].values) + 0.5 * plan["y_bar"].values ** 2


def surface(noise_sd=0.1):
    plan, y = process_points(25)
    points = np.column_stack([plan["x_mm"], plan["y_bar"]])
    y = y + np.random.default_rng(0).normal(0.0, noise_sd, 25)
    return ProcessSurface(
        points=points, values=y, offset=1.5, signal_sd=2.0, length_scales=np.array([2.0, 1.5]), noise_sd=noise_sd
    )


def test_left_out_points_of_a_process_are_those_without_them():
    whole = surface()
    left_out, studentised = whole.left_out()
    for k in (0, 7, 24):
        others = np.delete(np.arange(25), k)
        without = ProcessSurface(
            points=whole.points[others], values=whole.values[others], offset=1.5, signal_sd=2.0,
            length_scales=whole.length_scales, noise_sd=0.1,
        )  # fmt: skip
        mean, sd = without.predict(whole.points[[k]])
        assert left_out[k] == pytest.approx(mean[0], abs=1e-8)
        assert studentised[k] == pytest.approx((whole.values[k] - mean[0]) / np.hypot(sd[0], 0.1), rel=1e-6)


def test_a_process_is_that_of_scikit_learn():
    sk = pytest.importorskip("sklearn.gaussian_process", reason="scikit-learn is not installed: pip install 'mgdd[gp]'")
    own = surface()
    kernel = 4.0 * sk.kernels.Matern(own.length_scales, nu=2.5) + sk.kernels.WhiteKernel(0.01)
    other = sk.GaussianProcessRegressor(kernel, optimizer=None).fit(own.points, own.values - 1.5)
    asked = np.random.default_rng(3).uniform([0.0, 1.0], [12.0, 3.0], (50, 2))
    mean, sd = other.predict(asked, return_std=True)
    np.testing.assert_allclose(own.predict(asked)[0], 1.5 + mean, atol=1e-7)
    np.testing.assert_allclose(np.hypot(own.predict(asked)[1], 0.1), sd, rtol=1e-6)


def test_a_process_follows_a_response_that_no_low_polynomial_does():
    pytest.importorskip("sklearn", reason="scikit-learn is not installed: pip install 'mgdd[gp]'")
    plan, y = process_points(60)
    y = y + np.random.default_rng(2).normal(0.0, 0.05, 60)
    fit = fit_response(plan, y, kind="gaussian_process")
    rough = fit_response(plan, y, degree=3)
    assert fit.test.rmse < 0.15 < rough.test.rmse
    assert fit.report.values[fit.report.names.index("noise_sd")] == pytest.approx(0.05, rel=0.5)
    assert np.isfinite(fit.stderr["length_scale_x_mm"])
    assert "found by" in fit.report.message
    again = ResponseModel.from_toml(fit.model.to_toml())
    asked = {"x_mm": [2.0, 11.0], "y_bar": 2.0}
    assert again.predict(asked).identical(fit.model.predict(asked))
    assert again.predict(asked)["extrapolated"].values.tolist() == [False, True]
    json.dumps(fit.to_dict(), allow_nan=False)
    y[31] += 1.0
    odd = fit_response(plan, y, kind="gaussian_process", folds=5)
    assert "point 31" in next(finding for finding in odd.findings if finding.code == "outlier").names


def test_a_process_covers_new_measurements_and_says_what_is_straight():
    pytest.importorskip("sklearn", reason="scikit-learn is not installed: pip install 'mgdd[gp]'")
    inside = []
    for seed in range(8):
        plan, y = process_points(50, seed=seed)
        asked, wanted = process_points(64, seed=100 + seed)
        generator = np.random.default_rng(seed)
        fit = fit_response(plan, y + generator.normal(0.0, 0.1, 50), kind="gaussian_process", n_starts=2)
        found = fit.model.predict(asked)
        new = wanted + generator.normal(0.0, 0.1, 64)
        inside.append(np.mean((new > found["lower"]) & (new < found["upper"])))
    assert 0.90 < np.mean(inside) < 0.98
    idle = fit_response(plan, np.sin(plan["x_mm"].values) + generator.normal(0.0, 0.02, 50), kind="gaussian_process")
    (found,) = [finding for finding in idle.findings if finding.code == "at_bound"]
    assert found.names == ("length_scale_y_bar",)
    assert np.isnan(idle.stderr["length_scale_y_bar"])
    assert "few_points" in codes(fit_response(plan.isel(point=slice(12)), y[:12], kind="gaussian_process"))


def test_without_scikit_learn_the_extra_is_named(monkeypatch):
    import sys

    real = builtins.__import__

    def hidden(name, *more, **how):
        if name.split(".")[0] == "sklearn":
            raise ModuleNotFoundError("No module named 'sklearn'", name="sklearn")
        return real(name, *more, **how)

    for name in [name for name in sys.modules if name.split(".")[0] == "sklearn"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "sklearn", None)
    monkeypatch.setattr(builtins, "__import__", hidden)
    with pytest.raises(ImportError, match=r"a Gaussian process needs sklearn: pip install \"mgdd\[gp\]\""):
        fit_response(PLAN, measured(1), kind="gaussian_process")


# --- bad input ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"kind": "spline"}, "kind = .*one of polynomial, gaussian_process"),
        ({"degree": 0}, "degree = 0"),
        ({"degree": 5}, "degree = 5"),
        ({"degree": True}, "degree = True"),
        ({"select": "aic"}, "select = .*bic, press, all"),
        ({"folds": 1}, "folds = 1"),
        ({"folds": 49}, r"folds = 49: must be a whole number in \[2, 48\]"),
        ({"n_starts": 0}, "n_starts = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"factors": ["fuel_mg", "fuel_mg"]}, "each once"),
        ({"factors": "fuel_mg"}, "factors = "),
        ({"factors": []}, "at least one"),
    ],
)
def test_bad_requests_are_named(options, text):
    with pytest.raises(ParameterError, match=text):
        fit_response(PLAN, measured(1), **options)


def test_bad_records_are_named():
    y = measured(1)
    for value, text in ((np.nan, "response: point 3 is not finite"), (np.inf, "not finite")):
        bad = y.copy()
        bad[3] = value
        with pytest.raises(DataError, match=text):
            fit_response(PLAN, bad)
    with pytest.raises(DataError, match="response is 4 at every point"):
        fit_response(PLAN, np.full(48, 4.0))
    with pytest.raises(DataError, match="b does not vary"):
        fit_response({"a": [1.0, 2.0, 3.0], "b": [1.0, 1.0, 1.0]}, [1.0, 2.0, 4.0])
    with pytest.raises(DataError, match="fuel_mg: sample 2 is not a finite number"):
        fit_response({"fuel_mg": [1.0, 2.0, np.nan]}, [1.0, 2.0, 4.0])
    with pytest.raises(DataError, match="no response 'torque_nm': they have speed_rpm, fuel_mg, soi_cad"):
        fit_response(PLAN, "torque_nm")
    with pytest.raises(ShapeError, match=r"response has shape \(47,\): must have one value per point, \(48,\)"):
        fit_response(PLAN, y[:-1])
    with pytest.raises(DataError, match="10 points for 10 terms: at least 11 are needed"):
        fit_response(PLAN.isel(point=slice(10)), y[:10], select="all")
    with pytest.raises(DataError, match="do not separate the 3 terms"):
        fit_response({"x": np.tile([0.0, 1.0], 4)}, np.arange(8.0), select="all")
    with pytest.raises(ParameterError, match="none of point, mean"):
        fit_response({"mean": [1.0, 2.0, 3.0]}, [1.0, 2.0, 4.0])
    with pytest.raises(ParameterError, match="points = "):
        fit_response([1.0, 2.0], [1.0, 2.0])


def test_bad_predictions_are_named():
    model = fit_response(PLAN, measured(1)).model
    with pytest.raises(DataError, match="points have no soi_cad: needed are speed_rpm, fuel_mg, soi_cad"):
        model.predict({"speed_rpm": 1500.0, "fuel_mg": 20.0})
    with pytest.raises(DataError, match="soi_cad"):
        model.predict({"speed_rpm": 1500.0, "fuel_mg": 20.0, "soi_cad": np.nan})
    with pytest.raises(ShapeError, match="columns of one length"):
        model.predict({"speed_rpm": [1500.0, 1600.0], "fuel_mg": [20.0, 21.0, 22.0], "soi_cad": 0.0})
    for level in (0.0, 1.0, float("nan")):
        with pytest.raises(ParameterError, match="level"):
            model.predict(PLAN, level=level)
    assert io.StringIO(repr(model)).readline().startswith("ResponseModel response polynomial")
