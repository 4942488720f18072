"""Presets: named parameter sets as TOML, every value with its unit and its source."""

from __future__ import annotations

from mgdd.presets.preset import available, load

__all__ = ["available", "load"]


def __dir__() -> list[str]:
    return __all__
