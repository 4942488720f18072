"""What the tables of the documentation must say: row label to numbers, computed with the package.

Run `python tools/docs_tables.py [NAME ...]` to see them; `tests/python/test_docs.py` compares them with the pages.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from mgdd import datasets, engine, presets
from mgdd.engine import Cylinder, OperatingPoint, analyze, simulate
from mgdd.guide import OnlineCalibration
from mgdd.identify import best_timing, wall_heat_profile
from mgdd.identify.engine.burn_laws import compare_laws
from mgdd.identify.engine.records import CylinderFit
from mgdd.identify.engine.timing_records import BestTiming
from mgdd.io import pressure_trace
from mgdd.loop import EngineBench
from mgdd.results.labels import ANGLE, VARIABLES
from mgdd.studies import guided_plane as plane_study
from mgdd.studies import run_study
from mgdd.studies.guide_cases import SteadyMap

__all__ = [
    "burn_laws",
    "convergence",
    "demo",
    "esc_cases",
    "esc_components",
    "esc_tests",
    "gamma",
    "golden",
    "guided_bench",
    "guided_plane",
    "guided_start",
    "ignition",
    "integrators",
    "learning",
    "members",
    "online_calibration",
    "optimum",
    "pegging",
    "profile",
    "seekers",
    "sensor_fits",
    "sensors",
    "tdc",
    "timing",
    "timing_table",
    "traces",
    "triangle",
    "variables",
    "woschni_units",
]

Rows = Mapping[str, list[float]]
LABEL_COLUMNS = {"woschni_units": 2, "burn_laws": 2, "variables": 3, "esc_cases": 2, "seekers": 2}
LAW_NAMES = {
    ("triangle", "constant"): "triangle, 1.37",
    ("wiebe", "constant"): "Wiebe, 1.37",
    ("triangle", "linear"): "triangle, linear",
    ("wiebe", "linear"): "Wiebe, linear",
    ("double_wiebe", "constant"): "double Wiebe, 1.37",
}
_LOADS = ("25 %", "50 %", "75 %", "100 %")


@cache
def single() -> tuple[Cylinder, OperatingPoint]:
    preset = presets.load("puma_single")
    return preset.cylinder, preset.point


@cache
def measured() -> tuple[list[Any], Cylinder]:
    return datasets.load("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder


@cache
def fits() -> dict[tuple[str, str], CylinderFit]:
    return dict(zip(LAW_NAMES, compare_laws(*measured(), laws=tuple(LAW_NAMES)), strict=True))


@cache
def ranges() -> list[BestTiming]:
    return best_timing(*measured())


def _values(dataset: Any, *names: str) -> list[float]:
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
    for name in ("seed", "euler", "trapezoid", "split"):
        cold = simulate(adiabatic, motored, integrator=name)
        fired = simulate(cylinder, point, soc_cad=-6.0, integrator=name)
        fine = simulate(cylinder, point, soc_cad=-6.0, integrator=name, step_cad=0.1)
        rows[f"`{name}`"] = [
            float(cold["pressure_bar"].sel({ANGLE: 0.0})),
            *_values(cold, "work_closed_j"),
            *_values(fired, "efficiency_gross"),
            float(fired["work_booked_j"].sum()),
            *_values(fired, "work_closed_j"),
            *_values(fine, "efficiency_gross"),
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
            *_values(fired, "efficiency_gross", "p_max_bar"),
            *_values(motored, "p_max_bar"),
            exponent,
        ]
    return rows


def optimum() -> Rows:
    cylinder, point = single()
    best = {s: engine.find_optimum(cylinder.replace(wall_heat_scale=s), point) for s in (0.0, 0.5, 1.0, 2.0)}
    return {f"{s:g}": [b["ca50_cad"], b["efficiency_gross"], b.curvature] for s, b in best.items()}


def convergence() -> Rows:
    names = ("imep_gross_bar", "efficiency_gross", "p_max_bar", "t_max_k", "heat_loss_j")
    table = engine.convergence(*single()).sel(indicator=list(names))
    columns = [table[name].to_numpy() for name in ("value", "error", "order")]
    return {f"`{name}`": [float(c[k]) for c in columns] for k, name in enumerate(names)}


def ignition() -> Rows:
    soi = [-30.0, -20.0, -15.0, -10.0, -5.0, 0.0, 5.0, 10.0]
    delay = [engine.ignition_delay(*single(), soi_cad=s).delay_cad for s in soi]
    return {"SOI [°CA aTDC]": soi, "delay [°CA]": delay}


# --- calibration --------------------------------------------------------------------------------------------
def burn_laws() -> Rows:
    return {
        f"{LAW_NAMES[law]} {load}": [
            own.rmse_percent,
            own.imep_closed_error_percent,
            own.onset_against_soi_cad,
            own.largest_error_bar,
            fit.model.wall_heat_scale,
        ]
        for law, fit in fits().items()
        for load, own in zip(_LOADS, fit.loads, strict=True)
    }


def profile() -> Rows:
    rows = {}
    for law, label in {
        ("wiebe", "linear"): r"Wiebe, linear $\gamma$",
        ("double_wiebe", "constant"): r"double Wiebe, $\gamma$ 1.37",
    }.items():
        own = wall_heat_profile(fits()[law])
        moves = [end for name in ("gamma", "pegging_bar", "tdc_cad") for end in sorted(own.moved[name])]
        rows[label] = [own.value, own.correlation, own.range_low, own.range_high, *moves]
    return rows


_ANSWERS = ("ca50_cad", "gain_percent", "free_ca50_cad", "free_gain_percent")


def _answers(row: BestTiming) -> list[float]:
    return [value for name in _ANSWERS for value in (getattr(row.best, name), *getattr(row, name))]


def timing() -> Rows:
    return {load: _answers(row) for load, row in zip(_LOADS, ranges(), strict=True)}


def members() -> Rows:
    """Set the plausible members side by side: RMSE and best CA50 of each load, and the span of the efficiencies."""
    rows: dict[str, list[float]] = {}
    for at, answer in enumerate(ranges()[0].members):
        own = [row.members[at] for row in ranges()]
        if all(one.plausible for one in own):
            eta = [one.efficiency_gross for one in own]
            values = [one.rmse_percent for one in own] + [one.free_ca50_cad for one in own]
            rows[answer.member.name.replace("_", " ")] = [*values, min(eta), max(eta)]
    return rows


def demo() -> Rows:
    rows = {}
    for load, row in zip(_LOADS, ranges(), strict=True):
        best: Any = row.best
        names = ("free_ca50_cad", "free_shift_cad", "free_gain_percent", "shift_cad", "gain_percent")
        answers = [value for name in names for value in (getattr(best, name), *getattr(row, name))]
        rows[load] = [best.rmse_percent, best.imep_closed_error_percent, *answers]
    return rows


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


def traces() -> Rows:
    loaded, cylinder = measured()
    names = ("p_max_bar", "ca50_cad", "heat_net_j", "imep_closed_bar", "n_compression", "n_expansion")
    return {load: _values(analyze(trace, cylinder), *names) for load, trace in zip(_LOADS, loaded, strict=True)}


def variables() -> Rows:
    return {f"`{name}` {label.units} {label.long_name}": [] for name, label in VARIABLES.items()}


# --- calibration while the engine runs ----------------------------------------------------------------------
def online_calibration() -> Rows:
    alone = dict.fromkeys(OnlineCalibration("puma_single").parameters, 0.0)
    rows = {}
    for label, sensor, told_late_cad in (
        ("nothing", {}, 0.0),
        ("timing told 0.5 °CA late", {}, 0.5),
        ("TDC read 0.5 °CA late", {"tdc_error_cad": 0.5}, 0.0),
        ("pressure 1 % high", {"pressure_gain_error": 0.01}, 0.0),
        ("pegging 0.1 bar high", {"pressure_offset_bar": 0.1}, 0.0),
    ):
        row: list[float] = []
        for method, uncertainty in (("gauss_newton", alone), ("gauss_newton", None), ("recursive", None)):
            bench = EngineBench(pressure_noise_bar=0.1, soc_scatter_cad=0.0, seed=2, **sensor)
            settings = {"method": method, "uncertainty": uncertainty, "soc_scatter_cad": 0.0}
            guide = OnlineCalibration(Cylinder(wall_heat_scale=1.0), **settings)
            for _ in range(100):
                bench.step(-6.0)
                guide.offer(bench.pressure()[1], bench.point, -6.0 + told_late_cad)
                guide.update()
            row += [guide.parameters["wall_heat_scale"], guide.standard_errors["wall_heat_scale"]]
        rows[label] = row
    return rows


# --- studies ------------------------------------------------------------------------------------------------
@cache
def study(name: str) -> Mapping[str, Any]:
    return run_study(name, figures=False).summary


def _with_ends(row: Mapping[str, Any], *names: str) -> list[float]:
    """Mean and ends of its interval where the row has them, else the number alone; nothing for what never happens."""
    found = [row.get(name + end) for name in names for end in ("", "_low", "_high")]
    return [float(value) for value in found if value is not None]


def seekers() -> Rows:
    names = ("cycles_to_1_cad", "rms_cad", "final_cad", "j_lost")
    return {f"{row['seeker']} {row['settings']}": _with_ends(row, *names) for row in study("seeker-comparison")["rows"]}


def guided_bench() -> Rows:
    names = ("cycles_to_1_cad", "cycles_stays_1_5_cad", "lost_j_cycles", "late_loss")
    return {row["case"]: [row["start_cad"], *_with_ends(row, *names)] for row in study("guided")["rows"]}


def guided_start() -> Rows:
    names = ("cycles_to_1_cad", "lost_j_cycles", "late_loss")
    return {row["case"]: [float(row[name]) for name in names] for row in study("guided")["rows"]}


def learning() -> Rows:
    names = ("sigma_max", "first_rms_cad", "third_rms_cad", "last_rms_cad")
    return {f"`{row['law']}`": _with_ends(row, *names) for row in study("seeker-comparison")["iterative_learning"]}


def guided_plane() -> Rows:
    speeds, fuels = plane_study.SPEEDS_RPM, plane_study.FUELS_MG
    maps = [
        [SteadyMap.of(EngineBench(point=OperatingPoint(speed_rpm=float(n), fuel_mg=float(m)))) for m in fuels]
        for n in speeds
    ]
    planes = [plane_study.run_plane(name, maps) for name in ("none", *plane_study.PLANE_GUIDES)]
    names = ("cells_slower", "cells_costlier", "worst_cost_over_unguided", "mean_cycles", "mean_cycles_saved")
    rows = [plane_study.plane_row(plane, planes[0]) for plane in planes]
    return {row["guide"]: [float(row[name]) for name in (*names, "lost_over_unguided")] for row in rows}


def sensors() -> Rows:
    steps = ("timing_step_t90_cycles", "load_step_t90_cycles", "load_step_t90_s")
    names = ("steady_error_percent", "worst_error_percent", "scatter_percent")
    return {row["sensor"]: [float(row[name]) for name in (*names, *steps)] for row in study("nox-sensors")["rows"]}


def sensor_fits() -> Rows:
    names = ("reference_nox_ppm", "reference_nox_stderr_ppm", "activation_temperature_k")
    names += ("activation_temperature_stderr_k", "residual_percent")
    return {f"`{row['map']}`": [row[name] for name in names] for row in study("nox-sensors")["fits"]}


def esc_cases() -> Rows:
    names = ("phase_deg", "step_sign", "cycles_stays", "final_cad")
    return {f"{row['case']} {row['period_cycles']}": _with_ends(row, *names) for row in study("sensor-delay")["rows"]}


def esc_components() -> Rows:
    names = ("time_constant_cycles", "nox_gain", "rms_cad")
    return {
        f"period {row['period_cycles']}": _with_ends(row, *names) for row in study("sensor-delay")["component_wise"]
    }


def esc_tests() -> Rows:
    names = ("start_cad", "optimum_cad", "final_cad", "cycles_to_1_cad", "efficiency_before_percent")
    names += ("efficiency_after_percent", "nox_before_ppm", "nox_after_ppm", "gain_percent_points")
    means = {"efficiency_after_percent", "nox_after_ppm", "gain_percent_points"}
    rows = {}
    for row in study("timing-tests")["rows"]:
        kept = {name: value for name, value in row.items() if name.rpartition("_")[0] not in means}
        rows[row["test"]] = _with_ends(kept, *names)
    return rows


# --- single numbers -----------------------------------------------------------------------------------------
def _rmse(*law: str) -> Callable[[], float]:
    return lambda: max(load.rmse_percent for load in fits()[law[0], law[1]].loads)


def _imep_error(*law: str) -> Callable[[], float]:
    return lambda: max(abs(load.imep_closed_error_percent) for load in fits()[law[0], law[1]].loads)


NUMBERS: Mapping[str, Callable[[], float]] = {
    "triangle_rmse_percent": _rmse("triangle", "constant"),
    "triangle_imep_error_percent": _imep_error("triangle", "constant"),
    "wiebe_rmse_percent": _rmse("wiebe", "linear"),
    "wiebe_imep_error_percent": _imep_error("wiebe", "linear"),
    "double_wiebe_rmse_percent": _rmse("double_wiebe", "constant"),
    "double_wiebe_imep_error_percent": _imep_error("double_wiebe", "constant"),
    "best_ca50_cad": lambda: engine.find_optimum(*single())["ca50_cad"],
    "efficiency_gross": lambda: float(simulate(*single(), soc_cad=-6.0)["efficiency_gross"]),
    "seed_motored_work_j": lambda: integrators()["`seed`"][1],
    "step_error_imep_percent": lambda: (
        100.0 * float(np.abs(engine.convergence(*single())["error"].sel(indicator="imep_gross_bar")) / 9.627)
    ),
}


def main() -> None:
    """Print the rows of the tables named, or of all."""
    for name in sys.argv[1:] or __all__:
        print(f"\n{name}")
        for label, values in globals()[name]().items():
            print(f"  {label:48}", *(f"{value:12.6g}" for value in values))


if __name__ == "__main__":
    main()
