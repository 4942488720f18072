"""`mgdd map`: the chain from a design to a DCM file, each step against the Python interface called directly."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from map_cases import sweep as map_sweep
from mgdd import presets
from mgdd.cli import main
from mgdd.cli.map_files import map_content
from mgdd.design import FeasibleRegion, design_points
from mgdd.io.binary_files import write_netcdf
from mgdd.io.point_table import read_points
from mgdd.maps import apply_map, compare_maps, optimize_map, read_map, smooth_map
from mgdd.results.labels import to_jsonable
from mgdd.surrogate import ResponseModel, fit_response
from mgdd.sweep import sweep
from typed import Capsys, ran

RANGES = {"speed_rpm": (1000.0, 3000.0), "fuel_mg": (6.0, 30.0), "soc_cad": (-16.0, 4.0)}
OVER = [word for name, (low, high) in RANGES.items() for word in ("--over", f"{name}={low:g}:{high:g}")]
GRID = ["--over", "speed_rpm=1200,1700,2600", "--over", "fuel_mg=10:26:4", "--over", "soc_cad=-12:2:29"]
RESPONSES = ("efficiency_gross", "p_max_bar")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the whole chain was run once, from design to smooth map."""
    folder = tmp_path_factory.mktemp("chain")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        commands = [
            ["design", *OVER, "--points", "64", "--seed", "3", "--limit", "p_max_bar=140", "-o", "design.csv"],
            ["fit", "points.nc", "--response", "efficiency_gross", "--degree", "3", "-o", "efficiency.toml"],
            ["fit", "points.nc", "--response", "p_max_bar", "--degree", "3", "-o", "p_max.toml"],
            ["predict", "efficiency.toml", "p_max.toml", *GRID, "--extrapolate", "-o", "table.nc"],
            ["optimize", "table.nc", "--maximize", "efficiency_gross", "--along", "soc_cad", "--limit",
             "p_max_bar=105", "--max-loss", "0.002", "-o", "best.nc"],
            ["smooth", "best.nc", "--slope-limit", "speed_rpm=0.006", "--slope-limit", "fuel_mg=0.7", "-o",
             "smooth.nc"],
        ]  # fmt: skip
        for command in commands:
            assert main(["map", *command, "--quiet"]) == 0, command
            if command[0] == "design":
                points = ["--points", "design.csv", "--outputs", ",".join(RESPONSES), "-o", "points.nc"]
                assert main(["engine", "sweep", *points, "--quiet"]) == 0
    return folder


def region() -> FeasibleRegion:
    preset = presets.load("puma_single")

    def indicators(columns: dict[str, Any]) -> dict[str, Any]:
        return {"p_max_bar": sweep(preset.cylinder, preset.point, columns, pointwise=True)["p_max_bar"].to_numpy()}

    return FeasibleRegion.of_model(indicators, {"p_max_bar": 140.0})


def test_the_design_is_that_of_the_library(chain: Path) -> None:
    expected = design_points(RANGES, 64, feasible=region(), seed=3)
    found = read_points(chain / "design.csv")
    np.testing.assert_array_equal(found["point"], expected["point"])
    for name in RANGES:
        np.testing.assert_array_equal(found[name], expected[name])
    assert (chain / "design.csv").read_text().splitlines()[0] == "point,speed_rpm,fuel_mg,soc_cad"


def test_the_points_are_simulated_as_they_stand(chain: Path) -> None:
    preset = presets.load("puma_single")
    plan = read_points(chain / "design.csv")
    expected = sweep(preset.cylinder, preset.point, plan, outputs=RESPONSES)
    with xr.open_dataset(chain / "points.nc", engine="scipy") as found:
        np.testing.assert_array_equal(found["p_max_bar"], expected["p_max_bar"])
        assert float(found["p_max_bar"].max()) <= 140.0
        assert set(RANGES) <= set(found.coords)


def test_the_models_are_those_of_the_library(chain: Path) -> None:
    table = read_points(chain / "points.nc")
    for response, file in zip(RESPONSES, ("efficiency.toml", "p_max.toml"), strict=True):
        expected = fit_response(table, response, factors=list(RANGES), degree=3).model
        found = ResponseModel.from_toml((chain / file).read_text())
        assert found.terms == expected.terms
        at = {"speed_rpm": [1100.0, 2500.0], "fuel_mg": [12.0, 25.0], "soc_cad": [-10.0, 1.0]}
        xr.testing.assert_identical(found.predict(at), expected.predict(at))


