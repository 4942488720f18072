"""Studies: whole pieces of work that end in a table, figures and a summary.

`available_studies` lists them, `run_study` runs one by name; each is also a function, `run_<name>(...)`, that returns
a `StudyResult`.
"""

from __future__ import annotations

from mgdd.studies.base import StudyResult
from mgdd.studies.ch2_throttle_characteristics import run_ch2_throttle_characteristics
from mgdd.studies.ch3_optimizers import run_ch3_optimizers
from mgdd.studies.ch4_esc import run_ch4_esc
from mgdd.studies.ch4_sensors import run_ch4_sensors
from mgdd.studies.ch4_tests import run_ch4_tests
from mgdd.studies.ch7_first_principle import run_ch7_first_principle
from mgdd.studies.ch7_pseudo_wiener import run_ch7_pseudo_wiener
from mgdd.studies.h2df_seek import run_h2df_seek
from mgdd.studies.identification_benchmarks import run_identification_benchmarks
from mgdd.studies.measured_traces import best_timing, compare_laws, run_measured_traces
from mgdd.studies.registry import available_studies, run_study
from mgdd.studies.sections import Section, Table

__all__ = [
    "Section",
    "StudyResult",
    "Table",
    "available_studies",
    "best_timing",
    "compare_laws",
    "run_ch2_throttle_characteristics",
    "run_ch3_optimizers",
    "run_ch4_esc",
    "run_ch4_sensors",
    "run_ch4_tests",
    "run_ch7_first_principle",
    "run_ch7_pseudo_wiener",
    "run_h2df_seek",
    "run_identification_benchmarks",
    "run_measured_traces",
    "run_study",
]
