"""`mgdd engine check`, and the forms of pressure files on the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from mgdd import datasets, io
from mgdd.cli import main
from mgdd.results.labels import ANGLE
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
    assert main(["engine", "check", *files, *HD, "--json"]) == 1
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
    assert main(["engine", "check", *files[1:], *HD]) == 1
    clipped, torn = capsys.readouterr().out.split("\n\n")
    assert clipped.splitlines()[0] == "clipped.csv: fail"
    assert clipped.splitlines()[1].split()[0] == "samples"
    assert torn.splitlines()[0] == "torn.csv: fail"


def test_what_is_stated_is_judged(files: list[str], tmp_path: Path, capsys: Capsys) -> None:
    def verdict(*options: str) -> str:
        code = main(["engine", "check", files[0], *HD, "--json", *options])
        (file,) = json.loads(capsys.readouterr().out)["files"]
        assert code == (file["verdict"] == "fail")
        verdicts = {check["name"]: check["verdict"] for check in file["checks"]}
        return str(verdicts.get("work and heat", file["verdict"]))

    assert verdict("--bmep-bar", "12.5") == "no fault found"  # closed IMEP is 13.7 bar
    assert verdict("--bmep-bar", "8") == "doubt"
    assert verdict("--bmep-bar", "15") == "fail"
    assert verdict() == "open"
    assert main(["engine", "check", files[0], *HD, "--inlet-pressure-kpa", "100"]) == 2
    assert "--pegging inlet" in capsys.readouterr().err
    assert main(["engine", "check", str(tmp_path / "none.csv"), *HD]) == 2


TRACE = datasets.read("hd_diesel_128x144")[1]
CLOSED, BAR = TRACE[ANGLE].to_numpy(), TRACE["pressure_bar"].to_numpy()
# CA50 of the plain file, as the data set documents it in test_engine_trace.
CA50 = 6.9


def written(folder: Path, columns: list[np.ndarray], header: str) -> str:
    path = folder / "bench.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.12g")
    return str(path)


FORMS: dict[str, tuple[list[np.ndarray], str, list[str], str]] = {
    "unit": ([CLOSED, BAR / 10.0], "angle,p", ["--pressure-unit", "MPa"], ""),
    "header": ([CLOSED, BAR * 100.0], "angle,p_kPa", [], ""),
    "volts": (
        [CLOSED, (BAR + 7.5) / 25.0], "angle,U [V]", ["--gain-bar-per-v", "25", "--offset-bar", "-7.5"],
        "pass --gain-bar-per-v and --offset-bar",
    ),
    "count": ([BAR], "p", ["--angle-step-deg", "1", "--angle-start-deg", "-143"], "pass --angle-step-deg"),
    "time": (
        [(CLOSED + 143.0) / 7.2, BAR], "time_ms,p", ["--speed-rpm", "1200", "--angle-start-deg", "-143"],
        "pass --speed-rpm",
    ),
    "time set": (
        [(CLOSED + 143.0) / 7.2, BAR], "t,p",
        ["--set", "speed_rpm=1200", "--angle-start-deg", "-143", "--angle-unit", "ms"], "or --angle-unit 'ms' and",
    ),
    "column": ([CLOSED, BAR, 0.9 * BAR], "angle,mean,min", ["--pressure-column", "mean"], "--pressure-column 'mean'"),
    "angle": ([np.arange(267.0), CLOSED, BAR], "sample,phi,p", ["--angle-column", "phi"], "pass --angle-column 'phi'"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_every_form_has_its_option(form: str, tmp_path: Path, capsys: Capsys) -> None:
    columns, header, options, message = FORMS[form]
    path = written(tmp_path, columns, header)
    assert main(["engine", "analyze", path, *HD, *options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ca50_cad"] == pytest.approx(CA50, abs=0.1)
    if message:
        assert main(["engine", "analyze", path, *HD]) == 2
        assert message in capsys.readouterr().err


def test_the_speed_of_a_file_comes_from_its_conditions(tmp_path: Path, capsys: Capsys) -> None:
    path = written(tmp_path, [(CLOSED + 143.0) / 7.2, BAR], "time_ms,p")
    conditions = tmp_path / "conditions.csv"
    conditions.write_text("file,speed_rpm\nbench.csv,1200\n")
    wrong = ["--speed-rpm", "600", "--angle-start-deg", "-143"]
    assert main(["engine", "analyze", path, *HD, *wrong, "--conditions", str(conditions), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ca50_cad"] == pytest.approx(CA50, abs=0.1)


def test_warnings_of_reading_are_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = written(tmp_path, [CLOSED, 0.1 * BAR], "angle,p")
    assert main(["engine", "analyze", path, *HD]) == 0
    assert "--pressure-unit 'MPa' would make it 2.32 bar" in caplog.text


def test_a_calibration_names_the_columns_to_choose_from(tmp_path: Path, capsys: Capsys) -> None:
    path = written(tmp_path, [CLOSED, BAR, 1.02 * BAR], "angle,p1,p2")
    assert main(["engine", "calibrate", path, *HD]) == 2
    assert "bench.csv: 2 cycles, and one is needed" in capsys.readouterr().err
