"""What the benchmarks of seeking share: their options, the figures of a contender on a map, and the tables of them."""

from __future__ import annotations

import argparse
import json
import math
import re
import statistics
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from peers.peer_seekers import installed
from support import machine
from support.seeking_rows import Row, check_agreement, run_once

from mgdd_studies.several_maps import CYCLES, EARLY, SeekingMap
from mgdd_studies.statistics import mean_interval

HEADS = (
    ("", "J lost", "95 %", "in the", "cycles", "never", "away", "J lost", "85 %", ""),
    ("", "a cycle", "", f"first {EARLY}", "to near", "", "at end", "at end", "holds", "seeds"),
)


@dataclass(frozen=True)
class Figures:
    """What came out of one contender on one map."""

    seeds: int
    lost: float
    lost_low: float
    lost_high: float
    lost_early: float
    median_arrival: float | None
    never: float
    away_at_end: float
    lost_at_end: float
    covered: float | None = None  # share of the stated intervals of 85 % that hold J


def judged(row: Row, field: SeekingMap, seeds: int) -> Figures:
    plants = [run_once(row, field, seed) for seed in range(seeds)]
    arrivals = [plant.arrived for plant in plants]
    median = statistics.median(arrivals)
    stated = sum(plant.judged for plant in plants)
    return Figures(
        seeds,
        *mean_interval([plant.lost / CYCLES for plant in plants]),
        statistics.fmean(plant.lost_early / EARLY for plant in plants),
        None if median == math.inf else median,
        sum(arrival == math.inf for arrival in arrivals) / seeds,
        sum(not plant.near() for plant in plants) / seeds,
        statistics.fmean(plant.lost_by_estimate() for plant in plants),
        sum(plant.covered for plant in plants) / stated if stated else None,
    )


def arguments(description: str, seeds: int = 200, bayes_seeds: int = 20) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--seeds", type=int, default=seeds, help="runs per contender and map")
    parser.add_argument("--bayes-seeds", type=int, default=bayes_seeds, help="the same for Bayesian optimisation")
    parser.add_argument("--only", type=re.compile, default=re.compile(""), help="contenders whose name has this in it")
    parser.add_argument("--maps", type=re.compile, default=re.compile(""), help="maps whose name has this in it")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    parser.add_argument(
        "--bayes-from", type=Path, metavar="FILE", help="take Bayesian optimisation from FILE, an earlier --json"
    )
    options = parser.parse_args()
    if options.seeds < 2 or options.bayes_seeds < 2:
        parser.error("--seeds and --bayes-seeds must be at least 2")
    return options


def known_figures(file: Path | None) -> dict[tuple[str, str], Figures]:
    """Map and name of a contender to its figures of an earlier run."""
    if file is None:
        return {}
    maps = json.loads(file.read_text(encoding="utf-8"))["maps"]
    return {
        (field, name): Figures(**found) for field, told in maps.items() for name, found in told["contenders"].items()
    }


def print_row(name: str, found: Figures) -> None:
    half = (found.lost_high - found.lost_low) / 2
    covered = "" if found.covered is None else f"{found.covered:.0%}"
    arrival = "never" if found.median_arrival is None else f"{found.median_arrival:.0f}"
    print(
        f"{name:54s} {found.lost:7.3f} +-{half:6.3f} {found.lost_early:8.3f} {arrival:>7s} {found.never:6.0%} "
        f"{found.away_at_end:7.0%} {found.lost_at_end:8.4f} {covered:>6s} {found.seeds:6d}",
        flush=True,
    )


def best_other(table: dict[str, Figures], rows: list[Row]) -> str | None:
    """Name of the one that is not under test and loses least."""
    return min((row.name for row in rows if not row.is_tested), key=lambda name: table[name].lost, default=None)


def print_tables(
    options: argparse.Namespace,
    chosen: list[tuple[SeekingMap, list[Row]]],
    agreed: set[str],
    packages: Mapping[str, str],
) -> None:
    """Run the rows that `options` asks for, those that must arrive without noise on the `agreed` maps first."""
    context = machine.versions()
    for package, version in installed(packages).items():
        context[package] = version or "missing: its rows are left out (pip install --group bench)"
    known = known_figures(options.bayes_from)
    chosen = [
        (field, [row for row in rows if options.only.search(row.name)])
        for field, rows in chosen
        if options.maps.search(field.name)
    ]
    taken = {
        (field.name, row.name): known[field.name, row.name]
        for field, rows in chosen
        for row in rows
        if row.is_bayes and (field.name, row.name) in known
    }
    for field, rows in chosen:
        if field.name in agreed:
            check_agreement([row for row in rows if (field.name, row.name) not in taken], field)
    for key, value in context.items():
        print(f"{key:26s} {value}")
    report = {}
    for field, rows in chosen:
        print(f"\n{field.name}: noise {field.noise_sd:g}, {CYCLES} cycles")
        for head in HEADS:
            print("{:54s} {:>7s} {:>8s} {:>8s} {:>7s} {:>6s} {:>7s} {:>8s} {:>6s} {:>6s}".format(*head))
        table: dict[str, Figures] = {}
        for row in rows:
            seeds = options.bayes_seeds if row.is_bayes else options.seeds
            table[row.name] = taken.get((field.name, row.name)) or judged(row, field, seeds)
            print_row(row.name, table[row.name])
        best = best_other(table, rows)
        ratios = {row.name: table[row.name].lost / table[best].lost for row in rows if row.is_tested} if best else {}
        for name, ratio in ratios.items():
            print(f"{name} loses {ratio:.2f} times what {best} loses")
        report[field.name] = {
            "contenders": {name: asdict(found) for name, found in table.items()},
            "best_of_the_others": best,
            "ratios": ratios,
        }
        if options.json:
            whole = {"context": context, "cycles": CYCLES, "maps": report}
            options.json.write_text(json.dumps(whole, indent=2) + "\n", encoding="utf-8")
