"""Tables of the documentation that the cycle model gives: theory, numbers beside references, units of the variables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from mgdd import engine, presets
from mgdd.engine import Cylinder, OperatingPoint, analyze, simulate
from mgdd.engine.cycle import convergence as step_error
from mgdd.io import pressure_trace
from mgdd.results.labels import ANGLE

__all__ = [
    "Rows",
    "convergence",
    "gamma",
    "golden",
    "ignition",
    "integrators",
    "optimum",
    "pegging",
    "single",
    "tdc",
    "timing_table",
    "triangle",
    "values_of",
    "woschni_units",
]

Rows = Mapping[str, list[float]]


@cache
def single() -> tuple[Cylinder, OperatingPoint]:
    preset = presets.load("puma_single")
    return preset.cylinder, preset.point


def values_of(dataset: Any, *names: str) -> list[float]:
    return [float(dataset[name]) for name in names]


# --- theory -------------------------------------------------------------------------------------------------
def woschni_units() -> Rows:
    kilopascal = 3.26
    bar = kilopascal * 100.0**0.8
    rows = {"kPa m": kilopascal, "bar m": bar, "bar mm": bar * 1000.0**0.2, "Pa m": kilopascal * 1000.0**-0.8}
    return {label: [value] for label, value in rows.items()}


def triangle() -> Rows:
    cylinder, point = single()
    half = point.replace(fuel_mg=0.5 * point.fuel_mg, burn_duration_cad=30.0)
    imep = [float(simulate(cylinder, p, soc_cad=-6.0)["imep_gross_bar"]) for p in (half, point)]
    slope = r"slope $2Q/\varphi_{CD}$"
    return {
        r"slope $2Q$ as printed, $Q = E/\varphi_{CD}$": [30.0 / 2.0],
        rf"{slope}, $Q = E/\varphi_{{CD}}$": [0.5, imep[0]],
        rf"{slope}, $Q = 2E/\varphi_{{CD}}$ (the code)": [1.0, imep[1]],
    }


def integrators() -> Rows:
    cylinder, point = single()
    adiabatic, motored = cylinder.replace(wall_heat_scale=0.0), point.replace(fuel_mg=0.0)
    rows = {}
    for name in ("tan2018_lagged", "euler", "trapezoid", "split"):
        cold = simulate(adiabatic, motored, integrator=name)
        fired = simulate(cylinder, point, soc_cad=-6.0, integrator=name)
        fine = simulate(cylinder, point, soc_cad=-6.0, integrator=name, step_cad=0.1)
        rows[f"`{name}`"] = [
            float(cold["pressure_bar"].sel({ANGLE: 0.0})),
            *values_of(cold, "work_closed_j"),
            *values_of(fired, "efficiency_gross"),
            float(fired["work_booked_j"].sum()),
            *values_of(fired, "work_closed_j"),
            *values_of(fine, "efficiency_gross"),
            engine.find_optimum(cylinder, point, integrator=name)["soc_cad"],
        ]
    return rows


def gamma() -> Rows:
    cylinder, point = single()
    rows = {}
    for name in ("constant", "linear", "polynomial"):
        own = cylinder.replace(gamma_model=name)
        fired, motored = simulate(own, point, soc_cad=-6.0), simulate(own, point.replace(fuel_mg=0.0))
        exponent = float(analyze(motored, own, point=point)["n_compression"])
        rows[f"`{name}`"] = [
            *values_of(fired, "efficiency_gross", "p_max_bar"),
            *values_of(motored, "p_max_bar"),
            exponent,
        ]
    return rows


def optimum() -> Rows:
    cylinder, point = single()
    best = {s: engine.find_optimum(cylinder.replace(wall_heat_scale=s), point) for s in (0.0, 0.5, 1.0, 2.0)}
    return {f"{s:g}": [b["ca50_cad"], b["efficiency_gross"], b.curvature] for s, b in best.items()}


def convergence() -> Rows:
    names = ("imep_gross_bar", "efficiency_gross", "p_max_bar", "t_max_k", "heat_loss_j")
    table = step_error(*single()).sel(indicator=list(names))
    columns = [table[name].to_numpy() for name in ("value", "error", "order")]
    return {f"`{name}`": [float(c[k]) for c in columns] for k, name in enumerate(names)}


def ignition() -> Rows:
    soi = [-30.0, -20.0, -15.0, -10.0, -5.0, 0.0, 5.0, 10.0]
    delay = [engine.ignition_delay(*single(), soi_cad=s).delay_cad for s in soi]
    return {"SOI [°CA aTDC]": soi, "delay [°CA]": delay}


# --- validation ---------------------------------------------------------------------------------------------
def golden() -> Rows:
    """Set references, which come from an independent program, beside the package."""
    cylinder, point = single()
    cycle, motored = simulate(cylinder, point, soc_cad=-6.0), simulate(cylinder, point.replace(fuel_mg=0.0))

    def at(angle: float) -> float:
        return float(cycle["pressure_bar"].sel({ANGLE: angle}))

    pairs = {
        "swept volume [L]": (0.499557, cylinder.swept_volume_l),
        "clearance volume [L]": (0.029044, cylinder.clearance_volume_l),
        "temperature at IVC [K]": (337.36, float(cycle["temperature_k"][0])),
        "pressure at −90 °CA [bar]": (2.725, at(-90.0)),
        "pressure at −6 °CA [bar]": (64.944, at(-6.0)),
        "pressure at 15 °CA [bar]": (103.05, at(15.0)),
        "pressure at 60 °CA [bar]": (14.10, at(60.0)),
        "$p_{max}$ [bar]": (107.15, float(cycle["p_max_bar"])),
        "angle of $p_{max}$ [°CA aTDC]": (11.58, float(cycle["p_max_cad"])),
        "$T_{max}$ [K]": (1958.7, float(cycle["t_max_k"])),
        "wall heat [J]": (105.3, float(cycle["heat_loss_j"])),
        "closed IMEP [bar]": (9.392, float(cycle["imep_closed_bar"])),
        "gross IMEP [bar]": (9.627, float(cycle["imep_gross_bar"])),
        "gross efficiency": (0.5618, float(cycle["efficiency_gross"])),
        "motored $p_{max}$ [bar]": (70.11, float(motored["p_max_bar"])),
    }
    return {label: list(pair) for label, pair in pairs.items()}


def timing_table() -> Rows:
    soc = [-20.0, -15.0, -10.0, -6.0, 0.0, 5.0, 10.0]
    sweep = engine.timing_sweep(*single(), soc_cad=soc)
    names = {
        "gross efficiency": "efficiency_gross",
        "$p_{max}$ [bar]": "p_max_bar",
        "$T_{max}$ [K]": "t_max_k",
        "largest pressure rise [bar/°CA]": "dp_max_bar_per_cad",
        "wall heat / fuel heat": "heat_loss_fraction",
    }
    return {"SOC [°CA aTDC]": soc, **{label: sweep[name].values.tolist() for label, name in names.items()}}


def pegging() -> Rows:
    cylinder, point = single()
    adiabatic = cylinder.replace(wall_heat_scale=0.0)
    motored = simulate(adiabatic, point.replace(fuel_mg=0.0))
    rows = {}
    for offset in (-0.3, 0.3):
        trace = pressure_trace(motored[ANGLE].values, motored["pressure_bar"].values + offset)
        rows[f"{offset:g}"] = [
            float(analyze(trace, adiabatic, point=point, pegging=method, pegging_exponent=1.37)["pegging_bar"])
            for method in ("two_point", "least_squares")
        ]
    return rows


def tdc() -> Rows:
    cylinder, point = single()
    cycle = simulate(cylinder, point, soc_cad=-6.0)
    angle, pressure = cycle[ANGLE].values[2:-2], cycle["pressure_bar"].values[2:-2]

    def imep(shift: float) -> float:
        return float(analyze(pressure_trace(angle + shift, pressure), cylinder, point=point)["imep_closed_bar"])

    return {f"{s:.1f}": [100.0 * (imep(s) / imep(0.0) - 1.0)] for s in (1.0, 0.1, -1.0)}
