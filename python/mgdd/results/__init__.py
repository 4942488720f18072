"""Results: labelled Datasets, what every result and every model can do, the one result of a fit, and findings.

Nothing stands here without a unit: a Dataset refuses a variable that does not say its own.
"""

from __future__ import annotations

from mgdd.results.finding import Finding
from mgdd.results.fit import Fit
from mgdd.results.fit_report import FitReport
from mgdd.results.model import Model
from mgdd.results.result import Result

__all__ = [
    "Finding",
    "Fit",
    "FitReport",
    "Model",
    "Result",
]


def __dir__() -> list[str]:
    return __all__
