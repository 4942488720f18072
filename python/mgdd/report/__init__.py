"""Reports: any study as one HTML page that needs no network; a cycle or a map under sliders in a notebook."""

from __future__ import annotations

from mgdd.report.explore import explore
from mgdd.report.page import write_report

__all__ = ["explore", "write_report"]


def __dir__() -> list[str]:
    return __all__
