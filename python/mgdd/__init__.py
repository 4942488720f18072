"""Model-guided data-driven optimization and control for internal combustion engine systems.

The rooms: `mgdd.engine` (cycle model and trace analysis), `mgdd.identify` (calibration), `mgdd.optimize` (least squares),
`mgdd.presets`, `mgdd.io`, `mgdd.datasets`, `mgdd.plot`, `mgdd.studies` and `mgdd.errors`. They are imported on use.

Crank angles are degrees everywhere, firing TDC = 0, compression negative (°CA aTDC).
"""

from __future__ import annotations

import importlib
from types import ModuleType

from mgdd._core import __version__

_ROOMS = ("datasets", "engine", "errors", "identify", "io", "optimize", "plot", "presets", "report", "results", "studies")

__all__ = ["__version__", *_ROOMS]


def __getattr__(name: str) -> ModuleType:
    if name in _ROOMS:
        return importlib.import_module(f"mgdd.{name}")
    raise AttributeError(f"module 'mgdd' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
