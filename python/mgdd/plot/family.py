"""Every member of a model family: its best timing of one load as a strip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, minus, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mgdd.results.result import Result

_NEEDED = ("free_ca50_cad", "fitted_ca50_cad", "plausible")
_LABEL = "best CA50, no pressure limit [°CA aTDC]"


def family_strip(timing: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw each member's best CA50 without a pressure limit, one row per member, of a load of `best_timing`.

    Filled: plausible; open: not; ringed: the best; band: the range; dashed: burn as measured.
    """
    timing = require("timing", timing, ("member", *_NEEDED), "mgdd.identify.best_timing")
    names = [str(name) for name in timing["member"].to_numpy()]
    if not names:
        raise DataError(f"{timing.attrs.get('file', 'timing')}: no members to draw")
    ax = new_axes(ax, height=0.24 * len(names) + 1.2)
    rows, chosen = np.arange(len(names)), timing.attrs.get("best")
    best, kept = timing["free_ca50_cad"].to_numpy(), timing["plausible"].to_numpy().astype(bool)
    if chosen:
        ends = ("free_ca50_low_cad", best[kept].min()), ("free_ca50_high_cad", best[kept].max())
        low, high = (float(timing.attrs.get(name, end)) for name, end in ends)
        ax.axvspan(low, high, color=ORANGE, alpha=0.15, linewidth=0, label=minus(f"plausible: {low:.1f} to {high:.1f}"))
        at = names.index(chosen)
        measured = float(timing["fitted_ca50_cad"][at])
        ax.axvline(measured, color=BLUE, linestyle="--", linewidth=1.0, label=minus(f"as measured: {measured:.1f}"))
    ax.plot(best[~kept], rows[~kept], "o", color=GREY, markerfacecolor="none", markersize=4, label="not plausible")
    ax.plot(best[kept], rows[kept], "o", color=BLACK, markersize=4.5)
    if chosen:
        label = minus(f"best member: {best[at]:.1f}")
        ax.plot(
            best[at], at, "o", color=ORANGE, markerfacecolor="none", markersize=10, markeredgewidth=1.8, label=label
        )
    ax.set_yticks(rows, names, fontsize="x-small")
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
