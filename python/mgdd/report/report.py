"""What a page is made of: sections, verdict and figures, with the data and the numbers behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mgdd.report.sections import Section
from mgdd.results.describe import Row, rows_of
from mgdd.results.result import Figures, Result

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True, repr=False)
class Report(Result):
    """A finished piece of work that `mgdd.report.write_report` makes a page of.

    Parameters
    ----------
    name : str
        What was done; the page names it beside its date.
    dataset : xarray.Dataset
        Its table, with units on every variable.
    figures : mapping of str to matplotlib.figure.Figure
        Figures by caption.
    summary : mapping
        Plain numbers and text, ready for JSON; ``interrupted`` is true in the part that `mgdd.errors.Interrupted`
        carries. The verdict joins it.
    sections : tuple of Section
        What the page states, in order; those with figures stand first.
    title : str
        Heading of the page; the name if left out.
    verdict : tuple of str
        The answer in a sentence or a few, with which the page begins.

    Examples
    --------
    >>> from mgdd.engine import simulate
    >>> from mgdd.report import Report, Section
    >>> report = Report(
    ...     name="one cycle",
    ...     dataset=simulate("puma_single"),
    ...     summary={"imep_gross_bar": 4.3},
    ...     sections=(Section(title="Note", text=("A cycle without misfire.",)),),
    ...     verdict=("The engine runs.",),
    ... )
    >>> report.summary["verdict"]
    ['The engine runs.']
    """

    name: str
    dataset: xr.Dataset
    figures: Mapping[str, Figure] = field(default_factory=dict)
    summary: Figures = field(default_factory=Figures)
    sections: tuple[Section, ...] = ()
    title: str = ""
    verdict: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "summary", Figures({**self.summary, "verdict": list(self.verdict)}))

    @property
    def heading(self) -> str:
        """What stands above the page."""
        return self.title or self.name

    @property
    def made_by(self) -> str:
        """What the page names as its maker."""
        return self.name

    def _title(self) -> str:
        return f"{type(self).__name__} {self.name}" + (f": {self.title}" if self.title else "")

    def _rows(self) -> list[Row]:
        return rows_of(
            {
                "verdict": self.verdict,
                "seeds": self.summary.get("seeds"),
                "rows": len(self.summary.get("rows", ())),
                "sections": tuple(section.title for section in self.sections),
                "figures": len(self.figures),
                "dataset": self.dataset,
                "interrupted": bool(self.summary.get("interrupted", False)),
            }
        )
