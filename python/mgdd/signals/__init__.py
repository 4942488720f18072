"""Sampled signals, whatever the plant: excitation signals, and the quality figure of a fit.

Numbers in, numbers out; units are those of the caller.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.signals.excitation import amplitude_random_steps, chirp, multisine, prbs, staircase, triangle
from mgdd.signals.metrics import nrmse_fit_percent

__all__ = ["amplitude_random_steps", "chirp", "multisine", "nrmse_fit_percent", "prbs", "staircase", "triangle"]

_furnish(__name__)
