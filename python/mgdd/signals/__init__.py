"""Sampled signals, whatever the plant: the one check of an even grid, quality figures, tests of residuals, excitation.

Numbers in, numbers out; units are those of the caller.
"""

from __future__ import annotations

from mgdd.signals.excitation import amplitude_random_steps, chirp, multisine, prbs, staircase, triangle
from mgdd.signals.metrics import nrmse_fit_percent

__all__ = [
    "amplitude_random_steps",
    "chirp",
    "multisine",
    "nrmse_fit_percent",
    "prbs",
    "staircase",
    "triangle",
]


def __dir__() -> list[str]:
    return __all__
