"""Identification: fitting models to measured records, and which parameters the data do not identify.

Engine: `fit_cylinder`, `wall_heat_profile`, `best_timing`. Throttle: `identify_throttle`,
`validate_throttle` and the fits and excitations below them. Models of the
user's own: `fit_model`, and `fit_ode` in one call. Every fit answers with a `mgdd.results.Fit`.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.identify.engine.best_timing import best_timing
from mgdd.identify.engine.cylinder import fit_cylinder
from mgdd.identify.engine.family import ModelFamily
from mgdd.identify.engine.profile import wall_heat_profile
from mgdd.identify.engine.tdc import estimate_tdc
from mgdd.identify.grey_box.fit import fit_model
from mgdd.identify.grey_box.models import DiscreteModel, OdeModel, SimulatorModel
from mgdd.identify.grey_box.ode import fit_ode
from mgdd.identify.grey_box.profile import profile_likelihood
from mgdd.identify.throttle.excitation import check_excitation, design_excitation
from mgdd.identify.throttle.fits import load_throttle_model
from mgdd.identify.throttle.identify import identify_throttle
from mgdd.identify.throttle.online_update import OnlineUpdate
from mgdd.identify.throttle.validation import validate_throttle

__all__ = [
    "DiscreteModel", "ModelFamily", "OdeModel", "OnlineUpdate", "SimulatorModel", "best_timing", "check_excitation",
    "design_excitation", "estimate_tdc", "fit_cylinder", "fit_model", "fit_ode", "identify_throttle",
    "load_throttle_model", "profile_likelihood", "validate_throttle", "wall_heat_profile",
]  # fmt: skip

_furnish(__name__)
