"""The two measured engine maps: what stands in them, what lies above full load, what a broken file says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mgdd import datasets
from mgdd.datasets.readers import engine_map
from mgdd.errors import DataError
from mgdd.maps import CalibrationMap
from mgdd.results.labels import check_labels

NAME = "advisor_engine_maps"
HEAD = "speed_rpm,torque_Nm,fuel_g_s,nox_g_s,pm_g_s,hc_g_s,co_g_s,exh_temp_C,exh_flow_g_s,attainable"


@pytest.fixture(scope="module")
def engines() -> tuple[xr.Dataset, xr.Dataset]:
    if NAME not in datasets.names():
        pytest.skip(f"MGDD_DATA_DIR holds no folder {NAME}")
    return datasets.read("advisor_engine_maps")


def small(folder: Path, *rows: str) -> Path:
    """A map of two speeds and two torques, the second torque above full load at 3000 rpm."""
    cells = rows or (
        "1000,0,0.1,1e-3,1e-4,1e-4,1e-3,100,10,1", "1000,100,0.7,1e-2,1e-4,1e-4,1e-3,300,20,1",
        "3000,0,0.3,3e-3,1e-4,1e-4,1e-3,150,30,1", "3000,100,2.2,3e-2,1e-4,1e-4,1e-3,400,50,0",
    )  # fmt: skip
    file = folder / "engine.csv"
    file.write_text("\n".join([HEAD, *cells]) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("engine", "rows", "least", "at"), [(0, 982, 211.9, (1900.0, 216.9)), (1, 780, 203.7, (1500.0, 162.7))]
)
def test_the_best_consumption_and_the_attainable_rows(
    engines: tuple[xr.Dataset, xr.Dataset], engine: int, rows: int, least: float, at: tuple[float, float]
) -> None:
    data = engines[engine]
    check_labels(data)
    bsfc = data["bsfc_g_per_kwh"]
    best = bsfc.where(bsfc == bsfc.min(), drop=True)
    assert int(data["attainable"].sum()) == rows
    assert float(best.squeeze()) == pytest.approx(least, abs=0.05)
    assert (float(best["speed_rpm"][0]), float(best["torque_nm"][0])) == pytest.approx(at, abs=0.05)


def test_nothing_above_full_load_and_no_share_of_zero_power(engines: tuple[xr.Dataset, xr.Dataset]) -> None:
    for data in engines:
        above = data["torque_nm"] > data["full_load_nm"]
        np.testing.assert_array_equal(*xr.broadcast(above, ~data["attainable"].astype(bool)))
        for name in ("fuel_g_per_s", "nox_g_per_s", "exhaust_temperature_k", "bsfc_g_per_kwh"):
            assert np.isnan(data[name].where(above)).all(), name
        assert np.isfinite(data["fuel_g_per_s"].where(~above, 0.0)).all()
        at_work = data["bsfc_g_per_kwh"].where(~above & (data["torque_nm"] > 0.0), 0.0)
        assert np.isfinite(at_work).all()
        assert np.isnan(data["bsfc_g_per_kwh"].sel(torque_nm=0.0)).all()


def test_a_measured_map_can_be_read_and_says_where_it_ends(engines: tuple[xr.Dataset, xr.Dataset]) -> None:
    table = CalibrationMap.from_dataset(engines[0], "bsfc_g_per_kwh", source="measured")
    at = table.lookup({"speed_rpm": [1900.0, 1900.0, 4400.0, 9000.0], "torque_nm": [216.92, 150.0, 223.0, 100.0]})
    assert at.values[0] == pytest.approx(211.9, abs=0.05)
    assert 211.0 < at.values[1] < 240.0
    assert np.isnan(at.values[2])  # above full load
    assert at.held_outside.tolist() == [False, False, False, True]
    assert set(np.unique(table.cells["source"])) == {"measured", "unattainable"}


def test_the_range_of_nox_is_that_of_the_record(engines: tuple[xr.Dataset, xr.Dataset]) -> None:
    for data, (least, most) in zip(engines, ((1.56, 22.0), (2.15, 11.9)), strict=True):
        power_w = data["torque_nm"] * data["speed_rpm"] * np.pi / 30.0
        nox = data["nox_g_per_kwh"].where(power_w > 5000.0)
        assert float(nox.min()) == pytest.approx(least, abs=0.006)
        assert float(nox.max()) == pytest.approx(most, abs=0.06)


def test_a_measured_map_travels(engines: tuple[xr.Dataset, xr.Dataset], tmp_path: Path) -> None:
    table = CalibrationMap.from_dataset(engines[1], "nox_g_per_kwh")
    table.save(tmp_path / "nox.nc")
    assert CalibrationMap.load(tmp_path / "nox.nc") == table


def test_columns_units_and_consumption_of_a_small_map(tmp_path: Path) -> None:
    data = engine_map(small(tmp_path))
    assert dict(data.sizes) == {"speed_rpm": 2, "torque_nm": 2}
    assert data["full_load_nm"].values.tolist() == [100.0, 0.0]
    # 0.7 g/s at 100 N m and 1000 rpm, 10.472 kW
    assert float(data["bsfc_g_per_kwh"].sel(speed_rpm=1000.0, torque_nm=100.0)) == pytest.approx(240.64, abs=0.01)
    assert float(data["exhaust_temperature_k"][0, 1]) == 573.15
    assert np.isnan(data["fuel_g_per_s"][1, 1])


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (("1000,0,0.1,1,1,1,1,100,10,1", "1000,100,0.7,1,1,1,1,300,20,1", "3000,0,0.3,1,1,1,1,150,30,1"), "3 rows"),
        (
            (
                "1000,0,0.1,1,1,1,1,100,10,1", "1000,100,0.7,1,1,1,1,300,20,1", "3000,0,0.3,1,1,1,1,150,30,1",
                "3000,0,0.3,1,1,1,1,150,30,1",
            ),
            "4 rows: a map of 2 speeds and 2 torques",
        ),
    ],
)  # fmt: skip
def test_a_grid_with_a_gap_is_refused(tmp_path: Path, rows: tuple[str, ...], said: str) -> None:
    with pytest.raises(DataError, match=said):
        engine_map(small(tmp_path, *rows))


def test_another_table_is_refused(tmp_path: Path) -> None:
    file = small(tmp_path)
    file.write_text(file.read_text(encoding="utf-8").replace("nox_g_s", "nox"), encoding="utf-8")
    with pytest.raises(DataError, match="no column 'nox_g_s'"):
        engine_map(file)
