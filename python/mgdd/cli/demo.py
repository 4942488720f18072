"""`mgdd demo`: the main job on the measured traces of the package, a guided start, and a throttle under control."""

from __future__ import annotations

import argparse
from typing import Any

from mgdd.cli.from_library import Options
from mgdd.cli.output import emit, whole_or_part
from mgdd.cli.progress import Stopped
from mgdd.cli.study import studies
from mgdd.identify import ModelFamily
from mgdd.identify.engine.timing_records import undetermined
from mgdd.loop.controller_families import FAMILIES
from mgdd.report import Table, write_report
from mgdd.report.calibration import shipped_report

_REPORT = Options(write_report, "folder")
_GUIDED = {
    "unguided": "extremum seeking, unguided",
    "feed_forward": "extremum seeking from the model's timing",
    "curve": "guided by the model's curve",
    "parabola": "guided by a parabola",
}


_CUT_SHORT = "\nInterrupted: these are the models that were finished, and not every check of them was made."


def run(args: argparse.Namespace) -> None:
    """Calibrate, write the report, run two studies; Ctrl-C keeps what is finished."""
    step = args.progress.expect(120)
    result, stopped = whole_or_part(shipped_report, name="mgdd demo", progress=step)
    step("write the report")
    try:
        page = write_report(result, **_REPORT.given(args))
    except KeyboardInterrupt:
        emit(args, result.summary, text=_text(result.summary))
        raise
    summary, text = {**result.summary, "report": page.as_posix()}, _text(result.summary)
    for key, study, written in (("guided", "guided", _guided_text), ("throttle", "throttle-tracking", _throttle_text)):
        if stopped:
            break
        try:
            part, stopped = whole_or_part(studies().run_study, study, quick=True, figures=False, progress=step)
        except KeyboardInterrupt:
            stopped = True
        except ImportError as error:  # without the studies the demo is its first part
            text.append(f"\n{error}")
            break
        else:
            summary[key] = part.summary
            text += written(part.summary)
    emit(args, summary, text=[*text, f"\nEvery model's answer, with the limitations found: {page}"])
    if stopped:
        raise Stopped(f"what was finished is printed, and in {page}")


def _text(summary: Any) -> list[str | Table]:
    columns = (
        "trace", "RMSE [%]", "closed IMEP err [%]", "best CA50, no limit [CAD]", "move by [CAD]", "gain [%]",
        "own p_max kept: move by [CAD]", "gain [%]",
    )  # fmt: skip
    rows = []
    for row in summary["traces"]:
        best, fit = row["best_timing"], row["calibrated"]
        rows.append(
            (
                row["file"], f"{fit['rmse_percent']:.2f}", f"{fit['imep_closed_error_percent']:+.1f}",
                _span(best, "free_ca50_cad", 1), _span(best, "free_shift_cad", 1), _span(best, "free_gain_percent", 2),
                _span(best, "shift_cad", 1), _span(best, "gain_percent", 2),
            )
        )  # fmt: skip
    members = summary["best_timing"][0]["members"]
    kept = sum(any(row["members"][at]["plausible"] for row in summary["best_timing"]) for at in range(len(members)))
    return [
        (
            f"{len(summary['traces'])} measured traces, calibrated with {kept} plausible models of {len(members)}. "
            f"Angles are °CA aTDC.{_CUT_SHORT if summary['interrupted'] else ''}\n"
        ),
        Table(columns=columns, rows=tuple(rows)),
        (
            f"\nFirst number: the headline model, {summary['law']}. In brackets: the range over all plausible ones,\n"
            f"angles with {ModelFamily().misfit_cad:g} °CA on both sides for what all of them lack; gains are\n"
            "those of the models. Wall heat and gamma cannot be separated here.\n"
            'Positive moves are later. "open": the range spans zero, so no direction is determined.'
        ),
    ]


def _guided_text(summary: Any) -> list[str | Table]:
    columns = ("seeker", "start [CAD]", "cycles to 1 CAD", "loss in 100 cycles [% x cycles]", "late loss [%]")
    rows = [
        (
            _GUIDED[row["case"]], f"{row['start_cad']:.1f}", f"{row['cycles_to_1_cad']:g}",
            f"{row['lost_j_cycles']:.1f}", f"{row['late_loss']:.3f}",
        )
        for row in summary["rows"]
    ]  # fmt: skip
    return [
        (
            "\nThe other half needs no trace: a seeker looks for the best timing on the virtual bench, "
            f"{summary['optimum_cad']:.1f} °CA aTDC.\nA model with twice the wall heat says "
            f"{summary['guide_cad']:.1f}; medians and means of {summary['seeds']} seeds:\n"
        ),
        Table(columns=columns, rows=tuple(rows)),
        "\nMore seeds: mgdd study guided. One run: mgdd engine seek --guide curve --guide-set wall_heat_scale=1.0",
    ]


def _throttle_text(summary: Any) -> list[str | Table]:
    columns = (
        "controller",
        "20 to 60 deg [ms]",
        "slowest",
        "40 to 42 deg [ms]",
        "slowest",
        "duty moves in 2 s of rest",
    )
    rows = [
        (
            FAMILIES[row["controller"]].label,
            *(_milliseconds(row[name]) for name in ("large_ms", "large_p95_ms", "small_ms", "small_p95_ms")),
            f"{row['variation_rest']:.1f}",
        )
        for row in summary["rows"]
    ]
    return [
        (
            f"\nThe throttle in front of the engine: {summary['seeds']} throttles within 20 % of the one for which\n"
            "every controller is designed; settling times, median and slowest:\n"
        ),
        Table(columns=columns, rows=tuple(rows)),
        "\nMore throttles: mgdd study throttle-tracking. One run: mgdd throttle track --plant-scale coulomb_nm=1.2",
    ]


def _milliseconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.0f}"


def _span(best: Any, name: str, digits: int) -> str:
    if best["best"] is None:
        return "not known: no plausible model"
    sign, shift = "+" if name.endswith("shift_cad") else "", name.replace("gain_percent", "shift_cad")
    low, high, own = (f"{value:{sign}z.{digits}f}" for value in (*best[name], best["best"][name]))
    is_open = shift.endswith("shift_cad") and undetermined(best[shift])
    return f"{'open' if is_open else own} ({low} to {high})"


COMMANDS = {"demo": (_REPORT.add, run)}
