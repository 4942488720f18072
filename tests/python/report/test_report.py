"""Pages: of any report, and of a calibration of the user's own files and of the demo; Ctrl-C keeps what is finished."""

import html
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from browser import CHROMIUM, Browser
from mgdd import datasets, io
from mgdd.cli import demo, engine, main
from mgdd.errors import Interrupted, ShapeError
from mgdd.report import Report, Section, Table, calibration_report, write_report
from mgdd.report.calibration import shipped_report
from mgdd.report.calibration_page import move_of
from mgdd.results.labels import labelled_dataset


def pressed(make: Callable[..., Any]) -> Callable[..., Any]:
    """Make a report, and press Ctrl-C when one model is calibrated."""

    def progress(text: str) -> None:
        if text.startswith("calibrated "):
            raise KeyboardInterrupt

    return lambda *given, **how: make(*given, **how | {"progress": progress})


def test_ctrl_c_in_the_demo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "shipped_report", pressed(shipped_report))
    assert main(["demo", "--folder", str(tmp_path)]) == 130
    shown = capsys.readouterr()
    assert "Interrupted: these are the models that were finished" in shown.out
    assert shown.out.splitlines()[-1].endswith(f"{tmp_path / 'index.html'}")
    assert (tmp_path / "index.html").is_file()
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["interrupted"] is True
    assert f"interrupted: what was finished is printed, and in {tmp_path}" in shown.err


def test_without_the_studies_the_demo_is_its_first_part(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(Interrupted) as stop:
        pressed(shipped_report)(figures=False)
    monkeypatch.setattr(demo, "shipped_report", lambda **_: stop.value.partial)
    monkeypatch.setitem(sys.modules, "mgdd_studies.command", None)
    assert main(["demo", "--folder", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("4 measured traces")
    assert "mgdd_studies is not installed" in shown


def test_a_file_of_the_user_gets_the_page_of_the_demo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    trace = datasets.read("hd_diesel_128x144")[2]
    io.write_csv(trace, tmp_path / "mine.csv")
    known = {"speed_rpm": trace.attrs["speed_rpm"], "trapped_mass_g": trace.attrs["trapped_mass_g"], "fuel_mg": 150.0}
    told = [word for name, value in known.items() for word in (f"--{name.replace('_', '-')}", str(value))]
    monkeypatch.setattr(engine, "calibration_report", pressed(calibration_report))
    page = tmp_path / "page.html"
    argv = ["engine", "calibrate", str(tmp_path / "mine.csv"), "--preset", "hd_diesel_128x144", *told]
    assert main([*argv, "--report", str(page)]) == 130
    shown = capsys.readouterr()
    assert "RMSE" in shown.out
    assert f"what was finished of the report is in {page}" in shown.err
    text = html.unescape(page.read_text(encoding="utf-8"))
    assert "interrupted: ranges over 1" in text
    assert "mine" in text.split("<dl>")[0]  # the verdict names the file
    assert "mgdd engine calibrate" in text
    assert "Files of the user." in text
    assert sorted(tmp_path.iterdir()) == [tmp_path / "mine.csv", page]
    # The models of the page are judged by the fuel that was stated, a fifth too little for this trace.
    assert re.search(r"heat 1\.\d\d of the stated fuel, outside", text)


def test_a_page_has_its_ending_and_its_folder_before_any_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for file, said in (("page", "the ending must be one of .html"), ("none/page.html", "does not exist")):
        assert main(["engine", "calibrate", "no.csv", "--report", str(tmp_path / file)]) == 2
        assert said in capsys.readouterr().err
    with pytest.raises(ShapeError, match="traces is one Dataset: pass a list"):
        calibration_report(datasets.read("hd_diesel_128x144")[0], "hd_diesel_128x144")  # type: ignore[arg-type]


def test_the_move_of_a_trace_is_said_with_how_sure_it_is() -> None:
    best = {"shift_cad": 0.0, "gain_percent": 0.0, "free_shift_cad": 0.76, "free_gain_percent": 0.03}
    row = {"file": "a50", "best": {**best, "free_p_max_bar": 240.0}, "shift_cad": [-1.0, 1.0]}
    assert move_of(row | {"free_shift_cad": [0.1, 2.86]}) == (
        "a50: no direction is determined, range −1.0 to +1.0 °CA, its own p_max kept; without that limit retard by "
        "0.8 °CA to a p_max of 240 bar, gain 0.03 %, range +0.1 to +2.9 °CA."
    )
    assert move_of({"file": "a25", "best": None}) == "a25: no plausible model, so no best timing."
    best["shift_cad"] = 0.76
    assert move_of(row | {"best": best, "free_shift_cad": [-3.04, 2.86]}) == (
        "a50: no direction is determined, range −3.0 to +2.9 °CA; its own p_max kept, range −1.0 to +1.0 °CA."
    )


def test_sections_of_its_own_are_escaped_and_kept_in_order(tmp_path: Path) -> None:
    result = Report(
        name="mine",
        title="what < and & do",
        dataset=labelled_dataset({"time_s": ("time_s", [0.0])}),
        summary={"value": float("nan")},
        sections=(
            Section(title="<b>", text=("1 < 2 & 3",), items=("<script>alert(1)</script>",)),
            Section(title="Table", table=Table(columns=("a [<]",), rows=(("<td>",), ("-1.5",)))),
        ),
    )
    text = write_report(result, tmp_path).read_text(encoding="utf-8")
    assert "<script>" not in text
    assert "<h1>what &lt; and &amp; do</h1>" in text
    assert text.index("&lt;b&gt;") < text.index("1 &lt; 2 &amp; 3") < text.index("a [&lt;]")
    assert json.loads((tmp_path / "summary.json").read_text())["value"] is None


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium: tools/system_packages.sh browser")
def test_the_values_under_the_pointer_stand_below_a_figure(tmp_path: Path) -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2)
    left.set(xlim=(6.0, 4.0), ylim=(59.0, 61.0), xlabel="crank angle [°CA aTDC]", ylabel="pressure [bar]")
    left.twinx().set(ylim=(-1.0, 1.0), ylabel="heat")
    right.set(xscale="log", yscale="symlog")
    section = Section(title="Figures", figures={"two": figure})
    data = labelled_dataset({"time_s": ("time_s", [0.0])})
    page = write_report(Report(name="mine", dataset=data, sections=(section,)), tmp_path / "page.html")
    x, y = left.transData.transform((5.0, 60.0)) / figure.bbox.size
    with Browser(page.as_uri(), tmp_path) as browser:
        assert browser.shows("compression negative")  # the last line: all is loaded
        read = browser.evaluate(
            "(() => { const img = document.querySelector('img'), box = img.getBoundingClientRect(), at = (x, y) => {"
            "const place = { clientX: box.left + x * box.width, clientY: box.bottom - y * box.height };"
            "img.dispatchEvent(new MouseEvent('mousemove', place)); return document.querySelector('output').value; };"
            f"return [at({x}, {y}), at(0.9, 0.5), at(0.01, 0.01)]; }})()"
        )
    assert read[1:] == ["", ""]
    shown = dict(part.split(": ") for part in read[0].split(", "))
    assert {name: abs(round(float(value), 1)) for name, value in shown.items()} == {
        "crank angle [°CA aTDC]": 5.0, "pressure [bar]": 60.0, "heat": 0.0,
    }  # fmt: skip
