"""Presets: named parameter sets as TOML, every value with its unit and its source."""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.presets.preset import available, load

__all__ = ["available", "load"]

_furnish(__name__)
