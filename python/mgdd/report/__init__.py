"""Reports: a piece of work as one HTML page that needs no network."""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.report.calibration import calibration_report
from mgdd.report.page import write_report
from mgdd.report.report import Report, Section, Table

__all__ = ["Report", "Section", "Table", "calibration_report", "write_report"]

_furnish(__name__)
