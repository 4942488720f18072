"""`mgdd map show | diff | export`: the table in a terminal, axes in any order, file forms, measured engines."""

from pathlib import Path

import numpy as np
import pytest

from map_cases import FUEL, SPEED, bend, centre, timing_table
from map_cases import sweep as map_sweep
from mgdd import datasets
from mgdd.cli import main
from mgdd.cli.map_files import map_blocks
from mgdd.cli.output import show
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


def small() -> CalibrationMap:
    return CalibrationMap(
        {"speed_rpm": [900.0, 1500.0], "fuel_mg": [6.5, 20.0, 40.0]},
        [[1.0, -4.25, -6.0], [0.0, -10.5, np.nan]],
        name="soc_cad",
        cells={
            "source": [["optimised", "learned", "optimised"], ["optimised", "optimised", "infeasible"]],
            "active_limit": [["", "p_max_bar", ""], ["", "p_max_bar", ""]],
            "sd": 0.25,
        },
        provenance={"from": "bench run 7"},
    )


def test_the_table_has_breakpoints_units_and_flags() -> None:
    assert show(map_blocks(small())).splitlines() == [
        "CalibrationMap soc_cad [°CA aTDC], 2 speed_rpm x 3 fuel_mg, 1 infeasible, 1 learned, 4 optimised",
        "  from: bench run 7",
        "",
        "start of combustion [°CA aTDC]",
        "down: speed [rpm]; across: fuel [mg]",
        "speed_rpm   6.5         20        40",
        "      900  1.00      -4.25 bc  -6.00",
        "     1500  0.00     -10.50 c       – a",
        "a: infeasible, 1 cell",
        "b: learned, 1 cell",
        "c: held by p_max_bar, 2 cells",
    ]


def test_a_curve_is_two_columns() -> None:
    curve = CalibrationMap({"fuel_mg": [6.0, 20.0, 40.0]}, [400.0, 825.5, 1600.0], name="rail_bar")
    assert show(map_blocks(curve)).splitlines() == [
        "CalibrationMap rail_bar [bar], 3 fuel_mg, 3 given",
        "",
        "fuel [mg]  rail [bar]",
        "        6         400",
        "       20         826",
        "       40        1600",
    ]


@pytest.mark.parametrize("column", ["value", "p_max_bar", *timing_table().cells])
def test_every_column_can_be_shown(column: str, here: Path, capsys: Capsys) -> None:
    table = timing_table().replaced(cells={"p_max_bar": np.arange(15.0).reshape(3, 5)})
    write_map(table, here / "map.nc")
    assert main(["map", "show", "map.nc", "--column", column]) == 0
    lines = capsys.readouterr().out.splitlines()
    row = next(line for line in lines if line.startswith("     1400")).replace(" c", "").split()[1:]
    cells = table.values if column == "value" else table.cells[column]
    if cells.dtype.kind == "U":
        assert row == [text or "–" for text in cells[1]]
    else:
        found = [np.nan if word == "–" else float(word) for word in row]
        np.testing.assert_allclose(found, cells[1], atol=6e-4)
    title = next(place for place, line in enumerate(lines) if line.startswith("down: ")) - 1
    assert lines[title].endswith("[°CA aTDC]") == (column in ("value", "low", "high"))
    assert lines[title].endswith("[°CA]") == (column == "sd")
    assert lines[title].endswith("[bar]") == (column == "p_max_bar")


@pytest.mark.parametrize("size", [1e-9, 0.03, 1.0, 4e4, 3e9])
def test_numbers_of_any_size_keep_four_digits(size: float) -> None:
    rows = np.array([[1.2344, -0.5678], [0.1, 0.0]]) * size
    table = CalibrationMap({"x": [0.0, 1.0], "y": [0.0, 1.0]}, rows, name="share")
    lines = show(map_blocks(table)).splitlines()[-2:]
    found = np.array([[float(word) for word in line.split()[1:]] for line in lines])
    np.testing.assert_allclose(found, rows, atol=6e-4 * size)
    assert max(map(len, lines)) < 40


def test_a_wide_map_is_cut_for_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = {"speed_rpm": [900.0, 1500.0], "fuel_mg": np.arange(1.0, 31.0)}
    table = CalibrationMap(axes, -np.arange(60.0).reshape(2, 30) / 7.0, name="soc_cad")
    whole = show(map_blocks(table))
    assert len(whole.splitlines()) == 7
    monkeypatch.setattr("mgdd.cli.map_files.is_terminal", lambda: True)
    monkeypatch.setenv("COLUMNS", "80")
    cut = show(map_blocks(table))
    assert max(map(len, cut.splitlines())) <= 80
    assert sum(line.startswith("speed_rpm") for line in cut.splitlines()) == 4
    assert all(f"{value:.3f}" in cut for value in table.values.ravel()[1:])


def test_a_picture_of_each_kind(here: Path, capsys: Capsys) -> None:
    write_map(timing_table(), here / "map.nc")
    for options in (
        ["--figure", "cells.svg"],
        ["--figure", "sd.pdf", "--column", "sd"],
        ["--figure", "c.png", "--contour"],
    ):
        assert main(["map", "show", "map.nc", *options]) == 0
        assert f"wrote {options[1]}" in capsys.readouterr().err
        assert (here / options[1]).stat().st_size > 5_000
    assert (here / "cells.svg").read_text().startswith("<?xml")


def test_equal_maps_have_no_difference(here: Path, capsys: Capsys) -> None:
    write_map(small(), here / "a.nc")
    write_map(small(), here / "b.csv")
    assert main(["map", "diff", "a.nc", "b.csv"]) == 0
    assert "no difference in 5 cells" in capsys.readouterr().out
