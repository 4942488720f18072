"""One self-contained HTML page: of a report, with its summary as JSON beside it, or of any sections."""

from __future__ import annotations

import base64
import io
import json
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd._core import __version__
from mgdd.io.files import write_whole_text
from mgdd.report.report import as_number
from mgdd.results.labels import to_jsonable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mgdd.report.report import Report, Section

_DPI = 110
_VERSIONS = ("numpy", "scipy", "xarray", "matplotlib")
_INPUTS = {"seeds": "Seeds", "plant": "Plant", "data": "Data", "engine": "Engine", "records": "Records"}  # in a summary
_NUMBERS = " The numbers are in summary.json beside this page."
_SHORT = 8  # rows of a table that is not folded


def write_report(result: Report, folder: str | os.PathLike[str] = "mgdd-report") -> Path:
    """Write a report as one page, or as a folder with the page and its numbers.

    Parameters
    ----------
    result : Report
        `calibration_report` makes one, and every study.
    folder : path-like
        Made if missing; ``index.html`` and ``summary.json`` in it are replaced. Or a file that ends in ``.html``: the
        page alone, whole or not at all.

    Returns
    -------
    pathlib.Path
        The page. It holds its figures itself and needs no network; the values under the pointer stand below a figure.

    Examples
    --------
    >>> import tempfile
    >>> from mgdd.engine import simulate
    >>> from mgdd.report import Report, Section, write_report
    >>> note = Section(title="Note", text=("A cycle without misfire.",))
    >>> result = Report(name="one cycle", dataset=simulate("puma_single"), sections=(note,))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(result, folder).name
    'index.html'
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(result, f"{folder}/cycle.html").name
    'cycle.html'
    """
    folder = Path(folder)
    if folder.suffix == ".html":
        write_whole_text(folder, _page(result))
        return folder
    text = json.dumps(to_jsonable(result.summary), indent=2, ensure_ascii=False, allow_nan=False)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    (folder / "index.html").write_text(_page(result, numbers=_NUMBERS), encoding="utf-8")
    return folder / "index.html"


def write_page(
    file: str | os.PathLike[str],
    title: str,
    sections: Sequence[Section],
    *,
    verdict: Sequence[str],
    made_by: str,
    facts: Mapping[str, str],
) -> None:
    """Write sections as one page, whole or not at all; `facts` stand behind the date and what made it."""
    first, last = _first_and_last_fact(made_by)
    page = _rendered(
        title=title, verdict=verdict, facts=[first, *facts.items(), last], sections=list(map(_section, sections))
    )
    write_whole_text(file, page)


def _page(result: Report, *, numbers: str = "") -> str:
    first, last = _first_and_last_fact(result.made_by)
    return _rendered(
        title=result.heading,
        verdict=result.verdict,
        interrupted=bool(result.summary.get("interrupted")),
        facts=[first, *_inputs(result.summary), last],
        # What is seen at a glance stands before what is looked up.
        sections=sorted(map(_section, result.sections), key=lambda section: not section["figures"]),
        numbers=numbers,
    )


def _rendered(*, interrupted: bool = False, numbers: str = "", **parts: Any) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("mgdd.report", "templates")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    style, _, _ = loader.get_source(environment, "style.css")
    page = environment.get_template("page.html")
    return page.render(style=style, short=_SHORT, interrupted=interrupted, numbers=numbers, **parts)


def _inputs(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name, head in _INPUTS.items():
        if value := summary.get(name):
            pairs = value.items() if isinstance(value, Mapping) else ()
            yield head, ", ".join(f"{key} {as_number(entry)}" for key, entry in pairs) or str(value)


def _first_and_last_fact(made_by: str) -> tuple[tuple[str, str], tuple[str, str]]:
    """Give date and versions behind a page."""
    others = ", ".join(f"{name} {metadata.version(name)}" for name in _VERSIONS)
    written = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, {made_by}"
    return ("Written", written), ("Versions", f"mgdd {__version__}, Python {platform.python_version()}, {others}")


def _section(section: Section) -> dict[str, Any]:
    return {
        "title": section.title,
        "text": section.text,
        "items": section.items,
        "table": section.table,
        "figures": [
            {"caption": caption, "png": _png(figure), "axes": json.dumps(_axes(figure))}
            for caption, figure in section.figures.items()
        ],
    }


def _axes(figure: Figure) -> list[dict[str, Any]]:
    """Return where axes lie, in shares of a drawn figure, and what they show, so that the page can read the pointer."""
    places = []
    for ax in figure.axes:
        shown: dict[str, Any] = {}
        for way in "xy":
            beside = getattr(ax, f"get_shared_{way}_axes")().get_siblings(ax)  # one of them may have the label
            label = next(filter(None, (getattr(axes, f"get_{way}label")() for axes in (ax, *beside))), way)
            shown[way] = [*getattr(ax, f"get_{way}lim")(), getattr(ax, f"get_{way}scale")(), label]
        if ax.axison and {shown["x"][2], shown["y"][2]} <= {"linear", "log"}:
            places.append({"place": [*map(float, ax.get_position().extents)], **shown})
    return places


def _png(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    return base64.b64encode(buffer.getvalue()).decode("ascii")
