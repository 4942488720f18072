"""A measured engine as a benchmark: surfaces of its signals fitted to records under random steps, and run as a plant.

`fit_surrogate` makes response surfaces over the injection with the lag of each signal, from records; `SurrogatePlant`
runs them as an engine, cycle by cycle. `random_step_records` makes records of a known engine.
"""

from __future__ import annotations

from mgdd_studies.measured_engine.fit import fit_surrogate, random_step_records
from mgdd_studies.measured_engine.plant import SurrogatePlant
from mgdd_studies.measured_engine.surrogate import EngineSurrogate

__all__ = ["EngineSurrogate", "SurrogatePlant", "fit_surrogate", "random_step_records"]
