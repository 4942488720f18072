"""`mgdd data`: what a file holds, the file as another that reads back equal, and public data as files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd import datasets
from mgdd.cli import main
from mgdd.datasets.files import FILES, LICENCES
from mgdd.io import read, read_pressure
from mgdd.io.plain_csv import long_columns, write_long
from mgdd.io.table import read_table
from mgdd.results.labels import ANGLE, labelled_dataset
from table_files import write_hdf5
from typed import Capsys
from typed import ran as out

FULL = np.arange(-180.0, 180.0, 0.5)
HUMP = np.exp(-(((FULL - 8.0) / 30.0) ** 2))
CYCLES = np.array([2.0 + 0.1 * k + (50.0 + 3.0 * k) * HUMP for k in range(3)])
LATER = 0.9 * np.roll(CYCLES, 240, axis=1)
SLOW = np.arange(11.0) * 40.0
FILE = {
    "CAD": np.tile(FULL, 3), "p1": 100.0 * CYCLES.ravel(), "p2": 100.0 * LATER.ravel(),
    "lift": np.tile(np.clip(np.abs(FULL) - 100.0, 0.0, 9.0), 3) + 0.01 * np.repeat(np.arange(3.0), 720),
}  # fmt: skip
UNITS = {"CAD": "deg", "p1": "kPa", "p2": "kPa", "lift": "mm", "T_exh": "°C", "t_ms": "ms"}
MORE = {"imep": np.array([4.5, 4.1, 4.9]), "T_exh": 600.0 + SLOW**1.1, "t_ms": SLOW}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_hdf5(tmp_path / "fast.h5", FILE, UNITS)
    write_hdf5(tmp_path / "all.h5", FILE | MORE, UNITS)
    return tmp_path


# --- laws --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("ending", ["nc", "csv", "parquet"])
@pytest.mark.usefixtures("folder")
def test_what_was_written_reads_back_equal(ending: str, capsys: Capsys) -> None:
    source = "all.h5" if ending == "nc" else "fast.h5"
    said = out(capsys, "data", "convert", source, "-o", f"bench.{ending}")
    before, after = read(source), read(f"bench.{ending}")
    assert after.equals(before)
    for name in before.variables:
        assert after[name].attrs["units"] == before[name].attrs["units"]
        assert after[name].attrs["long_name"] == before[name].attrs["long_name"]
    assert (said["file"], said["channels"]) == (f"bench.{ending}", list(before.data_vars))
    assert said["sizes"] == dict(before.sizes)


@pytest.mark.parametrize("ending", ["nc", "csv", "parquet"])
@pytest.mark.usefixtures("folder")
def test_one_cylinder_is_read_from_every_file(ending: str) -> None:
    command = [
        "data",
        "convert",
        "fast.h5",
        "--pressure-column",
        "p1",
        "--channels",
        "pressure_bar",
        "--channels",
        "lift",
    ]
    assert main([*command, "-o", f"one.{ending}"]) == 0
    trace = read_pressure(f"one.{ending}")
    np.testing.assert_array_equal(trace["pressure_bar"], read("fast.h5", pressure_column="p1")["pressure_bar"])
    np.testing.assert_allclose(trace["pressure_bar"], CYCLES, rtol=1e-14)


def test_long_columns_are_those_of_the_dataset(tmp_path: Path) -> None:
    grid = labelled_dataset({
        "speed_rpm": ("speed_rpm", [900.0, 1500.0, 2100.0], "rpm", "speed"),
        "fuel_mg": ("fuel_mg", [6.0, 20.0], "mg", "fuel"),
        "level": (("fuel_mg", "speed_rpm"), np.arange(6.0).reshape(2, 3), "N m", "torque, net"),
        "ambient_k": ((), 293.0, "K", "ambient temperature"),
    })  # fmt: skip
    columns = long_columns(grid)
    assert {name: values.tolist() for name, (values, _, _) in columns.items()} == {
        "fuel_mg": [6.0] * 3 + [20.0] * 3, "speed_rpm": [900.0, 1500.0, 2100.0] * 2,
        "level": [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
    }  # fmt: skip
    write_long(grid, tmp_path / "grid.csv")
    assert read_table(tmp_path / "grid.csv").header == ("fuel_mg", "speed_rpm", "level [N m]")


# --- info --------------------------------------------------------------------------------------------------
@pytest.mark.usefixtures("folder")
def test_info_says_what_each_column_is_taken_for(capsys: Capsys) -> None:
    shown = out(capsys, "data", "info", "all.h5")
    assert shown["format"].startswith("HDF5")
    assert shown["sizes"] == {ANGLE: 720, "cycle": 3, "time_1_s": 11}
    columns = {column["name"]: column for column in shown["columns"]}
    assert columns["p2"] == {
        "name": "p2", "unit": "kPa", "rows": 2160, "lowest": pytest.approx(180.0),
        "highest": pytest.approx(5238.0), "taken_for": "pressure_2_bar", "raster": f"cycle, {ANGLE}",
    }  # fmt: skip
    taken = {name: (column["taken_for"], column["raster"]) for name, column in columns.items()}
    assert taken["CAD"] == (ANGLE, ANGLE)
    assert taken["t_ms"] == ("time_1_s", "time_1_s")
    assert taken["T_exh"] == ("T_exh", "time_1_s")
    assert taken["imep"] == ("imep", "cycle")
    assert shown["doubts"] == ["the file gives no unit of 'imep': their numbers are unchanged"]
    assert main(["data", "info", "all.h5"]) == 0
    text = capsys.readouterr().out.splitlines()
    assert text[2].split() == ["column", "unit", "rows", "lowest", "highest", "taken", "for", "over"]
    assert text[-1].startswith("doubtful: the file gives no unit of 'imep'")


def test_info_shows_a_file_that_cannot_be_cut(folder: Path, capsys: Capsys) -> None:
    rows = "".join(f"{0.5 * k},{100 * float(CYCLES[0, k % 720])!r},{'ok' if k % 2 else ''}\n" for k in range(1440))
    (folder / "run.csv").write_text("CAD,p [kPa],note\n" + rows)
    shown = out(capsys, "data", "info", "run.csv")
    assert (shown["format"], shown["sizes"]) == ("text", {})
    assert [column["taken_for"] for column in shown["columns"]] == [None] * 3
    assert shown["columns"][2]["lowest"] is None
    assert len(shown["doubts"]) == 1
    assert "not read as cycles: run.csv" in shown["doubts"][0]
    assert "pass --firing-tdc-deg" in shown["doubts"][0]  # options, not arguments
    (folder / "wave.csv").write_text(
        "Crank position,p [bar]\n" + "".join(f"{5 * (k % 6 < 3)},{float(CYCLES[0, k])!r}\n" for k in range(720))
    )
    shown = out(capsys, "data", "info", "wave.csv")
    assert "column 'Crank position' is not a crank angle: its values are a square wave" in shown["doubts"][0]


@pytest.mark.usefixtures("folder")
def test_info_shows_a_column_per_cycle_as_one(capsys: Capsys) -> None:
    out(capsys, "data", "convert", "fast.h5", "-o", "bench.nc")
    columns = out(capsys, "data", "info", "bench.nc")["columns"]
    assert [column["name"] for column in columns] == [
        ANGLE, "pressure_1_bar 1 ... pressure_1_bar 3", "pressure_2_bar 1 ... pressure_2_bar 3", "lift 1 ... lift 3",
        "cycle",
    ]  # fmt: skip


def test_a_long_series_is_one_line_in_a_file_that_cannot_be_cut(folder: Path, capsys: Capsys) -> None:
    np.savez(folder / "many.npz", angle=FULL + 540.0, p=np.tile(CYCLES[:1], (30, 1)).T)
    columns = out(capsys, "data", "info", "many.npz")["columns"]
    assert [(column["name"], column["highest"]) for column in columns] == [
        ("angle", 719.5), ("p 1 ... p 30", pytest.approx(52.0)),
    ]  # fmt: skip


# --- errors ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["convert", "fast.h5"], "-o FILE is needed: a name that ends in .nc, .csv, .parquet"),
        (["convert", "fast.h5", "-o", "a.txt"], "the ending must be one of .nc, .csv, .parquet"),
        (["convert", "fast.h5", "-o", "none/a.nc"], "the folder none does not exist"),
        (["convert", "all.h5", "-o", "a.csv"], "columns of one length: T_exh is over time_1_s"),
        (["convert", "fast.h5", "-o", "a.nc", "--channels", "lfit"], "--channels 'lfit': did you mean 'lift'?"),
        (["convert", "fats.h5", "-o", "a.nc"], "did you mean 'fast.h5'?"),
        (["info", "."], "this is a folder"),
        (["get", "h2df_502"], "-o FILE is needed"),
    ],
)
def test_errors_name_the_remedy(argv: list[str], message: str, folder: Path, capsys: Capsys) -> None:
    before = sorted(folder.iterdir())
    assert main(["data", *argv]) == 2
    assert message in capsys.readouterr().err
    assert sorted(folder.iterdir()) == before


def test_the_nearest_set_is_named(capsys: Capsys) -> None:
    with pytest.raises(SystemExit):
        main(["data", "get", "h2df", "-o", "a.nc"])
    assert "did you mean 'h2df_502'?" in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
def test_warnings_are_said(caplog: pytest.LogCaptureFixture) -> None:
    assert main(["data", "convert", "all.h5", "-o", "a.nc"]) == 0
    assert "all.h5: the file gives no unit of 'imep'" in caplog.text


# --- public data -------------------------------------------------------------------------------------------
def test_sets_are_listed_with_licence_and_place(
    capsys: Capsys, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    rows = {row["name"]: row for row in out(capsys, "data", "list")["datasets"]}
    assert set(rows) == set(FILES) == set(LICENCES)
    assert all(row["licence"] for row in rows.values())
    assert rows["hd_diesel_128x144"]["place"].endswith("data")
    assert rows["h2df_502"]["place"] == "not here: put it into $MGDD_DATA_DIR/h2df_502"


@pytest.mark.parametrize("ending", ["csv", "nc", "parquet"])
@pytest.mark.usefixtures("folder")
def test_a_set_is_written_and_reads_back(ending: str, capsys: Capsys) -> None:
    said = out(capsys, "data", "get", "hd_diesel_128x144", "-o", f"hd.{ending}")
    assert said["licence"] == "MIT"
    assert said["files"] == [f"hd_{k}.{ending}" for k in (1, 2, 3, 4)]
    for file, trace in zip(said["files"], datasets.read("hd_diesel_128x144"), strict=True):
        assert read(file).equals(trace)
        if ending == "nc":
            assert xr.open_dataset(file, engine="scipy").identical(trace)


def test_records_of_one_set_have_the_licence_that_is_listed() -> None:
    here = [name for name in datasets.names() if name != "hd_diesel_128x144"]
    if not here:
        pytest.skip("no set beside that of the package")
    for name in here:
        found: Any = datasets.read(name)  # type: ignore[call-overload]
        first = found[0] if isinstance(found, tuple) else found
        assert first.attrs["licence"] == LICENCES[name]
