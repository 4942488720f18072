"""A report as a page: complete, self-contained, escaped."""

import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from browser import CHROMIUM, Browser
from mgdd.report import Report, Section, Table, write_report
from mgdd.results.labels import labelled_dataset


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
