"""What a study hands back, and how all of them run: part by part, with an end by Ctrl-C that keeps the finished."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from itertools import takewhile
from typing import TYPE_CHECKING, Any, TypeVar

from mgdd.errors import Interrupted, ParameterError, WorkerLostError, hand_over
from mgdd.parallel.chunks import run_chunks
from mgdd.parallel.pool import MakesExecutor, Pool
from mgdd.results.describe import Row, rows_of
from mgdd.results.result import Figures, Result
from mgdd.studies.sections import Section, standard_sections

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Progress", "StudyResult", "check_seeds", "finish", "parts_on", "run_parts"]

Progress = Callable[[str], None]
Part = TypeVar("Part")


@dataclass(frozen=True, kw_only=True, repr=False)
class StudyResult(Result):
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
    summary: Figures = field(default_factory=Figures)
    sections: tuple[Section, ...] = ()
    title: str = ""

    def __post_init__(self) -> None:
        if not self.sections:
            object.__setattr__(self, "sections", standard_sections(self.summary, self.figures, self.dataset))

    def _title(self) -> str:
        return f"StudyResult {self.name}" + (f": {self.title}" if self.title else "")

    def _rows(self) -> list[Row]:
        return rows_of(
            {
                "seeds": self.summary.get("seeds"),
                "rows": len(self.summary.get("rows", ())),
                "sections": tuple(section.title for section in self.sections),
                "figures": len(self.figures),
                "dataset": self.dataset,
                "interrupted": bool(self.summary.get("interrupted", False)),
            }
        )


def check_seeds(seeds: int) -> int:
    """Refuse a number of seeds that is none."""
    if seeds < 1:
        raise ParameterError.of("seeds", seeds, ">= 1")
    return seeds


@dataclass
class _Workers:
    pool: Pool
    lost: WorkerLostError | None = None


_workers: ContextVar[_Workers | None] = ContextVar("workers", default=None)


@contextmanager
def parts_on(executor: MakesExecutor | None, workers: int | None) -> Iterator[None]:
    """Let `run_parts` hand the parts to workers; with neither it runs one after the other, each on all cores."""
    if executor is None and workers is None:
        yield
        return
    with Pool(executor, workers) as pool:
        token = _workers.set(_Workers(pool))
        try:
            yield
        finally:
            _workers.reset(token)


def run_parts(parts: Iterable[tuple[str, Callable[[], Part]]], progress: Progress | None) -> tuple[list[Part], bool]:
    """Run the parts of a study; Ctrl-C ends them and keeps what is finished, unless nothing is.

    A part must be picklable, as `functools.partial` of a function at the top level is, and so must what it returns.

    Parameters
    ----------
    parts : iterable of (str, callable)
        What is going on, and the work.
    progress : callable, optional
        Called with that text before each part.

    Returns
    -------
    tuple of list and bool
        What the first parts returned, as many as are finished, and whether Ctrl-C or a lost worker ended them.
    """
    workers = _workers.get()
    if workers is not None:
        return _on_workers(workers, list(parts), progress)
    done: list[Part] = []
    try:
        for text, work in parts:
            if progress is not None:
                progress(text)
            done.append(work())
    except KeyboardInterrupt:
        if not done:  # what the part itself may have kept is not a result of the study
            raise Interrupted("interrupted: nothing was finished") from None
        return done, True
    return done, False


def _on_workers(
    workers: _Workers, parts: Sequence[tuple[str, Callable[[], Part]]], progress: Progress | None
) -> tuple[list[Part], bool]:
    found: dict[int, Part] = {}

    def cut(start: int, _: int) -> tuple[Callable[[], Part]]:
        text, work = parts[start]
        if progress is not None:
            progress(text)
        return (work,)

    def keep(start: int, _: int, part: Part) -> None:
        found[start] = part

    # One part to a chunk; an unbroken row of them is what a study knows how to hand over.
    stop = run_chunks(_call, cut, keep, len(parts), executor=workers.pool, largest=1)
    done = [found[number] for number in takewhile(found.__contains__, range(len(parts)))]
    if stop is not None and not done:
        raise stop
    workers.lost = stop if isinstance(stop, WorkerLostError) else None
    return done, stop is not None


def _call(work: Callable[[], Part]) -> Part:
    return work()


def finish(
    dataset: xr.Dataset, summary: Mapping[str, Any], draw: Callable[[xr.Dataset], Mapping[str, Figure]] | None
) -> StudyResult:
    """Return a whole result; raise one that was cut short as the part of the error that did it."""
    figures = {} if draw is None else draw(dataset)
    result = StudyResult(name=summary["study"], dataset=dataset, figures=figures, summary=Figures(summary))
    workers = _workers.get()
    stop: Interrupted | WorkerLostError | None = None if workers is None else workers.lost
    if stop is None and summary["interrupted"]:
        stop = Interrupted(f"interrupted: {len(summary['rows'])} finished rows are in .partial")
    return hand_over(result, stop)
