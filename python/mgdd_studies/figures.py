"""Shapes that the figures of several studies share: bands over seeds, panels of estimates, numbered planes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.plot.style import new_figure
from mgdd_studies.curves import convergence

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = ["band", "convergence_panels", "grey_band", "legend_outside", "names_of", "numbered_plane"]


def names_of(dataset: xr.Dataset, name: str) -> list[str]:
    """List the texts of a variable."""
    return [str(text) for text in dataset[name].to_numpy()]


def legend_outside(figure: Figure, ax: Axes, columns: int, *, at: str = "upper", size: str | None = "small") -> None:
    """Put one legend of what these axes show above or below all panels."""
    place: Any = f"outside {at} center"
    figure.legend(*ax.get_legend_handles_labels(), loc=place, ncols=columns, frameon=False, fontsize=size)


def band(
    ax: Axes, over: Any, low: Any, middle: Any, high: Any, *, dash: Any, color: str, alpha: float = 0.15,
    linewidth: float | None = None, label: str | None = None,
) -> list[Line2D]:  # fmt: skip
    """Draw a line and the band about it."""
    ax.fill_between(over, low, high, color=color, alpha=alpha, linewidth=0.0)
    return ax.plot(over, middle, linestyle=dash, color=color, linewidth=linewidth, label=label)


def grey_band(ax: Axes, over: Any, low: Any, middle: Any, high: Any, *, linewidth: float | None = None) -> None:
    """Draw the median error of the seeds in a grey band, over all cycles."""
    ax.fill_between(over, low, high, color="0.8", linewidth=0.0)
    ax.plot(over, middle, color="black", linewidth=linewidth)
    ax.axhline(0.0, color="0.4", linewidth=0.8)
    ax.set_xlim(0, len(over))
    ax.grid(alpha=0.3)


def convergence_panels(panels: Sequence[tuple[str, xr.Dataset]], *, height: float) -> Figure:
    """Draw estimates over cycles in panels of a title each, four to a row, in a figure of that height [inch]."""
    columns = 4
    figure = new_figure(11.0, height)
    axes = figure.subplots(-(-len(panels) // columns), columns, sharex=True, sharey=True, squeeze=False)
    for place, (ax, (title, tracks)) in enumerate(zip(axes.flat, panels, strict=False)):
        convergence(tracks, ax=ax)
        ax.get_legend().remove()
        ax.set_title(title, loc="left", fontsize="small")
        ax.set(xlabel="", ylabel="")
        ax.tick_params(labelbottom=place + columns >= len(panels))
    for ax in axes.flat[len(panels) :]:
        ax.remove()
    figure.supylabel("estimate of the best timing [°CA aTDC]", fontsize="medium")
    figure.supxlabel("engine cycle [-]", fontsize="medium")
    return figure


def numbered_plane(
    ax: Axes, speeds: Any, fuels: Any, values: Any, *, numbers: Any, white: Any, cmap: str, span: tuple[float, float]
) -> Any:
    """Colour cells by values of shape (speeds, fuels), write numbers into them, some in white, and give the mesh.

    The colour map ends at the values of `span`.
    """
    mesh = ax.pcolormesh(speeds, fuels, values.T, cmap=cmap, vmin=span[0], vmax=span[1], shading="nearest")
    for i, j in np.ndindex(*values.shape):
        color = "white" if white[i, j] else "black"
        ax.text(speeds[i], fuels[j], f"{numbers[i, j]:z.2f}", ha="center", va="center", fontsize=6.0, color=color)
    return mesh
