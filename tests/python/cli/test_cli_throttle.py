"""`mgdd throttle excite | identify | validate`: the library's results, files that go round, refusals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd import identify, io, signals
from mgdd.cli import main
from mgdd.throttle import Throttle, simulate_throttle
from typed import Capsys, refused
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
        (("--preset", "puma_single"), "throttle"),
        (("--set", "coulomb=0.2"), "did you mean 'coulomb_nm'"),
        (("-o", "chirp.txt"), "the ending must be one of .csv, .json"),
    ],
)
def test_excite_refuses_contradictions(capsys: Capsys, argv: tuple[str, ...], said: str) -> None:
    assert said in refused(capsys, "throttle", "excite", "chirp", *argv)


# --- identify and validate --------------------------------------------------------------------------------------


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
