"""The one result of a fit, its findings and its options, whatever was fitted."""

from __future__ import annotations

import functools
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from mgdd import datasets, presets
from mgdd.errors import DataError, ParameterError
from mgdd.identify import OdeModel, fit_cylinder, fit_model, identify_throttle
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.optimize import FitOptions, least_squares
from mgdd.optimize.least_squares import fit_options
from mgdd.results import Fit
from mgdd.results.finding import Finding
from mgdd.results.fit import FitQuality, Model
from mgdd.throttle import PseudoWiener

TIME = np.arange(4000) * 1e-3
DUTY = 0.12 + 0.2 * np.sin(2.0 * np.pi * TIME * (0.5 + TIME))


def log() -> xr.Dataset:
    return FirstPrincipleModel().simulate({"time_s": TIME, "duty": DUTY}, initial_state={"angle_deg": 30.0})


@functools.cache
def fits() -> dict[str, Fit]:
    once = FitOptions(n_starts=1)
    y = 2.0 * (1.0 - np.exp(-TIME / 0.5))
    record = {"time_s": TIME, "u": np.ones(TIME.size), "y": y}
    lag = OdeModel(
        derivative=lambda _t, x, u, p: (p[0] * u[0] - x) / p[1],
        parameters={"gain": 1.0, "tau_s": 1.0},
        initial_state=(0.0,),
    )
    return {
        "first_principle": identify_throttle(log(), "first_principle", test=log(), options=once),
        "pw_r": identify_throttle(log(), test=log(), limp_home_deg=8.0, options=once),
        "ode": fit_model(lag, record),
        "cylinder": fit_cylinder(datasets.read("hd_diesel_128x144")[:2], presets.load("hd_diesel_128x144").cylinder),
    }


KINDS = ("first_principle", "pw_r", "ode", "cylinder")


@pytest.mark.parametrize("kind", KINDS)
def test_every_fit_can_be_asked_the_same(kind: str, tmp_path: Path) -> None:
    fit = fits()[kind]
    assert isinstance(fit, Fit)
    assert isinstance(fit.train, FitQuality)
    plain = fit.to_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert set(plain["stderr"]) == set(fit.report.names)
    assert plain["findings"] == [finding.to_dict() for finding in fit.findings]
    for text in (fit.summary(), fit._repr_html_()):
        assert fit.kind in text
    assert all(str(finding) in fit.summary() for finding in fit.findings)
    assert fit.kind in repr(fit)
    ax = fit.plot(ax=Figure().add_subplot())
    assert ax.get_ylabel()
    fit.to_netcdf(tmp_path / "fit.nc")
    with xr.open_dataset(tmp_path / "fit.nc", engine="scipy") as back:
        np.testing.assert_array_equal(back["value"], fit.report.values)
        assert json.loads(back.attrs["train"]) == plain["train"]


@pytest.mark.parametrize("kind", ["first_principle", "pw_r"])
def test_a_fit_that_is_written_keeps_its_model_and_its_figures(kind: str) -> None:
    fit = fits()[kind]
    text = fit.to_toml()
    assert type(fit.model).from_toml(text) == fit.model
    assert "stderr" in text
    assert f"fitted to {fit.source}" in text
    assert pickle.loads(pickle.dumps(fit)).to_dict() == fit.to_dict()


def test_a_model_without_a_file_says_so() -> None:
    with pytest.raises(DataError, match="Cylinder has no parameter file"):
        fits()["cylinder"].to_toml()
    empty = Fit(report=fits()["ode"].report, model=None, kind="none")
    with pytest.raises(DataError, match="keeps no run to draw"):
        empty.plot()


@pytest.mark.parametrize("model", [FirstPrincipleModel(), PseudoWiener("pw_r")], ids=lambda model: model.kind)
def test_models_share_one_signature(model: Model) -> None:
    assert isinstance(model, Model)
    inputs = {"time_s": TIME, "duty": DUTY}
    run = model.simulate(inputs)
    xr.testing.assert_identical(run, model.simulate(xr.Dataset({"duty": ("time_s", DUTY)}, {"time_s": TIME})))
    xr.testing.assert_identical(run, model.simulate(inputs, initial_state={"angle_deg": 8.0}))
    assert float(run["angle_deg"][0]) == 8.0, "at rest at limp-home"
    ahead = model.predict(run, 20)
    np.testing.assert_array_equal(ahead["time_s"], TIME[20:])
    with pytest.raises(ParameterError, match="is not a state: must be one of angle_deg"):
        model.simulate(inputs, initial_state={"plate": 8.0})


def test_findings_of_the_search_know_their_names() -> None:
    def twins(x):
        return [x[0] + x[1] - 1.0, 2.0 * (x[0] + x[1]), x[2]], [[1, 1, 0], [2, 2, 0], [0, 0, 1]]

    report = least_squares(twins, [0.1, 0.2, 0.5], names=["a", "b", "c"], bounds=([-9, -9, 0.1], np.inf))
    found = {finding.code: finding for finding in report.findings}
    assert set(found["null_direction"].names) == {"a", "b"}
    assert found["at_bound"].names == ("c",)

    def near(x):
        rows = np.array([[1.0, 1.0, 0.0], [1.0, 1.001, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0005, 0.1]])
        return rows @ x - [1.0, 1.1, 0.3, 0.9], rows

    report = least_squares(near, [0.0, 0.0, 0.0], names=["a", "b", "c"])
    assert [(finding.code, finding.names) for finding in report.findings] == [("correlated", ("a", "b"))]
    assert str(Finding("code", (), "text")) == "text"


def test_options_keep_the_defaults_of_the_fit_and_refuse_what_it_lacks() -> None:
    assert fit_options(None, n_starts=4, seed=1).n_starts == 4
    chosen = fit_options(FitOptions(n_starts=2), n_starts=4, seed=1, tolerance=1e-9)
    assert (chosen.n_starts, chosen.seed, chosen.tolerance) == (2, 1, 1e-9)
    with pytest.raises(ParameterError, match="tolerance has no effect on this fit, which has n_starts, seed"):
        fit_options(FitOptions(tolerance=1e-3), n_starts=4, seed=1)
    for bad in ({"n_starts": 0}, {"seed": -1}, {"max_iterations": 0}, {"tolerance": float("nan")}):
        with pytest.raises(ParameterError, match=next(iter(bad))):
            FitOptions(**bad)
