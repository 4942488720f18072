"""What a study hands back, and how all of them run: part by part, with an end by Ctrl-C that keeps the finished."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from mgdd.errors import Interrupted, ParameterError

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Progress", "StudyResult", "check_seeds", "finish", "run_parts"]

Progress = Callable[[str], None]
Part = TypeVar("Part")


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """Data, figures and summary of a study.

    Parameters
    ----------
    name : str
        Name of the study.
    dataset : xarray.Dataset
        Its table, with units on every variable.
    figures : mapping of str to matplotlib.figure.Figure
        Figures by caption.
    summary : mapping
        Plain numbers and text, ready for JSON: at least ``study``, ``seeds`` (0 where nothing is random) and ``rows``,
        a list of flat mappings; ``interrupted`` is true in the part that `mgdd.errors.Interrupted` carries.

    Examples
    --------
    >>> from mgdd.studies import run_measured_traces
    >>> result = run_measured_traces(quick=True, figures=False)
    >>> len(result.summary["traces"])
    4
    """

    name: str
    dataset: xr.Dataset
    figures: Mapping[str, Figure] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)


def check_seeds(seeds: int) -> int:
    """Refuse a number of seeds that is none."""
    if seeds < 1:
        raise ParameterError(f"seeds = {seeds}: must be >= 1")
    return seeds


def run_parts(parts: Iterable[tuple[str, Callable[[], Part]]], progress: Progress | None) -> tuple[list[Part], bool]:
    """Run the parts of a study in order; Ctrl-C ends them and keeps what is finished, unless nothing is.

    Parameters
    ----------
    parts : iterable of (str, callable)
        What is going on, and the work.
    progress : callable, optional
        Called with that text before each part.

    Returns
    -------
    tuple of list and bool
        What the finished parts returned, and whether Ctrl-C ended them.
    """
    done: list[Part] = []
    try:
        for text, work in parts:
            if progress is not None:
                progress(text)
            done.append(work())
    except KeyboardInterrupt:
        if not done:
            raise
        return done, True
    return done, False


def finish(result: StudyResult) -> StudyResult:
    """Return a whole result; raise one that Ctrl-C has cut short, as the part that an Interrupted carries."""
    if result.summary.get("interrupted"):
        raise Interrupted(f"interrupted: {len(result.summary['rows'])} finished rows are in .partial", result)
    return result
