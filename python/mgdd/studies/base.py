"""What a study hands back, and how all of them run: part by part, with an end by Ctrl-C that keeps the finished."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from mgdd.errors import Interrupted, ParameterError
from mgdd.results.describe import described
from mgdd.studies.sections import Section, standard_sections

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Progress", "StudyResult", "check_seeds", "finish", "run_parts"]

Progress = Callable[[str], None]
Part = TypeVar("Part")


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """Data, figures, summary and sections of a study; `mgdd.report.write_report` makes a page of any of them.

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
    sections : tuple of Section
        What a report of the study says, in order; made of the summary, the figures and the dataset where the study
        writes none itself.
    title : str
        Heading of the report; the title in `available_studies` if left out.

    Examples
    --------
    >>> from mgdd.studies import run_study
    >>> result = run_study("measured-traces", quick=True, figures=False)
    >>> len(result.summary["traces"])
    4
    """

    name: str
    dataset: xr.Dataset
    figures: Mapping[str, Figure] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)
    sections: tuple[Section, ...] = ()
    title: str = ""

    def __post_init__(self) -> None:
        if not self.sections:
            object.__setattr__(self, "sections", standard_sections(self.summary, self.figures, self.dataset))


described(
    StudyResult,
    title=lambda result: f"StudyResult {result.name}" + (f": {result.title}" if result.title else ""),
    rows=lambda result: {
        "seeds": result.summary.get("seeds"),
        "rows": len(result.summary.get("rows", ())),
        "sections": tuple(section.title for section in result.sections),
        "figures": len(result.figures),
        "dataset": result.dataset,
        "interrupted": bool(result.summary.get("interrupted", False)),
    },
)


def check_seeds(seeds: int) -> int:
    """Refuse a number of seeds that is none."""
    if seeds < 1:
        raise ParameterError.of("seeds", seeds, ">= 1")
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
        if not done:  # what the part itself may have kept is no result of a study
            raise Interrupted("interrupted: nothing was finished") from None
        return done, True
    return done, False


def finish(
    dataset: xr.Dataset, summary: Mapping[str, Any], draw: Callable[[xr.Dataset], Mapping[str, Figure]] | None
) -> StudyResult:
    """Return a whole result; raise one that Ctrl-C has cut short, as the part that an Interrupted carries."""
    figures = {} if draw is None else draw(dataset)
    result = StudyResult(name=summary["study"], dataset=dataset, figures=figures, summary=summary)
    if summary["interrupted"]:
        raise Interrupted(f"interrupted: {len(summary['rows'])} finished rows are in .partial", result)
    return result
