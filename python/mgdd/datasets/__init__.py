"""Public data by name: `load` reads a set from the folder MGDD_DATA_DIR, the package or what `fetch` has kept."""

from __future__ import annotations

from mgdd.datasets.files import available, path
from mgdd.datasets.origins import fetch
from mgdd.datasets.readers import load

__all__ = ["available", "fetch", "load", "path"]


def __dir__() -> list[str]:
    return __all__
