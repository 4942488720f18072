"""`mgdd map` in a terminal: what stands in the table of a map, and that a wide one is cut into parts."""

from pathlib import Path

import numpy as np
import pytest

from map_cases import timing_table
from mgdd.cli import main
from mgdd.cli.map_files import map_blocks
from mgdd.cli.output import show
from mgdd.maps import CalibrationMap, write_map
from typed import Capsys


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


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
