"""Results: labelled Datasets, the one result of a fit, what it finds, and the contract of a model.

Nothing stands here without a unit: a Dataset refuses a variable that does not say its own.
"""

from __future__ import annotations

from mgdd.results.finding import Finding
from mgdd.results.fit import Fit
from mgdd.results.fit_report import FitReport
from mgdd.results.model import Model

__all__ = [
    "Finding",
    "Fit",
    "FitReport",
    "Model",
]
