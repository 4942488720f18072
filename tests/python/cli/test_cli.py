"""The command line: JSON alone on stdout, options named after parameters, exit codes, messages."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mgdd import datasets, io
from mgdd.cli import main
from mgdd.engine import Cylinder, OperatingPoint, find_optimum, simulate
from typed import Capsys, refused
from typed import ran as run_json

HD = ("--preset", "hd_diesel_128x144")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], str]:
    """The four measured traces as a user would have them: one file each, and a table of conditions."""
    folder = tmp_path_factory.mktemp("traces")
    names, rows = [], ["file,speed_rpm,trapped_mass_g,soi_cad"]
    for trace in datasets.read("hd_diesel_128x144"):
        file = folder / f"{trace.attrs['file']}.csv"
        io.write_csv(trace, file)
        names.append(str(file))
        a = trace.attrs
        rows.append(f"{file.name},{a['speed_rpm']},{a['trapped_mass_g']},{a['soi_cad']}")
    conditions = folder / "conditions.csv"
    conditions.write_text("\n".join(rows) + "\n")
    return names, str(conditions)


def test_simulate_prints_the_library_result(capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "simulate", "--preset", "puma_single", "--soc-cad", "-6")
    cycle = simulate(Cylinder(), OperatingPoint(), soc_cad=-6.0)
    for name in (
        "imep_closed_bar imep_gross_bar efficiency_gross p_max_bar p_max_cad t_max_k dp_max_bar_per_cad ca50_cad "
        "heat_loss_fraction"
    ).split():
        assert out[name] == pytest.approx(float(cycle[name]), rel=1e-12), name
    assert out["imep_gross_bar"] == pytest.approx(9.627, rel=5e-4)


def test_options_are_parameter_names(capsys: Capsys) -> None:
    out = run_json(
        capsys, "engine", "simulate", "--speed-rpm", "2000", "--fuel-mg", "12", "--burn-duration-cad", "25",
        "--burn", "wiebe", "--gamma", "linear", "--integrator", "split", "--step-cad", "0.5", "--soc-cad", "-9",
        "--set", "bore_mm=90", "--set", "compression_ratio=16", "--set", "ivc_cad=-130",
    )  # fmt: skip
    cylinder = Cylinder(bore_mm=90.0, compression_ratio=16.0, ivc_cad=-130.0, burn_shape="wiebe", gamma_model="linear")
    point = OperatingPoint(speed_rpm=2000.0, fuel_mg=12.0, burn_duration_cad=25.0)
    cycle = simulate(cylinder, point, soc_cad=-9.0, step_cad=0.5, integrator="split")
    assert out["imep_closed_bar"] == pytest.approx(float(cycle["imep_closed_bar"]), rel=1e-12)


def test_injection_timing_adds_the_delay(capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "simulate", "--soi-cad", "-10")
    assert out["soi_cad"] == -10.0
    assert out["soc_cad"] == pytest.approx(-5.4, abs=0.05)
    late = refused(capsys, "engine", "simulate", "--soi-cad", "19", code=3)
    assert "does not ignite" in late


def test_motored_has_no_burn_angles(capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "simulate", "--motored")
    assert out["ca50_cad"] is None
    assert out["p_max_bar"] == pytest.approx(70.11, rel=5e-4)
    assert "contradict" in refused(capsys, "engine", "simulate", "--motored", "--fuel-mg", "10")


def test_output_file_holds_the_traces(tmp_path: Path, capsys: Capsys) -> None:
    file = tmp_path / "cycle.csv"
    assert main(["engine", "simulate", "-o", str(file)]) == 0
    capsys.readouterr()
    names, *rows = [line.split(",") for line in file.read_text().splitlines()]
    table = np.array(rows, dtype=np.float64)
    cycle = simulate(Cylinder(), OperatingPoint())
    np.testing.assert_array_equal(table[:, names.index("pressure_bar")], cycle["pressure_bar"].values)
    assert "ending" in refused(capsys, "engine", "simulate", "-o", str(tmp_path / "cycle.xls"))


def test_analyze_pegging_recovers_an_offset(tmp_path: Path, capsys: Capsys) -> None:
    motored = simulate(Cylinder(wall_heat_scale=0.0), OperatingPoint(fuel_mg=0.0))
    shifted = io.pressure_trace(motored["crank_angle_cad"].values, motored["pressure_bar"].values - 0.2, name="shifted")
    file = tmp_path / "shifted.csv"
    io.write_csv(shifted, file)
    out = run_json(capsys, "engine", "analyze", str(file), "--pegging", "two_point", "--pegging-exponent", "1.37")
    assert out["pegging_bar"] == pytest.approx(0.2, abs=0.005)


def test_calibrate_reports_what_it_cannot_tell(files: tuple[list[str], str], capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "calibrate", *files[0], *HD, "--conditions", files[1])
    assert all(row["rmse_percent"] <= 1.5 and abs(row["imep_closed_error_percent"]) <= 3.0 for row in out["traces"])
    assert all(row["onset_against_soi_cad"] >= 0.0 for row in out["traces"])
    assert {"file", "p_max_bar", "rmse_bar", "soc_cad", "burn_duration_cad", "fuel_heat_j", "ca50_cad"} <= set(
        out["traces"][0]
    )
    scale = out["common"]["wall_heat_scale"]
    assert {"value", "stderr", "identifiable"} <= set(scale)
    assert scale["identifiable"] is False
    assert "wall_heat_scale" in out["unidentifiable"]
    compared = out["report"].split("the nearest first:")[1].splitlines()[2:]
    errors = [float(line.split(", gamma ")[1].split()[1]) for line in compared]
    assert errors == sorted(errors)
    assert len(errors) == 5
    assert len(out["laws"]) == 5
    assert out["tdc"]["low_cad"] < 0.0 < out["tdc"]["high_cad"]
    assert not out["tdc"]["suspect"]


@pytest.mark.slow
def test_calibrate_with_known_fuel_and_free_gamma_and_pegging(files: tuple[list[str], str], capsys: Capsys) -> None:
    common = ["engine", "calibrate", files[0][1], *HD, "--conditions", _one_row(files[1], 2)]
    free = "gamma,wall_heat_scale,soc_cad,burn_duration_cad,wiebe_m"
    out = run_json(capsys, *common, "--fuel-mg", "115", "--free", free)
    assert out["traces"][0]["fuel_heat_j"] == pytest.approx(115.0 * 42.8)
    assert out["common"]["gamma_linear_300k"]["stderr"] > 0.0
    pegged = run_json(capsys, *common, "--pegging", "two_point", "--pegging-exponent", "1.375")
    plain = run_json(capsys, *common)
    assert pegged["traces"][0]["rmse_percent"] != plain["traces"][0]["rmse_percent"]
    assert "loads" not in refused(capsys, *common, "--free", "soc_cad", "--pegging-exponent", "1.3")


@pytest.mark.slow
def test_calibrate_without_conditions_has_no_onset_column(files: tuple[list[str], str], capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "calibrate", *files[0], *HD)
    assert all("onset_against_soi_cad" not in row for row in out["traces"])
    measured = [row["rmse_percent"] for row in out["traces"]]
    assert measured == pytest.approx([0.64, 0.50, 0.37, 0.68], abs=0.015)


def test_optimum_matches_the_library(capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "optimum", "--limit", "p_max_bar=95")
    best = find_optimum(Cylinder(), OperatingPoint(), limits={"p_max_bar": 95.0})
    assert {name: out[name] for name in best.to_dict()} == best.to_dict()
    assert set(out) - set(best.to_dict()) == {"preset", "soi_cad"}


def test_optimum_of_files_is_a_range(files: tuple[list[str], str], capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "optimum", files[0][3], *HD, "--conditions", _one_row(files[1], 4))
    (row,) = out["traces"]
    kept = [member for member in row["members"] if member["plausible"]]
    assert len(kept) >= 2
    assert row["best"] in kept
    answers = [m["free_ca50_cad"] for m in kept]
    assert row["free_ca50_cad"] == pytest.approx([min(answers) - 1.0, max(answers) + 1.0])
    assert row["free_gain_percent"][0] > 0.3  # its own peak pressure holds the full load back
    assert row["best"]["free_p_max_bar"] > row["best"]["p_max_limit_bar"]


def _one_row(conditions: str, row: int) -> str:
    lines = Path(conditions).read_text().splitlines()
    file = Path(conditions).with_name(f"row{row}.csv")
    file.write_text(f"{lines[0]}\n{lines[row]}\n")
    return str(file)


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--set", "bore_mm=-86"], ["bore_mm = -86", "must be > 0"]),
        (["--set", "bore=86"], ["'bore'", "bore_mm"]),
        (["--set", "bore_mm"], ["--set bore_mm", "FIELD=VALUE"]),
        (["--set", "bore_mm=wide"], ["bore_mm = 'wide'", "[mm]"]),
        (["--soc-cad", "25"], ["soc_cad = 25", "°bTDC", "-25"]),
        (["--preset", "puma"], ["no preset 'puma'", "puma_single"]),
        (["--preset", "nowhere.toml"], ["nowhere.toml"]),
    ],
)
def test_bad_input_names_field_value_and_remedy(argv: list[str], words: list[str], capsys: Capsys) -> None:
    error = refused(capsys, "engine", "simulate", *argv)
    for word in words:
        assert word in error


def test_bad_files(tmp_path: Path, capsys: Capsys) -> None:
    empty = tmp_path / "empty.csv"
    empty.write_text("")
    assert "empty" in refused(capsys, "engine", "analyze", str(empty))
    assert "nowhere.csv" in refused(capsys, "engine", "analyze", "nowhere.csv")
    pascal = tmp_path / "pascal.csv"
    trace = datasets.read("hd_diesel_128x144")[0]
    pascal.write_text(
        "\n".join(
            f"{a} {p * 1e5}" for a, p in zip(trace["crank_angle_cad"].values, trace["pressure_bar"].values, strict=True)
        )
    )
    assert "Pa" in refused(capsys, "engine", "analyze", str(pascal), *HD)
    assert main(["engine", "analyze", str(pascal), *HD, "--pressure-unit", "Pa"]) == 0
    capsys.readouterr()
    assert "--pressure-unit 'Pa'" in refused(capsys, "engine", "analyze", str(pascal), *HD)


def test_angles_before_tdc(tmp_path: Path, capsys: Capsys) -> None:
    trace, turned = datasets.read("hd_diesel_128x144")[0], tmp_path / "turned.csv"
    columns = trace["crank_angle_cad"].values.tolist(), trace["pressure_bar"].values.tolist()
    turned.write_text("".join(f"{-a!r} {p!r}\n" for a, p in zip(*columns, strict=True)))
    assert refused(capsys, "engine", "analyze", str(turned), *HD).rstrip().endswith("pass --before-tdc")
    out = run_json(capsys, "engine", "analyze", str(turned), *HD, "--before-tdc")
    assert out["ca50_cad"] == pytest.approx(5.0, abs=0.1)


def test_conditions_of_a_campaign(tmp_path: Path, files: tuple[list[str], str], capsys: Capsys) -> None:
    out = run_json(capsys, "engine", "calibrate", files[0][0], *HD, "--conditions", files[1])  # one file of four rows
    assert out["traces"][0]["soi_cad"] == -5.06
    twin = tmp_path / Path(files[0][0]).name
    twin.write_text(Path(files[0][0]).read_text())
    error = refused(capsys, "engine", "calibrate", files[0][0], str(twin), *HD, "--conditions", files[1])
    assert "fits both" in error
    missing = tmp_path / "missing.csv"
    missing.write_text("file,speed_rpm\nother.csv,1200\n")
    error = refused(capsys, "engine", "calibrate", files[0][0], *HD, "--conditions", str(missing))
    assert "no row for" in error
    assert "'other.csv'" in error


@pytest.mark.slow
def test_a_short_trace_is_told_and_still_reported(tmp_path: Path, files: tuple[list[str], str], capsys: Capsys) -> None:
    trace = io.read_pressure(files[0][1]).sel(crank_angle_cad=slice(-90.0, 50.0))
    short = tmp_path / "short.csv"
    io.write_csv(trace, short)
    assert "trapped_mass_g" in refused(capsys, "engine", "calibrate", str(short), *HD)
    out = run_json(
        capsys,
        "engine",
        "calibrate",
        str(short),
        *HD,
        "--trapped-mass-g",
        "4.13863",
        "--report",
        str(tmp_path / "r.html"),
    )
    assert any("spans -90 to 50" in text for text in out["warnings"])
    assert "–" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_late_injection_and_failed_fits_have_their_exit_codes(files: tuple[list[str], str], capsys: Capsys) -> None:
    assert "ignites at 26.2" in refused(capsys, "engine", "simulate", "--soi-cad", "14")
    # Wall heat beyond reason on a coarse step: the model leaves the numbers wherever the search wants to go.
    beyond = ("--set", "woschni_cp_m_per_sk=1", "--speed-rpm", "60", "--step-cad", "5")
    assert main(["engine", "calibrate", files[0][1], *HD, *beyond, "--json"]) == 3
    captured = capsys.readouterr()
    assert json.loads(captured.out)["status"] not in ("cost_converged", "step_converged", "gradient_converged")
    assert "did not converge" in captured.err


def test_a_held_scale_beyond_the_search_is_still_compared(files: tuple[list[str], str], capsys: Capsys) -> None:
    held = ("--set", "wall_heat_scale=3", "--free", "soc_cad,burn_duration_cad,fuel_heat_j")
    out = run_json(capsys, "engine", "calibrate", files[0][1], *HD, *held)
    assert out["common"]["wall_heat_scale"]["value"] == 3.0
    assert len(out["laws"]) == 5


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--pegging-exponent", "1.3"], "two_point or least_squares"),
        (["--inlet-pressure-kpa", "150"], "--pegging inlet"),
        (["--motored"], "does not act on measured traces"),
        (["--set", "bore_mm=90", "--set", "bore_mm=80"], "given twice"),
        (["--burn", "wiebe", "--set", "burn_shape=triangle"], "contradict"),
        (["--speed-rpm", "1000", "--set", "speed_rpm=2000"], "contradict"),
    ],
)
def test_options_that_would_do_nothing_are_refused(
    argv: list[str], words: str, files: tuple[list[str], str], capsys: Capsys
) -> None:
    assert words in refused(capsys, "engine", "analyze", files[0][0], *HD, *argv)


def test_infeasible_limit_has_its_own_exit_code(capsys: Capsys) -> None:
    error = refused(capsys, "engine", "optimum", "--limit", "p_max_bar=50", code=3)
    assert "p_max_bar >=" in error
    assert "is not an indicator" in refused(capsys, "engine", "optimum", "--limit", "p_maxx=50")


def test_process_keeps_stdout_clean() -> None:
    env = {**os.environ, "PYTHONWARNINGS": "error"}

    def call(*argv: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "mgdd", *argv], capture_output=True, text=True, env=env, timeout=120
        )

    version = call("--version")
    assert version.returncode == 0
    assert version.stdout.startswith("mgdd ")
    doctor = call("doctor", "--json")
    report = json.loads(doctor.stdout)
    assert {"mgdd", "python", "simd_compiled", "simd_processor", "extras"} <= set(report)
    assert call("engine", "simulate", "--soc-cad", "-6", "--soi-cad", "-9").returncode == 2


def test_without_a_command_it_says_which_there_are(capsys: Capsys) -> None:
    assert main([]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "mgdd engine simulate" in said.err
