"""Studies: whole pieces of work that end in a table, figures and a summary.

`available_studies` lists them, `run_study` runs one by name; each is also a function, `run_<name>(...)`, that returns
a `StudyResult`.
"""

from __future__ import annotations

from mgdd.studies.base import StudyResult
from mgdd.studies.benchmarks.identification_benchmarks import run_identification_benchmarks
from mgdd.studies.measured_engine_seek import run_measured_engine_seek
from mgdd.studies.measured_traces import run_measured_traces
from mgdd.studies.nox_sensors import run_nox_sensors
from mgdd.studies.registry import available_studies, run_study
from mgdd.studies.sections import Section, Table
from mgdd.studies.seeker_comparison import run_seeker_comparison
from mgdd.studies.sensor_delay import run_sensor_delay
from mgdd.studies.throttle_characteristics import run_throttle_characteristics
from mgdd.studies.throttle_first_principle import run_throttle_first_principle
from mgdd.studies.throttle_pseudo_wiener import run_throttle_pseudo_wiener
from mgdd.studies.timing_tests import run_timing_tests

__all__ = [
    "Section",
    "StudyResult",
    "Table",
    "available_studies",
    "run_identification_benchmarks",
    "run_measured_engine_seek",
    "run_measured_traces",
    "run_nox_sensors",
    "run_seeker_comparison",
    "run_sensor_delay",
    "run_study",
    "run_throttle_characteristics",
    "run_throttle_first_principle",
    "run_throttle_pseudo_wiener",
    "run_timing_tests",
]
