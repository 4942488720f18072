"""`mgdd engine analyze`: window, smoothing, brake work, and files of several cycles."""

from pathlib import Path

import numpy as np
import pytest

from mgdd import datasets, io
from mgdd.cli import main
from mgdd.engine import Cylinder, OperatingPoint, analyze, simulate
from typed import Capsys, commands

run_json, refused = commands("engine", "analyze")

HD = ("--preset", "hd_diesel_128x144")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("trace") / "a50.csv"
    io.write_csv(datasets.read("hd_diesel_128x144")[1], path)
    return str(path)


def test_the_payload_says_how_it_was_computed(file: str, capsys: Capsys) -> None:
    out = run_json(capsys, file, *HD)
    assert out["heat_window"] == "found"
    assert out["smoothing"] == "none"
    assert out["mass_source"] == "p, V, T at IVC with T = 353 K, the intake temperature + 40 K"
    assert out["trapped_mass_g"] == pytest.approx(4.13863, rel=0.03)
    assert out["motored"] == 0
    assert out["tdc_offset_cad"] is None
    assert out["warnings"] == []
    given = run_json(capsys, file, *HD, "--heat-window-cad", "-10", "90", "--smoothing", "savitzky_golay")
    assert given["heat_window"] == "given"
    assert (given["heat_from_cad"], given["heat_to_cad"]) == (-10.0, 90.0)
    assert given["smoothing"] == "savitzky_golay over 4 °CA (5 samples)"
    assert given["imep_closed_bar"] == out["imep_closed_bar"]


def test_a_stated_intake_pressure_is_judged(file: str, capsys: Capsys) -> None:
    (line,) = run_json(capsys, file, *HD, "--intake-pressure-kpa", "100")["warnings"]
    assert "the stated intake pressure is 1 bar" in line
    assert run_json(capsys, file, *HD, "--intake-pressure-kpa", "230")["warnings"] == []


def test_brake_work_beyond_the_gas_is_refused(file: str, capsys: Capsys) -> None:
    assert run_json(capsys, file, *HD, "--bmep-bar", "12.5")["warnings"] == []  # closed IMEP is 13.7 bar
    assert "below bmep_bar = 16" in refused(capsys, file, *HD, "--bmep-bar", "16")
    # Six cylinders of 1.853 L at 16 bar: p V/(4 pi) = 1415.6 N m.
    assert "below bmep_bar = 16" in refused(capsys, file, *HD, "--brake-torque-nm", "1415.6", "--cylinders", "6")


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--smoothing", "low_pass", "--smoothing-width-cad", "3"], "savitzky_golay or angle_window"),
        (["--smoothing-cutoff-hz", "2000"], "--smoothing low_pass"),
        (["--cylinders", "4"], "--brake-torque-nm"),
        (["--smoothing", "savitzky_golay", "--smoothing-width-cad", "2"], "take 4 or more"),
    ],
)
def test_options_that_cannot_act_are_refused(argv: list[str], words: str, file: str, capsys: Capsys) -> None:
    assert words in refused(capsys, file, *HD, *argv)


def test_a_file_of_cycles_adds_their_scatter(tmp_path: Path, capsys: Capsys) -> None:
    cycles = [simulate(Cylinder(), OperatingPoint(), soc_cad=soc) for soc in (-9.0, -6.0, -5.0, 1.0)]
    file, table = tmp_path / "record.csv", tmp_path / "figures.csv"
    columns = [cycles[0].crank_angle_cad.values, *(cycle.pressure_bar.values for cycle in cycles)]
    np.savetxt(file, np.column_stack(columns), delimiter=",", header="angle,p_1,p_2,p_3,p_4", comments="", fmt="%.17g")
    out = run_json(capsys, str(file), "--preset", "puma_single", "-o", str(table))
    direct = analyze(io.read_pressure(file), Cylinder(), point=OperatingPoint())
    assert out["cycles"] == 4
    assert out["ca50_cad"] == float(direct.mean_ca50_cad)
    assert out["std_ca50_cad"] == pytest.approx(np.std(direct.ca50_cad.values, ddof=1))
    assert out["cov_imep_closed_bar_percent"] == float(direct.cov_imep_closed_bar_percent)
    assert out["cycle_mean_ca50_cad"] != out["ca50_cad"]
    assert "mean_ca50_cad" not in out
    rows = table.read_text().splitlines()
    assert rows[0].startswith("cycle,")
    assert "imep_closed_bar" in rows[0]
    assert len(rows) == 5
    assert main(["engine", "analyze", str(file), "--preset", "puma_single"]) == 0
    (line,) = (row for row in capsys.readouterr().out.splitlines() if row.startswith("ca50_cad"))
    shown = [float(word) for word in line.split()[1:3]]  # mean and standard deviation, side by side
    assert shown == pytest.approx([out["ca50_cad"], out["std_ca50_cad"]], rel=1e-3)


