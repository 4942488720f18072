"""Tables of the documentation about what a guide rests on: ignition delay, and the model beside measured traces."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from tables_of_measured_traces import measured

from mgdd_studies.guide_cases import SpeedLoadPlane
from mgdd_studies.ignition_cases import TRUTHS, assumed_laws
from mgdd_studies.ignition_delay import Plane, plane_of, plane_row, slope_row
from mgdd_studies.model_validation import stage_rows, validate_law
from mgdd_studies.validation_fits import LAWS, STAGES

if TYPE_CHECKING:
    from tables_of_model import Rows

__all__ = ["ignition_plane", "ignition_slopes", "model_stages"]


@cache
def _planes() -> tuple[Plane, ...]:
    plane = SpeedLoadPlane()
    return tuple(plane_of(truth, assumed, plane) for truth in TRUTHS for assumed in assumed_laws(truth))


def ignition_plane() -> Rows:
    names = ("soi_error_median_cad", "lost_mean", "lost_p95", "to_learn", "left_median_cad", "lost_trimmed_mean")
    names += ("lost_trimmed_p95", "cells_without_ignition", "cells_without_ignition_trimmed")
    rows = {}
    for plane in _planes():
        if plane.truth != plane.assumed:
            row = {**plane_row(plane), "to_learn": -plane.trim_cad}
            rows[f"{plane.truth} {plane.assumed}"] = [float(row[name]) for name in names]
    return rows


def ignition_slopes() -> Rows:
    names = ("delay_smallest_cad", "delay_median_cad", "delay_largest_cad", "slope_p10", "slope_median", "slope_p90")
    names += ("curvature_ratio_median", "cells_out_of_reach")
    own = [plane for plane in _planes() if plane.truth == plane.assumed]
    return {plane.truth: [float(slope_row(plane)[name]) for name in names] for plane in own}


def model_stages() -> Rows:
    done = [validate_law(law, *measured(), 0) for law in LAWS]
    names = ("rmse_percent", "imep_closed_error_percent", "best_ca50_cad", "lost_percent", "curvature_ratio")
    rows = {}
    for own in done:
        found = stage_rows(own, done[0])
        for stage in STAGES:
            loads = [row for row in found if row["stage"] == stage]
            rows[f"{own.law.name} {stage}"] = np.ravel([[row[name] for row in loads] for name in names]).tolist()
    return rows
