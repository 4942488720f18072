"""Plain tables: CSV and points by column names, and files that are not there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import mgdd
from map_cases import FUEL, SOC, SPEED, p_max
from map_cases import sweep as map_sweep
from mgdd import datasets, io, presets
from mgdd.cli.main import main
from mgdd.engine import Cylinder, OperatingPoint, simulate, timing_sweep
from mgdd.errors import DataError
from mgdd.guide import TimingMap
from mgdd.identify import load_throttle_model
from mgdd.io.binary_files import read_netcdf, write_netcdf
from mgdd.io.parameters import ParameterFile
from mgdd.io.plain_csv import write_traces
from mgdd.io.point_table import read_conditions, read_points
from mgdd.optimize import Seeker
from mgdd.results.labels import check_labels, label_of
from mgdd.sweep import sweep
from mgdd.throttle import SensorPair, Throttle, simulate_throttle

DATA = sorted((Path(mgdd.__file__).parent / "data").glob("*.csv"))


def throttle_run() -> xr.Dataset:
    return simulate_throttle(Throttle(), 0.2 * np.sin(6.0 * np.arange(1500) * 1e-3), supply_v=12.0)


def of_pressure(path: Path) -> xr.Dataset:
    trace = datasets.read("hd_diesel_128x144")[0]
    io.write_csv(trace, path)
    return trace


def of_log(path: Path) -> xr.Dataset:
    run = throttle_run()
    log = io.throttle_log(run["time_s"], run["duty"], run["angle_deg"], current_a=run["current_a"])
    io.write_csv(log, path)
    return log


def of_traces(dataset: Callable[[], xr.Dataset]) -> Callable[[Path], xr.Dataset]:
    def write(path: Path) -> xr.Dataset:
        made = dataset()
        write_traces(made, path)
        return made

    return write


def of_map(path: Path) -> xr.Dataset:
    timing = TimingMap({"speed_rpm": [900.0, 1500.0], "fuel_mg": [6.0, 20.0, 40.0]}, [[-2, -3, -4], [-5, -6, -8.5]])
    timing.learn((1100.0, 17.0), -4.5, sd_cad=0.4)
    timing.write_csv(path)
    flat = timing.to_dataset().stack(cell=("speed_rpm", "fuel_mg")).reset_index("cell")
    return flat.assign({name: ("cell", [value] * 6) for name, value in flat.attrs.items()})


WRITERS = {
    "timing map": of_map,
    "write_csv, trace": of_pressure,
    "write_csv, log": of_log,
    "cycle": of_traces(lambda: simulate(Cylinder(), OperatingPoint())),
    "throttle": of_traces(throttle_run),
    "flags and NaN": of_traces(lambda: SensorPair().sense(throttle_run())),
    "sweep": of_traces(lambda: timing_sweep(Cylinder(), OperatingPoint())),
}
COMMANDS = {
    "engine simulate": ["engine", "simulate"],
    "engine optimum": ["engine", "optimum"],
    "throttle simulate": ["throttle", "simulate", "--duty", "0.3", "--duration-s", "0.1"],
    "throttle excite": ["throttle", "excite", "chirp", "--preset", "P1"],
    "engine seek": ["engine", "seek", "--cycles", "30"],
}


@pytest.mark.parametrize("file", DATA, ids=lambda path: path.name)
def test_packaged_tables(file: Path) -> None:
    table = pd.read_csv(file)
    assert not table.isna().any(axis=None)
    numbers = table.drop(columns="file", errors="ignore")
    assert all(np.issubdtype(kind, np.number) for kind in numbers.dtypes)
    assert all(name.isidentifier() for name in table.columns)


@pytest.mark.parametrize("name", WRITERS)
def test_written_tables(name: str, tmp_path: Path) -> None:
    dataset = WRITERS[name](tmp_path / "out.csv")
    table = pd.read_csv(tmp_path / "out.csv")
    assert len(table.columns) > 1
    for column in table.columns:
        written = dataset[column].to_numpy().astype(np.float64)
        np.testing.assert_allclose(table[column], written, rtol=1e-14, err_msg=column)


@pytest.mark.parametrize("name", COMMANDS)
def test_tables_of_the_command_line(name: str, tmp_path: Path) -> None:
    assert main([*COMMANDS[name], "--output", str(tmp_path / "out.csv")]) == 0
    table = pd.read_csv(tmp_path / "out.csv")
    assert len(table) > 10
    assert all(np.issubdtype(kind, np.number) for kind in table.dtypes)


@pytest.mark.parametrize(
    ("head", "name", "unit"),
    [
        ("p_max_bar\n1\n", "p_max_bar", "bar"),
        ("p_max_bar\nbar\n1\n", "p_max_bar", "bar"),
        ("soc_cad\n°CA aTDC\n1\n", "soc_cad", "°CA aTDC"),
        ("soc_cad\ndeg\n1\n", "soc_cad", "°CA aTDC"),
        ("n [1/min],\n1,\n", "n", "rpm"),
        ("n\n1/min\n1\n", "n", "rpm"),
        ("Motor torque (Nm),\n1,\n", "Motor torque", "N m"),
        ("lambda\n-\n1\n", "lambda", "-"),
        ("egr [%];\n1;\n", "egr", "%"),
    ],
)
def test_a_unit_is_found(head: str, name: str, unit: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(head)
    table = read_points(tmp_path / "t.csv")
    assert list(table.data_vars) == [name]
    assert label_of(table[name]).units == unit
    assert table[name].values.tolist() == [1.0]
    check_labels(table)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("p_max_bar\nkPa\n100\n", "column 'p_max_bar': unit 'kPa': must be 'bar', as the name says"),
        ("n [per minute!],\n100,\n", "column 'n': unit 'per minute!' is not a product"),
        ("a,a\n1,2\n", "column 'a' occurs twice"),
        ("1,2\n3,4\n", "no header"),
        ("a,b\nx,y\nz,w\nq,1/min2\n", "no numeric rows below the header"),
        ("point,a\nP1,3.5\n", "line 2, column 'point': 'P1' is not a number"),
    ],
)
def test_what_is_no_table_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(DataError) as error:
        read_points(tmp_path / "t.csv")
    assert message in str(error.value)


def test_remarks_are_left_out_but_not_what_must_be_numbers(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("point,fuel_mg,remark,soc_cad\n4,6,cold,\n8,7,,\n")
    table = read_points(tmp_path / "t.csv")
    assert list(table.data_vars) == ["fuel_mg"]
    assert table["point"].values.tolist() == [4.0, 8.0]
    with pytest.raises(DataError, match="line 2, column 'soc_cad': the cell is empty"):
        read_points(tmp_path / "t.csv", always=["soc_cad", "bore_mm"])


def test_a_grid_is_a_list_of_its_cells(tmp_path: Path) -> None:
    write_netcdf(map_sweep(), tmp_path / "t.nc")
    table = read_points(tmp_path / "t.nc", ["p_max_bar", "soc_cad", "fuel_mg", "speed_rpm"])
    assert table.sizes == {"point": SPEED.size * FUEL.size * SOC.size}
    n, m, t = (table[name].to_numpy() for name in ("speed_rpm", "fuel_mg", "soc_cad"))
    np.testing.assert_array_equal(table["p_max_bar"], p_max(n, m, t))
    assert label_of(table["speed_rpm"]).long_name == "engine speed"
    check_labels(table)


def test_a_list_keeps_its_numbers_and_inputs(tmp_path: Path) -> None:
    plan = {"speed_rpm": [1000.0, 2500.0], "soc_cad": [-9.0, 1.0]}
    made = sweep(Cylinder(), OperatingPoint(), plan, points=True, outputs=["p_max_bar"])
    write_netcdf(made.assign_coords(point=("point", [5, 3], made["point"].attrs)), tmp_path / "t.nc")
    table = read_points(tmp_path / "t.nc")
    assert table["point"].values.tolist() == [5, 3]
    assert table["speed_rpm"].values.tolist() == plan["speed_rpm"]
    np.testing.assert_array_equal(table["p_max_bar"], made["p_max_bar"])
    with pytest.raises(DataError, match="no column 'p_max': did you mean 'p_max_bar'"):
        read_points(tmp_path / "t.nc", ["p_max"])


def test_variables_without_units_are_refused(tmp_path: Path) -> None:
    write_netcdf(xr.Dataset({"a": ("point", [1.0, 2.0])}, coords={"point": [0, 1]}), tmp_path / "t.nc")
    with pytest.raises(DataError, match="a has no units or no long_name"):
        read_points(tmp_path / "t.nc")


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.999])
def test_a_netcdf_file_that_was_cut_off_is_named(share: float, tmp_path: Path) -> None:
    write_netcdf(map_sweep(), tmp_path / "t.nc")
    content = (tmp_path / "t.nc").read_bytes()
    (tmp_path / "t.nc").write_bytes(content[: int(share * len(content))])
    with pytest.raises(DataError, match=r"t\.nc: cannot be read .* cut off or damaged"):
        read_netcdf(tmp_path / "t.nc")


READERS: dict[str, tuple[Callable[[Path], Any], str, str]] = {
    "pressure": (io.read_pressure, "mean.csv", "maen.csv"),
    "conditions": (read_conditions, "conditions.csv", "condition.csv"),
    "log": (io.read_throttle_log, "chirp.csv", "chrip.csv"),
    "MATLAB log": (io.read_throttle_log, "chirp.mat", "chrip.mat"),
    "parameters": (ParameterFile.read, "lag.toml", "lagg.toml"),
    "model": (load_throttle_model, "fit.toml", "fits.toml"),
    "preset": (presets.load, "mine.toml", "mime.toml"),
    "seeker": (Seeker.load, "seeker.json", "seker.json"),
}


@pytest.mark.parametrize("kind", READERS)
def test_the_nearest_name_is_asked_for(kind: str, tmp_path: Path) -> None:
    read, there, meant = READERS[kind]
    (tmp_path / there).write_bytes(b"?")
    with pytest.raises(FileNotFoundError, match=f"did you mean '{there}'"):
        read(str(tmp_path / meant))  # type: ignore[arg-type]
    with pytest.raises(ValueError):  # noqa: PT011 - it is read then, and refused for what is in it
        read(str(tmp_path / there))  # type: ignore[arg-type]


@pytest.mark.parametrize("path", ["lost.csv", "no folder/chirp.csv"])
def test_where_no_name_is_near_the_path_is_to_be_checked(path: str, tmp_path: Path) -> None:
    (tmp_path / "chirp.csv").touch()
    with pytest.raises(FileNotFoundError, match="no such file: check the path") as caught:
        io.read_throttle_log(tmp_path / path)
    assert caught.value.filename == str(tmp_path / path)


def test_the_command_line_says_it_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mean.csv").touch()
    assert main(["engine", "analyze", str(tmp_path / "meen.csv"), "--preset", "puma_single"]) == 2
    assert f"error: {tmp_path / 'meen.csv'}: no such file: did you mean 'mean.csv'?" in capsys.readouterr().err
