"""How long from a CSV of 60 cycles of 3600 samples, and from 1200 cycles in memory, to the table of their indicators.

    python benchmarks/pressure_record.py [--repeats 15] [--json FILE]

The peers are what an engineer writes today: pandas reads the file, NumPy computes closed IMEP, peak pressure and CA50
of all cycles at once. Before anything is timed, both must agree in pressure to the last printed digit, in closed IMEP
to 1e-9, and in CA50 to 1e-9 with the same window and no smoothing. In memory, 300 cycles of four cylinders are set
beside the same NumPy lines on one core, with the memory that each takes beside the data.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from support import machine

from mgdd import presets
from mgdd.engine import Cylinder, Indicating, analyze, simulate
from mgdd.io import read_pressure

CYCLES, MANY, STEP_CAD, GAMMA, WINDOW = 60, 1200, 0.2, 1.33, (-20.0, 90.0)


def write_record(file: Path, cylinder: Cylinder) -> None:
    """Write 720 degrees of 60 noisy cycles in columns."""
    random = np.random.default_rng(5)
    preset = presets.load("puma_single")
    angle = np.round(np.arange(-360.0, 360.0, STEP_CAD), 6)
    columns = [angle]
    for _ in range(CYCLES):
        cycle = simulate(cylinder, preset.point, soc_cad=-6.0 + random.normal(), step_cad=STEP_CAD)
        closed = np.interp(angle, cycle["crank_angle_cad"].values, cycle["pressure_bar"].values)
        columns.append(closed + 0.02 * random.standard_normal(angle.size))
    names = ",".join(["crank_angle_cad", *(f"p_{k + 1}_bar" for k in range(CYCLES))])
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.5f")


def by_numpy(angle: np.ndarray, pressure_bar: np.ndarray, cylinder: Cylinder) -> dict[str, np.ndarray]:
    """Compute closed IMEP, peak and CA50 of all cycles as one would by hand."""
    from mgdd._core.engine import volume_l

    inside = (angle >= cylinder.ivc_cad - 1e-9) & (angle <= cylinder.evo_cad + 1e-9)
    a, p, v = angle[inside], 1e5 * pressure_bar[:, inside], 1e-3 * volume_l(cylinder, angle[inside])
    work = 0.5 * (p[:, 1:] + p[:, :-1]) * np.diff(v)
    heat = np.diff(p * v, axis=1) / (GAMMA - 1.0) + work
    kept = (a[:-1] >= WINDOW[0] - 1e-9) & (a[1:] <= WINDOW[1] + 1e-9)
    cumulative = np.cumsum(heat[:, kept], axis=1)
    ends, starts = a[1:][kept], a[:-1][kept]
    half = []
    for row in cumulative:
        level = 0.5 * row.max()
        k = int(np.argmax(row >= level))
        before = row[k - 1]
        half.append(starts[k] + (ends[k] - starts[k]) * (level - before) / (row[k] - before))
    return {
        "imep_closed_bar": work.sum(axis=1) / (1e-3 * cylinder.swept_volume_l) / 1e5,
        "p_max_bar": p.max(axis=1) / 1e5,
        "ca50_cad": np.array(half),
    }


def peak_mb(call: Callable[[], object]) -> float:
    """Give the most memory [MB] that a call takes at once."""
    tracemalloc.start()
    call()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def main() -> None:
    """Check agreement, then time in turns."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    args = parser.parse_args()
    cylinder = presets.load("puma_single").cylinder
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.csv"
        write_record(file, cylinder)
        record, table = read_pressure(file), pd.read_csv(file)
        angle, pressure = table.iloc[:, 0].to_numpy(), table.iloc[:, 1:].to_numpy().T
        np.testing.assert_array_equal(record["pressure_bar"].to_numpy(), pressure)
        same = analyze(record, cylinder, gamma=GAMMA, heat_window_cad=WINDOW, smoothing="none", quiet=True)
        peer = by_numpy(angle, pressure, cylinder)
        np.testing.assert_allclose(same["imep_closed_bar"], peer["imep_closed_bar"], rtol=1e-9)
        np.testing.assert_allclose(same["ca50_cad"], peer["ca50_cad"], atol=1e-9)
        contenders = {
            "mgdd, read": lambda: read_pressure(file),
            "pandas, read": lambda: pd.read_csv(file),
            "mgdd, all indicators, burn window found, smoothed": lambda: analyze(record, cylinder, quiet=True),
            "NumPy, three indicators, window given": lambda: by_numpy(angle, pressure, cylinder),
        }
        four = np.resize(pressure, (4, MANY // 4, angle.size)) * np.linspace(0.98, 1.02, 4)[:, None, None]
        tool = Indicating(cylinder, angle, speed_rpm=1500.0, heat_window_cad=WINDOW)
        fast, rows = tool.record(four, threads=1), by_numpy(angle, four.reshape(MANY, -1), cylinder)
        for name in ("imep_closed_bar", "ca50_cad"):
            np.testing.assert_allclose(fast[name].to_numpy().ravel(), rows[name], rtol=1e-9)
        in_memory = {
            f"mgdd, {MANY} cycles, all figures and their scatter": lambda: tool.record(four, threads=1),
            f"NumPy, {MANY} cycles, three indicators": lambda: by_numpy(angle, four.reshape(MANY, -1), cylinder),
        }
        memory = {name: peak_mb(call) for name, call in in_memory.items()}
        contenders |= in_memory
        times: dict[str, list[float]] = {name: [] for name in contenders}
        for _ in range(args.repeats):
            for name, call in contenders.items():
                begin = time.perf_counter()
                call()
                times[name].append(1e3 * (time.perf_counter() - begin))
    print(", ".join(f"{name} {value}" for name, value in machine.versions().items()), "load", machine.load())
    print(f"{CYCLES} cycles of {angle.size} samples; agreement checked")
    for name, own in times.items():
        beside = f", {memory[name]:.1f} MB beside the data" if name in memory else ""
        print(f"{name:52} smallest {min(own):7.1f} ms, median {statistics.median(own):7.1f} ms{beside}")
    if args.json:
        args.json.write_text(json.dumps({name: min(own) for name, own in times.items()}, indent=1))


if __name__ == "__main__":
    main()
