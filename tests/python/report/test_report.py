"""A report as a page: complete, self-contained, escaped."""

from __future__ import annotations

import json
from pathlib import Path

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
