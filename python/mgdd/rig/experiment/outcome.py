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
    """What a task came to."""

    figures: Mapping[str, Any]  # numbers and short texts, as JSON holds them
    dataset: xr.Dataset
    interrupted: bool = False  # whether Ctrl-C cut it
    files: Mapping[str, str] = field(default_factory=dict)  # further texts by file name, as a fitted model
    drawings: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)  # by file name without ending
