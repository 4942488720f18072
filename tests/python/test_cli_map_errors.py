"""`mgdd map`: what is refused names field, value and remedy, in the words of the options, and writes nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from map_cases import sweep as map_sweep
from map_cases import timing_table
from mgdd.cli import main
from mgdd.io.binary_files import write_netcdf
from mgdd.maps import CalibrationMap, optimize_map, write_map
from mgdd.surrogate import fit_response

BENCH = """speed_rpm,fuel_mg,p_max_bar,flat_k,hole_bar
900,6,60,300,61
1500,12,75,300,
2100,20,99,300,80
2700,9,66,300,70
3000,28,121,300,90
1200,25,112,300,91
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one good file of each kind."""
    monkeypatch.chdir(tmp_path)
    write_netcdf(map_sweep(), tmp_path / "table.nc")
    write_netcdf(map_sweep().isel(speed_rpm=0, fuel_mg=0, drop=True), tmp_path / "line.nc")
    best = optimize_map(map_sweep(), "efficiency_gross", limits={"p_max_bar": 140.0}, max_loss=1e-5)
    write_map(best, tmp_path / "best.json")
    write_map(timing_table(), tmp_path / "holes.json")
    write_map(CalibrationMap({"fuel_mg": [6.0, 40.0]}, [1.0, 2.0], name="rail_bar"), tmp_path / "rail.json")
    write_map(CalibrationMap({"fuel_mg": [60.0, 80.0]}, [1.0, 2.0], name="rail_bar"), tmp_path / "far.json")
    (tmp_path / "bench.csv").write_text(BENCH)
    columns = dict(
        zip(
            ("speed_rpm", "fuel_mg", "p_max_bar"),
            np.loadtxt(tmp_path / "bench.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2)).T,
            strict=True,
        )
    )
    model = fit_response(columns, "p_max_bar", degree=1).model
    (tmp_path / "p_max.toml").write_text(model.to_toml())
    (tmp_path / "cut.nc").write_bytes((tmp_path / "table.nc").read_bytes()[:700])
    (tmp_path / "hdf.nc").write_bytes(b"\x89HDF\r\n\x1a\n")
    (tmp_path / "design.csv").write_text("point,speed_rpm,fuel_mg\n0,900,6\n1,1500,50\n")
    return tmp_path


def refused(here: Path, capsys: pytest.CaptureFixture[str], *argv: str) -> tuple[int, str]:
    before = {file.name: file.read_bytes() for file in here.iterdir()}
    try:
        code = main(["map", *argv, "--quiet"])
    except SystemExit as stop:
        code = int(str(stop.code))
    captured = capsys.readouterr()
    assert captured.out == ""
    assert {file.name: file.read_bytes() for file in here.iterdir()} == before
    return code, captured.err


RANGES = ["--over", "speed_rpm=900:3000", "--over", "fuel_mg=6:40"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "the following arguments are required: --over"),
        (["--over", "speed_rpm=900", "--points", "4"], "--over speed_rpm=900: write NAME=LOW:HIGH, for example"),
        (["--over", "speed_rpm=3000:900", "--points", "4"], "LOW and HIGH must be finite and LOW < HIGH"),
        (["--over", "speed_rpm=900:3000:1", "--points", "4"], "N = 1: must be >= 2 levels"),
        (["--over", "speed_rpm=900,900", "--points", "4"], "speed_rpm = [900. 900.]: must be (low, high)"),
        ([*RANGES, "--over", "fuel-mg=1:2", "--points", "4"], "--over fuel_mg is given twice"),
        (RANGES, "--points = None: must be a whole number in [1, 1000000] for method 'sobol'"),
        ([*RANGES, "--points", "0"], "--points = 0: must be a whole number"),
        ([*RANGES, "--method", "factorial", "--points", "9"], "--points = 9: must be None: the levels of a factorial"),
        ([*RANGES, "--method", "d_optimal", "--points", "5"], "--points = 5: must be >= 6: the quadratic model has 6"),
        ([*RANGES, "--method", "random", "--points", "5"], "invalid choice: 'random'"),
        ([*RANGES, "--points", "4", "--model", "cubic"], "--model does not act here; --method sobol fits no"),
        ([*RANGES, "--points", "4", "--preset", "puma_single"], "--preset does not act here; without --limit"),
        ([*RANGES, "--points", "4", "--motored"], "--motored does not act here; without --limit"),
        ([*RANGES, "--points", "4", "--limit", "p_max_bar=high"], "--limit p_max_bar=high: 'high' is not a number"),
        ([*RANGES, "--points", "4", "--limit", "p_max_ba=9"], "--limit = 'p_max_ba': must be a known name"),
        (["--over", "egr_percent=0:30", "--points", "4", "--limit", "p_max_bar=99"], "must be a known input"),
        ([*RANGES, "--points", "4", "--limit", "p_max_bar=20"], "feasible"),
        ([*RANGES, "--points", "4", "--extend", "design.csv"], "--extend: fuel_mg = 50 of point 1: must be in [6, 40]"),
        ([*RANGES, "--points", "4", "--extend", "designs.csv"], "did you mean 'design.csv'"),
        ([*RANGES, "--points", "4", "--extend", "rail.json"], "points are read from .csv and .nc"),
        (["--over", "soc_cad=0:9", "--points", "4", "--extend", "design.csv"], "design.csv: no column 'soc_cad'"),
        (
            ["--over", "fuel_mg=0:60", "--points", "4", "--extend", "design.csv", "-o", "design.csv"],
            "-o design.csv: the file of --extend; new points would replace it: name another",
        ),
        ([*RANGES, "--points", "4", "--seed", "-1"], "seed = -1: must be a whole number >= 0"),
        ([*RANGES, "--points", "4", "-o", "plan.xlsx"], "the ending must be one of .csv, .nc, .json"),
        ([*RANGES, "--points", "4", "-o", "no/plan.csv"], "the folder no does not exist"),
    ],
)  # fmt: skip
def test_design(options: list[str], message: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = [] if "-o" in options else ["-o", "plan.csv"]
    code, said = refused(here, capsys, "design", *options, *out)
    assert (code, message in said) == (2, True), said


P_MAX = ["--response", "p_max_bar"]
FACTORS = ["--factors", "speed_rpm,fuel_mg"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["bench.csv", *FACTORS], "the following arguments are required: --response"),
        (["bench.csv", *P_MAX], "--factors is needed: which columns of bench.csv make p_max_bar"),
        (["bench.csv", "--response", "p_max", *FACTORS], "bench.csv: no column 'p_max': did you mean 'p_max_bar'?"),
        (["bench.csv", *P_MAX, "--factors", "speed,fuel_mg"], "no column 'speed': did you mean 'speed_rpm'?"),
        (["bench.csv", *P_MAX, "--factors", "p_max_bar,fuel_mg"], "each name once, without the response p_max_bar"),
        (["bench.csv", *P_MAX, "--factors", "fuel_mg,"], "--factors fuel_mg,: each name once"),
        (["bench.csv", *P_MAX, *FACTORS, "--degree", "5"], "degree = 5: must be a whole number in [1, 4]"),
        (["bench.csv", *P_MAX, *FACTORS, "--select", "all"], "6 points for 6 terms: at least 7 are needed"),
        (["bench.csv", *P_MAX, *FACTORS, "--folds", "7"], "folds = 7: must be a whole number in [2, 6]"),
        (["bench.csv", *P_MAX, "--factors", "flat_k"], "flat_k does not vary in the points"),
        (["bench.csv", "--response", "flat_k", *FACTORS], "flat_k is 300 at every point: nothing to fit"),
        (["bench.csv", "--response", "hole_bar", *FACTORS], "bench.csv, line 3, column 'hole_bar': the cell is empty"),
        (["bench.csv", *P_MAX, *FACTORS, "--delimiter", ";"], "no column 'speed_rpm'"),
        (["bench.cvs", *P_MAX, *FACTORS], "points are read from .csv and .nc"),
        (["cut.nc", *P_MAX], "the file was cut off or damaged"),
        (["hdf.nc", *P_MAX], "netCDF 4 (HDF5), only the classic format is read"),
        (["table.nc", "--response", "p_max"], "table.nc: no column 'p_max': did you mean 'p_max_bar'?"),
        (["bench.csv", *P_MAX, *FACTORS, "--figure", "fit.gif"], "--figure fit.gif: the ending must be one of"),
        (["bench.csv", *P_MAX, *FACTORS, "-o", "fit.csv"], "-o fit.csv: the ending must be one of .toml, .json"),
    ],
)
def test_fit(options: list[str], message: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(here, capsys, "fit", *options)
    assert (code, message in said) == (2, True), said


GRID = ["--over", "speed_rpm=1000:2000:3", "--over", "fuel_mg=10,20"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["p_max.toml"], "one of the arguments --over --points is required"),
        (["p_max.toml", "--over", "speed_rpm=1000:2000:3"], "--over fuel_mg=LOW:HIGH:N is missing: the models need"),
        (["p_max.toml", *GRID, "--over", "soc_cad=0:1:2"], "--over soc_cad: not a factor of the models: they have"),
        (["p_max.toml", "p_max.toml", *GRID], "two files hold a model of p_max_bar: give one of each response"),
        (["bench.csv", *GRID], "bench.csv: a model ends in .toml, as mgdd map fit -o model.toml writes it"),
        (["p_min.toml", *GRID], "did you mean 'p_max.toml'?"),
        (["p_max.toml", *GRID, "--level", "1"], "level = 1: must be between 0 and 1"),
        (["p_max.toml", *GRID, "-o", "table.csv"], "-o table.csv: the ending must be one of .nc"),
        (["p_max.toml", "--points", "rail.json"], "points are read from .csv and .nc"),
    ],
)
def test_predict(options: list[str], message: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(here, capsys, "predict", *options)
    assert (code, message in said) == (2, True), said


BEST = ["--maximize", "efficiency_gross"]


@pytest.mark.parametrize(
    ("options", "message", "expected"),
    [
        (["table.nc"], "one of the arguments --maximize --minimize is required", 2),
        (["table.nc", *BEST, "--minimize", "p_max_bar"], "not allowed with argument", 2),
        (["table.nc", "--maximize", "efficiency"], "did you mean 'efficiency_gross'?", 2),
        (["table.nc", *BEST, "--along", "soi_cad"], "name the swept input with --along", 2),
        (["line.nc", *BEST], "name the swept input with --along", 2),
        (["table.nc", *BEST, "--limit", "p_max=100"], "did you mean 'p_max_bar'?", 2),
        (["table.nc", *BEST, "--limit", "efficiency_gross=0.4"], "efficiency_gross is the objective", 2),
        (["table.nc", *BEST, "--limit", "p_max_bar=60"], "or pass --infeasible 'keep'", 3),
        (["table.nc", *BEST, "--limit", "p_max_bar=10"], "no soc_cad keeps the limits in any cell", 3),
        (["table.nc", *BEST, "--max-loss", "0"], "max_loss = 0: must be > 0, in the unit of efficiency_gross", 2),
        (["table.nc", *BEST, "--sd", "nox_ppm=1"], "'nox_ppm' is neither the objective nor limited", 2),
        (["table.nc", *BEST, "--sd", "efficiency_gross=-1"], "sd = -1: must be a number >= 0", 2),
        (["hdf.nc", *BEST], "only the classic format is read", 2),
        (["bench.csv", *BEST], "not a netCDF file: it begins with b'speed_rp'; a text table ends in .csv", 2),
        (["tables.nc", *BEST], "did you mean 'table.nc'?", 2),
        (["table.nc", *BEST, "-o", "best.toml"], "the ending must be one of .csv, .json, .nc, .dcm", 2),
        (
            ["table.nc", *BEST, "--limit", "p_max_bar=110", "--infeasible", "keep", "-o", "b.dcm"],
            "smooth the map with --fill",
            2,
        ),
    ],
)
def test_optimize(
    options: list[str], message: str, expected: int, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = refused(here, capsys, "optimize", *options)
    assert (code, message in said) == (expected, True), said


def test_a_list_of_points_is_not_a_grid(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = ["--points", "bench.csv", "-o", "list.nc"]
    (here / "bench.csv").write_text("speed_rpm,fuel_mg\n1000,10\n2000,20\n1500,11\n")
    assert main(["engine", "sweep", *points, "--quiet"]) == 0
    capsys.readouterr()
    code, said = refused(here, capsys, "optimize", "list.nc", *BEST)
    assert code == 2
    assert "list.nc: a list of 3 points, but a map needs a grid" in said
    assert "mgdd map predict" in said


@pytest.mark.parametrize(
    ("options", "message", "expected"),
    [
        (["best.json", "--slope-limit", "speed=1"], "slope_limits: no axis 'speed': did you mean 'speed_rpm'?", 2),
        (["best.json", "--slope-limit", "fuel_mg=0"], "slope_limits: fuel_mg = 0: must be > 0", 2),
        (["best.json", "--slope-limit", "fuel_mg"], "--slope-limit fuel_mg: write NAME=NUMBER", 2),
        (["best.json", "--slope-limit", "fuel_mg=1e-4"], "widen the ranges: a larger --max-loss, other limits", 3),
        (["best.json", "--weight", "-1"], "weight = -1: must be >= 0", 2),
        (["rail.json"], "an optimum with --max-loss has one", 2),
        (["best.jsn"], "no such file: did you mean 'best.json'?", 2),
        (["p_max.toml"], "give such an ending", 2),
        (["tables.json"], "no such file", 2),
    ],
)
def test_smooth(
    options: list[str], message: str, expected: int, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = refused(here, capsys, "smooth", *options, "-o", "smooth.json")
    assert (code, message in said) == (expected, True), said


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["show", "best.json", "--contour"], "--contour does not act here; it is a form of the picture"),
        (["show", "best.json", "--contour", "--figure", "a.png", "--column", "source"], "contradict each other"),
        (["show", "best.json", "--column", "lowest"], "invalid choice: 'lowest'"),
        (["show", "best.json", "--name", "soi_cad"], "best.json: holds 'soc_cad', not 'soi_cad'"),
        (["show", "table.nc"], "of a sweep make a map first, with optimize_map or mgdd map optimize"),
        (["show", "rail.json", "--sweep", "table.nc"], "it does not belong to this map"),
        (["show", "p_max.toml"], "a map is written to and read from .csv, .json, .dcm, .cdfx, .nc"),
        (["diff", "best.json", "rail.json"], "the same axes in the same order are needed"),
        (["diff", "rail.json", "far.json"], "have nothing in common: pass --grid 'first'"),
        (["diff", "best.json", "holes.json", "--tolerance", "-1"], "tolerance = -1: must be >= 0"),
        (["diff", "best.json", "holes.json", "-o", "diff.csv"], "the ending must be one of .nc, .json"),
        (["export", "best.json"], "-o is needed: name the file to write"),
        (["export", "-o", "a.json"], "no map: name a file, or a measured engine with --advisor"),
        (["export", "best.json", "-o", "a.toml"], "the ending must be one of .csv, .json, .nc, .dcm"),
        (["export", "best.json", "rail.json", "-o", "a.json"], "2 maps fit into a .dcm or .cdfx only"),
        (
            ["export", "best.json", "--label", "A", "-o", "a.json"],
            "--label does not act here; only a .dcm or .cdfx file",
        ),
        (["export", "best.json", "--label", "A", "--label", "B", "-o", "a.dcm"], "2 for 1 maps: give one per map"),
        (["export", "rail.json", "far.json", "-o", "a.dcm"], "two maps would be called 'rail_bar' in a.dcm"),
        (["export", "holes.json", "-o", "a.dcm"], "a DCM file needs all: smooth the map with --fill"),
        (["export", "holes.json", "--guide-map", "-o", "a.csv"], "1 cells have no value: smooth the map with --fill"),
        (["export", "rail.json", "--guide-map", "-o", "a.csv"], "a timing map needs '°CA aTDC'"),
        (["export", "best.json", "--guide-map", "-o", "a.dcm"], "the ending must be one of .csv, .toml"),
        (["export", "best.json", "--advisor", "mercedes", "-o", "a.csv"], "--advisor and best.json contradict"),
        (["export", "--advisor", "opel", "-o", "a.csv"], "invalid choice: 'opel'"),
    ],
)
def test_show_diff_export(options: list[str], message: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(here, capsys, *options)
    assert (code, message in said) == (2, True), said


def test_errors_are_json_where_that_is_asked(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "design", "--over", "fuel_mg=6:40", "--points", "0", "--json"]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert (error["type"], error["field"], error["value"]) == ("ParameterError", "--points", 0)
    assert main(["map", "optimize", str(here / "table.nc"), *BEST, "--limit", "p_max_bar=10", "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["error"]["type"] == "ConvergenceError"


def test_a_file_that_was_there_stays_as_it_was(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A command that fails after it has computed leaves the old file, and none half written beside it."""
    (here / "old.dcm").write_text("old")
    options = ["--limit", "p_max_bar=110", "--infeasible", "keep", "-o", "old.dcm"]
    code, said = refused(here, capsys, "optimize", "table.nc", *BEST, *options)
    assert code == 2
    assert "value" in said
    assert (here / "old.dcm").read_text() == "old"


@pytest.mark.parametrize(
    "verb", ["design", "fit", "predict", "optimize", "smooth", "show", "diff", "trade-off", "export"]
)
def test_help_ends_with_an_example(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["map", verb, "--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert f"example:\n  mgdd map {verb} " in out
    assert "[unit" not in out


def test_the_two_kinds_of_map_are_told_apart(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "the table of mgdd engine seek --guide-map is another file" in " ".join(capsys.readouterr().out.split())
