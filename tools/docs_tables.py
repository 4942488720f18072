"""What the tables of the documentation must say: row label to numbers, computed with the package.

Run `python tools/docs_tables.py [NAME ...]` to see them; `tests/python/test_docs.py` compares them with the pages.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
from tables_of_control import throttle_baselines, throttle_faults
from tables_of_guidance import ignition_plane, ignition_slopes, model_stages
from tables_of_measured_traces import burn_laws, fits, members, profile, timing, traces
from tables_of_model import (
    Rows,
    convergence,
    gamma,
    golden,
    ignition,
    integrators,
    optimum,
    pegging,
    single,
    tdc,
    timing_table,
    triangle,
    woschni_units,
)

from mgdd import engine
from mgdd.engine import Cylinder, OperatingPoint, simulate
from mgdd.engine.cycle import convergence as step_error
from mgdd.guide import OnlineCalibration
from mgdd.loop import VirtualEngine
from mgdd_studies import guided_transients as plane_study
from mgdd_studies import run_study
from mgdd_studies.guide_cases import SpeedLoadPlane

__all__ = [
    "burn_laws",
    "convergence",
    "esc_cases",
    "esc_components",
    "esc_tests",
    "gamma",
    "golden",
    "guided_bench",
    "guided_plane",
    "guided_start",
    "ignition",
    "ignition_plane",
    "ignition_slopes",
    "integrators",
    "learning",
    "members",
    "model_stages",
    "online_calibration",
    "optimum",
    "pegging",
    "profile",
    "seekers",
    "sensor_fits",
    "sensors",
    "tdc",
    "throttle_baselines",
    "throttle_faults",
    "timing",
    "timing_table",
    "torque_demand",
    "traces",
    "triangle",
    "woschni_units",
]

LABEL_COLUMNS = {
    "woschni_units": 2, "esc_cases": 2, "seekers": 2, "ignition_plane": 2,
    "model_stages": 2, "guided_plane": 2,
}  # fmt: skip


# --- calibration while the engine runs ----------------------------------------------------------------------
def online_calibration() -> Rows:
    alone = {name: 0.0 for name in OnlineCalibration("puma_single").parameters if name != "wall_heat_scale"}
    rows = {}
    for label, off, told_late_cad in (
        ("nothing", {}, 0.0),
        ("timing given 0.5 °CA late", {}, 0.5),
        ("TDC read 0.5 °CA late", {"tdc_error_cad": 0.5}, 0.0),
        ("pressure 1 % high", {"pressure_gain_error": 0.01}, 0.0),
        ("pegging 0.1 bar high", {"pressure_offset_bar": 0.1}, 0.0),
        ("compression ratio 0.1 higher", {"cylinder": Cylinder(compression_ratio=18.3)}, 0.0),
        ("intake 10 K warmer", {"point": OperatingPoint(intake_temperature_k=323.0)}, 0.0),
        ("walls 70 K hotter", {"cylinder": Cylinder(wall_temperature_k=520.0)}, 0.0),
    ):
        row: list[float] = []
        for method, uncertainty in (("gauss_newton", alone), ("gauss_newton", None), ("recursive", None)):
            bench = VirtualEngine(pressure_noise_bar=0.1, soc_scatter_cad=0.0, seed=2, **off)
            settings = {"method": method, "uncertainty": uncertainty, "soc_scatter_cad": 0.0}
            guide = OnlineCalibration(Cylinder(wall_heat_scale=1.0), **settings)
            for _ in range(100):
                bench.step(-6.0)
                guide.offer(bench.pressure()[1], OperatingPoint(), -6.0 + told_late_cad)
                guide.update()
            row += [guide.parameters["wall_heat_scale"], guide.standard_errors["wall_heat_scale"]]
        rows[label] = row
    return rows


# --- studies ------------------------------------------------------------------------------------------------
@cache
def study(name: str) -> Mapping[str, Any]:
    return run_study(name, figures=False).summary


def torque_demand() -> Rows:
    rows = study("torque-demand")["rows"]
    return {row["case"]: [value for name, value in row.items() if name != "case"] for row in rows}


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
    rows = [row for row in study("guided")["rows"] if row["case"] != "feed_forward"]
    return {row["case"]: [float(row["cycles_to_1_cad"]), float(row["lost_j_cycles"])] for row in rows}


def learning() -> Rows:
    names = ("sigma_max", "first_rms_cad", "third_rms_cad", "last_rms_cad")
    return {f"`{row['law']}`": _with_ends(row, *names) for row in study("seeker-comparison")["iterative_learning"]}


def guided_plane() -> Rows:
    plane = SpeedLoadPlane()
    planes = [plane_study.run_plane(form, name, plane) for form, name in plane_study.PLANE_RUNS]
    names = ("cells_slower", "cells_costlier", "worst_cost_over_unguided", "mean_cycles", "mean_cycles_saved")
    rows = [plane_study.plane_row(own, planes[0]) for own in planes]
    return {
        f"{row['form']} {row['guide']}": [float(row[name]) for name in (*names, "lost_over_unguided")] for row in rows
    }


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
    "lagged_motored_work_j": lambda: integrators()["`tan2018_lagged`"][1],
    "step_error_imep_percent": lambda: (
        100.0 * float(np.abs(step_error(*single())["error"].sel(indicator="imep_gross_bar")) / 9.627)
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
