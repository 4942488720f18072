"""Identification: fitting the cycle model to measured pressure, and what such a fit can and cannot tell."""

from __future__ import annotations

from mgdd.identify.cylinder import CylinderFit, LoadFit, fit_cylinder
from mgdd.identify.profile import WallHeatProfile, wall_heat_profile

__all__ = ["CylinderFit", "LoadFit", "WallHeatProfile", "fit_cylinder", "wall_heat_profile"]
