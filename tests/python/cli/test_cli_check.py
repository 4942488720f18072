"""`mgdd engine check`: one verdict per file, refused files among them, as text and as JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mgdd import datasets, io
from mgdd.cli import main
from typed import Capsys

HD = ("--preset", "hd_diesel_128x144")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("bench")
    sound = datasets.read("hd_diesel_128x144")[1]
    io.write_csv(sound, folder / "sound.csv")
    io.write_csv(sound.assign(pressure_bar=sound["pressure_bar"].clip(max=100.0)), folder / "clipped.csv")
    (folder / "torn.csv").write_text("crank_angle_cad,pressure_bar\n-30,4\n-29,?\n", encoding="utf-8")
    return [str(folder / name) for name in ("sound.csv", "clipped.csv", "torn.csv")]


def test_every_file_has_a_verdict(files: list[str], capsys: Capsys) -> None:
    assert main(["engine", "check", *files, *HD, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["files"]
    assert [(each["file"], each["verdict"]) for each in found] == [
        ("sound.csv", "no fault found"), ("clipped.csv", "fail"), ("torn.csv", "fail"),
    ]  # fmt: skip
    (samples,) = [check for check in found[1]["checks"] if check["name"] == "samples"]
    assert samples["verdict"] == "fail"
    assert "a saturated amplifier" in samples["text"]
    assert "amplifier" in samples["remedy"]
    assert "line 3" in found[2]["checks"][0]["text"]


def test_without_an_engine_the_geometry_is_open(files: list[str], capsys: Capsys) -> None:
    def seen(*options: str) -> dict[str, object]:
        assert main(["engine", "check", files[0], "--json", *options]) == 0
        return dict(json.loads(capsys.readouterr().out))

    bare = seen()
    assert [each["verdict"] for each in bare["files"]] == ["open"]
    assert "bore_mm = 86" in bare["assumed"]
    assert bare["engine"]["bore_mm"] == 86.0
    part = seen("--set", "bore_mm=128", "--set", "stroke_mm=144")
    assert "bore_mm" not in part["assumed"]
    assert "compression_ratio" in part["assumed"]
    assert [each["verdict"] for each in part["files"]] == ["doubt"]  # the compression ratio is that of another engine
    whole = seen(*HD)
    assert (whole["assumed"], whole["files"][0]["verdict"]) == ("", "no fault found")
    assert whole["files"][0]["checks_made"] == 7
    assert whole["files"][0]["warnings"] == []


def test_fuel_by_set_is_fuel(files: list[str], capsys: Capsys) -> None:
    texts = []
    for stated in (["--fuel-mg", "400"], ["--set", "fuel_mg=400"]):
        assert main(["engine", "check", files[0], *HD, *stated]) == 0
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1]
    assert "of the heat of the stated fuel" in texts[0]


def test_text_says_the_worst_first(files: list[str], capsys: Capsys) -> None:
    assert main(["engine", "check", *files[1:], *HD]) == 0
    clipped, torn = capsys.readouterr().out.split("\n\n")
    assert clipped.splitlines()[0] == "clipped.csv: fail"
    assert clipped.splitlines()[1].split()[0] == "samples"
    assert torn.splitlines()[0] == "torn.csv: fail"


def test_what_is_stated_is_judged(files: list[str], tmp_path: Path, capsys: Capsys) -> None:
    def verdict(*options: str) -> str:
        assert main(["engine", "check", files[0], *HD, "--json", *options]) == 0
        (file,) = json.loads(capsys.readouterr().out)["files"]
        verdicts = {check["name"]: check["verdict"] for check in file["checks"]}
        return str(verdicts.get("work and heat", file["verdict"]))

    assert verdict("--bmep-bar", "12.5") == "no fault found"  # closed IMEP is 13.7 bar
    assert verdict("--bmep-bar", "8") == "doubt"
    assert verdict("--bmep-bar", "15") == "fail"
    assert verdict() == "open"
    assert main(["engine", "check", files[0], *HD, "--inlet-pressure-kpa", "100"]) == 2
    assert "--pegging inlet" in capsys.readouterr().err
    assert main(["engine", "check", str(tmp_path / "none.csv"), *HD]) == 2
