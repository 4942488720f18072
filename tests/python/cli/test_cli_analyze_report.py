"""`mgdd engine analyze` of several files, and their page: what it holds, and when nothing is written."""

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest

from mgdd import datasets, io
from mgdd.cli import main
from mgdd.engine import analyze, simulate
from typed import Capsys

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
