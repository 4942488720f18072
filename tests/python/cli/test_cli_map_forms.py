"""`mgdd map show | diff | export` on maps of known content: axes in any order, file forms, measured engines."""

from pathlib import Path

import numpy as np
import pytest

from map_cases import FUEL, SPEED, bend, centre, timing_table
from map_cases import sweep as map_sweep
from mgdd import datasets
from mgdd.cli import main
from mgdd.io.binary_files import write_netcdf
from mgdd.maps import CalibrationMap, optimize_map, read_dcm, read_map, write_map
from typed import Capsys, ran


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_axes_of_map_and_table_may_stand_in_another_order(here: Path, capsys: Capsys) -> None:
    best = optimize_map(map_sweep(), "efficiency_gross")
    late = best.values + np.arange(15.0).reshape(3, 5) / 10.0
    write_map(best.replaced(late), here / "late.nc")
    write_netcdf(map_sweep().transpose("soc_cad", "fuel_mg", "speed_rpm"), here / "table.nc")
    told = ran(capsys, "map", "show", "late.nc", "--sweep", "table.nc")
    loss = bend(SPEED[:, None], FUEL) * (late - centre(SPEED[:, None], FUEL)) ** 2
    row, column = np.unravel_index(np.argmax(loss), loss.shape)
    assert told["achieved"]["loss"]["highest_at"] == {"speed_rpm": SPEED[row], "fuel_mg": FUEL[column]}
    assert told["achieved"]["loss"]["highest"] == pytest.approx(loss.max(), rel=0.05)


def test_diff_at_the_breakpoints_of_the_first(here: Path, capsys: Capsys) -> None:
    axes = {"fuel_mg": [6.0, 20.0, 40.0]}
    write_map(CalibrationMap(axes, [400.0, 800.0, 1600.0], name="rail_bar"), here / "old.nc")
    write_map(CalibrationMap({"fuel_mg": [10.0, 30.0]}, [500.0, 900.0], name="rail_bar"), here / "new.nc")
    told = ran(capsys, "map", "diff", "old.nc", "new.nc", "--grid", "first")
    assert told["axes"] == [{"name": "fuel_mg", "entries": axes["fuel_mg"]}]
    assert told["difference"] == [100.0, -100.0, -700.0]
    assert told["held_outside"] == [True, False, True]
    assert ran(capsys, "map", "diff", "old.nc", "new.nc")["axes"][0]["entries"] == [10.0, 20.0, 30.0]


@pytest.mark.parametrize("ending", ["csv", "nc"])
def test_export_keeps_everything_or_says_what_it_leaves_out(ending: str, here: Path, capsys: Capsys) -> None:
    extra = timing_table().replaced(cells={"visits": 3.0}, labels={"visits": ("-", "visits")})
    write_map(extra, here / "map.nc")
    told = ran(capsys, "map", "export", "map.nc", "-o", f"other.{ending}")
    assert told["maps"] == [{"name": "soc_cad", "unit": "°CA aTDC", "axes": {"speed_rpm": 3, "fuel_mg": 5}}]
    back = read_map(here / f"other.{ending}")
    if ending == "nc":
        assert back == extra
        assert told["left_out"] == []
    else:
        np.testing.assert_array_equal(back.values, extra.values)
        assert told["left_out"] == sorted({*extra.cells} - {"objective"})


def test_several_maps_into_one_dcm_file(here: Path, capsys: Capsys) -> None:
    soc = CalibrationMap({"fuel_mg": [6.0, 20.0, 40.0]}, [-1.0, -4.0, -6.5], name="soc_cad", cells={"sd": 0.3})
    rail = CalibrationMap({"speed_rpm": [900.0, 3000.0]}, [400.0, 1600.0], name="rail_bar")
    write_map(soc, here / "soc.nc")
    write_map(rail, here / "rail.csv")  # points
    told = ran(
        capsys, "map", "export", "soc.nc", "rail.csv", "--label", "Soc.Base", "--label", "Rail.Base", "-o", "e.dcm"
    )
    back = read_dcm(here / "e.dcm").maps
    assert list(back) == ["Soc.Base", "Rail.Base"]
    np.testing.assert_array_equal(back["Soc.Base"].values, soc.values)
    assert told["left_out"] == ["sd", "support"]
    told = ran(capsys, "map", "export", "e.dcm", "--name", "Rail.Base", "-o", "rail.nc")
    assert read_map(here / "rail.nc").values.tolist() == [400.0, 1600.0]


