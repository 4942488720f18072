"""Error over trials of iterative learning."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import LINE_STYLES, finished, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

_MARKERS = "osv^D"


def learning(learned: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw how the error of a repeated task falls from trial to trial, one line per learning law."""
    learned = require("learned", learned, ("law", "trial", "ca50_error_cad"), "the study seeker-comparison")
    ax = new_axes(ax)
    error = learned["ca50_error_cad"].transpose("law", "trial").to_numpy()
    lines: list[Line2D] = []
    for index, law in enumerate(learned["law"].to_numpy()):
        dash, color = LINE_STYLES[index % len(LINE_STYLES)]
        lines += ax.semilogy(
            learned["trial"], error[index], linestyle=dash, color=color, marker=_MARKERS[index % len(_MARKERS)],
            markersize=4, label=str(law),
        )  # fmt: skip
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter("{x:g}")
    ax.grid(alpha=0.3, which="both")
    return finished(ax, learned, "trial", "ca50_error_cad", lines, columns=3, grid=False)
