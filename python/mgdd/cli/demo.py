"""`mgdd demo`: the main job on the measured traces of the package."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mgdd.cli.options import add_command
from mgdd.cli.output import check_output, emit, progress
from mgdd.report import write_report
from mgdd.studies import run_measured_traces

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
    check_output(args, csv=False)
    with progress(args, expected=45) as step:
        result = run_measured_traces(progress=step)
        step("write the report")
        page = write_report(result, Path(args.folder))
    emit(args, result.summary, text=_text(result.summary, page))


def _text(summary: Any, page: Path) -> str:
    form = "{:20} {:>8} {:>7} {:>7} {:>9}  {:>24} {:>13}  {:>18} {:>13}"
    own, free = "best SOC, own p_max kept", "best SOC, no limit"
    out = [
        f"{len(summary['traces'])} measured traces, calibrated with {summary['law']}.",
        "",
        form.format("trace", "p_max", "CA50", "RMSE", "IMEP err", own, "gain", free, "gain"),
        form.format("", "[bar]", "[CAD]", "[%]", "[%]", "[°CA aTDC]", "[%]", "[°CA aTDC]", "[%]"),
    ]
    for row in summary["traces"]:
        best, fit = row["best_timing"], row["calibrated"]
        out.append(
            f"{row['file']:20} {row['analysis']['p_max_bar']:8.1f} {row['analysis']['ca50_cad']:7.1f} "
            f"{fit['rmse_percent']:7.2f} {fit['imep_closed_error_percent']:+9.1f}  {_span(best['soc_cad'], 1):>24} "
            f"{_span(best['gain_percent'], 2):>13}  {_span(best['free_soc_cad'], 1):>18} "
            f"{_span(best['free_gain_percent'], 2):>13}"
        )
    out += [
        "",
        "Ranges: wall-heat scale 0.5 to 1, everything else refitted; these traces do not determine it.",
        f"Read what to distrust in {page}",
    ]
    return "\n".join(out)


def _span(pair: list[float], digits: int) -> str:
    return f"{pair[0]:.{digits}f} to {pair[1]:.{digits}f}"
