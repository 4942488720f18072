"""`mgdd throttle simulate`: the summary of the library, files, figures, and every refusal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mgdd import io, presets
from mgdd.cli import main
from mgdd.throttle import simulate_throttle
from mgdd.throttle.simulation import step_summary
from typed import Capsys, commands

COMMAND = ("throttle", "simulate")
run_json, refused = commands(*COMMAND)


def table(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_step_prints_the_summary_of_the_library(capsys: Capsys) -> None:
    out = run_json(capsys, "--preset", "P1", "--duty", "1", "--duration-s", "0.3")
    run = simulate_throttle(presets.load("P1").throttle, 1.0, duration_s=0.3)
    assert {name: out[name] for name in step_summary(run)} == step_summary(run)
    assert out["t10_s"] == pytest.approx(0.019, abs=0.002)
    assert out["t90_s"] == pytest.approx(0.078, abs=0.002)
    assert (out["bridge"], out["preset"], out["samples"]) == ("brake", "P1", 301)
    assert out["parameters"]["coulomb_nm"] == 0.284


def test_options_reach_the_plant(capsys: Capsys) -> None:
    argv = (
        "--preset", "P2", "--duty", "0", "--start-deg", "90", "--bridge", "open", "--duration-s", "0.4",
        "--sample-s", "0.002", "--step-s", "0.0005", "--supply-v", "14", "--airflow-torque-nm", "-0.05",
        "--set", "coulomb_nm=0.09", "--set", "friction=stiction",
    )  # fmt: skip
    out = run_json(capsys, *argv)
    throttle = presets.load("P2").throttle.replace(coulomb_nm=0.09, friction="stiction")
    run = simulate_throttle(
        throttle, 0.0, start_deg=90.0, bridge="open", duration_s=0.4, sample_s=0.002, step_s=0.0005,
        supply_v=14.0, airflow_torque_nm=-0.05,
    )  # fmt: skip
    assert out["final_angle_deg"] == float(run["angle_deg"][-1])
    shorted = run_json(capsys, *argv[:6], "--duration-s", "0.4")
    assert shorted["t90_s"] > 1.5 * out["t90_s"]  # a shorted motor brakes


def test_a_plate_that_stays_has_no_rise_time(capsys: Capsys) -> None:
    out = run_json(capsys, "--duty", "0.05")
    assert (out["t10_s"], out["t90_s"]) == (None, None)
    assert out["final_angle_deg"] == 8.0
    assert main([*COMMAND, "--duty", "-0.05"]) == 0
    assert "t90_s" in capsys.readouterr().out


def test_a_file_drives_the_run_and_the_run_becomes_a_file(tmp_path, capsys: Capsys) -> None:
    time = np.arange(600) * 1e-3
    duty = 0.3 * np.sin(20.0 * time)
    rows = "\n".join(f"{t:.3f},{u!r},14.4,-0.1" for t, u in zip(time, duty.tolist(), strict=True))
    file = table(tmp_path / "in.csv", f"time_s,duty,supply_v,airflow_torque_nm\ns,-,V,N m\n{rows}\n")
    output, figure = tmp_path / "out.csv", tmp_path / "out.png"
    out = run_json(capsys, "--input", file, "--output", str(output), "--figure", str(figure))
    run = simulate_throttle(
        presets.load("P1").throttle, duty, time_s=time, supply_v=14.4, airflow_torque_nm=-0.1
    )  # fmt: skip
    assert out["final_angle_deg"] == float(run["angle_deg"][-1])
    assert out["duty"] is None
    assert figure.stat().st_size > 10_000
    back = io.read_throttle_log(output)
    np.testing.assert_array_equal(back["angle_deg"], run["angle_deg"])
    again = run_json(capsys, "--input", str(output))  # what it wrote, it reads
    assert again["final_angle_deg"] == out["final_angle_deg"]


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("--duty", "1.2"), "duty = 1.2 at sample 0: must be in [-1, 1]; a duty in percent is divided by 100"),
        (("--duty", "1", "--preset", "puma_single"), "'puma_single' is an engine, not a throttle"),
        (("--duty", "1", "--preset", "P9"), "no preset 'P9'"),
        (("--duty", "1", "--set", "coulomb=1"), "no field 'coulomb'; did you mean"),
        (("--duty", "1", "--set", "foo=1"), "no field 'foo'; the fields are "),
        (("--duty", "1", "--set", "foo=1"), ", coulomb_nm, "),
        (("--duty", "1", "--set", "coulomb_nm=much"), "coulomb_nm = 'much': must be a number [N m]"),
        (("--duty", "1", "--set", "coulomb_nm"), "--set coulomb_nm: write FIELD=VALUE"),
        (("--duty", "1", "--output", "run.txt"), "the ending must be one of .json, .csv"),
        (("--duty", "1", "--figure", "run.bmp"), "the ending must be one of .png, .svg, .pdf"),
        (("--input", "nowhere.csv"), "nowhere.csv"),
    ],
)
def test_bad_options_are_refused(argv: tuple[str, ...], message: str, capsys: Capsys) -> None:
    assert message in refused(capsys, *argv)


@pytest.mark.parametrize(
    ("text", "more", "message"),
    [
        ("time_s,duty\n0,0\n0.001,0.1\n", ("--duration-s", "1"), "--duration-s goes with --duty"),
        ("time_s,duty\n0,0\n0.001,0.1\n", ("--sample-s", "1"), "--sample-s goes with --duty"),
        ("time_s,u\n0,0\n0.001,0.1\n", (), "no column 'duty': the header has 'time_s', 'u'"),
        ("time_s,duty\nms,-\n0,0\n1,0.1\n", (), "in.csv, column 'time_s': unit 'ms': must be 's'; convert the values"),
        ("time_s,duty\ns,%\n0,0\n1,0.1\n", (), "in.csv, column 'duty': unit '%': must be '-'; convert the values"),
        (
            "time_s,duty\n0,0\n0.001,40\n",
            (),
            "in.csv, line 3, column 'duty': duty = 40: must be in [-1, 1]; a duty in percent",
        ),
        ("time_s,duty\n0,0\n0,0.1\n", (), "in.csv, line 3, column 'time_s': 0 s does not exceed the time before"),
        (
            "time_s,duty\n0,0\n1,0\n2,0\n9,0\n",
            (),
            "line 5, column 'time_s': uneven sampling: the step is 7 s and the mean 3 s: resample the duty first",
        ),
        ("time_s,duty\n0,0\n", (), "must be one column of at least two samples"),
        (
            "time_s,duty,supply_v\ns,-,V\n0,0,12\n0.001,0.1,-12\n",
            (),
            "in.csv, line 4, column 'supply_v': supply_v = -12 V: must be >= 0",
        ),
        ("time_s,duty,supply_v\n0,0,12\n0.001,0.1,12\n", ("--supply-v", "12"), "--supply-v and the column supply_v of"),
    ],
)
def test_bad_files_are_refused(text: str, more: tuple[str, ...], message: str, tmp_path: Path, capsys: Capsys) -> None:
    assert message in refused(capsys, "--input", table(tmp_path / "in.csv", text), *more)
