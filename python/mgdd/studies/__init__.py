"""Studies: whole pieces of work, each with `run(...) -> StudyResult`."""

from __future__ import annotations

from mgdd.studies.base import StudyResult
from mgdd.studies.h2df_seek import run_h2df_seek
from mgdd.studies.measured_traces import best_timing, compare_laws, run_measured_traces

__all__ = ["StudyResult", "best_timing", "compare_laws", "run_h2df_seek", "run_measured_traces"]