def test_a_measured_engine_becomes_a_map(here: Path, capsys: Capsys) -> None:
    if "advisor_engine_maps" not in datasets.names():
        pytest.skip("advisor_engine_maps is not in MGDD_DATA_DIR")
    told = ran(capsys, "map", "export", "--advisor", "mercedes", "--name", "nox_g_per_kwh", "-o", "nox.nc")
    data = datasets.read("advisor_engine_maps")[1]
    found = read_map(here / "nox.nc")
    np.testing.assert_array_equal(found.values, data["nox_g_per_kwh"])
    assert found.unit == "g/kWh"
    assert "Oak Ridge" in found.provenance["citation"]
    assert set(np.unique(found.cells["source"])) == {"measured", "unattainable"}
    assert told["maps"][0]["axes"] == dict(data["nox_g_per_kwh"].sizes)
    assert main(["map", "show", "nox.nc", "--contour", "--figure", "nox.png"]) == 0
    assert (here / "nox.png").stat().st_size > 10_000


def test_a_measured_grid_becomes_a_label_file(here: Path, capsys: Capsys, caplog: pytest.LogCaptureFixture) -> None:
    """The way of a measured map: its axes chosen, its gaps filled within a tolerance, as CDFX and as DCM."""
    pytest.importorskip("clarabel", reason="clarabel is not installed: pip install 'mgdd[maps]'")
    torque = 50.0 + 1e-2 * SPEED[:, None] - 0.4 * FUEL
    rows = [["speed [1/min] / fuel [mg]", *FUEL], *([n, *row] for n, row in zip(SPEED, torque, strict=True))]
    rows[1][3] = rows[3][5] = ""
    (here / "bench.csv").write_text("Größtes Moment [Nm]\n" + "\n".join(";".join(map(str, row)) for row in rows))
    assert main(["map", "show", "bench.csv"]) == 2
    assert "pass --rows 'speed [1/min]' if speed [1/min] runs down" in capsys.readouterr().err
    asked = ["bench.csv", "--rows", "speed_rpm", "--columns", "fuel_mg", "--name", "torque_nm"]
    told = ran(capsys, "map", "smooth", *asked, "--fill", "--tolerance", "0.5", "-o", "smooth.nc")
    assert told["tolerance"] == 0.5
    assert 0.0 <= told["largest_shift"] <= 0.5
    (doubt,) = told["warnings"]
    assert doubt.startswith("torque_nm: extrapolated 1 cell: speed_rpm = 3000, fuel_mg = 40")
    back = read_map(here / "smooth.nc")
    np.testing.assert_allclose(back.values, torque, atol=0.5)
    assert (back.cells["source"][0, 2], back.cells["source"][2, 4]) == ("interpolated", "extrapolated")
    assert main(["map", "smooth", *asked, "--fill", "--tolerance", "0.5"]) == 0
    shown = capsys.readouterr().out
    assert caplog.messages[-1] == doubt
    assert "tolerance 0.5" in shown
    assert "extrapolated, 1 cell" in shown
    for ending in ("cdfx", "dcm"):
        ran(capsys, "map", "export", "smooth.nc", "--label", "KF.Torque", "--encoding", "latin-1", "-o", f"e.{ending}")
    first, second = read_dcm(here / "e.cdfx"), read_dcm(here / "e.dcm")
    assert first == second
    assert first.maps["KF.Torque"].labels["KF.Torque"].long_name == "Größtes Moment"
    assert "Größtes".encode("latin-1") in (here / "e.dcm").read_bytes()


def test_axes_without_names_are_doubted_on_the_command_line(
    here: Path, capsys: Capsys, caplog: pytest.LogCaptureFixture
) -> None:
    (here / "bare.csv").write_text(",10,20\n900,1,2\n1500,3,5\n")
    assert main(["map", "show", "bare.csv"]) == 0
    assert "name it with --rows 'speed_rpm'" in caplog.messages[0]
    capsys.readouterr()
    assert main(["map", "export", "bare.csv", "--encoding", "latin-1", "-o", "a.nc"]) == 2
    assert "--encoding does not act here; only a .dcm or .cdfx file" in capsys.readouterr().err
