"""Measure what the analysis of pressure sees and how smoothing acts (docs/theory_engine.md).

Simulated cycles of both engine presets, wall-heat scale 0.3 to 1.5, gamma 1.34 to 1.40 or linear, intake 1 to 3 bar,
noise of 0.05 bar, steps of 0.2 to 1 °CA. Run: python tools/measure_trace_analysis.py [--cycles N]
"""

from __future__ import annotations

import argparse

import numpy as np

from mgdd import presets
from mgdd.engine import OperatingPoint, analyze, simulate
from mgdd.io import pressure_trace

NOISE_BAR = 0.05
AIR_J_PER_GK = 0.287055
STOICHIOMETRIC = 14.6


def draw_cycle(random, *, motored=False, step_cad=None):
    """Draw an engine, a point and a simulated cycle."""
    preset = presets.load(random.choice(["hd_diesel_128x144", "puma_single"]))
    cylinder = preset.cylinder.replace(
        wall_heat_scale=random.uniform(0.3, 1.5),
        gamma=random.uniform(1.34, 1.40),
        gamma_model=random.choice(["constant", "linear"]),
    )
    intake_kpa = random.uniform(100.0, 300.0)
    air_mg = cylinder.volumetric_efficiency * intake_kpa * cylinder.swept_volume_l / (AIR_J_PER_GK * 313.0) * 1e3
    point = OperatingPoint(
        speed_rpm=random.uniform(800.0, 3000.0 if preset.name == "puma_single" else 1900.0),
        fuel_mg=0.0 if motored else air_mg / STOICHIOMETRIC / random.uniform(1.3, 6.0),
        intake_pressure_kpa=intake_kpa,
        burn_duration_cad=random.uniform(25.0, 60.0),
    )
    step = step_cad or float(random.choice([0.2, 0.5, 1.0]))
    return cylinder, point, simulate(cylinder, point, soc_cad=random.uniform(-20.0, 8.0), step_cad=step)


def figures(random, cylinder, point, cycle, *, level_bar=0.0, angle_cad=0.0, noise_bar=NOISE_BAR, **options):
    """Analyse a cycle with an error put in."""
    noise = noise_bar * random.standard_normal(cycle.sizes["crank_angle_cad"])
    trace = pressure_trace(cycle.crank_angle_cad.values + angle_cad, cycle.pressure_bar.values + noise + level_bar)
    trace = trace.assign_attrs(trapped_mass_g=cycle.attrs["trapped_mass_g"])
    return analyze(trace, cylinder, point=point, quiet=True, **options)


def doubted(n, *, motored=False, **error):
    """Count the doubted of n cycles."""
    random = np.random.default_rng(77)
    return sum(bool(figures(random, *draw_cycle(random, motored=motored), **error).attrs["warnings"]) for _ in range(n))


def main():
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=150)
    n = parser.parse_args().cycles
    print(f"clean: {doubted(500)} of 500 fired, {doubted(300, motored=True)} of 300 motored doubted")
    for level in (-0.3, -0.2, -0.1, 0.1, 0.2, 0.3):
        print(f"level {level:+.1f} bar: {doubted(n, level_bar=level)} of {n} fired doubted")
    for angle in (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0):
        fired, motored = doubted(n, angle_cad=angle), doubted(n, motored=True, angle_cad=angle)
        print(f"top dead centre {angle:+.0f} CAD: {fired} of {n} fired, {motored} of {n} motored doubted")
    window = {"heat_window_cad": (-10.0, 90.0), "smoothing": "none"}
    for noise, step in ((0.05, 0.2), (0.1, 0.1), (0.2, 0.2), (0.4, 0.1), (0.2, 1.0)):
        random = np.random.default_rng(21)
        errors = []
        for _ in range(25):
            cylinder, point, cycle = draw_cycle(random, step_cad=step)
            clean = figures(random, cylinder, point, cycle, noise_bar=0.0, smoothing="none")["ca50_cad"]
            noisy = (
                figures(random, cylinder, point, cycle, noise_bar=noise, **options)["ca50_cad"]
                for options in (window, {"smoothing": "none"}, {})
            )
            errors.append([float(value - clean) for value in noisy])
        text = ", ".join(f"{m:.2f} ± {s:.2f}" for m, s in zip(np.mean(errors, 0), np.std(errors, 0), strict=True))
        print(f"noise {noise} bar, step {step} CAD, error of CA50 (-10 to 90, found, default): {text}")


if __name__ == "__main__":
    main()
