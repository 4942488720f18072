"""What a task came to: figures, signals, files and drawings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Outcome"]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a task came to.

    Parameters
    ----------
    figures : mapping of str to value
        Numbers and short texts, as JSON holds them.
    dataset : xarray.Dataset
        Signals over time or cycle.
    interrupted : bool
        Whether Ctrl-C cut it.
    files : mapping of str to str
        Further texts by file name, for example a fitted model.
    drawings : mapping of str to callable
        Functions without arguments that draw a figure, by file name without ending.
    """

    figures: Mapping[str, Any]
    dataset: xr.Dataset
    interrupted: bool = False
    files: Mapping[str, str] = field(default_factory=dict)
    drawings: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
