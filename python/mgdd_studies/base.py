"""What a study hands back, and how all of them run: part by part, with an end by Ctrl-C that keeps the finished."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import takewhile
from typing import TYPE_CHECKING, Any, TypeVar

from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.parallel.chunks import run_chunks
from mgdd.parallel.finished import hand_over
from mgdd.parallel.pool import MakesExecutor, Pool
from mgdd.report import Report
from mgdd.results.labels import to_jsonable
from mgdd.results.result import Figures
from mgdd_studies.sections import standard_sections
from mgdd_studies.titles import STUDIES
from mgdd_studies.verdicts import verdict_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Parts", "Progress", "StudyResult", "check_seeds", "parts_on", "silent"]

Progress = Callable[[str], None]
Part = TypeVar("Part")


@dataclass(frozen=True, kw_only=True, repr=False)
class StudyResult(Report):
    """What a study ends in: a report, of which `mgdd.report.write_report` makes a page.

    Parameters
    ----------
    name, dataset, figures, title
        As of `mgdd.report.Report`; the heading of the page is the title in `available_studies` if left out.
    summary : mapping
        Plain numbers and text, ready for JSON: at least ``study``, ``seeds`` (0 where nothing is random) and ``rows``,
        a list of flat mappings; ``interrupted`` is true in the part that `mgdd.errors.Interrupted` carries. The verdict
        joins it.
    sections : tuple of Section
        As of `mgdd.report.Report`; made of the summary, the figures and the dataset where the study writes none itself.
    verdict : tuple of str
        The answer in a sentence or a few, with which a report begins; made of the summary where the study is one of
        `available_studies`.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> result = run_study("measured-traces")
    >>> len(result.summary["traces"])
    4
    """

    def __post_init__(self) -> None:
        if not self.verdict:
            object.__setattr__(self, "verdict", verdict_of(self.name, self.summary))
        super().__post_init__()
        if not self.sections:
            object.__setattr__(self, "sections", standard_sections(self.summary, self.figures, self.dataset))

    @property
    def heading(self) -> str:
        """What stands above the page."""
        title = self.title or (STUDIES[self.name].title if self.name in STUDIES else self.name)
        return title[:1].upper() + title[1:]

    @property
    def made_by(self) -> str:
        """What the page names as its maker."""
        return f"study {self.name}"


def check_seeds(n_seeds: int, *, quick: bool = False, most: int = 1) -> int:
    """Refuse a number of seeds that is none; a quick study takes `most` at the most."""
    if n_seeds < 1:
        raise ParameterError.of("n_seeds", n_seeds, ">= 1")
    return min(n_seeds, most) if quick else n_seeds


@dataclass
class _Workers:
    pool: Pool
    lost: WorkerLostError | None = None


_workers: ContextVar[_Workers | None] = ContextVar("workers", default=None)


@contextmanager
def parts_on(executor: MakesExecutor | None, workers: int | None) -> Iterator[None]:
    """Let `Parts` hand the parts to workers; with neither it runs one after the other, each on all cores."""
    if executor is None and workers is None:
        yield
        return
    with Pool(executor, workers) as pool:
        token = _workers.set(_Workers(pool))
        try:
            yield
        finally:
            _workers.reset(token)


class Parts:
    """Run the parts of a study, group by group; Ctrl-C or a lost worker ends them and keeps what is finished.

    Parameters
    ----------
    progress : callable, optional
        Called with a short text before each part.

    Attributes
    ----------
    progress : callable
        The same, or one that does nothing.
    interrupted : bool
        Whether Ctrl-C or a lost worker ended them; every later group is empty.
    """

    def __init__(self, progress: Progress | None) -> None:
        self.interrupted = False
        self.progress = progress or silent
        self._any = False

    def __call__(self, parts: Iterable[tuple[str, Callable[[], Part]]]) -> list[Part]:
        """Return what the first parts of a group returned, as many as are finished.

        Parameters
        ----------
        parts : iterable of (str, callable)
            What is going on, and the work. It must be picklable, as `functools.partial` of a function at the top level
            is, and so must what it returns. Nothing is read of it where an earlier group was interrupted.

        Raises
        ------
        mgdd.errors.Interrupted, mgdd.errors.WorkerLostError
            Nothing of this group or an earlier one is finished.
        """
        if self.interrupted:
            return []
        workers = _workers.get()
        done, stop = _one_by_one(parts, self.progress) if workers is None else _on(workers, list(parts), self.progress)
        self.interrupted = stop is not None
        self._any = self._any or bool(done)
        if stop is not None and not self._any:  # what the part itself may have kept is not a result of the study
            raise stop
        return done

    def finish(
        self,
        name: str,
        dataset: xr.Dataset,
        draw: Callable[[xr.Dataset], Mapping[str, Figure]] | None,
        **summary: Any,
    ) -> StudyResult:
        """Return a whole result; raise one that was cut short as the part of the error that did it.

        `draw` makes the figures of the dataset by caption; the summary has at least ``seeds`` and ``rows``.
        """
        figures: Mapping[str, Figure] = {}
        undrawn = False
        try:
            figures = {} if draw is None else draw(dataset)
        except KeyboardInterrupt:
            undrawn = True
        plain = to_jsonable({"study": name, **summary, "interrupted": self.interrupted})
        result = StudyResult(name=name, dataset=dataset, figures=figures, summary=Figures(plain))
        workers = _workers.get()
        stop: Interrupted | WorkerLostError | None = None if workers is None else workers.lost
        if undrawn:
            stop = Interrupted(f"interrupted while it drew: all {len(plain['rows'])} rows are in .partial")
        elif stop is None and self.interrupted:
            stop = Interrupted(f"interrupted: {len(plain['rows'])} finished rows are in .partial")
        return hand_over(result, stop)


def silent(_: str) -> None:
    """Take no notice of progress."""


def _one_by_one(
    parts: Iterable[tuple[str, Callable[[], Part]]], progress: Progress
) -> tuple[list[Part], Interrupted | None]:
    done: list[Part] = []
    try:
        for text, work in parts:
            progress(text)
            done.append(work())
    except KeyboardInterrupt:
        return done, Interrupted("interrupted: nothing was finished")
    return done, None


def _on(
    workers: _Workers, parts: Sequence[tuple[str, Callable[[], Part]]], progress: Progress
) -> tuple[list[Part], Interrupted | WorkerLostError | None]:
    found: dict[int, Part] = {}

    def cut(start: int, _: int) -> tuple[Callable[[], Part]]:
        text, work = parts[start]
        progress(text)
        return (work,)

    def keep(start: int, _: int, part: Part) -> None:
        found[start] = part

    # One part to a chunk; an unbroken row of them is what a study knows how to hand over.
    stop = run_chunks(_call, cut, keep, len(parts), executor=workers.pool, largest=1)
    workers.lost = stop if isinstance(stop, WorkerLostError) else None
    return [found[number] for number in takewhile(found.__contains__, range(len(parts)))], stop


def _call(work: Callable[[], Part]) -> Part:
    return work()
