"""Measure what `wall_heat_profile` may be trusted for: the numbers of docs/calibration.md.

Simulated pairs of loads of the heavy-duty preset, wall heat 0.3 to 1.5, noise of 0.05 bar, calibrated with a gamma that
is 0.03 too low or too high. Run: python tools/measure_identifiability.py [--cases N]
"""

from __future__ import annotations

import argparse
import logging

import numpy as np

from mgdd import presets
from mgdd.engine import simulate
from mgdd.identify import fit_cylinder, wall_heat_profile
from mgdd.io import pressure_trace

NOISE_BAR = 0.05
GAMMA_ERROR = 0.03
LOADS = ((60.0, -3.0, 170.0), (150.0, -5.0, 260.0))  # fuel [mg], SOC [°CA aTDC], intake pressure [kPa]
KNOWN = {"gamma": 0.0, "pegging_bar": 0.0, "tdc_cad": 0.0}


def pair_of_loads(random, truth, point):
    """Simulate two loads with noise, and say their fuel heat."""
    traces, heats = [], []
    for fuel, soc, intake in LOADS:
        own = point.replace(fuel_mg=fuel, intake_pressure_kpa=intake, burn_duration_cad=random.uniform(30.0, 55.0))
        cycle = simulate(truth, own, soc_cad=soc + random.uniform(-3.0, 3.0), step_cad=0.5)
        noise = NOISE_BAR * random.standard_normal(cycle.sizes["crank_angle_cad"])
        trace = pressure_trace(cycle["crank_angle_cad"].values, cycle["pressure_bar"].values + noise)
        traces.append(trace.assign_attrs(speed_rpm=1200.0, trapped_mass_g=cycle.attrs["trapped_mass_g"]))
        heats.append(float(cycle["fuel_heat_j"]))
    return traces, heats


def verdicts(n, *, known_fuel, free_gamma, widths):
    """Give per case the true scale, its estimate and the verdict."""
    random = np.random.default_rng(2026)
    preset = presets.load("hd_diesel_128x144")
    out = []
    for _ in range(n):
        scale = random.uniform(0.3, 1.5)
        gamma = random.uniform(1.35, 1.39)
        truth = preset.cylinder.replace(
            burn_shape="wiebe", gamma_model="constant", gamma=gamma, wall_heat_scale=scale, wiebe_m=1.5
        )
        traces, heats = pair_of_loads(random, truth, preset.point)
        wrong = truth.replace(gamma=gamma + random.choice([-1, 1]) * GAMMA_ERROR, wall_heat_scale=1.0)
        free = ["wall_heat_scale", "soc_cad", "burn_duration_cad", "start_pressure_bar"]
        free += [] if known_fuel else ["fuel_heat_j"]
        free += ["gamma"] if free_gamma else []
        fit = fit_cylinder(traces, wrong, free=free, fuel_heat_j=heats if known_fuel else None)
        profile = wall_heat_profile(fit, scales=[0.5, 1.0, 1.5], widths=widths)
        out.append((scale, profile.value, profile.identifiable))
    return np.array(out, dtype=float)


def main():
    """Print one line per kind of knowledge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    n = parser.parse_args().cases
    logging.disable(logging.WARNING)
    cases = {
        "gamma held 0.03 off, taken as known": {"known_fuel": False, "free_gamma": False, "widths": KNOWN},
        "gamma held 0.03 off, default widths": {"known_fuel": False, "free_gamma": False, "widths": None},
        "fuel known, gamma held 0.03 off, default widths": {"known_fuel": True, "free_gamma": False, "widths": None},
        "fuel known, gamma fitted, default widths": {"known_fuel": True, "free_gamma": True, "widths": None},
        "fuel known, gamma fitted, pegging and TDC known": {"known_fuel": True, "free_gamma": True, "widths": KNOWN},
    }
    for label, options in cases.items():
        rows = verdicts(n, **options)
        right = np.abs(rows[:, 1] / rows[:, 0] - 1.0) <= 0.2
        said = rows[:, 2] > 0.0
        true = f"{int((right & said).sum())} of {int(said.sum())}" if said.any() else "none"
        print(
            f"{label}: identifiable in {int(said.sum())} of {n}, within 20 % {true}; all {int(right.sum())}", flush=True
        )


if __name__ == "__main__":
    main()
