"""Every member of a model family: its best timing of one load as a strip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, minus, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["family_strip", "family_strips"]

_LABEL = "best CA50, no pressure limit [°CA aTDC]"


def family_strip(timing: Any, *, ax: Axes | None = None) -> Axes:
    """Draw each member's best CA50 without a pressure limit, one row per member.

    Parameters
    ----------
    timing : BestTiming
        One load of `mgdd.identify.best_timing`.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        Filled: plausible; open: not; ringed: the best; band: range of the plausible ones; dashed: burn as measured.

    Raises
    ------
    DataError
        No members.

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import ModelFamily, best_timing
    >>> from mgdd.plot.family import family_strip
    >>> family = ModelFamily(burn_shapes=["double_wiebe"], gammas=[("linear", 1.40)], wall_heat_scales=[1.0])
    >>> cylinder = presets.load("hd_diesel_128x144").cylinder
    >>> row = best_timing(datasets.load("hd_diesel_128x144"), cylinder, family=family)[1]
    >>> family_strip(row).get_xlabel()
    'best CA50, no pressure limit [°CA aTDC]'
    """
    if not timing.members:
        raise DataError(f"{timing.file}: no members to draw")
    ax = new_axes(ax, height=0.24 * len(timing.members) + 1.2)
    rows = np.arange(len(timing.members))
    best = np.array([member.free_ca50_cad for member in timing.members])
    kept = np.array([member.plausible for member in timing.members])
    if timing.best is not None:
        low, high = timing.free_ca50_cad
        ax.axvspan(low, high, color=ORANGE, alpha=0.15, linewidth=0, label=minus(f"plausible: {low:.1f} to {high:.1f}"))
        measured = timing.best.fitted_ca50_cad
        ax.axvline(measured, color=BLUE, linestyle="--", linewidth=1.0, label=minus(f"as measured: {measured:.1f}"))
    ax.plot(best[~kept], rows[~kept], "o", color=GREY, markerfacecolor="none", markersize=4, label="not plausible")
    ax.plot(best[kept], rows[kept], "o", color=BLACK, markersize=4.5)
    if timing.best is not None:
        at = timing.members.index(timing.best)
        label = minus(f"best member: {best[at]:.1f}")
        ax.plot(
            best[at], at, "o", color=ORANGE, markerfacecolor="none", markersize=10, markeredgewidth=1.8, label=label
        )
    ax.set_yticks(rows, [member.member.name for member in timing.members], fontsize="x-small")
    ax.set_ylim(rows[-1] + 0.7, -0.7)
    ax.set_xlabel(_LABEL)
    ax.grid(axis="x", alpha=0.3)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize="small")
    return ax


def family_strips(rows: Sequence[Any]) -> Figure:
    """Draw one strip per load, side by side over one list of members."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 + 2.9 * len(rows), 0.21 * len(rows[0].members) + 2.3), layout="constrained")
    panels = figure.subplots(1, len(rows), sharex=True, sharey=True, squeeze=False)[0]
    for ax, row in zip(panels, rows, strict=True):
        family_strip(row, ax=ax)
        ax.set_xlabel(f"{row.file}\n{_LABEL.replace(', no', ',' + chr(10) + 'no')}", fontsize="small")
    return figure
