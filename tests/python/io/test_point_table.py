"""Tables of points: units by name, bracket or row, the habits of a bench, grids as lists."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from map_cases import FUEL, SOC, SPEED, p_max
from map_cases import sweep as map_sweep
from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError
from mgdd.io.binary_files import read_netcdf, write_netcdf
from mgdd.io.point_table import read_points
from mgdd.results.labels import check_labels, label_of
from mgdd.sweep import sweep


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
    made = sweep(Cylinder(), OperatingPoint(), plan, pointwise=True, outputs=["p_max_bar"])
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
