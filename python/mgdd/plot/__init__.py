"""Figures: a Dataset goes in, matplotlib Axes come out; `ax=` is accepted and nothing is shown or simulated.

Every angle axis reads "crank angle [°CA aTDC]". Lines differ in dash or marker as well as in colour, so that
a figure survives a black-and-white printer. Legends stand above the axes, where they hide no data: for a
title use the figure's `suptitle`.
"""

from __future__ import annotations

from mgdd.plot.calibration import calibration_overlay, wall_heat_profile
from mgdd.plot.convergence import plot_convergence
from mgdd.plot.cycle import log_pv, pressure
from mgdd.plot.learning import plot_learning
from mgdd.plot.seeking import plot_seeking
from mgdd.plot.sensors import plot_sensors
from mgdd.plot.timing import timing

__all__ = [
    "calibration_overlay",
    "log_pv",
    "plot_convergence",
    "plot_learning",
    "plot_seeking",
    "plot_sensors",
    "pressure",
    "timing",
    "wall_heat_profile",
]
