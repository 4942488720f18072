"""`mgdd throttle`: what the library gives, files that go round, a controller for a target, refusals."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mgdd
from mgdd import identify, io, presets, signals
from mgdd.cli import main
from mgdd.loop import export_controller, tuned
from mgdd.loop.controller_families import groups_of
from mgdd.loop.tune import with_stiction
from mgdd.throttle import Throttle, simulate_throttle
from mgdd.throttle.simulation import step_summary
from typed import Capsys, commands, refused
from typed import ran as run_json

KINDS = ("pw_r", "first_principle")


def measured(signal: Any, name: str, seed: int) -> Any:
    run = simulate_throttle(Throttle(), signal["duty"], time_s=signal["time_s"])
    noise = 0.03 * np.random.default_rng(seed).standard_normal(run.sizes["time_s"])
    return io.throttle_log(run["time_s"], run["duty"], run["angle_deg"] + noise, name=name)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """Two logs of P1 as a user would have them."""
    folder = tmp_path_factory.mktemp("logs")
    train = measured(signals.chirp(4.0, offset=0.01, amplitude=0.34, high_hz=5.0), "train", 1)
    test = measured(signals.amplitude_random_steps(3.0, offset=0.0, amplitude=0.33), "test", 2)
    for name, log in (("train", train), ("test", test)):
        io.write_csv(log, folder / f"{name}.csv")
    return str(folder / "train.csv"), str(folder / "test.csv")


# --- excite -----------------------------------------------------------------------------------------------------


def test_excite_designs_what_the_library_designs(capsys: Capsys, tmp_path: Path) -> None:
    file = tmp_path / "chirp.csv"
    out = run_json(capsys, "throttle", "excite", "chirp", "--preset", "P1", "--duration-s", "4", "-o", str(file))
    signal, check = identify.design_excitation("chirp", Throttle(), duration_s=4.0)
    assert out["offset"] == signal.attrs["offset"]
    assert out["amplitude"] == signal.attrs["amplitude"]
    assert out["passed"] is True
    assert out["angle_high_deg"] == check.content.angle_high_deg
    assert out["peak_current_a"] == check.peak_current_a
    assert any("never goes below limp-home" in text for text in out["unanswered"])
    log = io.read_throttle_log(file, supply=None)
    np.testing.assert_array_equal(log["duty"], signal["duty"])
    np.testing.assert_array_equal(log["angle_deg"], check.prediction["angle_deg"])


def test_excite_takes_a_signal_of_ones_own(capsys: Capsys) -> None:
    argv = ("throttle", "excite", "amplitude_random_steps", "--offset", "0.15", "--amplitude", "0.15")
    out = run_json(capsys, *argv, "--duration-s", "3", "--hold-s", "0.1", "--set", "coulomb_nm=0.2")
    assert out["hold_s"] == 0.1
    assert out["samples"] == 3000
    assert main([*argv, "--duration-s", "3"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("amplitude_random_steps, offset 0.15, amplitude 0.15\ninside the limits")


def test_excite_refuses_what_leaves_the_window(capsys: Capsys, tmp_path: Path) -> None:
    file = tmp_path / "no.csv"
    argv = ("throttle", "excite", "chirp", "--offset", "0.15", "--amplitude", "0.3", "-o", str(file))
    said = refused(capsys, *argv)
    assert "this signal must not be sent: the plate opens to" in said
    assert "lower offset or amplitude" in said
    assert not file.exists()
    said = refused(capsys, "throttle", "excite", "chirp", "--max-current-a", "0.3", code=3)
    assert "no chirp above limp-home stays inside" in said


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (("--offset", "0.1"), "--offset and --amplitude belong together"),
        (("--offset", "0.1", "--amplitude", "0.1", "--hold-s", "0.1"), "--hold-s is not an option of a chirp"),
        (("--low-hz", "0.5"), "--low-hz acts on a signal of your own only"),
        (("--offset", "0.5", "--amplitude", "0.9"), "the duty passes ±1"),
        (("--angle-window-deg", "50", "10"), "--angle-window-deg = (50, 10)"),
        (("-o", "chirp.txt"), "the ending must be one of .csv, .json"),
    ],
)
def test_excite_refuses_contradictions(capsys: Capsys, argv: tuple[str, ...], said: str) -> None:
    assert said in refused(capsys, "throttle", "excite", "chirp", *argv)


# --- identify and validate --------------------------------------------------------------------------------------


def test_a_log_becomes_a_throttle_that_a_controller_is_tuned_for(
    capsys: Capsys, tmp_path: Path, files: tuple[str, str]
) -> None:
    own = tmp_path / "own.toml"
    known = ["--resistance-ohm", "1.5", "--supply-v", "12", "--torque-constant-nm-per-a", "0.383"]
    bare = ["throttle", "identify", files[0]]
    identify = [*bare, "--model", "first_principle", "--throttle", str(own)]
    assert "give --resistance-ohm, --supply-v, one of --inertia-kgm2" in refused(capsys, *identify)
    assert "one of --inertia-kgm2" in refused(capsys, *identify, *known, "--inertia-kgm2", "0.002")
    assert "resistance_ohm = -1" in refused(capsys, *identify, "--resistance-ohm", "-1", *known[2:])
    assert "with --throttle FILE.toml" in refused(capsys, *bare, "--supply-v", "12")
    assert "leave it out" in refused(capsys, *bare, "--model", "pw_r", "--throttle", str(own), *known)
    assert not own.exists()
    run_json(capsys, *identify, *known)
    preset = presets.load(own)
    assert preset.throttle.inertia_kgm2 == pytest.approx(0.0021, rel=0.1)
    assert preset.sources["throttle.resistance_ohm"] == "measured"
    assert preset.sources["throttle.coulomb_nm"].startswith("fitted to ")
    assert preset.sources["throttle.bore_mm"] == "default"
    track = ["throttle", "track", "--controller", "guided", "--reference", "step:20:60"]
    found, true = (run_json(capsys, *track, "--preset", name) for name in (str(own), "P1"))
    assert found["settling_ms"] == pytest.approx(true["settling_ms"], rel=0.15)


@pytest.mark.parametrize("model", KINDS)
def test_identify_then_validate(capsys: Capsys, tmp_path: Path, files: tuple[str, str], model: str) -> None:
    train, test = files
    fit_file, figure = tmp_path / "fit.toml", tmp_path / "fit.png"
    out = run_json(
        capsys, "throttle", "identify", train, "--model", model, "--test", test, "--output", str(fit_file),
        "--figure", str(figure),
    )  # fmt: skip
    assert out["kind"] == model
    assert out["train"]["nrmse_fit_percent"] > 98.0
    assert out["test"]["nrmse_fit_percent"] > 92.0
    assert 0.0 < out["test"]["rmse"] < 0.6
    assert out["parameters"]["limp_home_deg"] == pytest.approx(8.0, abs=0.2)
    assert isinstance(out["unidentifiable"], list)
    assert figure.stat().st_size > 10_000
    again = run_json(capsys, "throttle", "validate", str(fit_file), test)
    assert again["kind"] == model
    assert again["fit_percent"] == pytest.approx(out["test"]["nrmse_fit_percent"], rel=1e-9)
    assert again["n_step_rms"]["20"] < 0.3 * again["n_step_rms_persistence"]["20"]
    assert again["fit_percent"] == out["validation"]["fit_percent"]


@pytest.mark.slow
def test_columns_are_mapped(capsys: Capsys, tmp_path: Path, files: tuple[str, str]) -> None:
    log = io.read_throttle_log(files[0])
    rows = zip(log["time_s"].values * 1e3, log["duty"].values * 100.0, np.deg2rad(log["angle_deg"].values), strict=True)
    file = tmp_path / "own.csv"
    file.write_text(
        "t;u;y\n" + "\n".join(f"{t!r};{u!r};{y!r}" for t, u, y in ((float(a), float(b), float(c)) for a, b, c in rows))
    )
    columns = (
        "--time",
        "t",
        "--duty",
        "u",
        "--angle",
        "2",
        "--time-unit",
        "ms",
        "--duty-unit",
        "%",
        "--angle-unit",
        "rad",
    )
    out = run_json(capsys, "throttle", "identify", str(file), *columns)
    assert out["test"] is None
    plain = run_json(capsys, "throttle", "identify", files[0])
    assert out["train"] == pytest.approx(plain["train"], abs=1e-6)
    said = refused(capsys, "throttle", "identify", str(file), *columns[:6])
    assert "time_unit" not in said
    assert "--time-unit 'ms'" in said, "remedies are those of the command line"


def test_bad_logs_and_files_are_refused(capsys: Capsys, tmp_path: Path, files: tuple[str, str]) -> None:
    assert "no such file" in refused(capsys, "throttle", "identify", "nowhere.csv")
    assert "the ending must be" in refused(capsys, "throttle", "identify", files[0], "-o", "fit.yaml")
    assert "--figure fit.txt" in refused(capsys, "throttle", "identify", files[0], "--figure", "fit.txt")
    assert "exchange --duty" in refused(
        capsys, "throttle", "identify", files[0], "--duty", "angle_deg", "--angle", "duty"
    )
    above = measured(signals.chirp(3.0, offset=0.15, amplitude=0.15), "above", 3)
    io.write_csv(above, tmp_path / "above.csv")
    said = refused(capsys, "throttle", "identify", str(tmp_path / "above.csv"), "--two-sided")
    assert "below limp-home" in said
    assert "fit one side with --two-sided left out" in said
    bad = tmp_path / "fit.toml"
    bad.write_text("kind = 'pw_r'\nformat = 1\n")
    assert "no table [parameters]" in refused(capsys, "throttle", "validate", str(bad), files[0])


COMMAND = ("throttle", "simulate")
simulated, refused_run = commands(*COMMAND)


def table(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_step_prints_the_summary_of_the_library(capsys: Capsys) -> None:
    out = simulated(capsys, "--preset", "P1", "--duty", "1", "--duration-s", "0.3")
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
    out = simulated(capsys, *argv)
    throttle = presets.load("P2").throttle.replace(coulomb_nm=0.09, friction="stiction")
    run = simulate_throttle(
        throttle, 0.0, start_deg=90.0, bridge="open", duration_s=0.4, sample_s=0.002, step_s=0.0005,
        supply_v=14.0, airflow_torque_nm=-0.05,
    )  # fmt: skip
    assert out["final_angle_deg"] == float(run["angle_deg"][-1])
    shorted = simulated(capsys, *argv[:6], "--duration-s", "0.4")
    assert shorted["t90_s"] > 1.5 * out["t90_s"]  # a shorted motor brakes


def test_a_plate_that_stays_has_no_rise_time(capsys: Capsys) -> None:
    out = simulated(capsys, "--duty", "0.05")
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
    out = simulated(capsys, "--input", file, "--output", str(output), "--figure", str(figure))
    run = simulate_throttle(
        presets.load("P1").throttle, duty, time_s=time, supply_v=14.4, airflow_torque_nm=-0.1
    )  # fmt: skip
    assert out["final_angle_deg"] == float(run["angle_deg"][-1])
    assert out["duty"] is None
    assert figure.stat().st_size > 10_000
    back = io.read_throttle_log(output)
    np.testing.assert_array_equal(back["angle_deg"], run["angle_deg"])
    again = simulated(capsys, "--input", str(output))  # what it wrote, it reads
    assert again["final_angle_deg"] == out["final_angle_deg"]


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("--duty", "1.2"), "duty = 1.2 at sample 0: must be in [-1, 1]; a duty in percent is divided by 100"),
        (("--duty", "1", "--preset", "puma_single"), "'puma_single' is an engine, not a throttle"),
        (("--duty", "1", "--set", "coulomb=1"), "no field 'coulomb'; did you mean"),
        (("--duty", "1", "--set", "foo=1"), "no field 'foo'; the fields are "),
        (("--duty", "1", "--set", "foo=1"), ", coulomb_nm, "),
        (("--duty", "1", "--set", "coulomb_nm=much"), "coulomb_nm = 'much': must be a number [N m]"),
        (("--duty", "1", "--set", "coulomb_nm"), "--set coulomb_nm: write FIELD=VALUE"),
        (("--duty", "1", "--figure", "run.bmp"), "the ending must be one of .png, .svg, .pdf"),
        (("--input", "nowhere.csv"), "nowhere.csv"),
    ],
)
def test_bad_options_are_refused(argv: tuple[str, ...], message: str, capsys: Capsys) -> None:
    assert message in refused_run(capsys, *argv)


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
    assert message in refused_run(capsys, "--input", table(tmp_path / "in.csv", text), *more)


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
