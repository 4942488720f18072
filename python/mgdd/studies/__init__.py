"""Studies: whole pieces of work that end in a table, figures and a summary.

`available_studies` lists them, `run_study` runs one by name and returns a `StudyResult`. The study
``measured-traces`` takes the user's own traces.
"""

from __future__ import annotations

from mgdd.studies.base import StudyResult
from mgdd.studies.registry import available_studies, run_study

__all__ = [
    "StudyResult",
    "available_studies",
    "run_study",
]


def __dir__() -> list[str]:
    return __all__
