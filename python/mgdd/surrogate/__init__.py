"""Surrogate of a measured engine: response surfaces over its injection, the lag of each signal, a virtual engine.

`fit_surrogate` makes one from records; `SurrogateEngine` runs on it.
"""

from __future__ import annotations

from mgdd.surrogate.engine import SurrogateEngine
from mgdd.surrogate.fit import fit_surrogate
from mgdd.surrogate.random_steps import random_step_records
from mgdd.surrogate.surrogate import EngineSurrogate

__all__ = [
    "EngineSurrogate",
    "SurrogateEngine",
    "fit_surrogate",
    "random_step_records",
]
