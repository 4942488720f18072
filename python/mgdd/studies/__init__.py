"""Studies: whole pieces of work, each with `run(...) -> StudyResult`."""

from __future__ import annotations

from mgdd.studies.base import StudyResult
from mgdd.studies.measured_traces import best_timing, compare_laws, run_measured_traces

__all__ = ["StudyResult", "best_timing", "compare_laws", "run_measured_traces"]
