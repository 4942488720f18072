"""Results: labelled Datasets, the one result of a fit, what it finds, and the contract of a model.

Nothing stands here without a unit: `labelled_dataset` refuses a variable that does not say its own.
"""

from __future__ import annotations

from mgdd.results.finding import Finding
from mgdd.results.fit import Fit, FitQuality
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import VARIABLES, Label, check_labels, labelled_dataset
from mgdd.results.model import Model

__all__ = [
    "VARIABLES",
    "Finding",
    "Fit",
    "FitQuality",
    "FitReport",
    "Label",
    "Model",
    "check_labels",
    "labelled_dataset",
]
