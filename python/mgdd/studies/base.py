"""What a study hands back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["StudyResult"]


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
        Plain numbers and text, ready for JSON.

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
