"""Figures: a result or its Dataset goes in, matplotlib Axes come out; nothing is shown or simulated.

Every crank-angle axis reads "crank angle [°CA aTDC]". Lines differ in dash or marker as well as in colour, so that
a figure survives a black-and-white printer. Legends stand above the axes, where they hide no data: for a
title use the figure's `suptitle`.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.plot.cycles import cycles, pressure
from mgdd.plot.identification import correlation_matrix
from mgdd.plot.maps import map_cells, map_contour
from mgdd.plot.seeking import seeking, sensors
from mgdd.plot.throttle import holding_duty, throttle_run
from mgdd.plot.timing import timing, trade_off

__all__ = [
    "correlation_matrix",
    "cycles",
    "holding_duty",
    "map_cells",
    "map_contour",
    "pressure",
    "seeking",
    "sensors",
    "throttle_run",
    "timing",
    "trade_off",
]

_furnish(__name__)
