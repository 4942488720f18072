"""What a page is made of: sections, verdict and figures, with the data and the numbers behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mgdd.results.describe import Row, rows_of
from mgdd.results.result import Figures, Result

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table as it is printed.

    Parameters
    ----------
    columns : tuple of str
        Heads, each with its unit.
    rows : tuple of tuple of str
        Cells.

    Examples
    --------
    >>> from mgdd.report import Table
    >>> Table(columns=("throttle", "limp-home [deg]"), rows=(("P1", "8"), ("P3", "12"))).rows[1]
    ('P3', '12')
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a report; every part of it may be missing.

    Parameters
    ----------
    title : str
        Its heading.
    text : tuple of str
        Paragraphs.
    items : tuple of str
        A list below them.
    table : Table, optional
        A table below that.
    figures : mapping of str to matplotlib.figure.Figure
        Figures by caption.

    Examples
    --------
    >>> from mgdd.report import Section
    >>> Section(title="Limitations found", items=("NOx is a proxy: read its trend only.",)).table is None
    True
    """

    title: str
    text: tuple[str, ...] = ()
    items: tuple[str, ...] = ()
    table: Table | None = None
    figures: Mapping[str, Figure] = field(default_factory=dict)


def as_number(value: Any, form: str = ".4g") -> str:
    """Print a number; a dash for None and NaN, text as it stands."""
    if value is None or value != value:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return format(value, form) if isinstance(value, float) else str(value)


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
