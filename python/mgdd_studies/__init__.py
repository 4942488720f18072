"""Studies: whole pieces of work that end in a table, figures and a summary.

`run_study` runs one by name and returns its data, figures and summary; ``mgdd study`` lists them.
"""

from __future__ import annotations

from mgdd_studies.registry import run_study

__all__ = ["run_study"]


def __dir__() -> list[str]:
    return __all__
