"""Design of experiments: which points to run, inside what an engine may be driven at, and beside what was run.

`design_points` chooses them; a `FeasibleRegion` defines where they may lie: inside limits that a model predicts, or
between points that were measured. `mgdd.surrogate.fit_response` fits a model to what was measured there.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.design.points import design_points
from mgdd.design.region import FeasibleRegion

__all__ = ["FeasibleRegion", "design_points"]

_furnish(__name__)
