"""One question: how fast are many cycles, beside what people use for them.

    python benchmarks/sweep_speed.py [--quick] [--only 'mgdd|JAX'] [--json FILE]

`puma_single`, trapezoid, 1 °CA from IVC to EVO, constant gamma, Woschni, triangular heat release; eight figures per
cycle and no traces. Three tasks: 4096 timings of one operating point, 4096 and 65536 points whose speed, fuel, intake
pressure, intake temperature and SOC all differ. Everyone's figures must agree with the scalar core before anything is
timed: to 1e-9, ours to 1e-6 in a timing sweep, whose expansion it interpolates.

On one core the time is processor time, which leaves out what else the machine does; on two it is wall time, in a
process of its own. Compilation is in the first call, which has a column of its own. Repeats are interleaved. Cantera's
engine network follows in a table of its own: its physics are others.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from peers import cycle_cases, cycle_contenders
from peers.cycle_contenders import JAX, LITERAL, NUMBA, OURS, Contender
from support import machine
from support.sweep_report import bars, print_bars, print_table, rows_of

from mgdd import _core

LEAST_SECONDS = 0.02  # of one timed sample: shorter calls are repeated
SEED = 15
TASKS = {"timing sweep": 4096, "arbitrary points": 4096, "many arbitrary points": 65536}
PACKAGES = ("numba", "llvmlite", "jax", "jaxlib", "cantera")
CANTERA = {"kinetics off, rtol 1e-6": (False, 1e-6), "kinetics on, rtol 1e-6": (True, 1e-6)}
CANTERA |= {"kinetics on, rtol 1e-12": (True, 1e-12)}


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, help="interleaved repeats, at least 9 (default 9; 3 with --quick)")
    parser.add_argument("--quick", action="store_true", help="512 cycles per task, one core: do all run and agree?")
    parser.add_argument("--only", metavar="REGEX", help="contenders of that name, ours and the literal C++")
    parser.add_argument(
        "--literal-library", type=Path, help="libliteral_sweep.so of cpp/bench (default: if built in build/bench)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    parser.add_argument("--cores", type=int, choices=(1, 2), default=1, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.repeats is None:
        options.repeats = 3 if options.quick else 9
    elif options.repeats < 9 and not options.quick:
        parser.error("--repeats must be at least 9 without --quick")
    if options.literal_library is None and cycle_contenders.LIBRARY.exists():
        options.literal_library = cycle_contenders.LIBRARY
    return options


def cases_of(task: str, quick: bool) -> np.ndarray:
    n = 512 if quick else TASKS[task]
    if task == "timing sweep":
        return cycle_cases.timing_sweep(_core.engine.OperatingPoint(), n)
    return cycle_cases.arbitrary_points(cycle_cases.engine_of(_core.engine.Cylinder()), n, SEED)


def check_agreement(
    found: dict[str, Contender], cases: np.ndarray, expected: np.ndarray
) -> tuple[dict[str, float], dict[str, float]]:
    """Largest difference of any figure relative to its size or 1, and the first call's seconds; SystemExit above."""
    worst, seconds = {}, {}
    for name, contender in found.items():
        call = contender.ready(contender.of(cases))
        start = time.perf_counter()
        answer = call()
        seconds[name] = time.perf_counter() - start
        figures = contender.rows(answer)
        wanted = contender.of(expected)
        difference = np.abs(figures - wanted) / np.maximum(1.0, np.abs(wanted))
        worst[name] = float(difference.max())
        if not worst[name] <= contender.tolerance:
            row, column = np.unravel_index(difference.argmax(), difference.shape)
            sys.exit(
                f"{name} and the scalar core differ by {worst[name]:.1e} (bound {contender.tolerance:.0e}) in "
                f"{cycle_cases.FIGURES[column]} of case {row}: nothing timed"
            )
    return worst, seconds


def measure(
    found: dict[str, Contender], cases: np.ndarray, repeats: int, clock: Callable[[], float]
) -> dict[str, list[float]]:
    """Microseconds per cycle of each repeat; every sample lasts for `LEAST_SECONDS` or longer."""
    calls = {name: contender.ready(contender.of(cases)) for name, contender in found.items()}
    counts = {}
    for name, call in calls.items():
        start = clock()
        call()
        counts[name] = max(1, int(LEAST_SECONDS / max(clock() - start, 1e-6)))
    times: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(repeats):
        for name, call in calls.items():
            start = clock()
            for _ in range(counts[name]):
                call()
            times[name].append((clock() - start) / counts[name] / len(found[name].of(cases)) * 1e6)
    return times


