"""Many cycles at once: any parameter or input over a grid or a list of points, on any executor."""

from __future__ import annotations

from mgdd.sweep.cycles import sweep

__all__ = ["sweep"]


def __dir__() -> list[str]:
    return __all__
