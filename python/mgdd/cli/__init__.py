"""The command line `mgdd`: options, defaults and help come from the functions of the library that commands call."""

from __future__ import annotations

from mgdd.cli.main import main

__all__ = ["main"]


def __dir__() -> list[str]:
    return __all__
