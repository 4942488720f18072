"""What `mgdd study` does: run one of the studies, print its table, write its figures."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import refuse_idle
from mgdd.cli.output import emit, whole_or_part
from mgdd.cli.progress import Stopped
from mgdd.errors import ParameterError
from mgdd.parallel.pool import processes
from mgdd.report import Table, write_report
from mgdd_studies.registry import available_studies, run_study
from mgdd_studies.sections import cells, column_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["fill", "rows_table", "run", "run_study"]

_STUDY = Options(run_study, "quick", n_seeds="seeds")
_LOW = "_low"
_OPTIONS = {"real": ("guided",)}  # of single studies


def fill(parser: argparse.ArgumentParser) -> None:
    """Add name and options to the parser of the command."""
    parser.add_argument("name", nargs="?", metavar="NAME", help=f"one of {', '.join(available_studies())}")
    parser.add_argument("--list", action="store_true", help="list the studies and their titles")
    _STUDY.add(parser)
    parser.add_argument(
        "--real", action="store_true", default=None,
        help="of guided: on the surrogate of the measured hydrogen-diesel engine instead of the virtual bench",
    )  # fmt: skip
    parser.add_argument(
        "--workers", type=int, metavar="N", help="processes that share its parts (default: one part after the other)"
    )
    parser.add_argument("--figures", metavar="DIR", help="write its figures into DIR")
    parser.add_argument("--report", metavar="DIR", help="write a page with tables and figures into DIR")
    parser.add_argument("--format", choices=("png", "svg"), default="png", help="of the figures (default: %(default)s)")


def run(args: argparse.Namespace) -> None:
    """List the studies, or run one."""
    titles = available_studies()
    if args.list:
        refuse_idle(args, *_OPTIONS, "workers", why="--list runs no study")
        width = max(map(len, titles))
        text = "\n".join(f"{name:{width}} {title}" for name, title in titles.items())
        emit(args, {"studies": [{"name": name, "title": title} for name, title in titles.items()]}, text=text)
        return
    if args.name not in titles:
        raise ParameterError.of("study", args.name or "", "one of those that `mgdd study --list` prints", known=titles)
    options: dict[str, Any] = {}
    for option, studies in _OPTIONS.items():
        if args.name not in studies:
            refuse_idle(args, option, why=f"it is an option of the study {', '.join(studies)}, not of {args.name}")
        elif getattr(args, option) is not None:
            options[option] = getattr(args, option)
    folder = None if args.figures is None else Path(args.figures)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    drawn = folder is not None or args.report is not None
    step = args.progress.expect(10)
    result, stopped = whole_or_part(
        run_study, args.name, figures=drawn, progress=step, **_STUDY.given(args),
        executor=None if args.workers is None else processes(args.workers), **options,
    )  # fmt: skip
    files = {} if folder is None else _files(result.figures, folder, f"{args.name}.{args.format}")
    summary: dict[str, Any] = dict(result.summary)
    if folder is not None:
        summary["figures"] = [path.as_posix() for path in files]
    if args.report is not None:
        summary["report"] = (Path(args.report) / "index.html").as_posix()
    emit(args, summary, text=_text(titles[args.name], summary))
    for path, (caption, figure) in files.items():
        figure.savefig(path, dpi=120, metadata={"Title": caption})
    if args.report is not None:
        write_report(result, args.report)
    if stopped:
        raise Stopped(f"{len(summary['rows'])} finished rows are printed")


def _files(figures: Mapping[str, Figure], folder: Path, ending: str) -> dict[Path, tuple[str, Figure]]:
    files = {}
    stem, _, suffix = ending.rpartition(".")
    for number, (caption, figure) in enumerate(figures.items(), start=1):
        slug = "-".join(re.findall(r"[a-z0-9]+", caption.lower())[:6])
        files[folder / f"{stem}-{number}-{slug}.{suffix}"] = caption, figure
    return files


def _text(title: str, summary: Mapping[str, Any]) -> list[str | Table]:
    seeds = summary["seeds"]
    chance = f" ({seeds} seed{'s' if seeds != 1 else ''})" if seeds else ""
    out: list[str | Table] = [f"{summary['study']}: {title}{chance}\n", rows_table(summary["rows"])]
    if any(name.endswith(_LOW) for row in summary["rows"] for name in row):
        out.append("\nBrackets: 95 % interval over seeds, of the mean or, for cycles, of the median.")
    if summary.get("figures"):
        out += ["", *summary["figures"]]
    if summary.get("report"):
        out += ["", f"Report: {summary['report']}"]
    return out


def rows_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Lay out flat rows: one line each, intervals behind their mean, the names of the keys as the head."""
    names = column_names(rows)
    return Table(columns=tuple(names), rows=tuple(tuple(cells(row, names)) for row in rows))
