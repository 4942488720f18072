"""Results: labelled Datasets, what every result and every model can do, the one result of a fit, and findings.

Nothing stands here without a unit: a Dataset refuses a variable that does not state its own.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.results.fit import Fit

__all__ = ["Fit"]

_furnish(__name__)
