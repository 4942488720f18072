"""`mgdd map trade-off`: lines in closed form, where a map stands on them, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from map_cases import FUEL, SOC, SPEED, bend, centre, efficiency, p_max
from map_cases import sweep as map_sweep
from mgdd.cli import main
from mgdd.io.binary_files import write_netcdf
from mgdd.maps import CalibrationMap, optimize_map, write_map
from typed import Capsys, ran

AXES = ["--right", "p_max_bar", "--up", "efficiency_gross"]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_netcdf(map_sweep(), tmp_path / "table.nc")
    write_map(optimize_map(map_sweep(), "efficiency_gross"), tmp_path / "best.nc")
    write_map(CalibrationMap({"fuel_mg": [6.0, 40.0]}, [1.0, 2.0], name="rail_bar"), tmp_path / "rail.nc")
    return tmp_path


def test_a_line_per_breakpoint_of_the_axis_that_is_left(here: Path, capsys: Capsys) -> None:
    found = ran(
        capsys, "map", "trade-off", "table.nc", *AXES, "--at", "speed_rpm=1400", "--map", "best.nc",
        "--figure", "trade.png", "--every", "9",
    )  # fmt: skip
    assert (found["right"], found["up"], found["along"], found["at"]) == (
        "p_max_bar", "efficiency_gross", "soc_cad", {"speed_rpm": 1400.0},
    )  # fmt: skip
    assert [line["fuel_mg"] for line in found["lines"]] == FUEL.tolist()
    for line, fuel in zip(found["lines"], FUEL, strict=True):
        np.testing.assert_array_equal(line["soc_cad"], SOC)
        np.testing.assert_allclose(line["p_max_bar"], p_max(1400.0, fuel, SOC), rtol=1e-12)
        np.testing.assert_allclose(line["efficiency_gross"], efficiency(1400.0, fuel, SOC), rtol=1e-12)
        chosen = line["chosen"]
        assert chosen["soc_cad"] == pytest.approx(centre(1400.0, fuel), abs=1e-6)
        assert chosen["p_max_bar"] == pytest.approx(p_max(1400.0, fuel, chosen["soc_cad"]), rel=1e-9)
        missed = 0.5 - chosen["efficiency_gross"]  # linear between points that lie at most 0.5 apart
        assert 0.0 <= missed <= bend(1400.0, fuel) * 0.25**2 + 1e-12
    assert (here / "trade.png").read_bytes().startswith(b"\x89PNG")


def test_every_axis_can_be_fixed_and_the_lines_can_be_kept(here: Path, capsys: Capsys) -> None:
    both = ["--at", "fuel_mg=25", "--at", "speed_rpm=900"]
    (line,) = ran(capsys, "map", "trade-off", "table.nc", *AXES, *both)["lines"]
    assert set(line) == {"soc_cad", "p_max_bar", "efficiency_gross"}
    np.testing.assert_allclose(line["p_max_bar"], p_max(900.0, 25.0, SOC), rtol=1e-12)
    assert main(["map", "trade-off", "table.nc", *AXES, "--at", "fuel_mg=25", "-o", "lines.json"]) == 0
    kept = json.loads((here / "lines.json").read_text())
    assert [own["speed_rpm"] for own in kept["lines"]] == SPEED.tolist()
    capsys.readouterr()


@pytest.mark.usefixtures("here")
def test_the_text_has_ranges_with_units(capsys: Capsys) -> None:
    assert main(["map", "trade-off", "table.nc", *AXES, "--at", "fuel_mg=6", "--map", "best.nc"]) == 0
    head, first, *others = capsys.readouterr().out.splitlines()
    assert head.split("  ")[0] == "speed_rpm"
    assert "soc_cad [°CA aTDC]" in head
    assert "p_max_bar [bar]" in head
    assert "chosen soc_cad" in head
    low, high = p_max(900.0, 6.0, SOC[-1]), p_max(900.0, 6.0, SOC[0])
    assert f"{low:.4g} to {high:.4g}" in first
    assert f"{centre(900.0, 6.0):.4g}" in first
    assert len(others) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([*AXES], "one line each for speed_rpm x fuel_mg is too much: fix one with --at AXIS=X"),
        ([*AXES, "--at", "speed_rpm=1500"], "--at speed_rpm=1500: not a breakpoint of the table; the nearest is 1400"),
        ([*AXES, "--at", "speed=900"], "--at speed: not an operating axis of the table: it has speed_rpm, fuel_mg"),
        ([*AXES, "--at", "soc_cad=0"], "--at soc_cad: not an operating axis"),
        (["--right", "p_max_bar", "--up", "p_max_bar"], "--right and --up are both p_max_bar: name two variables"),
        ([*AXES, "--along", "soi_cad"], "must stand over the same axes, one of them --along soi_cad"),
        (["--right", "p_max", "--up", "efficiency_gross"], "no variable 'p_max': did you mean 'p_max_bar'?"),
        (["--right", "p_max_bar", "--up", "speed_rpm"], "no variable 'speed_rpm': it has efficiency_gross, p_max_bar"),
        ([*AXES, "--at", "fuel_mg=6", "--every", "3"], "--every does not act here; it labels the picture"),
        ([*AXES, "--at", "fuel_mg=6", "--name", "soc_cad"], "--name does not act here; without --map no map is read"),
        ([*AXES, "--at", "fuel_mg=6", "--map", "rail.nc"], "it does not belong to this map"),
        ([*AXES, "--along", "fuel_mg", "--at", "speed_rpm=900", "--map", "best.nc"], "not a map of fuel_mg"),
        ([*AXES, "--at", "fuel_mg=6", "--figure", "a.png", "--every", "0"], "every = 0: must be >= 1"),
        ([*AXES, "--at", "fuel_mg=6", "-o", "a.csv"], "the ending must be one of .json"),
    ],
)
def test_what_is_refused(options: list[str], message: str, here: Path, capsys: Capsys) -> None:
    before = sorted(here.iterdir())
    assert main(["map", "trade-off", "table.nc", *options]) == 2
    assert message in capsys.readouterr().err
    assert sorted(here.iterdir()) == before
