"""The command line: `mgdd demo`, `mgdd engine simulate | analyze | calibrate | optimum`, `mgdd doctor`."""

from __future__ import annotations

from mgdd.cli.main import main

__all__ = ["main"]


def __dir__() -> list[str]:
    return __all__
