"""Models of measured responses: of an engine under random steps, and of any quantity over the points of a design.

`fit_surrogate` makes response surfaces over the injection with the lag of each signal, from records;
`mgdd.loop.SurrogatePlant` runs them as an engine. `fit_response` fits a polynomial or a Gaussian process to the points
of an experiment, as `mgdd.design.design_points` plans one.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.surrogate.fit import fit_surrogate
from mgdd.surrogate.response_fit import fit_response
from mgdd.surrogate.response_model import ResponseModel

__all__ = ["ResponseModel", "fit_response", "fit_surrogate"]

_furnish(__name__)
