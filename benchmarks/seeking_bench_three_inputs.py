"""One question: how far from the best timing, EGR and boost does a seeker stand after 40 cycles, and what did it break.

    python benchmarks/seeking_bench_three_inputs.py [--seeds 100] [--cycles 60] [--json FILE]

The virtual bench of `puma_single` with its default noise (efficiency 0.25 points, SOC 0.3 CAD), limits on maximum
pressure and on NOx by the fast sensor, both of which hold the optimum back. J lost: steady J of the constrained
optimum less that of the estimate after 40 cycles [points of efficiency]; negative where the estimate stands beyond a
limit. Broken: share of all applied cycles whose noise-free value is above a limit, and the worst of them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from mgdd.loop import VirtualEngine
from mgdd.optimize import GaussianProcessSeeking
from mgdd_studies.several_maps import EARLY
from mgdd_studies.three_input_bench import BOUNDS, LIMITS, START, bench_optimum, bench_run, noisy_bench, told


def run_of(seed: int, cycles: int, best: float) -> dict[str, float]:
    bench = noisy_bench(seed)
    seeker = GaussianProcessSeeking(inputs=BOUNDS, start=START, limits=told(bench), seed=seed)
    run = bench_run(bench, seeker, sorted({EARLY, max(cycles, EARLY)}), best)
    over = run.excess > 0.0
    return {
        "lost": run.lost[0],
        "estimate_excess_percent": 100.0 * run.estimate_excess[0],
        "broken": float(over.any(axis=1).mean()),
        **{f"broken_{name}": float(share) for name, share in zip(LIMITS, over.mean(axis=0), strict=True)},
        "worst_percent": 100.0 * float(run.excess.max()),
        **run.estimates[0],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--cycles", type=int, default=60)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    bench = VirtualEngine(inputs=list(BOUNDS))
    best = bench_optimum()
    start = float(bench.steady_map({name: [value] for name, value in START.items()})["j"].squeeze())
    print(f"{best}; the start loses {best.value - start:.2f} points")
    rows = [run_of(seed, options.cycles, best.value) for seed in range(options.seeds)]
    column = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    lost, safe = column["lost"], column["estimate_excess_percent"] <= 0.0
    print(f"J lost after {EARLY} cycles: mean {lost.mean():.3f}, median {np.median(lost):.3f}, worst {lost.max():.3f}")
    print(f"of estimates within the limits ({safe.mean():.0%}): mean {lost[safe].mean():.3f}")
    print(
        f"share of cycles above a limit, noise-free: {column['broken'].mean():.2%}; "
        + ", ".join(f"{name} {column[f'broken_{name}'].mean():.2%}" for name in LIMITS)
        + f"; worst by {column['worst_percent'].max():.1f} %, in the median run by "
        f"{np.median(column['worst_percent']):.1f} %"
    )
    if options.json:
        options.json.write_text(json.dumps({"best": best.to_dict(), "rows": rows}))


if __name__ == "__main__":
    main()
