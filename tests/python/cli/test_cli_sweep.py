"""`mgdd engine sweep`: the table of the library in a file, and its figures beside it."""

import json
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mgdd import presets
from mgdd.cli import main
from mgdd.sweep import sweep
from typed import Capsys

OVER = ["--over", "soc_cad=-12:0:4", "--over", "bore-mm=80:90:3"]


def test_the_file_holds_the_table(tmp_path: Path, capsys: Capsys) -> None:
    file = tmp_path / "table.nc"
    assert main(["engine", "sweep", *OVER, "--workers", "1", "-o", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["cycles"] == 12
    assert told["cycles_per_s"] > 0.0
    assert told["shape"] == {"soc_cad": 4, "bore_mm": 3}
    assert told["file"] == str(file)
    preset = presets.load("puma_single")
    expected = sweep(preset.cylinder, preset.point, {"soc_cad": [-12, -8, -4, 0], "bore_mm": [80, 85, 90]})
    with xr.open_dataset(file, engine="scipy") as found:
        assert set(found.variables) == set(expected.variables)
        np.testing.assert_array_equal(found["p_max_bar"], expected["p_max_bar"])
    assert [path.name for path in tmp_path.iterdir()] == ["table.nc"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--over", "soc_cad=-12:0"], "write NAME=LOW:HIGH:N"),
        (["--over", "soc_cad=-12:0:x"], "write NAME=LOW:HIGH:N"),
        (["--over", "soc_cad=0:0:5"], "must be finite and differ"),
        (["--over", "soc_cad=0:inf:5"], "must be finite and differ"),
        ([*OVER, "--over", "soc_cad=0:1:2"], "--over soc_cad is given twice"),
        (["--over", "soc_cad=-12,x"], "the values must be numbers with commas between them"),
        ([*OVER, "--workers", "0"], "must be >= 1"),
        ([*OVER, "--outputs", "p_max_ba"], "did you mean 'p_max_bar'"),
    ],
)
def test_bad_input_writes_nothing(options: list[str], message: str, tmp_path: Path, capsys: Capsys) -> None:
    assert main(["engine", "sweep", *options, "-o", str(tmp_path / "table.nc")]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_values_of_ones_own_are_an_axis(capsys: Capsys) -> None:
    assert main(["engine", "sweep", "--over", "speed_rpm=900,1500,2100", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["shape"] == {"speed_rpm": 3}


def test_the_timing_holds_where_it_is_not_swept(tmp_path: Path, capsys: Capsys) -> None:
    file = tmp_path / "table.nc"
    options = ["--over", "bore_mm=80:90:2", "--soc-cad", "3.5", "--outputs", "p_max_bar", "-o", str(file)]
    assert main(["engine", "sweep", *options]) == 0
    capsys.readouterr()
    preset = presets.load("puma_single")
    expected = sweep(preset.cylinder, preset.point, {"bore_mm": [80.0, 90.0]}, soc_cad=3.5)
    with xr.open_dataset(file, engine="scipy") as found:
        np.testing.assert_array_equal(found["p_max_bar"], expected["p_max_bar"])


# --- points of a file ---------------------------------------------------------------------------------------
POINTS = "point;bore_mm;soc-note;soc_cad\n[-];[mm];;[deg]\n7;80;early;-12\n9;90;;0.5\n12;85;late;-3\n"


@pytest.mark.parametrize("ending", ["csv", "nc"])
def test_points_of_a_file_are_simulated(ending: str, tmp_path: Path, capsys: Capsys) -> None:
    (tmp_path / "points.csv").write_text(POINTS)
    file = tmp_path / f"table.{ending}"
    options = ["--outputs", "p_max_bar,ca50_cad", "-o", str(file), "--json"]
    assert main(["engine", "sweep", "--points", str(tmp_path / "points.csv"), *options]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["shape"] == {"point": 3}
    assert told["interrupted"] is False
    preset = presets.load("puma_single")
    columns = {"bore_mm": [80.0, 90.0, 85.0], "soc_cad": [-12.0, 0.5, -3.0]}
    expected = sweep(preset.cylinder, preset.point, columns, pointwise=True, outputs=["p_max_bar", "ca50_cad"])
    if ending == "nc":
        with xr.open_dataset(file, engine="scipy") as found:
            np.testing.assert_array_equal(found["p_max_bar"], expected["p_max_bar"])
            assert found["point"].values.tolist() == [7, 9, 12]
    else:
        assert file.read_text().splitlines()[0] == "point,bore_mm,soc_cad,p_max_bar,ca50_cad"
        found = np.genfromtxt(file, delimiter=",", names=True)
        np.testing.assert_array_equal(found["ca50_cad"], expected["ca50_cad"])
        np.testing.assert_array_equal(found["bore_mm"], columns["bore_mm"])


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("bore_mm,speed\n80,1000\n", [], "--points = 'speed': must be a known input: did you mean 'speed_rpm'"),
        ("bore_mm\nm\n0.08\n", [], "column 'bore_mm': unit 'm': must be 'mm', as the name says"),
        ("bore_mm\n80\n", ["--over", "soc_cad=0:1:2"], "not allowed with argument"),
    ],
)
def test_bad_points_write_nothing(text: str, options: list[str], message: str, tmp_path: Path, capsys: Capsys) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text)
    command = ["engine", "sweep", "--points", str(file), *options, "-o", str(tmp_path / "table.nc")]
    try:
        code = main(command)
    except SystemExit as stop:
        code = int(str(stop.code))
    assert code == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["points.csv"]


def test_a_grid_is_csv_with_a_point_per_row(tmp_path: Path) -> None:
    for ending in ("nc", "csv"):
        assert main(["engine", "sweep", *OVER, "-o", str(tmp_path / f"table.{ending}")]) == 0
    rows = np.genfromtxt(tmp_path / "table.csv", delimiter=",", names=True)
    with xr.open_dataset(tmp_path / "table.nc", engine="scipy") as table:
        for row in rows:
            cell = table.sel(soc_cad=row["soc_cad"], bore_mm=row["bore_mm"])
            assert row["p_max_bar"] == float(cell["p_max_bar"])
    assert rows["point"].tolist() == list(range(12))


# --- Ctrl-C -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("keeps", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_ctrl_c_writes_what_is_done(keeps: bool, tmp_path: Path) -> None:
    """A signal comes when some cycles are done and most are not: the file has all cells, `finished` says which."""
    file = tmp_path / "table.nc"
    arguments = ["engine", "sweep", "--over", "speed_rpm=1000:3000:101", "--over", "soc_cad=-20:10:3001"]
    arguments += ["--outputs", "imep_gross_bar", "--step-cad", "5", "--json", *(["-o", str(file)] if keeps else [])]
    program = f"""
        import functools, os, signal, sys
        import mgdd.cli.sweep as command
        from mgdd.cli import main

        def progress(done, n):
            if done > 50:
                os.kill(os.getpid(), signal.SIGINT)

        command.sweep = functools.partial(command.sweep, progress=progress)
        sys.exit(main({arguments!r}))
    """
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 130, run.stderr
    told = json.loads(run.stdout)
    cells = 101 * 3001
    assert told["interrupted"] is True
    assert 50 < told["cycles"] < cells
    assert told["shape"] == {"speed_rpm": 101, "soc_cad": 3001}
    if not keeps:
        assert f"interrupted: {told['cycles']} of {cells} cycles are finished, none kept; name a file" in run.stderr
        return
    assert f"interrupted: {told['cycles']} of {cells} cycles are kept in {file}" in run.stderr
    with xr.open_dataset(file, engine="scipy") as table:
        done = table["finished"].values.astype(bool)
        assert done.sum() == told["cycles"]
        assert (np.isfinite(table["imep_gross_bar"].values) == done).all()
    assert [path.name for path in tmp_path.iterdir()] == ["table.nc"]
