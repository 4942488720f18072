"""A step from one operating point to every cell of the speed-load plane, guided by point or curve and not at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.loop import EngineBench
from mgdd.studies.guide_cases import GUIDES, Guide, SteadyMap, drive, first_within, guided_by

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["FUELS_MG", "PLANE_GUIDES", "PLANE_RUNS", "SPEEDS_RPM", "Plane", "plane_row", "run_plane"]

SPEEDS_RPM = np.linspace(900.0, 3000.0, 8)
FUELS_MG = np.round(np.linspace(6.0, 40.0, 8), 1)
LEARNT_AT = OperatingPoint(speed_rpm=1500.0, fuel_mg=20.0)
PLANE_GUIDES = ("wall heat -30 %", "wall heat +30 %", "duration -15 %", "adiabatic")
PLANE_RUNS = (("none", "none"), *((form, name) for form in ("feed-forward", "curve") for name in PLANE_GUIDES))
_SETTLED, _JUDGED = 400, 200
_SAME = 0.01  # share of loss within which two cells count as equal: two cycles of dither


@dataclass(frozen=True, kw_only=True)
class Plane:
    """Cycles to 1 CAD and J lost in 200 cycles [points x cycles] after the step, by speed and fuel."""

    form: str
    name: str
    cycles: NDArray[np.float64]
    lost: NDArray[np.float64]


def run_plane(
    form: str, name: str, maps: Sequence[Sequence[SteadyMap]], *, speeds: Any = SPEEDS_RPM, fuels: Any = FUELS_MG
) -> Plane:
    """Step from 1500 rpm and 20 mg to each cell, with that guide as feed-forward or curve, or without (``none``)."""
    guides: dict[str, Guide] = {guide.name: guide for guide in GUIDES}
    shape = (len(speeds), len(fuels))
    cycles, lost = np.empty(shape), np.empty(shape)
    for i, speed in enumerate(speeds):
        for j, fuel in enumerate(fuels):
            cell = OperatingPoint(speed_rpm=float(speed), fuel_mg=float(fuel))
            schedule = [(0, LEARNT_AT), (_SETTLED, cell)]
            bench = EngineBench(schedule=schedule, soc_scatter_cad=0.0, efficiency_noise_percent=0.0)
            run = drive(bench, guided_by(form, guides.get(name), LEARNT_AT), _SETTLED + _JUDGED)
            after = maps[i][j]
            cycles[i, j] = first_within(run.estimate[_SETTLED:], after.best_cad, 1.0)
            lost[i, j] = after.lost(run.applied[_SETTLED:]).sum()
    return Plane(form=form, name=name, cycles=cycles, lost=lost)


def plane_row(plane: Plane, none: Plane) -> dict[str, Any]:
    """Compare with the plain seeker: cells that take more cycles to 1 CAD or lose over 1 % more, and means."""
    ratio = plane.lost / none.lost
    return {
        "form": plane.form,
        "guide": plane.name,
        "cells": plane.lost.size,
        "cells_slower": int(np.sum(plane.cycles > none.cycles)),
        "cells_costlier": int(np.sum(ratio > 1.0 + _SAME)),
        "worst_cost_over_unguided": float(ratio.max()),
        "mean_cycles": float(plane.cycles.mean()),
        "mean_cycles_saved": float(np.mean(none.cycles - plane.cycles)),
        "mean_lost": float(plane.lost.mean()),
        "lost_over_unguided": float(plane.lost.sum() / none.lost.sum()),
    }