def run_task(task: str, options: argparse.Namespace) -> tuple[dict[str, dict[str, float]], list[str]]:
    """Rows of one table, and who is missing from it."""
    cases, e = cases_of(task, options.quick), cycle_cases.engine_of(_core.engine.Cylinder())
    expected = cycle_contenders.reference(cases)
    asked = {"one_point": task == "timing sweep", "n": len(cases), "library": options.literal_library}
    if options.cores == 2:
        found, missing = cycle_contenders.contenders_on_two(e, **asked), []
    else:
        found, missing = cycle_contenders.contenders(e, **asked)
    if options.only:
        kept = re.compile(options.only)
        found = {name: one for name, one in found.items() if name in (OURS, LITERAL) or kept.search(name)}
    worst, first = check_agreement(found, cases, expected)
    clock = time.process_time if options.cores == 1 else time.perf_counter
    return rows_of(measure(found, cases, options.repeats, clock), worst, first), missing


def on_two_cores(options: argparse.Namespace) -> dict[str, dict[str, dict[str, float]]]:
    """Tables of a process that may use two cores from its first import on."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "two.json"
        command = [sys.executable, __file__, "--cores", "2", "--repeats", str(options.repeats), "--json", str(file)]
        if options.only:
            command += ["--only", options.only]
        if options.literal_library:
            command += ["--literal-library", str(options.literal_library)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return json.loads(file.read_text(encoding="utf-8"))["tasks"]


def cantera_seconds(repeats: int) -> dict[str, dict[str, float]]:
    """Processor seconds per cycle of the reactor network; building it is not counted."""
    from peers.cantera_engine import CanteraEngine

    cylinder, point = _core.engine.Cylinder(), _core.engine.OperatingPoint()
    rows = {}
    for name, (kinetics, tolerance) in CANTERA.items():
        seconds = []
        for _ in range(repeats):
            engine = CanteraEngine(cylinder, point, kinetics=kinetics, relative_tolerance=tolerance)
            start = time.process_time()
            figures = engine.run()
            seconds.append(time.process_time() - start)
        rows[name] = {"min_s": min(seconds), "median_s": statistics.median(seconds), **figures}
    return rows


def print_cantera(rows: dict[str, dict[str, float]], ours_us: float) -> None:
    print("\nOTHER PHYSICS: Cantera, 100 species of n-dodecane, valves and injector, 720 °CA, no wall heat;")
    print("ours beside it is the closed cycle with a given burn. What the time buys, not a race.")
    print(f"{'one cycle':28s} {'min s':>9s} {'median s':>9s} {'/ ours':>11s} {'IMEP net':>9s} {'p_max':>8s} bar")
    for name, row in rows.items():
        ratio = row["min_s"] * 1e6 / ours_us
        print(
            f"{name:28s} {row['min_s']:9.3f} {row['median_s']:9.3f} {ratio:11.2g} "
            f"{row['imep_net_bar']:9.2f} {row['p_max_bar']:8.1f}"
        )


def versions(options: argparse.Namespace) -> dict[str, str]:
    context = machine.versions()
    context["instruction set"] = f"{_core.instruction_set()}, the widest that mgdd found here"
    for package in PACKAGES:
        if cycle_contenders.installed(package):
            context[package] = importlib.metadata.version(package)
    if options.literal_library:
        compiler = cycle_contenders.literal_cycles(options.literal_library)[1]
        context[LITERAL] = f"{compiler}, {_core.compiled_simd_level()} as the wheel"
    return context


def main() -> None:
    options = arguments()
    if options.cores == 1:
        machine.pin()  # before JAX and Numba look how many cores there are
    tasks = list(TASKS)[:2] if options.quick else list(TASKS)
    context, tables, missing = versions(options), {}, []
    for task in tasks:
        tables[task], missing = run_task(task, options)
    report = {"context": context, "repeats": options.repeats, "tasks": tables}
    for key, value in context.items():
        print(f"{key:20s} {value}")
    print(f"{'repeats':20s} {options.repeats} interleaved{', quick: indicative only' if options.quick else ''}")
    for line in missing:
        print(f"{'left out':20s} {line}")
    for task, rows in tables.items():
        print_table(f"{task}: {len(cases_of(task, options.quick))} cycles, {options.cores} core(s)", rows)
    if options.cores == 1:
        report["bars"] = bars(tables, ours=OURS, literal=LITERAL, jax=JAX, numba=NUMBA)
        print_bars(report["bars"], _core.instruction_set())
        if not options.quick:
            report["two_cores"] = on_two_cores(options)
            for task, rows in report["two_cores"].items():
                print_table(f"{task}: {TASKS[task]} cycles, two threads on two cores, wall time", rows)
        if not cycle_contenders.installed("cantera"):
            print("left out             Cantera: pip install cantera")
        elif not options.only or re.search(options.only, "Cantera"):
            report["cantera"] = cantera_seconds(1 if options.quick else options.repeats)
            print_cantera(report["cantera"], tables["arbitrary points"][OURS]["min_us"])
    if options.json:
        options.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
