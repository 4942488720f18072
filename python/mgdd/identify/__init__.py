"""Identification: fitting the cycle model to measured pressure, and what such a fit can and cannot tell."""

from __future__ import annotations

from mgdd.identify.cylinder import fit_cylinder
from mgdd.identify.profile import WallHeatProfile, wall_heat_profile
from mgdd.identify.records import CylinderFit, LoadFit

__all__ = ["CylinderFit", "LoadFit", "WallHeatProfile", "fit_cylinder", "wall_heat_profile"]
