"""The two packages of the extra `can`, imported when a function needs them."""

from __future__ import annotations

from types import ModuleType

__all__ = ["can_package", "cantools_package"]

_EXTRA = 'install it with pip install "mgdd[can]"'


def can_package() -> ModuleType:
    """Return python-can; ImportError names the extra."""
    try:
        import can
    except ImportError as error:
        raise ImportError(f"a CAN bus needs the package python-can: {_EXTRA}") from error
    return can


def cantools_package() -> ModuleType:
    """Return cantools; ImportError names the extra."""
    try:
        import cantools
    except ImportError as error:
        raise ImportError(f"reading a DBC file needs the package cantools: {_EXTRA}") from error
    return cantools