def test_the_grid_holds_what_the_models_say(chain: Path) -> None:
    model = ResponseModel.from_toml((chain / "p_max.toml").read_text())
    with xr.open_dataset(chain / "table.nc", engine="scipy") as table:
        assert dict(table.sizes) == {"speed_rpm": 3, "fuel_mg": 4, "soc_cad": 29}
        cell = table.isel(speed_rpm=2, fuel_mg=1, soc_cad=7)
        at = {name: float(cell[name]) for name in RANGES}
        expected = model.predict(at)
        for name, part in {"p_max_bar": "mean", "p_max_bar_sd": "sd", "p_max_bar_upper": "upper"}.items():
            assert float(cell[name]) == pytest.approx(float(expected[part][0]), rel=1e-12)
        assert at == {"speed_rpm": 2600.0, "fuel_mg": pytest.approx(10.0 + 16.0 / 3.0), "soc_cad": -8.5}


def test_optimum_and_smooth_map_are_those_of_the_library(chain: Path) -> None:
    with xr.open_dataset(chain / "table.nc", engine="scipy") as table:
        best = optimize_map(
            table, "efficiency_gross", limits={"p_max_bar": 105.0}, max_loss=0.002, provenance={"from": "table.nc"}
        )
        smooth = smooth_map(best, slope_limits={"speed_rpm": 0.006, "fuel_mg": 0.7})
        assert read_map(chain / "best.nc") == best
        assert read_map(chain / "smooth.nc") == smooth
        assert "p_max_bar" in best.cells["active_limit"]  # the limit acts
        assert float(apply_map(smooth, table)["loss"].max()) <= 0.002


def test_nothing_lies_beside_the_files(chain: Path) -> None:
    assert sorted(file.name for file in chain.iterdir()) == [
        "best.nc", "design.csv", "efficiency.toml", "p_max.toml", "points.nc", "smooth.nc", "table.nc",
    ]  # fmt: skip


# --- what is printed ----------------------------------------------------------------------------------------
def test_a_design_says_what_it_is(here: Path, capsys: Capsys) -> None:
    told = ran(capsys, "map", "design", *OVER, "--points", "16", "--limit", "p_max_bar=140")
    expected = design_points(RANGES, 16, feasible=region())
    assert told["points"] == 16
    assert told["feasible_share"] == expected.attrs["feasible_share"] < 1.0
    assert told["least_distance"] == expected.attrs["least_distance"]
    assert told["columns"]["soc_cad"] == expected["soc_cad"].values.tolist()
    assert told["limits"] == {"p_max_bar": 140.0}
    assert 120.0 < told["highest"]["p_max_bar"] <= 140.0
    assert told["file"] is None
    assert list(here.iterdir()) == []


def test_a_design_is_extended_and_numbered_on(here: Path, capsys: Capsys) -> None:
    ran(capsys, "map", "design", *OVER, "--method", "maximin", "--points", "8", "-o", "first.csv")
    told = ran(
        capsys, "map", "design", *OVER, "--method", "lhs", "--points", "5", "--extend", "first.csv", "-o", "more.nc"
    )
    first, more = read_points(here / "first.csv"), read_points(here / "more.nc")
    expected = design_points(RANGES, 5, method="lhs", existing=first)
    np.testing.assert_array_equal(more["speed_rpm"], expected["speed_rpm"])
    assert more["point"].values.tolist() == [8, 9, 10, 11, 12]
    assert told["existing"] == 8
    assert told["file"] == "more.nc"


def test_levels_and_methods(capsys: Capsys) -> None:
    over = ["--over", "speed_rpm=1000:3000:2", "--over", "fuel_mg=6,10,25", "--over", "soc-cad=-8:4"]
    told = ran(capsys, "map", "design", *over, "--method", "factorial")
    assert told["points"] == 2 * 3 * 3
    assert sorted(set(told["columns"]["fuel_mg"])) == [6.0, 10.0, 25.0]
    assert sorted(set(told["columns"]["soc_cad"])) == [-8.0, -2.0, 4.0]
    told = ran(capsys, "map", "design", *over, "--method", "d_optimal", "--points", "12", "--model", "linear")
    assert told["n_terms"] == 4
    assert set(told["columns"]["speed_rpm"]) == {1000.0, 3000.0}
    assert told["d_efficiency_percent"] == pytest.approx(100.0, abs=0.1)
    told = ran(capsys, "map", "design", *over, "--points", "6")
    assert "powers of two" in told["warnings"][0]


def test_a_fit_says_how_good_it_is(chain: Path, here: Path, capsys: Capsys) -> None:
    table = str(chain / "points.nc")
    options = ["--response", "p_max_bar", "--degree", "2", "--select", "press"]
    told = ran(capsys, "map", "fit", table, *options, "--figure", "fit.png", "-o", "fit.json")
    fit = fit_response(read_points(table), "p_max_bar", factors=list(RANGES), degree=2, select="press")
    assert fit.test is not None
    assert {name: told[name] for name in fit.to_dict()} == fit.to_dict()
    assert told["terms"] == list(fit.model.terms)
    assert told["points"] == 64
    assert told["left_out"] == 0
    assert told["unit"] == "bar"
    assert json.loads((here / "fit.json").read_text())["parameters"] == to_jsonable(fit.to_dict()["parameters"])
    assert (here / "fit.png").read_bytes().startswith(b"\x89PNG")


