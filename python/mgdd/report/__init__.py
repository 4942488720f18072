"""Reports: any study as one HTML page that needs no network."""

from __future__ import annotations

from mgdd.report.page import write_report

__all__ = ["write_report"]


def __dir__() -> list[str]:
    return __all__
