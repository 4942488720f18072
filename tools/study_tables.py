"""Print the tables of the docs that take a full run of a study, or put them there.

Run `python tools/study_tables.py [--page docs/study_guide_learning.md] online-calibration calibrated-guide` with
the package installed; it takes a quarter of an hour. `--page docs/throttle_tracking.md throttle-tracking` takes a
minute. With `--json FILE ...` it takes what `mgdd study NAME --json` has printed.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mgdd_studies import run_study

__all__ = ["TABLES", "put_into", "tables"]

Row = Mapping[str, Any]
Column = tuple[str, Callable[[Row], str]]


def _words(name: str) -> Callable[[Row], str]:
    return lambda row: str(row[name]).replace("CAD", "°CA")


def _printed(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def _number(name: str, digits: int) -> Callable[[Row], str]:
    return lambda row: "–" if row[name] is None else _printed(row[name], digits)


def _between(name: str, digits: int) -> Callable[[Row], str]:
    def said(row: Row) -> str:
        ends = [row[name + end] for end in ("_low", "_high")]
        if row[name] is None:
            return "never"
        middle = _printed(row[name], digits)
        if ends == [None, None]:
            return middle  # of too few seeds
        return f"{middle} ({' to '.join('never' if end is None else _printed(end, digits) for end in ends)})"

    return said


def _median_and_p95(name: str, digits: int, unit: str = "") -> Callable[[Row], str]:
    def said(row: Row) -> str:
        ends = (row[f"{name}{unit}"], row[f"{name}_p95{unit}"])
        median, p95 = ("never" if end is None else _printed(end, digits) for end in ends)
        return f"{median} ({p95})"

    return said


def _engine(row: Row) -> str:
    return str(row["engine"]).partition(",")[0]  # the page has its wall heat


_ENGINE: tuple[Column, ...] = (("engine", _engine), ("start [°CA aTDC]", _number("start_cad", 0)))
_PATH: tuple[Column, ...] = (
    ("stays within 1.5 °CA from cycle, median", _between("median_stays", 0)),
    ("90 % of the runs", _number("stays_90_percent", 0)),
    ("mean error after 60 cycles [°CA]", _between("late_error_cad", 2)),
    ("less than without calibration [°CA]", _between("late_error_less_cad", 2)),
    ("loss there [points]", _between("late_lost_percent", 4)),
)

_MAP: tuple[Column, ...] = (
    ("loss, mean of the cells [points]", _between("lost_percent", 4)),
    ("worst cell [points]", _between("worst_lost_percent", 3)),
    ("every cell within 0.1 points [% of maps]", _number("within_01_percent", 0)),
)


def _error_and_verdict(row: Row) -> str:
    error = f"{_printed(row['error_percent'], 1)} ± {_printed(row['error_sd_percent'], 1)}"
    return f"{error}, {_printed(row['determined_percent'], 0)} %"


def _is_of_noise(row: Row) -> bool:
    return bool(row["sensor"] == "clean" or row["sensor"].endswith("of noise"))


_VISITS = (0, 6, 8, 10, 12, 16, 24, 32, 64)  # that a page prints
# The rows of a table where it has not all of them.
_ROWS: Mapping[str, Callable[[Row], bool]] = {
    "online-calibration": lambda row: row["sensor"].endswith("of noise"),
    "calibrated-guide": lambda row: row["tdc_error_cad"] == 0.0,
    "map-that-seeks": lambda row: row["visits"] == 24,
}
# By study: name of the list in its summary, and the columns.
TABLES: Mapping[str, Mapping[str, tuple[Column, ...]]] = {
    "online-calibration": {
        "rows": (
            ("sensor", _words("sensor")),
            ("way", _words("way")),
            ("first within 3 %, cycles", _between("median_first", 0)),
            ("of later cycles [%]", _number("late_within_3_percent", 0)),
            ("error at the end [%]", _between("error_percent", 1)),
            ("spread [%]", _number("error_sd_percent", 1)),
            ("stated [%]", _number("stated_percent", 1)),
            ("holds [%]", _number("covered_percent", 0)),
            ("determined [%]", _number("determined_percent", 0)),
        ),
        "facts": (
            ("fact", _words("fact")),
            ("found", lambda row: f"{row['value']:.3g}"),
            ("expected", lambda row: f"{row['expected']:g} ± {row['margin']:g}"),
        ),
    },
    "calibrated-guide": {
        "rows": (
            *_ENGINE,
            ("calibrated", _words("calibrated")),
            *_PATH,
            ("guide after 10, 60, 200 cycles off by [°CA]", lambda row: ", ".join(
                f"{row[name]:.1f}" for name in ("guide_error_10_cad", "guide_error_60_cad", "guide_error_end_cad")
            )),
        ),
        "refits": (
            ("engine", _engine),
            ("calibrated", _words("calibrated")),
            ("per run", _number("refits_per_run", 1)),
            ("error changed by those before cycle 10 [°CA]", _number("early_change_cad", 2)),
            ("by later ones [°CA]", _between("late_change_cad", 3)),
            ("worst of those [°CA]", _number("late_worst_cad", 2)),
            ("threw back", lambda row: f"{row['thrown_back']} of {row['late_refits']}"),
        ),
        "load_step": (
            ("engine", _engine),
            ("form", _words("form")),
            ("calibrated", _words("calibrated")),
            ("guide off at the new point [°CA]", _number("guide_error_cad", 1)),
            ("back within 1 °CA, median [cycles]", _between("median_back", 0)),
            ("loss [points × cycles]", _between("lost", 1)),
            ("less than without calibration", _between("lost_less", 1)),
        ),
    },
    "from-design-to-map": {
        "rows": (
            ("calibration", _words("way")),
            ("points", _number("points", 0)),
            ("cycles averaged", _number("averaged_cycles", 0)),
            ("engine cycles", _number("cycles", 0)),
            ("loss, mean of the cells [points]", _between("lost_percent", 3)),
            ("worst cell [points]", _between("worst_lost_percent", 3)),
            ("between cells [points]", _between("between_lost_percent", 3)),
            ("every cell within 0.1, 0.2, 0.5 points [% of maps]", lambda row: ", ".join(
                f"{row[name]:.0f}" for name in ("within_01_percent", "within_02_percent", "within_05_percent")
            )),
            ("cells that the check found above a limit", _number("cells_found_above", 2)),
        ),
        "parts": (
            ("fit of 64 points", _words("way")),
            ("part", _words("part")),
            ("loss, mean of the cells [points]", _between("lost_percent", 4)),
            ("largest in a cell [points]", _number("largest_of_a_cell_percent", 3)),
            ("cells above a limit, of 30", _number("cells_above", 1)),
            ("furthest above [%]", _number("largest_excess_percent", 1)),
        ),
        "other_engines": (
            ("engine", _words("engine")),
            ("best timing moved [°CA]", _number("optimum_moved_cad", 1)),
            ("loss, mean of the cells [points]", _between("lost_percent", 3)),
            ("worst cell [points]", _between("worst_lost_percent", 2)),
            ("cells above a limit, of 30", _between("cells_above", 1)),
            ("furthest above [%]", _number("largest_excess_percent", 1)),
        ),
        "guides": (
            ("engine", _words("engine")),
            ("timing from", _words("guide")),
            ("loss per cycle [points]", _between("lost_percent", 3)),
            ("first 50 cycles at a point", _between("early_lost_percent", 3)),
            ("last 50", _between("late_lost_percent", 3)),
            ("less than with the rough model [%]", _between("less_than_rough_percent", 0)),
            ("cycles above a limit [%]", _between("above_percent", 1)),
        ),
        "learnt": (
            ("engine", _words("engine")),
            ("map alone, loss before [points]", _between("lost_before_percent", 3)),
            ("after", _between("lost_after_percent", 3)),
            ("gone [%]", _between("gone_percent", 0)),
            ("cycles above a limit before [%]", _between("above_before_percent", 1)),
            ("after [%]", _between("above_after_percent", 1)),
        ),
    },
    "map-that-seeks": {
        "rows": (
            ("engine", _words("engine")),
            ("guide", _words("guide")),
            ("trouble", _words("trouble")),
            *_MAP,
            ("cells above a limit by more than 1 %, of which not named", lambda row: (
                f"{row['cells_above']:.2f}, {row['unnamed_above']:.2f}"
            )),
            ("visits above a limit by more than 1 %", _number("visits_above", 2)),
            ("furthest visit above [%]", _number("largest_visit_excess_percent", 1)),
        ),
        "others": (
            ("way to a map", _words("way")),
            ("engine cycles", _number("engine_cycles", 0)),
            *_MAP,
            ("measured points or cycles above a limit", _number("driven_above", 1)),
        ),
        "two_inputs": (
            ("visits, timing and intake pressure", _number("visits", 0)),
            *_MAP,
            ("cells above a limit by more than 1 %", _number("cells_above", 2)),
        ),
        "drives": (
            ("guide", _words("guide")),
            ("timing from", _words("way")),
            ("loss per cycle [points]", _between("lost_percent", 3)),
            ("first turn", _between("first_turn_percent", 3)),
            ("second turn", _between("second_turn_percent", 3)),
            ("cells within 1.96 of the stated standard deviation [%]", _number("covered_percent", 0)),
        ),
    },
    "throttle-tracking": {
        "rows": (
            ("preset", _words("preset")),
            ("controller", _words("controller")),
            ("20→60 [ms]", _median_and_p95("large", 0, "_ms")),
            ("40→42 [ms]", _median_and_p95("small", 0, "_ms")),
            ("4→20 [ms]", _median_and_p95("up", 0, "_ms")),
            ("MSE sine [deg²]", _median_and_p95("sine_mse", 4, "_deg2")),
            ("static error [deg]", _number("static_p95_deg", 2)),
            ("overshoot [deg]", _number("overshoot_p95_deg", 1)),
            ("variation", _number("variation_rest", 1)),
            ("limit cycles", _number("limit_cycles", 0)),
        ),
    },
}  # fmt: skip


def tables(name: str, summary: Mapping[str, Any]) -> dict[str, list[str]]:
    """Give the lines of each table of a study by the name of its list."""
    out = {}
    for part, columns in TABLES[name].items():
        rows = [row for row in summary[part] if part != "rows" or name not in _ROWS or _ROWS[name](row)]
        if "case" in (rows[0] if rows else {}):
            out |= _by_case(columns, rows)
        else:
            out[part] = _table(columns, rows)
    if name == "online-calibration":
        out["errors"] = _errors(summary["rows"])
    elif name == "calibrated-guide":
        out["settings"] = _settings(summary["settings"])
    elif name == "throttle-tracking" and summary["warm"]:
        out["warm"] = _warm(summary["warm"])
    elif name == "map-that-seeks":
        out |= _by_visits(summary["rows"], summary["unvisited"])
    return out


def _table(columns: Sequence[Column], rows: Sequence[Row]) -> list[str]:
    lines = [[head for head, _ in columns], ["---"] * len(columns)]
    lines += [[cell(row) for _, cell in columns] for row in rows]
    return [f"| {' | '.join(line)} |" for line in lines]


def _by_case(columns: Sequence[Column], rows: Sequence[Row]) -> dict[str, list[str]]:
    """Give a table to each case, which heads its first column."""
    (_, first), *others = columns
    return {
        case: _table(((case, first), *others), [row for row in rows if row["case"] == case])
        for case in dict.fromkeys(row["case"] for row in rows)
    }


def _side_by_side(
    rows: Sequence[Row], head: str, below: str, beside: Callable[[Row], str], cell: Callable[[Row], str]
) -> list[str]:
    """Give a line to each value of ``below`` and a column to each of ``beside``."""
    columns = list(dict.fromkeys(map(beside, rows)))
    cells = {(row[below], beside(row)): cell(row) for row in rows}
    lines = [[head, *columns], ["---"] * (1 + len(columns))]
    lines += [
        [label.replace("CAD", "°CA"), *(cells.get((label, column), "") for column in columns)]
        for label in dict.fromkeys(row[below] for row in rows)
    ]
    return [f"| {' | '.join(line)} |" for line in lines]


def _errors(rows: Sequence[Row]) -> list[str]:
    """Error at the end ± spread over seeds, share of runs that call it determined."""
    faulty = [row for row in rows if not _is_of_noise(row)]
    return _side_by_side(faulty, "error of the sensor", "sensor", _words("way"), _error_and_verdict)


def _settings(rows: Sequence[Row]) -> list[str]:
    """Cycle from which it stays (90 % of the runs), mean error after 60 cycles, error of the guide."""

    def cell(row: Row) -> str:
        stays = f"{_number('median_stays', 0)(row)} ({_number('stays_90_percent', 0)(row)})"
        return f"{stays}; {_between('late_error_cad', 2)(row)}; {_number('guide_error_end_cad', 1)(row)}"

    return _side_by_side(
        rows, "calibrated", "calibrated", lambda row: f"{_engine(row)}, from {row['start_cad']:g}", cell
    )


def _warm(rows: Sequence[Row]) -> list[str]:
    """MSE of both sines, by what the controller knows."""

    def cell(row: Row) -> str:
        return f"{_number('sine_mse_deg2', 5)(row)}, {_number('crossing_mse_deg2', 5)(row)}"

    named = [{**row, "case": f"{row['preset']}, {row['wrong']}"} for row in rows]
    return _side_by_side(named, "preset, what is wrong", "case", _words("controller"), cell)


def _by_visits(rows: Sequence[Row], unvisited: Sequence[Row]) -> dict[str, list[str]]:
    """Loss over the visits, mean of the cells and its interval, then the worst cell; the guide alone at none."""

    def cell(row: Row) -> str:
        return f"{_between('lost_percent', 3)(row)}; {_number('worst_lost_percent', 2)(row)}"

    every = [row for row in (*unvisited, *rows) if row.get("trouble", "none") == "none" and row["visits"] in _VISITS]
    every.sort(key=lambda row: row["visits"])
    own = [row for row in every if row["engine"] == "as calibrated"]
    changed = [row for row in every if row["engine"] != "as calibrated"]
    return {
        "visits": _side_by_side(own, "guide, points visited", "guide", lambda row: f"{row['visits']}", cell),
        "changed": _side_by_side(
            [{**row, "engine": f"{row['engine']}, {row['guide']}"} for row in changed], "engine, guide, points visited",
            "engine", lambda row: f"{row['visits']}", cell,
        ),
    }  # fmt: skip


def put_into(page: str, name: str, summary: Mapping[str, Any]) -> str:
    """Put the tables into a page in place of those with the same head."""
    lines = page.split("\n")
    for new in tables(name, summary).values():
        if new[0] not in lines:
            raise SystemExit(f"the page has no table with the head {new[0]}")
        first = lines.index(new[0])
        last = first + next(k for k, line in enumerate(lines[first:]) if not line.startswith("|"))
        lines[first:last] = new
    return "\n".join(lines)


def main() -> None:
    """Run the studies that are named, or read what they said, and print their tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("study", nargs="*", choices=[[], *TABLES], help="which; all of them if none is named")
    parser.add_argument("--json", nargs="+", type=Path, default=[], help="what `mgdd study NAME --json` has printed")
    parser.add_argument("--page", type=Path, metavar="FILE", help="also put them into this page")
    options = parser.parse_args()
    found = [json.loads(file.read_text(encoding="utf-8")) for file in options.json]
    if not found:
        found = [run_study(name, figures=False).summary for name in options.study or TABLES]
    for summary in found:
        for part, lines in tables(summary["study"], summary).items():
            print(f"\n{summary['study']}, {part}\n")
            print("\n".join(lines))
        if options.page:
            page = options.page.read_text(encoding="utf-8")
            options.page.write_text(put_into(page, summary["study"], summary), encoding="utf-8")
        for bar in summary.get("bars", ()):
            print(f"{'met' if bar['met'] else 'MISSED':6} {bar['bar']}: {bar['worst']} ({bar['limit']})")


if __name__ == "__main__":
    main()
