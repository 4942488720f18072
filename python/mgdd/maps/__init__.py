"""Calibration maps: the best value per operating point, smooth, with its provenance, in and out of files."""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.maps.calibration_map import CalibrationMap
from mgdd.maps.compare import apply_map, compare_maps
from mgdd.maps.dcm_files import read_dcm
from mgdd.maps.files import read_map, write_map
from mgdd.maps.optimum import optimize_map
from mgdd.maps.smoothing import smooth_map

__all__ = [
    "CalibrationMap",
    "apply_map",
    "compare_maps",
    "optimize_map",
    "read_dcm",
    "read_map",
    "smooth_map",
    "write_map",
]

_furnish(__name__)
