"""Public data by name: `read` looks for a set in the folder MGDD_DATA_DIR and in the package."""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.datasets.files import names
from mgdd.datasets.readers import read

__all__ = ["names", "read"]

_furnish(__name__)
