"""One question: what do the next visit of a search for a map and its memory cost, with up to 500 readings.

    python benchmarks/map_suggest.py [--readings 32,64,128,250,500] [--repeats 5] [--json FILE]

`MapSeeking.suggest` on a formula with two limits and a rough model of all three, with one input over 6 x 5
cells and with three inputs over 6 x 4 cells (some thousand cells times inputs are compared), and `ask` and `tell` as on
a drive. Readings lie about the best inputs of the model, at every cell in turn. Processor time of one core, the least
and the median of the repeats; memory is what the process has grown by since before the search was made, imports
left out.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mgdd.optimize import MapSeeking

SPEEDS = [1000.0, 1400.0, 1800.0, 2200.0, 2600.0, 3000.0]
FUELS = [8.0, 14.0, 20.0, 26.0, 32.0]
BOUNDS = {"soc_cad": (-24.0, 8.0), "egr": (0.0, 0.4), "intake_pressure_kpa": (100.0, 200.0)}
LIMITS = {"p_max_bar": 130.0, "nox_ppm": 600.0}
_NOISE = {"p_max_bar": 0.1, "nox_ppm": 5.0}
GOAL_MS, GOAL_AT = 50.0, 128


def engine(x: Mapping[str, float], *, off: float = 0.0) -> tuple[float, dict[str, float]]:
    """J and limits; `off` is by how much a model of it is wrong [°CA]."""
    load, speed = x["fuel_mg"] / 20.0, x["speed_rpm"] / 2000.0
    egr, boost = x.get("egr", 0.1), x.get("intake_pressure_kpa", 150.0) / 150.0
    late = x["soc_cad"] - (-2.0 - 4.0 * speed - 2.0 * load + 20.0 * egr + off)
    j = 50.0 + 4.0 * speed - 0.05 * late**2 - 60.0 * (egr - 0.15) ** 2 * load + 3.0 * boost - 2.0 * boost**2
    p_max = 70.0 * boost + 25.0 * load - 3.0 * (x["soc_cad"] + off)
    return j, {"p_max_bar": p_max, "nox_ppm": 500.0 * load * np.exp(-0.05 * (x["soc_cad"] + off) - 5.0 * egr - boost)}


def resident_mb() -> float:
    """Memory of this process."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def timed_ms(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Least and median processor time of a call."""
    out = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        out.append(1e3 * (time.process_time() - start))
    return min(out), statistics.median(out)


def rows_of(inputs: list[str], fuels: list[float], counts: list[int], repeats: int) -> list[dict[str, Any]]:
    """Measure one search as its readings grow."""
    axes = {"speed_rpm": SPEEDS, "fuel_mg": fuels}
    cells = [dict(zip(axes, place, strict=True)) for place in ((n, m) for n in SPEEDS for m in fuels)]
    draw = np.random.default_rng(1)
    MapSeeking({"x": (0.0, 1.0)}, {"y": [0.0, 1.0]}, guide=lambda x: x["x"]).suggest()  # what is imported stays out
    before = resident_mb()
    search = MapSeeking(
        {name: BOUNDS[name] for name in inputs}, axes, limits=LIMITS, guide=lambda x: engine(x, off=2.0)[0],
        limit_guides={name: lambda x, name=name: engine(x, off=2.0)[1][name] for name in LIMITS}, kept=500,
    )  # fmt: skip

    def read(at: dict[str, float], asked: dict[str, float]) -> None:
        j, limits = engine({**at, **asked})
        told = {name: value + _NOISE[name] * float(draw.standard_normal()) for name, value in limits.items()}
        search.tell(at, asked, j + 0.04 * float(draw.standard_normal()), told)

    def asked() -> None:
        at = cells[search.readings % len(cells)]
        read(at, search.ask(at))

    out = []
    for count in counts:
        while search.readings < count:
            at = cells[search.readings % len(cells)]
            middle = {"soc_cad": -5.0, "egr": 0.2, "intake_pressure_kpa": 140.0}
            spread = {"soc_cad": 5.0, "egr": 0.1, "intake_pressure_kpa": 20.0}
            read(at, {name: float(middle[name] + spread[name] * draw.uniform(-1.0, 1.0)) for name in inputs})
        search.suggest()
        read(cells[0], dict(search.ask(cells[0])))
        times = []
        for _ in range(repeats):
            times.append(timed_ms(search.suggest, 1)[0])
            visit = search.suggest()  # known by now
            read(visit.at, visit.inputs)
        drive, _ = timed_ms(asked, repeats)
        out.append({
            "inputs": len(inputs), "cells": len(cells), "readings": count, "suggest_ms": min(times),
            "suggest_median_ms": statistics.median(times), "ask_ms": drive, "memory_mb": resident_mb() - before,
        })  # fmt: skip
    return out


def main() -> None:
    """Measure, print, and say whether the goal is met."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--readings", default="32,64,128,250,500")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    counts = [int(count) for count in options.readings.split(",")]
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, one core")
    heads = (f"{'inputs':>6}", f"{'cells':>5}", f"{'readings':>8}", f"{'suggest, least (median) [ms]':>29}")
    print(*heads, f"{'ask + tell [ms]':>15}", f"{'memory [MB]':>11}")
    rows = rows_of(["soc_cad"], FUELS, counts, options.repeats)
    rows += rows_of(list(BOUNDS), FUELS[:4], counts, options.repeats)
    for row in rows:
        both = f"{row['suggest_ms']:.1f} ({row['suggest_median_ms']:.1f})"
        print(f"{row['inputs']:>6} {row['cells']:>5} {row['readings']:>8} {both:>29} {row['ask_ms']:>15.2f} "
              f"{row['memory_mb']:>11.1f}")  # fmt: skip
        if row["readings"] == GOAL_AT:
            met = "met" if row["suggest_ms"] <= GOAL_MS else "MISSED"
            print(f"{'':>6} goal of {GOAL_MS:g} ms: {met}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
