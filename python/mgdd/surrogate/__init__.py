"""Surrogate of a measured engine: response surfaces over its injection, and the lag of each signal.

`fit_surrogate` makes one from records; `mgdd.loop.SurrogatePlant` runs it as an engine.
"""

from __future__ import annotations

from mgdd.surrogate.fit import fit_surrogate
from mgdd.surrogate.random_steps import random_step_records
from mgdd.surrogate.surrogate import EngineSurrogate

__all__ = [
    "EngineSurrogate",
    "fit_surrogate",
    "random_step_records",
]
