"""`mgdd study`: run one of the studies, print its table, write its figures."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.cli.options import add_command
from mgdd.cli.output import Stopped, check_output, emit, progress
from mgdd.errors import Interrupted, ParameterError
from mgdd.studies import StudyResult, available_studies, run_study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["add"]

_ENDS = ("_low", "_high")


def add(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "study",
        run,
        help_text="run a study of the package: a table over seeds, with figures",
        example="mgdd study ch4-esc --figures figures",
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help=f"one of {', '.join(available_studies())}")
    parser.add_argument("--list", action="store_true", help="list the studies and their titles")
    parser.add_argument(
        "--seeds", type=int, metavar="N", help="seeds behind every statistic (default: the study's own)"
    )
    parser.add_argument("--quick", action="store_true", help="a shorter study with wider intervals")
    parser.add_argument("--figures", metavar="DIR", help="write its figures into DIR")
    parser.add_argument("--format", choices=("png", "svg"), default="png", help="of the figures (default: png)")


def run(args: argparse.Namespace) -> None:
    """List the studies, or run one."""
    check_output(args, csv=False)
    titles = available_studies()
    if args.list:
        width = max(map(len, titles))
        text = "\n".join(f"{name:{width}} {title}" for name, title in titles.items())
        emit(args, {"studies": [{"name": name, "title": title} for name, title in titles.items()]}, text=text)
        return
    if args.name not in titles:
        given = "no study named" if args.name is None else f"no study {args.name!r}"
        raise ParameterError(f"{given}: must be one of {', '.join(titles)}")
    folder = None if args.figures is None else Path(args.figures)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    with progress(args, expected=10) as step:
        try:
            result = run_study(args.name, seeds=args.seeds, quick=args.quick, figures=folder is not None, progress=step)
        except Interrupted as stop:
            if not isinstance(stop.partial, StudyResult):
                raise
            result = stop.partial
        paths = [] if folder is None else _write(result.figures, folder, f"{args.name}.{args.format}")
    summary: dict[str, Any] = dict(result.summary)
    if folder is not None:
        summary["figures"] = [path.as_posix() for path in paths]
    emit(args, summary, text=_text(titles[args.name], summary))
    if summary.get("interrupted"):
        raise Stopped(f"{len(summary['rows'])} finished rows are printed")


def _write(figures: Mapping[str, Figure], folder: Path, ending: str) -> list[Path]:
    paths = []
    stem, _, suffix = ending.rpartition(".")
    for number, (caption, figure) in enumerate(figures.items(), start=1):
        slug = "-".join(re.findall(r"[a-z0-9]+", caption.lower())[:6])
        paths.append(folder / f"{stem}-{number}-{slug}.{suffix}")
        figure.savefig(paths[-1], dpi=120, metadata={"Title": caption})
    return paths


def _text(title: str, summary: Mapping[str, Any]) -> str:
    seeds = summary["seeds"]
    chance = f" ({seeds} seed{'s' if seeds != 1 else ''})" if seeds else ""
    out = [f"{summary['study']}: {title}{chance}", "", table(summary["rows"])]
    if any(name.endswith(_ENDS[0]) for row in summary["rows"] for name in row):
        out += ["", "Brackets: 95 % interval of the mean over seeds."]
    if summary.get("figures"):
        out += ["", *summary["figures"]]
    return "\n".join(out)


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Lay out flat rows: one line each, intervals behind their mean, the names of the keys as the head."""
    if not rows:
        return "(no rows)"
    names = [name for name in rows[0] if not (name.endswith(_ENDS) and name.rpartition("_")[0] in rows[0])]
    lines = [names, *([_cell(row, name) for name in names] for row in rows)]
    width = [max(len(line[place]) for line in lines) for place in range(len(names))]
    texts = [isinstance(rows[0][name], str) for name in names]
    return "\n".join(
        "  ".join(
            cell.ljust(size) if text else cell.rjust(size) for cell, size, text in zip(line, width, texts, strict=True)
        ).rstrip()
        for line in lines
    )


def _cell(row: Mapping[str, Any], name: str) -> str:
    ends = [row.get(name + end) for end in _ENDS]
    own = _number(row.get(name))
    return own if None in ends else f"{own} [{_number(ends[0])}, {_number(ends[1])}]"


def _number(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