def test_a_bench_table_with_units_is_fitted(here: Path, capsys: Capsys) -> None:
    rng = np.random.default_rng(5)
    speed, fuel = rng.uniform(900.0, 3000.0, 24), rng.uniform(5.0, 30.0, 24)
    torque = 6.0 * fuel - 0.004 * speed + rng.normal(0.0, 0.3, 24)
    rows = ["Drehzahl;fuel_mg;Moment [Nm];Bemerkung", "1/min;mg;;"]
    rows += [f"{n:.1f};{m:.3f};{t:.2f};ok".replace(".", ",") for n, m, t in zip(speed, fuel, torque, strict=True)]
    (here / "bench.csv").write_text("\n".join(rows), encoding="latin-1")
    options = [
        "--response",
        "Moment",
        "--factors",
        "Drehzahl,fuel_mg",
        "--degree",
        "1",
        "--decimal",
        ",",
        "-o",
        "torque.toml",
    ]
    told = ran(capsys, "map", "fit", "bench.csv", *options)
    assert told["unit"] == "N m"
    assert told["terms"] == ["1", "Drehzahl", "fuel_mg"]
    model = ResponseModel.from_toml((here / "torque.toml").read_text())
    assert model.factors["Drehzahl"].units == "rpm"
    at = model.predict({"Drehzahl": 2000.0, "fuel_mg": 20.0})
    assert float(at["mean"][0]) == pytest.approx(112.0, abs=0.5)


