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

from mgdd.loop import EngineBench, run_seeker
from mgdd.optimize import GaussianProcessSeeking, Limit

BOUNDS = {"soc_cad": (-25.0, 10.0), "egr": (0.0, 0.4), "intake_pressure_kpa": (120.0, 220.0)}
START = {"soc_cad": 2.0, "egr": 0.35, "intake_pressure_kpa": 200.0}
LIMITS = {"p_max_bar": 118.0, "nox_fast_ppm": 150.0}
EARLY = 40


def told(bench: EngineBench) -> list[Limit]:
    """Say what stands between the plant and a limit: the fast sensor is 0.05 s late and slow, a cycle takes 0.08 s."""
    cycle_s = 120.0 / bench.point.speed_rpm
    sensor = bench.settings["fast_sensor"]
    late = {"delay_cycles": round(sensor.delay_s / cycle_s), "lag_cycles": sensor.lag_s / cycle_s}
    return [Limit(name, upper, **(late if name.startswith("nox") else {})) for name, upper in LIMITS.items()]


def run_of(seed: int, cycles: int, best: float) -> dict[str, float]:
    bench = EngineBench(inputs=list(BOUNDS), limits=list(LIMITS), seed=seed)
    seeker = GaussianProcessSeeking(inputs=BOUNDS, start=START, limits=told(bench), seed=seed)
    parts = [run_seeker(bench, seeker, EARLY)]
    at = dict(zip(BOUNDS, map(float, seeker.estimate), strict=True))
    if cycles > EARLY:
        parts.append(run_seeker(bench, seeker, cycles - EARLY))
    quiet = EngineBench(inputs=list(BOUNDS), limits=list(LIMITS), soc_scatter_cad=0.0, efficiency_noise_percent=0.0)
    steady = float(quiet.steady_map({name: [value] for name, value in at.items()})["j"].squeeze())
    uppers = np.array(list(LIMITS.values()))
    first, *further = ([value] for value in at.values())
    excess = (quiet.noise_free_limits(first, [0], further)[0] - uppers) / uppers
    over = np.concatenate([part.dataset["noise_free_limits"].to_numpy() for part in parts]) / uppers - 1.0
    return {
        "lost": best - steady,
        "estimate_excess_percent": 100.0 * float(excess.max()),
        "broken": float((over > 0.0).any(axis=1).mean()),
        **{f"broken_{name}": float(share) for name, share in zip(LIMITS, (over > 0.0).mean(axis=0), strict=True)},
        "worst_percent": 100.0 * float(over.max()),
        **at,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--cycles", type=int, default=60)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    bench = EngineBench(inputs=list(BOUNDS))
    best = bench.find_optimum(LIMITS, bounds=BOUNDS)
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