def test_ringing_of_a_record_and_the_share_of_its_cycles_that_knock(tmp_path: Path, capsys: Capsys) -> None:
    file = tmp_path / "record.csv"
    runs = [simulate("puma_single", soc_cad=soc, step_cad=0.25) for soc in (-9.0, -6.0, -5.0, -2.0)]
    angle = runs[0]["crank_angle_cad"].to_numpy()
    ms = np.maximum(angle - 5.0, 0.0) / 9.0  # at 1500 rpm
    ringing = np.exp(-ms) * np.sin(2.0 * np.pi * 6.5 * ms)
    rows = [run["pressure_bar"] + size * ringing for run, size in zip(runs, (0.2, 0.6, 0.6, 0.6), strict=True)]
    head = "angle,p_1,p_2,p_3,p_4"
    np.savetxt(file, np.column_stack([angle, *rows]), delimiter=",", header=head, comments="", fmt="%.17g")
    out = run_json(capsys, str(file), "--preset", "puma_single", "--knock-threshold-bar", "0.35")
    assert out["ringing_frequency_khz"] == pytest.approx(6.5, rel=0.01)
    assert out["knock_share_percent"] == 75.0
    assert 5.0 < out["tangential_mode_khz"] < 7.0
    high = run_json(capsys, str(file), "--preset", "puma_single", "--knock-band-hz", "8000", "17000")
    assert high["ringing_frequency_khz"] is None
    assert "knock_share_percent" not in high
    assert main(["engine", "analyze", str(file), "--preset", "puma_single"]) == 0
    assert "ringing_frequency_khz" in capsys.readouterr().out


@pytest.mark.slow
def test_tdc_is_estimated_and_doubted_when_asked(file: str, tmp_path: Path, capsys: Capsys) -> None:
    trace = datasets.read("hd_diesel_128x144")[1]
    angle, pressure = trace["crank_angle_cad"].values + 3.0, trace["pressure_bar"].values
    late = tmp_path / "late.csv"
    np.savetxt(late, np.column_stack([angle, pressure]), delimiter=",", header="angle,p_bar", comments="", fmt="%.17g")
    said = ("--speed-rpm", "1200", "--trapped-mass-g", "4.13863")
    out = run_json(capsys, str(late), *HD, *said, "--tdc")
    assert 2.4 < out["tdc"]["tdc_offset_cad"] < 3.6
    assert any("suspect TDC" in text for text in out["warnings"])
    assert "tdc" not in run_json(capsys, str(late), *HD, *said)
    back = run_json(capsys, str(late), *HD, *said, "--tdc", "--tdc-offset-cad", str(out["tdc"]["tdc_offset_cad"]))
    assert not back["tdc"]["suspect"]
    assert abs(back["tdc"]["tdc_offset_cad"]) < 0.1
    right = run_json(capsys, file, *HD, *said, "--tdc")
    assert not right["tdc"]["suspect"]


def test_only_geometry_that_nobody_gave_is_warned_of(file: str, caplog: pytest.LogCaptureFixture) -> None:
    given = ["bore_mm=128", "stroke_mm=144", "compression_ratio=17.3", "connecting_rod_mm=230", "evo_cad=124"]
    options = [word for each in given for word in ("--set", each)]
    assert main(["engine", "analyze", file, *options]) == 0
    (said,) = [record.message for record in caplog.records if "no engine is given" in record.message]
    assert said.startswith("no engine is given: the traces are read with ivc_cad = -140 of puma_single; ")
    caplog.clear()
    assert main(["engine", "analyze", file, *options, "--set", "ivc_cad=-143"]) == 0
    assert not any("no engine is given" in record.message for record in caplog.records)
