"""One question: how fast is one cycle against the literal equations and against Numba with the same algebra.

    python benchmarks/cycle_speed.py [--bench-program build/bench/bench/bench_cycle] [--json FILE]

`puma_single` at its nominal point, 270 steps, constant gamma, run and all indicators; 1000 timings around SOC -6 °CA
aTDC per call, so that one call's overhead is shared. All contenders must agree to 1e-9 before any is timed; repeats are
interleaved and pinned to one core. Only ratios of one run mean something: the clock of a shared machine moves.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from peers.numba_cycle import FORMS, INDICATORS, compile_form, engine
from support import machine

from mgdd import _core

CYCLES = 1000
TOLERANCE = 1e-9
BENCH_PROGRAM = Path(__file__).parents[1] / "build" / "bench" / "bench" / "bench_cycle"
CPP_NAMES = {"C++ loop, mgdd": "cycle/triangle", "C++ loop, literal": "literal/triangle"}


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15, help="interleaved repeats, at least 9 (default 15)")
    parser.add_argument(
        "--bench-program", type=Path, help="bench_cycle: the C++ loop without Python (default: if built)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    if options.repeats < 9:
        parser.error("--repeats must be at least 9")
    if options.bench_program is None and BENCH_PROGRAM.exists():
        options.bench_program = BENCH_PROGRAM
    return options


def contenders() -> dict[str, Callable[[], np.ndarray]]:
    """Name to a call that returns the indicators of all timings; the Numba ones are compiled here."""
    cylinder, point = _core.engine.Cylinder(), _core.engine.OperatingPoint()
    timings = np.linspace(-6.5, -5.5, CYCLES)

    def scan() -> np.ndarray:
        columns = _core.engine.scan(cylinder, point, timings, 1.0, "trapezoid")
        return np.column_stack([columns[name] for name in INDICATORS])

    calls = {"mgdd": scan}
    model = engine(cylinder, point, _core.engine.burn_duration_cad(cylinder, point))
    for form in FORMS:
        sweep = compile_form(form, model)
        sweep(timings)
        calls[f"Numba, {form}"] = lambda sweep=sweep: sweep(timings)
    return calls


def check_agreement(calls: dict[str, Callable[[], np.ndarray]]) -> float:
    """Largest difference of any indicator from mgdd's, relative to its size or 1; SystemExit above 1e-9."""
    expected = calls["mgdd"]()
    worst = 0.0
    for name, call in calls.items():
        difference = np.abs(call() - expected) / np.maximum(1.0, np.abs(expected))
        worst = max(worst, float(difference.max()))
        if not worst <= TOLERANCE:
            column = INDICATORS[int(np.unravel_index(difference.argmax(), difference.shape)[1])]
            sys.exit(f"{name} and mgdd differ by {worst:.1e} in {column}: nothing timed")
    return worst


def cpp_program(program: Path) -> tuple[dict[str, float], dict[str, str]]:
    """Microseconds per cycle of the C++ loops (they check their own agreement) and the program's context."""
    names = "|".join(CPP_NAMES.values())
    command = [program, f"--benchmark_filter=^({names})$", "--benchmark_format=json", "--benchmark_min_time=0.01"]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    by_name = {row["name"]: row for row in report["benchmarks"]}
    seconds = {"ns": 1e-3, "us": 1.0, "ms": 1e3}
    times = {}
    for label, name in CPP_NAMES.items():
        row = by_name[name]
        if row.get("error_occurred"):
            sys.exit(f"{name}: {row['error_message']}")
        times[label] = row["cpu_time"] * seconds[row["time_unit"]]
    return times, {key: report["context"].get(key, "?") for key in ("compiler", "isa")}


def measure(options: argparse.Namespace, calls: dict[str, Callable[[], np.ndarray]]) -> dict[str, list[float]]:
    times: dict[str, list[float]] = {}
    for _ in range(options.repeats):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            times.setdefault(name, []).append((time.perf_counter() - start) / CYCLES * 1e6)
        if options.bench_program:
            for name, value in cpp_program(options.bench_program)[0].items():
                times.setdefault(name, []).append(value)
    return times


def main() -> None:
    options = arguments()
    machine.pin()
    calls = contenders()
    worst = check_agreement(calls)
    context = versions(options)
    times = measure(options, calls)
    table = {name: {"min_us": min(values), "median_us": statistics.median(values)} for name, values in times.items()}
    reference = table["mgdd"]
    for row in table.values():
        row["ratio_min"] = row["min_us"] / reference["min_us"]
        row["ratio_median"] = row["median_us"] / reference["median_us"]
    for key, value in context.items():
        print(f"{key:20s} {value}")
    print(f"agreement            {worst:.1e} over {len(INDICATORS)} indicators (bound {TOLERANCE:.0e})")
    print(f"repeats              {options.repeats} interleaved, {CYCLES} cycles each\n")
    print(f"{'one cycle':20s} {'min us':>9s} {'median us':>10s} {'/ mgdd: min':>12s} {'median':>8s}")
    for name, row in table.items():
        times_us, ratios = (row["min_us"], row["median_us"]), (row["ratio_min"], row["ratio_median"])
        print(f"{name:20s} {times_us[0]:9.2f} {times_us[1]:10.2f} {ratios[0]:12.2f} {ratios[1]:8.2f}")
    if options.json:
        report = {"context": context, "agreement": worst, "repeats": options.repeats, "cycles": table}
        options.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


def versions(options: argparse.Namespace) -> dict[str, str]:
    import llvmlite.binding
    import numba

    context = machine.versions()
    context["Numba"] = f"{numba.__version__}, LLVM for {llvmlite.binding.get_host_cpu_name()}"
    if options.bench_program:
        built = cpp_program(options.bench_program)[1]
        context["C++ program"] = f"{built['compiler']}, {built['isa']}"
    return context


if __name__ == "__main__":
    main()
