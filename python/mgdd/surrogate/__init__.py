"""Models of a measured response over the points of a design.

`fit_response` fits a polynomial or a Gaussian process to the points of an experiment, as `mgdd.design.design_points`
plans one.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.surrogate.response_fit import fit_response
from mgdd.surrogate.response_model import ResponseModel

__all__ = ["ResponseModel", "fit_response"]

_furnish(__name__)
