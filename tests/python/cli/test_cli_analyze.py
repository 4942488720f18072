"""`mgdd engine analyze`: how figures were computed, records of cycles, TDC, geometry that nobody gave, and the page."""

import html
import json
import re
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


ENGINE = ("--preset", "puma_single")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record that rings, one cycle, and a file with a hole."""
    place = tmp_path_factory.mktemp("bench")
    rng = np.random.default_rng(3)
    runs = [simulate("puma_single", {"fuel_mg": mg}, soc_cad=-5.0, step_cad=0.25) for mg in rng.normal(18.0, 0.5, 12)]
    angle = runs[0]["crank_angle_cad"].to_numpy()
    ms = np.maximum(angle - 5.0, 0.0) / 9.0  # at 1500 rpm
    ringing = 0.6 * np.exp(-ms) * np.sin(2.0 * np.pi * 6.5 * ms)
    rows = [run["pressure_bar"] + ringing + rng.normal(0.0, 0.005, angle.size) for run in runs]
    head = ",".join(["angle", *(f"p_{k}" for k in range(len(rows)))])
    table = np.column_stack([angle, *rows])
    np.savetxt(place / "record.csv", table, delimiter=",", header=head, comments="", fmt="%.12g")
    io.write_csv(datasets.read("hd_diesel_128x144")[1], place / "one.csv")
    (place / "torn.csv").write_text("crank_angle_cad,pressure_bar\n-30,4\n-29,?\n", encoding="utf-8")
    return place


def read(page: Path) -> tuple[str, list[str]]:
    """Give the text of a page, and the captions of its figures."""
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href)=\"(?!data:image/png;base64,|#s)", text)
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", text)
    plain = re.sub(r"<style>.*?</style>|base64,[A-Za-z0-9+/=]+", "", text, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]+>", " ", plain)), [html.unescape(each) for each in captions]


def test_a_page_has_a_section_per_file_and_the_exit_code_tells_of_a_refused_one(
    folder: Path, tmp_path: Path, capsys: Capsys
) -> None:
    page = tmp_path / "page.html"
    files = [str(folder / name) for name in ("record.csv", "torn.csv", "one.csv")]
    argv = ["engine", "analyze", *files, *ENGINE, "--knock-threshold-bar", "0.1", "--report", str(page), "--json"]
    assert main(argv) == 2
    out = json.loads(capsys.readouterr().out)
    assert out["report"] == str(page)
    assert [each["file"] for each in out["files"]] == ["record.csv", "torn.csv", "one.csv"]
    assert "line 3" in out["files"][1]["error"]["message"]
    text, captions = read(page)
    heads = re.findall("<h2>(.*?)</h2>", page.read_text(encoding="utf-8"))
    heads = [re.sub(", [0-9]+ of [0-9]+ checks made", "", head) for head in heads]
    assert heads == ["record.csv: no fault found", "torn.csv: fail", "one.csv: no fault found"]
    assert "torn.csv: fail (file)" in text
    assert text.count("'?' is not a number") == 1
    assert "The pressure rings at 6.50 kHz between 4 and 20 kHz" in text
    assert "100 % of the cycles knock" in text
    assert "top dead centre: open: a fired trace hardly shows an error" in text
    assert "no fault found: file, samples" in text
    cov = float(analyze(files[0], "puma_single", quiet=True)["cov_imep_closed_bar_percent"])
    assert f"closed-cycle IMEP (IVC to EVO)  {out['files'][0]['imep_closed_bar']:.4g}" in text
    assert f"  {cov:.4g}  " in text
    one = ["Pressure", "Pressure over volume, both logarithmic", "Heat release with burn angles"]
    assert captions[:3] == captions[-3:] == one
    assert captions[3:-3] == [
        *(f"{name}: from cycle to cycle, histogram, return map" for name in (
            "closed-cycle IMEP (IVC to EVO)", "CA50, angle of 50 % heat released", "maximum pressure",
            "largest pressure oscillation in the knock band",
        )),
        "Spectrum of the pressure in the knock window", "Pressure less the mean cycle",
        "Net heat release of every cycle",
    ]  # fmt: skip


def test_files_without_a_page_are_printed_one_after_the_other(folder: Path, tmp_path: Path, capsys: Capsys) -> None:
    both = [str(folder / "one.csv"), str(folder / "record.csv")]
    assert main(["engine", "analyze", *both, *ENGINE]) == 0
    assert capsys.readouterr().out.count("imep_closed_bar") == 2
    assert main(["engine", "analyze", str(folder / "torn.csv"), both[0], *ENGINE]) == 2
    assert "torn.csv: refused: " in capsys.readouterr().out
    table = tmp_path / "figures.csv"
    assert main(["engine", "analyze", *both, *ENGINE, "-o", str(table)]) == 2
    assert "must be one of .json" in capsys.readouterr().err
    assert not table.exists()


def test_nothing_is_written_where_a_path_is_wrong(
    folder: Path, tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("an analysis was begun")

    monkeypatch.setattr("mgdd.cli.analyze.analyze", never)
    sound, page = str(folder / "record.csv"), tmp_path / "page.html"
    for files, target, words in (
        ([sound, str(folder / "none.csv")], page, "none.csv: no such file"),
        ([sound], tmp_path / "page.pdf", ".html"),
        ([sound], tmp_path / "missing" / "page.html", "does not exist"),
        ([sound], folder, ".html"),
    ):
        output = tmp_path / "out.json"
        assert main(["engine", "analyze", *files, *ENGINE, "--report", str(target), "-o", str(output)]) == 2
        assert words in capsys.readouterr().err
        assert not page.exists()
        assert not output.exists()


def test_one_refused_file_is_an_error_alone_and_a_section_of_a_page(
    folder: Path, tmp_path: Path, capsys: Capsys
) -> None:
    torn, page = str(folder / "torn.csv"), tmp_path / "page.html"
    assert main(["engine", "analyze", torn, *ENGINE, "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["error"]["type"] == "DataError"
    assert main(["engine", "analyze", torn, *ENGINE, "--report", str(page)]) == 2
    text, captions = read(page)
    assert "torn.csv: fail" in text
    assert captions == []


def test_a_long_record_is_drawn_by_some_of_its_cycles(
    folder: Path, tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mgdd.cli.analyze.DRAWN_CYCLES", 5)
    page = tmp_path / "page.html"
    assert main(["engine", "analyze", str(folder / "record.csv"), *ENGINE, "--report", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["cycles"] == 12
    assert "Clouds, maps and spectrum show 4 cycles, evenly over the record." in read(page)[0]


def test_motored_and_coarse_records_have_a_page_too(tmp_path: Path) -> None:
    runs = [simulate("puma_single", {"fuel_mg": 0.0, "intake_pressure_kpa": kpa}) for kpa in (148.0, 150.0, 151.0)]
    table = np.column_stack([runs[0]["crank_angle_cad"], *(run["pressure_bar"] for run in runs)])
    file, page = tmp_path / "motored.csv", tmp_path / "page.html"
    np.savetxt(file, table, delimiter=",", header="angle,p_1,p_2,p_3", comments="", fmt="%.12g")
    assert main(["engine", "analyze", str(file), *ENGINE, "--report", str(page)]) == 0
    text, captions = read(page)
    assert "3 cycles, 3 motored" in text
    assert "No frequency stands out of the pressure" in text
    assert not any("CA50" in each or "Spectrum" in each or "oscillation" in each for each in captions)