def test_a_gaussian_process_goes_through_its_file(chain: Path, here: Path, capsys: Capsys) -> None:
    table = str(chain / "points.nc")
    options = ["--response", "efficiency_gross", "--kind", "gaussian_process", "--n-starts", "1"]
    told = ran(capsys, "map", "fit", table, *options, "-o", "gp.toml")
    assert set(told["length_scales"]) == set(RANGES)
    model = ResponseModel.from_toml((here / "gp.toml").read_text())
    assert model.kind == "gaussian_process"
    ran(capsys, "map", "predict", "gp.toml", "--points", table, "-o", "at.csv")
    expected = model.predict(read_points(table))
    inside = ~expected["extrapolated"].values
    at = np.genfromtxt(here / "at.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(at["efficiency_gross"][inside], expected["mean"].values[inside])
    assert at.dtype.names is not None
    assert at.dtype.names[:4] == ("point", *RANGES)


def test_points_without_a_value_are_left_out_and_counted(
    here: Path, capsys: Capsys, caplog: pytest.LogCaptureFixture
) -> None:
    table = map_sweep().isel(soc_cad=slice(30, 50, 4))
    table["p_max_bar"].values[1, 2, 3] = np.nan
    write_netcdf(table, here / "grid.nc")
    told = ran(capsys, "map", "fit", "grid.nc", "--response", "p_max_bar", "--degree", "1")
    cells = int(np.prod([*table.sizes.values()]))
    assert (told["points"], told["left_out"]) == (cells - 1, 1)
    assert f"1 of {cells} points have no value (NaN) and are left out" in caplog.text
    assert told["factors"] == ["speed_rpm", "fuel_mg", "soc_cad"]  # the axes of the grid
    assert told["test"]["rmse"] < 1e-9  # the law is linear


def test_what_is_extrapolated_is_left_empty_and_said(chain: Path, here: Path, capsys: Capsys) -> None:
    over = ["--over", "speed_rpm=1000:4000:4", "--over", "fuel_mg=20:20:1", "--over", "soc_cad=-6:0:3"]
    told = ran(capsys, "map", "predict", str(chain / "p_max.toml"), *over, "-o", "table.nc")
    assert told["points"] == 12
    assert told["extrapolated"]["p_max_bar"] >= 3
    with xr.open_dataset(here / "table.nc", engine="scipy") as table:
        assert int(np.isnan(table["p_max_bar"]).sum()) == told["extrapolated"]["p_max_bar"]
        assert np.isnan(table["p_max_bar_upper"].sel(speed_rpm=4000.0)).all()
    told = ran(capsys, "map", "predict", str(chain / "p_max.toml"), *over, "--extrapolate", "-o", "all.nc")
    with xr.open_dataset(here / "all.nc", engine="scipy") as table:
        assert np.isfinite(table["p_max_bar"]).all()
    assert "kept" in told["warnings"][0]


def test_a_map_of_predictions_says_so(chain: Path, here: Path, capsys: Capsys) -> None:
    over = ["--over", "speed_rpm=1000:4000:4", "--over", "fuel_mg=20:20:1", "--over", "soc_cad=-6:0:3"]
    ran(capsys, "map", "predict", str(chain / "p_max.toml"), *over, "--extrapolate", "-o", "all.nc")
    with xr.open_dataset(here / "all.nc", engine="scipy") as table:
        write_netcdf(table.isel(fuel_mg=0, drop=True).load(), here / "plane.nc")
    ran(capsys, "map", "export", "plane.nc", "--name", "p_max_bar", "-o", "map.nc")
    source = read_map(here / "map.nc").cells["source"]
    assert set(source[-1]) == {"extrapolated"}  # 4000 rpm were never driven
    assert "predicted" in source
    assert not {"measured", "given"} & set(source.ravel())


def test_what_is_printed_is_all_of_the_map(here: Path, capsys: Capsys) -> None:
    write_netcdf(map_sweep(), here / "table.nc")
    options = ["--minimize", "p_max_bar", "--limit", "efficiency_gross=0.49", "--sd", "p_max_bar=0.5"]
    told = ran(capsys, "map", "optimize", "table.nc", *options)
    best = optimize_map(
        map_sweep(), "p_max_bar", maximize=False, limits={"efficiency_gross": 0.49}, sd={"p_max_bar": 0.5},
        provenance={"from": "table.nc"},
    )  # fmt: skip
    assert {key: told[key] for key in map_content(best)} == to_jsonable(map_content(best))
    assert sum(told["n_held"].values()) == int((best.cells["active_limit"] != "").sum())


def test_infeasible_cells_may_stay_empty(here: Path, capsys: Capsys) -> None:
    write_netcdf(map_sweep(), here / "table.nc")
    command = ["map", "optimize", "table.nc", "--maximize", "efficiency_gross", "--limit", "p_max_bar=110"]
    assert main(command) == 3
    assert "or pass --infeasible 'keep'" in capsys.readouterr().err
    told = ran(capsys, *command, "--infeasible", "keep", "--max-loss", "0.002", "-o", "best.nc")
    assert None in np.array(told["values"], dtype=object).ravel().tolist()
    told = ran(capsys, "map", "smooth", "best.nc", "--fill", "--weight", "2", "-o", "smooth.nc")
    with pytest.warns(UserWarning, match="extrapolated 3 cells"):
        expected = smooth_map(read_map(here / "best.nc"), weight=2.0, fill=True)
    assert read_map(here / "smooth.nc") == expected
    assert told["largest_shift"] == pytest.approx(
        float(np.nanmax(np.abs(expected.values - read_map(here / "best.nc").values)))
    )
    steps = np.diff(expected.axes["fuel_mg"])
    assert told["largest_slope"]["fuel_mg"] == pytest.approx(np.abs(np.diff(expected.values, axis=1) / steps).max())


def test_show_says_what_a_map_achieves(chain: Path, capsys: Capsys) -> None:
    smooth = read_map(chain / "smooth.nc")
    told = ran(capsys, "map", "show", str(chain / "smooth.nc"), "--sweep", str(chain / "table.nc"))
    with xr.open_dataset(chain / "table.nc", engine="scipy") as table:
        found = apply_map(smooth, table)
    assert list(told["achieved"]) == ["loss", "efficiency_gross", "p_max_bar"]
    assert told["achieved"]["loss"]["highest"] == pytest.approx(float(found["loss"].max()))
    worst = found["p_max_bar"].where(found["p_max_bar"] == found["p_max_bar"].max(), drop=True)
    at = told["achieved"]["p_max_bar"]["highest_at"]
    assert at == {name: float(worst[name][0]) for name in ("speed_rpm", "fuel_mg")}
    assert told["values"] == smooth.values.tolist()


def test_diff_is_that_of_the_library(chain: Path, here: Path, capsys: Capsys) -> None:
    files = str(chain / "best.nc"), str(chain / "smooth.nc")
    told = ran(capsys, "map", "diff", *files, "--tolerance", "0.5", "--figure", "diff.png", "-o", "diff.nc")
    expected = compare_maps(*map(read_map, files), tolerance=0.5)
    assert told["largest_difference"] == float(expected["largest_difference"])
    assert told["rms_difference"] == float(expected["rms_difference"])
    assert told["n_beyond"] == int(expected["n_beyond"]) > 0
    assert told["difference"] == expected["difference"].values.tolist()
    assert told["unit"] == "°CA"
    with xr.open_dataset(here / "diff.nc", engine="scipy") as found:
        np.testing.assert_array_equal(found["difference"], expected["difference"])
    assert (here / "diff.png").stat().st_size > 10_000
