"""`mgdd demo`: the main job on the measured traces of the package."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mgdd.cli.options import add_command
from mgdd.cli.output import check_output, emit
from mgdd.report import write_report
from mgdd.studies import run_study
from mgdd.studies.sections import Table

__all__ = ["add"]


def add(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "demo",
        run,
        help_text="read, analyse and calibrate four measured traces, find their best timing, write a report",
        example="mgdd demo",
    )
    parser.add_argument("--folder", default="mgdd-report", help="folder of the report (default: mgdd-report)")


def run(args: argparse.Namespace) -> None:
    """Run the study and write the report."""
    check_output(args)
    step = args.progress.expect(45)
    result = run_study("measured-traces", progress=step)
    step("write the report")
    page = write_report(result, Path(args.folder))
    emit(args, result.summary, text=_text(result.summary, page))


def _text(summary: Any, page: Path) -> list[str | Table]:
    columns = (
        "trace", "p_max [bar]", "CA50 [CAD]", "RMSE [%]", "IMEP err [%]", "best SOC, own p_max kept [CAD]", "gain [%]",
        "best SOC, no limit [CAD]", "gain [%]",
    )  # fmt: skip
    rows = []
    for row in summary["traces"]:
        best, fit = row["best_timing"], row["calibrated"]
        rows.append(
            (
                row["file"], f"{row['analysis']['p_max_bar']:.1f}", f"{row['analysis']['ca50_cad']:.1f}",
                f"{fit['rmse_percent']:.2f}", f"{fit['imep_closed_error_percent']:+.1f}", _span(best["soc_cad"], 1),
                _span(best["gain_percent"], 2), _span(best["free_soc_cad"], 1), _span(best["free_gain_percent"], 2),
            )
        )  # fmt: skip
    return [
        f"{len(summary['traces'])} measured traces, calibrated with {summary['law']}. Angles are °CA aTDC.\n",
        Table(columns=columns, rows=tuple(rows)),
        "\nRanges: wall-heat scale 0.5 to 1, everything else refitted; these traces do not determine it.",
        f"Read what to distrust in {page}",
    ]


def _span(pair: list[float], digits: int) -> str:
    return f"{pair[0]:.{digits}f} to {pair[1]:.{digits}f}"
