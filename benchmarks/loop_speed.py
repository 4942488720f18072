"""One question: what does a closed loop cost, and what of that is the seeker.

    python benchmarks/loop_speed.py [--loops 2000] [--bench-program build/bench/bench/bench_seekers] [--json FILE]

The virtual bench on `puma_single` with its default noise, extremum seeking from -20 °CA aTDC, 1000 cycles to a loop.
Times of one core are processor time, so that neighbours on a shared machine disturb them less; the ratio of two threads
to one is of wall time, interleaved, and means nothing while others keep the cores busy: the load is printed. What the
threads cost each other shows in their processor time even then.

Before anything is timed, the loop in the core must equal the one driven from Python bit for bit, two threads must give
the numbers of one, and loops side by side those of single loops to 1e-9. With a C compiler a plant of one line of
arithmetic runs as well, in C and in Python, whose loops must be equal bit for bit.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from peers import peer_seekers
from peers.peer_seekers import Contender, Plant, null_time_us
from support import machine

from mgdd import optimize
from mgdd.loop import FunctionPlant, VirtualEngine, monte_carlo, run_seeker

CYCLES, PAIRS, STEPS = 1000, 20_000, 20_000
START, LOWER, UPPER = -20.0, -30.0, 10.0
SEVERAL = 10  # loops to a call, where its own cost must not count; so few run one by one
LANES = 16  # side by side
BENCH_ALONE = "the bench alone, same timings"
BENCH_PROGRAM = Path(__file__).parents[1] / "build" / "bench" / "bench" / "bench_seekers"
Times = dict[str, list[float]]


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9, help="interleaved repeats, at least 9 (default 9)")
    parser.add_argument("--loops", type=int, default=2000, help="loops on one and on two threads (default 2000)")
    parser.add_argument("--loop-repeats", type=int, default=3, help="interleaved repeats of those (default 3)")
    parser.add_argument("--bench-program", type=Path, help="bench_seekers: ask and tell in C++ (default: if built)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    if options.repeats < 9 or options.loops < 2 or options.loop_repeats < 1:
        parser.error("--repeats must be at least 9, --loops at least 2, --loop-repeats at least 1")
    if options.bench_program is None and BENCH_PROGRAM.exists():
        options.bench_program = BENCH_PROGRAM
    return options


def loop_seeker() -> optimize.ExtremumSeeking:
    return optimize.ExtremumSeeking(start=START, bounds=(LOWER, UPPER))


def drive_from_python(bench: VirtualEngine, seeker: optimize.ExtremumSeeking, cycles: int) -> None:
    for _ in range(cycles):
        cycle = bench.step(float(seeker.ask()[0]))
        seeker.tell(cycle["j"])


def check_agreement(loops: int) -> np.ndarray:
    """Return the applied inputs of the loop; SystemExit where a faster way gives other numbers than a slower one."""
    run = run_seeker(VirtualEngine(seed=3), loop_seeker(), CYCLES)
    seeker = loop_seeker()
    drive_from_python(VirtualEngine(seed=3), seeker, CYCLES)
    if not np.array_equal(run.dataset["estimate"][:, 0], seeker.history["estimate"][:, 0]):
        sys.exit("the loop in the core and the loop driven from Python differ: nothing timed")
    one, two = (monte_carlo(VirtualEngine(), loop_seeker(), range(loops), cycles=CYCLES, workers=n) for n in (1, 2))
    if not one.identical(two):
        sys.exit("one thread and two threads give different numbers: nothing timed")
    if float(one["final_soc_cad"][0, 0, 3]) != run.summary["final_soc_cad"]:
        sys.exit("a loop of monte_carlo and the same loop of run_seeker differ: nothing timed")
    lanes = monte_carlo(VirtualEngine(), loop_seeker(), range(2 * loops), cycles=CYCLES)
    if not np.allclose(lanes["final_soc_cad"][0, 0, :loops], one["final_soc_cad"][0, 0], rtol=1e-9, atol=0.0):
        sys.exit("loops side by side and loops one by one differ by more than 1e-9: nothing timed")
    return seeker.history["applied"].values[:, 0].copy()


PLANT = """#include <stddef.h>
int plant(const double *x, size_t n, double *out, size_t m, void *data) {
  out[0] = 50.0 - 0.03 * (x[0] + 4.0) * (x[0] + 4.0);
  return 0;
}
"""


def function_plants() -> dict[str, FunctionPlant]:
    """Give a plant in Python and the same in C; none without a compiler. SystemExit where their loops differ."""
    compiler = shutil.which("cc")
    if compiler is None:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "plant.c").write_text(PLANT, encoding="utf-8")
        subprocess.run(
            [compiler, "-shared", "-fPIC", "-O2", "-ffp-contract=off", "plant.c", "-o", "plant.so"],
            cwd=folder,
            check=True,
        )
        library = ctypes.CDLL(str(Path(folder, "plant.so")))
    found = {
        "in Python": FunctionPlant(lambda x: 50.0 - 0.03 * (x["x_cad"] + 4.0) * (x["x_cad"] + 4.0), ["x_cad"]),
        "in C": FunctionPlant(FunctionPlant.C_TYPE(("plant", library)), ["x_cad"]),
    }
    runs = [run_seeker(plant, loop_seeker(), CYCLES).dataset for plant in found.values()]
    if not runs[0].identical(runs[1]):
        sys.exit("a plant in C and the same in Python differ: nothing timed")
    return found


def seekers() -> dict[str, Callable[[], object]]:
    bounds = {"start": 0.0, "bounds": (LOWER, UPPER)}
    return {
        "ExtremumSeeking": lambda: optimize.ExtremumSeeking(**bounds),
        "Spsa": lambda: optimize.Spsa(**bounds),
        "GradientDescent": lambda: optimize.GradientDescent(**bounds),
        "GoldenSection": lambda: optimize.GoldenSection(**bounds, noise_sd=0.25),
        "ExtremumSeeking, 3 inputs": lambda: optimize.ExtremumSeeking(start=[0.0] * 3, period=40, harmonics=[4, 5, 7]),
        "ExtremumSeeking, a limit": lambda: optimize.ExtremumSeeking(
            **bounds, limits=[optimize.Limit("p_max_bar", 95.0)]
        ),
    }


def time_pairs(make: Callable[[], object], values: tuple[object, ...]) -> float:
    """Microseconds of processor time per ask and tell; the loop around them included."""
    seeker = make()
    ask, tell = seeker.ask, seeker.tell  # type: ignore[attr-defined]
    begin = time.process_time()
    for _ in range(PAIRS):
        ask()
        tell(*values)
    return (time.process_time() - begin) / PAIRS * 1e6


def ours_on_null(plant: Plant, start: float, seed: int) -> None:  # noqa: ARG001 - no chance in it
    seeker = optimize.ExtremumSeeking(start=start)
    ask, tell = seeker.ask, seeker.tell
    while True:
        tell(plant(float(ask()[0])))


def null_contenders() -> dict[str, Contender]:
    found: dict[str, Contender] = {
        "mgdd ExtremumSeeking": ours_on_null,
        "ten lines of Python": peer_seekers.plain_esc(),
    }
    if peer_seekers.installed()["cernml-extremum-seeking"] is not None:
        found["cernml ExtremumSeeker"] = peer_seekers.cernml()
    return found


def time_loops(applied: np.ndarray, plants: dict[str, FunctionPlant], into: Times) -> None:
    """Milliseconds of processor time for 1000 cycles: whole loops, the bench without a seeker, plants of one line."""

    def timed(name: str, loops: int, call: Callable[[], object]) -> None:
        begin = time.process_time()
        call()
        into.setdefault(name, []).append((time.process_time() - begin) / loops * 1e3)

    several, lanes, requests = range(SEVERAL), range(LANES), np.tile(applied, SEVERAL)
    timed("run_seeker, with its Dataset", 1, lambda: run_seeker(VirtualEngine(), loop_seeker(), CYCLES))
    timed("driven from Python", 1, lambda: drive_from_python(VirtualEngine(), loop_seeker(), CYCLES))
    timed(
        "monte_carlo, one thread",
        SEVERAL,
        lambda: monte_carlo(VirtualEngine(), loop_seeker(), several, cycles=CYCLES, workers=1),
    )
    timed(
        "monte_carlo in lanes, one thread",
        LANES,
        lambda: monte_carlo(VirtualEngine(), loop_seeker(), lanes, cycles=CYCLES, workers=1),
    )
    timed(BENCH_ALONE, SEVERAL, lambda: VirtualEngine().run_columns(requests))
    for name, plant in plants.items():
        timed(f"run_seeker, a plant {name}", 1, lambda plant=plant: run_seeker(plant, loop_seeker(), CYCLES))
    if compiled := plants.get("in C"):
        seeds = range(100 * SEVERAL)
        timed(
            "monte_carlo, a plant in C",
            len(seeds),
            lambda: monte_carlo(compiled, loop_seeker(), seeds, cycles=CYCLES, workers=1),
        )


def time_threads(options: argparse.Namespace) -> dict[str, float]:
    """Seconds of wall time: the smallest of the interleaved repeats and their ratio, and the median of the ratios."""
    seeker, bench, seeds = loop_seeker(), VirtualEngine(), range(options.loops)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    processor: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(options.loop_repeats):
        for threads, values in seconds.items():
            begin, work = time.perf_counter(), time.process_time()
            monte_carlo(bench, seeker, seeds, cycles=CYCLES, workers=threads)
            values.append(time.perf_counter() - begin)
            processor[threads].append(time.process_time() - work)
    ratios = [one / two for one, two in zip(seconds[1], seconds[2], strict=True)]
    return {
        "loops": options.loops,
        "one_thread_s": min(seconds[1]),
        "two_threads_s": min(seconds[2]),
        "ratio_of_smallest": min(seconds[1]) / min(seconds[2]),
        "ratio_median": statistics.median(ratios),
        "processor_time_ratio": min(processor[1]) / min(processor[2]),
    }


def cpp_program(program: Path) -> dict[str, float]:
    """Nanoseconds per ask and tell in C++."""
    command = [program, "--benchmark_format=json", "--benchmark_min_time=0.05"]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    for row in report["benchmarks"]:
        if row.get("error_occurred"):
            sys.exit(f"{row['name']}: {row['error_message']}")
    return {row["name"]: row["cpu_time"] for row in report["benchmarks"]}


def summary(times: Times) -> dict[str, dict[str, float]]:
    return {name: {"min": min(values), "median": statistics.median(values)} for name, values in times.items()}


def show(title: str, table: dict[str, dict[str, float]], rate: Callable[[float], str]) -> None:
    print(f"\n{title:36s} {'min':>9s} {'median':>9s}")
    for name, row in table.items():
        print(f"{name:36s} {row['min']:9.3f} {row['median']:9.3f}   {rate(row['min'])}")


def main() -> None:
    options = arguments()
    context = machine.versions()
    for package, version in peer_seekers.installed().items():
        context[package] = version or "missing: left out (pip install --group bench)"
    applied, plants = check_agreement(8), function_plants()
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    threads = time_threads(options)
    context["load after the threads"] = machine.load()
    machine.pin()
    loops: Times = {}
    pairs: Times = {}
    null: Times = {}
    for _ in range(options.repeats):
        time_loops(applied, plants, loops)
        for name, make in seekers().items():
            values = (0.0, (80.0,)) if name.endswith("limit") else (0.0,)
            pairs.setdefault(name, []).append(time_pairs(make, values))
        for name, contender in null_contenders().items():
            null.setdefault(name, []).append(null_time_us(contender, START, STEPS))
    if cores is not None:
        os.sched_setaffinity(0, cores)
    cpp = cpp_program(options.bench_program) if options.bench_program else {}
    for key, value in context.items():
        print(f"{key:26s} {value}")
    print(f"\n{threads['loops']} loops of {CYCLES} cycles, wall time")
    print(f"one thread {threads['one_thread_s']:.2f} s, two threads {threads['two_threads_s']:.2f} s", end=", ")
    print(f"ratio {threads['ratio_of_smallest']:.2f} (median of the repeats {threads['ratio_median']:.2f})")
    print(f"the work of one thread over that of two, processor time: {threads['processor_time_ratio']:.2f}")
    loop_table, pair_table, null_table = summary(loops), summary(pairs), summary(null)
    show(f"ms per {CYCLES} cycles", loop_table, lambda ms: f"{CYCLES / ms * 1e3:9.0f} cycles/s")
    show("us per ask/tell pair, from Python", pair_table, lambda us: f"{1e6 / us:9.0f} /s")
    show("us per step on a null plant", null_table, lambda us: f"{1e6 / us:9.0f} steps/s")
    alone = loop_table[BENCH_ALONE]["min"]
    share = (loop_table["monte_carlo, one thread"]["min"] / alone) - 1.0
    print(f"\nthe loop of monte_carlo takes {100 * share:.1f} % more than the bench alone", end="")
    name = "seeker/extremum_seeking/inputs:1/limits:0"
    print(f"; ask and tell in C++ are {100 * cpp[name] / (alone * 1e3):.2f} % of it" if cpp else "")
    for key, value in cpp.items():
        print(f"{key:50s} {value:8.1f} ns")
    if options.json:
        report = {"context": context, "threads": threads, "loops_ms": loop_table, "pairs_us": pair_table}
        report |= {"null_us": null_table, "cpp_ns": cpp}
        options.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
