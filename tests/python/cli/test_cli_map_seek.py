"""`mgdd map seek`: Ctrl-C and a record, several inputs, and what is wrong with an option."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.cli import main, map_seek
from mgdd.loop import VirtualEngine
from mgdd.maps import read_map
from mgdd.optimize import MapSeeking
from typed import Capsys, commands

seek, refused = commands("map", "seek")
AXES = ("--over", "speed_rpm=1200:2400:3", "--over", "fuel_mg=12,28")
MODEL = ("--guide", "model", "--guide-set", "wall_heat_scale=1.0", "--limit", "p_max_bar=:120", "--averaged", "10:30")


def test_a_search_that_was_stopped_goes_on_as_if_it_had_not(tmp_path: Path, capsys: Capsys) -> None:
    record, whole = tmp_path / "visits.csv", tmp_path / "whole.csv"
    argv = [*AXES, *MODEL, "--record", str(record), "--json", "--quiet"]
    program = "import sys; from mgdd.cli import main; sys.exit(main(sys.argv[1:]))"
    with subprocess.Popen(
        [sys.executable, "-c", program, "map", "seek", *argv, "--visits", "5000"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        while not (record.exists() and record.read_text().count("\n") > 3) and process.poll() is None:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    assert process.returncode == 130, err.decode()
    part = json.loads(out)
    assert part["interrupted"] is True
    assert f"interrupted: {part['visits']} visits are kept".encode() in err
    more = ("--visits", str(part["visits"] + 4))
    again = seek(capsys, *argv[:-2], *more)
    assert again["visits"] == part["visits"] + 4
    assert seek(capsys, *AXES, *MODEL, *more, "--record", str(whole))["inputs"] == again["inputs"]
    assert whole.read_text() == record.read_text()


def test_two_inputs_are_two_labels_of_one_file(tmp_path: Path, capsys: Capsys) -> None:
    file, drawn = tmp_path / "engine.dcm", tmp_path / "maps.png"
    argv = ["--over", "fuel_mg=12,20,28", "--input", "egr=0:0.3:0.05", "--limit", "nox_soft_ppm=900", "--visits", "6"]
    assert main(["map", "seek", *argv, *MODEL[:4], "-o", str(file), "--figure", str(drawn)]) == 0
    out = capsys.readouterr().out
    assert "CalibrationMap soc_cad" in out
    assert "CalibrationMap egr" in out
    assert "keeps the map" not in out
    assert [read_map(file, name=name).values.size for name in ("soc_cad", "egr")] == [3, 3]
    assert drawn.stat().st_size > 10_000


def test_an_engine_is_driven_and_the_map_learns_on(
    tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drive.csv").write_text("speed_rpm,fuel_mg,cycles\n1300,13,20\n2350,27,15\n")
    drawn = list[bytes]()
    monkeypatch.setattr("mgdd.cli.map_seek.save_figure", lambda *_, quiet: drawn.append(b"" if quiet else b"told"))
    argv = [*AXES, *MODEL, "--visits", "5", "--drive", "drive.csv", "--figure", "map.png", "--live", "-o", "map.nc"]
    found = seek(capsys, *argv)
    assert drawn == [b""] * 5
    assert Path("map.png").stat().st_size > 10_000
    assert found["driven_cycles"] == 35
    assert 40.0 < found["driven_j"] < 60.0  # percent
    learnt = read_map(Path("map.nc"))
    assert learnt.provenance["driven"] == "35 cycles"
    assert np.argwhere(learnt.cells["source"] == "learned").tolist() == [[0, 0], [2, 1]]


def test_a_search_that_is_written_drives_another_engine_and_is_written_back(tmp_path: Path, capsys: Capsys) -> None:
    file, steps = tmp_path / "search.json", ("--input", "soc_cad=-25:8:0.5", "--limit", "p_max_bar=40:115")
    seek(capsys, *AXES, *MODEL[:4], *steps, "--visits", "8", "--averaged", "20", "--search", str(file))
    drive = ["engine", "seek", "--map", str(file), "--speed-rpm", "1500", "--fuel-mg", "16", "--cycles", "25", "--json"]
    for readings in (33, 58):
        assert main([*drive, "--seed", str(readings)]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["start"]["soc_cad"] == pytest.approx(found["inputs"]["soc_cad"], abs=2.0)
        assert abs(found["j_lost"]) < 0.1  # percent
        assert MapSeeking.load(file).readings == readings
    for idle in (["--limit", "p_max_bar=100"], ["--input", "egr=0:0.3"], ["--guide", "curve"], ["--seeker", "spsa"]):
        assert main([*drive, *idle]) == 2
        assert f"{idle[0]} does not act here; the search of --map has its own" in capsys.readouterr().err
    assert main([*drive[:3], str(tmp_path / "none.json")]) == 2
    assert MapSeeking.load(file).readings == 58


def test_a_drive_that_is_stopped_keeps_the_map(tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(engine: VirtualEngine, *args: Any, **how: Any) -> Any:
        made = engine.measure

        def measure() -> Any:
            if engine.cycle == 12:
                raise KeyboardInterrupt
            return made()

        monkeypatch.setattr(engine, "measure", measure, raising=False)
        return found_by(engine, *args, **how)

    found_by = map_seek.seek
    monkeypatch.setattr(map_seek, "seek", stopped)
    file, drive = tmp_path / "map.nc", tmp_path / "drive.csv"
    drive.write_text("speed_rpm,fuel_mg,cycles\n1300,13,40\n")
    code = main(["map", "seek", *AXES, *MODEL, "--visits", "5", "--drive", str(drive), "-o", str(file), "--json"])
    assert code == 130
    told = json.loads(capsys.readouterr().out)
    assert told["interrupted"] is True
    assert told["driven_cycles"] == 12
    assert read_map(file).provenance["driven"] == "12 cycles"


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("speed_rpm,fuel_mg,cycles\n1300,0,9\n", "drive.csv: "),
        ("speed_rpm,cycles\n1300,20\n", "no column 'fuel_mg'"),
        ("speed_rpm,fuel_mg,cycles\n1300,13,2.5\n", "column cycles: must be whole numbers >= 1"),
        ("speed_rpm,fuel_mg,cycles\n1300,13,9\n-1300,13,9\n", "point 2: speed_rpm = -1300 rpm: must be"),
    ],
)
def test_a_drive_that_cannot_be_driven_is_refused_before_the_first_visit(
    tmp_path: Path, capsys: Capsys, rows: str, said: str
) -> None:
    file, record = tmp_path / "drive.csv", tmp_path / "visits.csv"
    file.write_text(rows)
    assert said in refused(capsys, *AXES, *MODEL, "--drive", str(file), "--record", str(record))
    assert not record.exists()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("", "--over is given 0 times: a map has one axis or two"),
        ("--over speed_rpm=1000:2000", "write NAME=LOW:HIGH:N"),
        ("--over speed=1:2:2", "--over: 'speed' is not a number of an operating point; did you mean 'speed_rpm'"),
        ("--over speed_rpm=2000,1000", "--over of speed_rpm = [2000.0, 1000.0]: must be two entries at least"),
        ("--over fuel_mg=0,20", "--over at fuel_mg = 0: "),
        ("--over speed_rpm=1000,2000 --speed-rpm 900", "speed_rpm is an axis, --over, and a number of the point"),
        ("--over fuel_mg=9,20 --guide-set wall_heat_scale=1", "--guide-set does not act here; --guide none has no"),
        ("--over fuel_mg=9,20 --guide model --start soc_cad=1", "--start does not act here; with --guide model"),
        ("--over fuel_mg=9,20 --start egr=1", "--start has egr: must have one number for each of soc_cad"),
        ("--over fuel_mg=9,20 --averaged 9:x", "--averaged 9:x: write N or N:MOST"),
        ("--over fuel_mg=9,20 --settling -1", "--settling -1: must be a whole number of cycles >= 0"),
        ("--over fuel_mg=9,20 --visits 0", "--visits 0: must be a whole number >= 1"),
        ("--over fuel_mg=9,20 --limit cov_imep_percent=3 --guide model", "--limit: cov_imep_percent has no steady"),
        ("--over fuel_mg=9,20 --input egr=0:0.3 -o a.nc", "-o a.nc: 2 maps fit into a .dcm or .cdfx only"),
        ("--over fuel_mg=9,20 --live", "--live draws --figure anew after every visit: give --figure too"),
        ("--over fuel_mg=9,20 --record none/a.csv", "--record none/a.csv: the folder none does not exist"),
    ],
)  # fmt: skip
def test_a_wrong_option_is_named_with_its_remedy(given: str, said: str, capsys: Capsys) -> None:
    assert said in refused(capsys, *given.split())
