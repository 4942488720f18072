"""Every study as a page: complete, self-contained; its sections and its verdict."""

import html
import itertools
import json
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from mgdd import datasets
from mgdd.cli import main
from mgdd.report import write_report
from mgdd.results.labels import check_labels, labelled_dataset
from mgdd_studies.base import StudyResult
from mgdd_studies.benchmarks import records
from mgdd_studies.registry import available_studies
from mgdd_studies.verdicts import verdict_of

NEEDS = {"measured-engine-seek": "h2df_502", "identification-benchmarks": "cascaded_tanks"}


class Page(HTMLParser):
    """Counts tags, checks that they close, and collects what a browser would fetch."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.count: dict[str, int] = {}
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.count[tag] = self.count.get(tag, 0) + 1
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        self.fetched += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def unlabelled(figure: Figure) -> list[str]:
    """Name axes of numbers without a label of their own, of their row or column, of a shared axis, or of the figure."""
    figure.canvas.draw()
    drawn = [axes for axes in figure.axes if axes.has_data() and axes.axison and axes.get_label() != "<colorbar>"]
    missing = []
    for axes, way in itertools.product(drawn, "xy"):
        side = (lambda each: each.get_position().x0) if way == "x" else (lambda each: each.get_position().y0)
        row = [each for each in figure.axes if abs(side(each) - side(axes)) < 0.01]
        row += getattr(axes, f"get_shared_{way}_axes")().get_siblings(axes)
        ticks = [tick.get_text() for each in row for tick in getattr(each, f"get_{way}ticklabels")()]
        names = any(re.search("[A-Za-z]", text.replace("mathdefault", "")) for text in ticks)
        label = getattr(figure, f"get_sup{way}label")() or any(getattr(each, f"get_{way}label")() for each in row)
        if not (label or names):
            missing.append(f"{way} of {axes.get_title(loc='left') or axes}")
    return missing


DEAR = {
    "calibrated-guide", "guide-accuracy", "guided-transients", "identification-benchmarks", "model-validation",
    "throttle-pseudo-wiener",
}  # fmt: skip


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in DEAR else []) for name in available_studies()]
)
def test_every_study_becomes_a_page(name: str, tmp_path: Path, quick_study: Callable[..., StudyResult]) -> None:
    if name in NEEDS and NEEDS[name] not in (*datasets.names(), *records.names()):
        pytest.skip(f"the data set {NEEDS[name]} is not at hand")
    result = quick_study(name)
    check_labels(result.dataset)
    assert json.loads(json.dumps(result.summary, allow_nan=False)) == result.summary
    assert result.summary["interrupted"] is False
    for row in (rows := result.summary["rows"]):
        assert row.keys() == rows[0].keys() or name == "identification-benchmarks"  # a benchmark in a row
        for low in (key for key in row if key.endswith("_low") and key.removesuffix("_low") in row):
            middle = low.removesuffix("_low")
            assert row[low] is None or row[low] <= row[middle] <= row[f"{middle}_high"], low
    file = write_report(result, tmp_path / "deep" / "page")
    assert file == tmp_path / "deep" / "page" / "index.html"
    text = file.read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    assert all(source.startswith(("data:image/png;base64,", "#s")) for source in page.fetched)
    assert not re.search(r"https?://|url\(|@import", re.sub(r"base64,[A-Za-z0-9+/=]+", "", text.split("</style>")[0]))
    assert page.count["img"] == len(result.figures) > 0
    assert page.count["h1"] == 1
    assert page.count["h2"] == len(result.sections)
    assert page.count["table"] >= 1
    for caption, figure in result.figures.items():
        assert caption in html.unescape(text)
        assert unlabelled(figure) == [], caption
    summary = json.loads((file.parent / "summary.json").read_text(encoding="utf-8"))
    assert summary["study"] == name
    # The answer comes first, and every long table is behind a fold.
    assert result.verdict == tuple(summary["verdict"]) != ()
    plain = html.unescape(text)
    assert text.index("Verdict") < plain.index(result.verdict[0]) < text.index("<h2>") < text.index("<img")
    assert not any("nan" in sentence or "None" in sentence for sentence in result.verdict)
    assert page.count["details"] == page.count["table"]
    assert text.count("<details open>") == sum(s.table is not None and len(s.table.rows) <= 8 for s in result.sections)
    assert len(summary["rows"]) == len(result.summary["rows"])
    assert page.count["tr"] > len(result.summary["rows"])


def test_standard_sections_say_rows_numbers_lists_and_interruption() -> None:
    rows = [{"who": "a", "final_cad": -5.1234, "final_cad_low": -6.0, "final_cad_high": -4.0, "arrived": True}]
    result = StudyResult(
        name="mine",
        dataset=labelled_dataset({"time_s": ("time_s", [0.0])}),
        summary={
            "study": "mine", "seeds": 3, "rows": rows, "interrupted": True, "fits": [{"rmse_bar": None}],
            "noise_deg": 0.03, "warnings": ["look out"], "records": {"source": "here"}, "missing": [],
        },
    )  # fmt: skip
    sections = {section.title: section for section in result.sections}
    assert list(sections) == ["Results", "Fits", "Warnings", "Records", "Settings and further numbers", "Data"]
    table = sections["Results"].table
    assert table is not None
    assert table.columns == ("who", "final cad [°CA aTDC]", "arrived")
    assert table.rows == (("a", "-5.123 [-6, -4]", "yes"),)
    assert any("interrupted" in text for text in sections["Results"].text)
    assert any("3 seeds" in text for text in sections["Results"].text)
    assert sections["Warnings"].items == ("look out",)
    settings = sections["Settings and further numbers"].table
    assert settings is not None
    assert settings.rows == (("noise deg", "0.03", "deg"),)
    fits = sections["Fits"].table
    assert fits is not None
    assert (fits.columns, fits.rows) == (("pressure RMSE, closed cycle [bar]",), (("–",),))


def test_the_verdict_is_made_of_the_numbers() -> None:
    rows = [{"seeker": "a_b", "cycles_to_1_cad": 4.0, "j_lost": None}, {"seeker": "c", "cycles_to_1_cad": 1600.0}]
    assert verdict_of("seeker-comparison", {"rows": [*rows, {"seeker": "d", "cycles_to_1_cad": None}]}) == (
        "Cycles to within 1 °CA of the optimum: 4 (a b) to 1600 (c); not known or never reached in 1 of 3.",
        "Loss of efficiency at the end: not known or never reached in all of 3.",
    )
    bars = [{"bar": "x", "limit": "at most 1", "met": False}, {"bar": "y", "limit": "none", "met": True}]
    assert verdict_of("mine", {"bars": bars}) == ("1 of 2 bars are met; missed: x (wanted at most 1).",)
    assert verdict_of("mine", {"rows": rows}) == verdict_of("guided", {"rows": []}) == ()


def test_the_command_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["study", "sensor-delay", "--quick", "--seeds", "2", "--report", str(tmp_path / "page"), "--json"]
    assert main(argv) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["report"] == (tmp_path / "page" / "index.html").as_posix()
    assert "data:image/png" in Path(summary["report"]).read_text(encoding="utf-8")
