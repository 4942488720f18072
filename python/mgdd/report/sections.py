"""Sections of a report: text, list, table and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
