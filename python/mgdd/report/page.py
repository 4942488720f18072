"""A study as one self-contained HTML page, with its summary as JSON beside it."""

from __future__ import annotations

import base64
import io
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd._core import __version__
from mgdd.results.labels import to_jsonable
from mgdd.studies.registry import available_studies

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mgdd.studies.base import StudyResult
    from mgdd.studies.sections import Section

__all__ = ["write_report"]

_DPI = 110


def write_report(result: StudyResult, folder: str | os.PathLike[str] = "mgdd-report") -> Path:
    """Write ``index.html`` and ``summary.json`` of a study.

    Parameters
    ----------
    result : StudyResult
        Of any study.
    folder : path-like
        Made if missing; the two files in it are replaced.

    Returns
    -------
    pathlib.Path
        The page. It holds its figures itself and needs no network.

    Examples
    --------
    >>> import tempfile
    >>> from mgdd.report import write_report
    >>> from mgdd.studies import run_study
    >>> result = run_study("sensor-delay", seeds=2, quick=True, figures=False)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(result, folder).name
    'index.html'
    """
    folder = Path(folder)
    page = _page(result)
    text = json.dumps(to_jsonable(result.summary), indent=2, ensure_ascii=False, allow_nan=False)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    (folder / "index.html").write_text(page, encoding="utf-8")
    return folder / "index.html"


def _page(result: StudyResult) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("mgdd.report", "templates")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    style, _, _ = loader.get_source(environment, "style.css")
    title = result.title or available_studies().get(result.name, result.name)
    return environment.get_template("page.html").render(
        title=title[:1].upper() + title[1:],
        style=style,
        study=result.name,
        version=__version__,
        sections=[_section(section) for section in result.sections],
    )


def _section(section: Section) -> dict[str, Any]:
    return {
        "title": section.title,
        "text": section.text,
        "items": section.items,
        "table": section.table,
        "figures": [{"caption": caption, "png": _png(figure)} for caption, figure in section.figures.items()],
    }


def _png(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    return base64.b64encode(buffer.getvalue()).decode("ascii")
