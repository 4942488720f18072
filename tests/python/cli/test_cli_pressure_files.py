"""Pressure files on the command line: an option for every form, and messages that name the option."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mgdd import datasets
from mgdd.cli import main
from mgdd.results.labels import ANGLE
from typed import Capsys

HD = ("--preset", "hd_diesel_128x144")
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
