"""`mgdd throttle export`: what the library writes, from the numbers of a tuner on a throttle of another friction."""

import json
from pathlib import Path

import mgdd
from mgdd.cli import main
from mgdd.loop import export_controller, tuned
from mgdd.loop.controller_families import groups_of
from mgdd.loop.tune import with_stiction
from mgdd.throttle import Throttle
from typed import Capsys, refused
from typed import ran as run_json


def test_export_writes_what_the_library_writes(capsys: Capsys, tmp_path: Path) -> None:
    numbers = tuned.shipped_numbers("pid", groups_of(Throttle())) | {"kick": 0.7123456789012345}
    (tmp_path / "pid.json").write_text(json.dumps({"controller": "pid", "numbers": numbers}))
    argv = ("--plant-scale", "coulomb_nm=1.3", "--numbers", str(tmp_path / "pid.json"), "--reference", "step:20:40")
    out = run_json(capsys, "throttle", "export", "pid", "--float", *argv, "--seed", "4", "-o", str(tmp_path / "cli"))
    plant = Throttle().replace(**with_stiction_of({"coulomb_nm": 1.3}))
    controller = tuned.tuned_controller("pid", Throttle(), numbers=numbers)
    folder = tmp_path / "library"
    own = export_controller(controller, folder, reference="step:20:40", throttle=plant, seed=4, single_precision=True)
    assert out["settling_ms"] == float(own["settling_ms"])
    assert out["allowed_difference"] == own.attrs["allowed_difference"]
    assert out["cmake_dir"] == mgdd.cmake_dir()
    assert len(out["files"]) == 4
    for file in map(Path, out["files"]):
        assert file.read_text() == (folder / file.name).read_text()


def with_stiction_of(scales: dict[str, float]) -> dict[str, float]:
    return {name: getattr(Throttle(), name) * factor for name, factor in with_stiction(scales).items()}


def test_export_says_what_it_needs(capsys: Capsys, tmp_path: Path) -> None:
    assert "-o is needed: name the folder to write into" in refused(capsys, "throttle", "export", "pid")
    assert "invalid choice: 'mgdd1'" in refused(capsys, "throttle", "export", "mgdd1", "-o", str(tmp_path / "a"))
    (tmp_path / "a").write_text("mine")
    said = refused(capsys, "throttle", "export", "pid", "-o", str(tmp_path / "a"))
    assert "must be a folder, and this is a file: name another" in said
    assert main(["throttle", "export", "pid", "-o", str(tmp_path / "a b")]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("cmake -S '")
    assert "-Dmgdd_DIR=" in last
