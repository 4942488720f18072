"""Public data by name: `read` looks for a set in the folder MGDD_DATA_DIR, the package and what was fetched before."""

from __future__ import annotations

from mgdd.datasets.files import names
from mgdd.datasets.readers import read

__all__ = ["names", "read"]


def __dir__() -> list[str]:
    return __all__
