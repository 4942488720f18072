"""Many cycles at once: any parameter or input over a grid or a list of points, on any executor."""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.sweep.cycles import sweep

__all__ = ["sweep"]

_furnish(__name__)
