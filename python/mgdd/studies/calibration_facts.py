"""Facts of calibration on a steady engine without noise: what extremum seeking needs, what a wrong timing does."""

from __future__ import annotations

from typing import Any

import numpy as np

from mgdd.engine import Cylinder
from mgdd.guide import OnlineCalibration
from mgdd.loop import EngineBench
from mgdd.studies.guide_cases import PLANT, stays_within, verdict_on

__all__ = ["ENGINE_KNOWN", "EXACT", "TRUE_SCALE", "WRONG", "calibration_facts", "fact_bars"]

WRONG: Cylinder = PLANT.replace(wall_heat_scale=1.0)
TRUE_SCALE = float(PLANT.wall_heat_scale)
# Everything but the wall heat taken as known exactly.
EXACT = {name: 0.0 for name in OnlineCalibration("puma_single").parameters if name != "wall_heat_scale"}
# The engine itself, as its virtual compression ratio and temperatures are: what is asked then is what a sensor does.
ENGINE_KNOWN = dict.fromkeys(
    ["compression_ratio_offset", "charge_temperature_offset_k", "wall_temperature_offset_k"], 0.0
)
_FACT_CAD, _TRIALS, _STEADY_CYCLES = -6.0, 200, 40
# Shift of the wall heat by a timing told 0.5 CAD late, at these timings, found by an independent program.
_SHIFTS = {-10.0: 0.053, -6.0: 0.075, 0.0: 0.114}
_SHIFT_MARGIN = 0.02


def calibration_facts() -> list[dict[str, Any]]:
    """Give rows ``fact value expected margin``: trials of extremum seeking, and the shift by a wrong timing."""
    trials, final = _seeking()
    rows: list[dict[str, Any]] = [
        {
            "fact": "extremum seeking: trials until it stays within 2 %",
            "value": trials,
            "expected": 137.0,
            "margin": 13.0,
        },
        {"fact": "extremum seeking: wall heat in the end", "value": final, "expected": TRUE_SCALE, "margin": 0.01},
    ]
    for soc, shift in _SHIFTS.items():
        told = [_told(soc, late) for late in (-0.5, 0.5)]
        rows.append(
            {
                "fact": f"shift of the wall heat by 0.5 CAD of told timing, at {soc:g} CAD",
                "value": 0.5 * abs(told[1] - told[0]),
                "expected": shift,
                "margin": _SHIFT_MARGIN,
            }
        )
    return rows


def fact_bars(facts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Compare each fact with what was expected."""
    return [
        verdict_on(
            fact["fact"], [fact["value"]], f"{fact['expected']:g} ± {fact['margin']:g}",
            low=fact["expected"] - fact["margin"], high=fact["expected"] + fact["margin"],
        )
        for fact in facts
    ]  # fmt: skip


def _steady() -> EngineBench:
    return EngineBench(soc_scatter_cad=0.0)


def _seeking() -> tuple[float, float]:
    """Count trials until the wall heat stays within 2 % of the truth, one trial per update; and where it ends."""
    bench = _steady()
    calibration = OnlineCalibration(
        WRONG, method="extremum_seeking", uncertainty=EXACT, window_cycles=2, soc_scatter_cad=0.0, trials_per_update=1
    )
    scale: list[float] = []
    while len(scale) < _TRIALS:
        bench.step(_FACT_CAD)
        calibration.offer(bench.pressure()[1], bench.point, _FACT_CAD)
        if calibration.update() == "updated":
            scale.append(calibration.parameters["wall_heat_scale"])
    return 1.0 + stays_within(np.array(scale), TRUE_SCALE, 0.02 * TRUE_SCALE), scale[-1]


def _told(soc_cad: float, late_cad: float) -> float:
    """Fit the wall heat alone where the timing is told wrong."""
    bench = _steady()
    calibration = OnlineCalibration(WRONG, uncertainty=EXACT, soc_scatter_cad=0.0)
    for _ in range(_STEADY_CYCLES):
        bench.step(soc_cad)
        calibration.offer(bench.pressure()[1], bench.point, soc_cad + late_cad)
        calibration.update()
    return calibration.parameters["wall_heat_scale"]
