"""Figures of the study `seekers-several-inputs`: loss by map, paths in the plane, limits on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, LINE_STYLES, ORANGE, new_figure
from mgdd_studies.figures import legend_outside, names_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_MARKS = (("o", BLACK), ("D", BLUE), ("s", BLUE), ("X", BLUE), ("^", ORANGE), ("v", GREEN))
_LEVELS = (0.06, 0.3, 1.0, 3.0, 10.0, 30.0)


_SAID = {
    "j_lost": "Loss per cycle by what was applied, without its noise: mean over seeds with its 95 % interval",
    "path": (
        "One run on the coupled map: inputs applied in the first cycles, and the estimate; contours of the "
        "loss [points], the innermost what counts as near"
    ),
    "bench_seeker": (
        "Limits on the bench by what was applied, without noise: medians of the seeds, and the band that holds 80 % of "
        "them for the first"
    ),
}


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw what the dataset of the study has, by caption."""
    made = {"j_lost": _losses, "path": _paths, "bench_seeker": _limits}
    return {_SAID[name]: figure_of(dataset) for name, figure_of in made.items() if name in dataset}


def _losses(dataset: xr.Dataset) -> Figure:
    from matplotlib.ticker import LogLocator

    figure = new_figure(8.0, 3.6)
    ax = figure.add_subplot()
    names, places = (list(dict.fromkeys(names_of(dataset, key))) for key in ("seeker", "map"))
    for at, (name, (mark, color)) in enumerate(zip(names, _MARKS, strict=False)):
        own = dataset.isel(case=np.flatnonzero(dataset["seeker"].to_numpy() == name))
        x = np.array([places.index(place) for place in names_of(own, "map")]) + 0.13 * (at - 2.5)
        middle = own["j_lost"].to_numpy()
        ends = np.nan_to_num([middle - own["j_lost_low"], own["j_lost_high"] - middle])
        ax.errorbar(x, middle, yerr=ends, fmt=mark, color=color, capsize=3, markersize=5, label=name)
    ax.set_xticks(range(len(places)), places)
    ax.set(xlabel="map", ylabel="loss of the objective per cycle [points]", yscale="log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.minorticks_off()
    ax.grid(axis="y", alpha=0.3)
    legend_outside(figure, ax, 3)
    return figure


def _paths(dataset: xr.Dataset) -> Figure:
    names = names_of(dataset, "path")
    figure = new_figure(8.0, 6.6)
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    soc, egr, lost = (dataset[name].to_numpy() for name in ("map_soc_cad", "map_egr", "map_j_lost"))
    best = np.unravel_index(lost.argmin(), lost.shape)
    for ax, name in zip(grid.flat, names, strict=False):
        own = dataset.sel(path=name)
        lines = ax.contour(soc, egr, lost.T, _LEVELS, colors=GREY, linewidths=0.8)
        ax.clabel(lines, fmt="%g", fontsize="x-small")
        ax.plot(own["applied_soc_cad"], own["applied_egr"], ".", color=BLUE, markersize=5, label="applied")
        ax.plot(own["estimate_soc_cad"], own["estimate_egr"], "-", color=ORANGE, linewidth=1.4, label="estimate")
        ax.plot(own["estimate_soc_cad"][0], own["estimate_egr"][0], "s", color=BLACK, label="start")
        ax.plot(soc[best[0]], egr[best[1]], "*", color=BLACK, markersize=10, label="best input")
        ax.set_title(name, loc="left", fontsize="small")
    for ax in grid[-1]:
        ax.set_xlabel("timing [°CA aTDC]")
    for ax in grid[:, 0]:
        ax.set_ylabel("EGR rate [-]")
    legend_outside(figure, grid.flat[0], 4)
    return figure


def _limits(dataset: xr.Dataset) -> Figure:
    figure = new_figure(8.0, 5.0)
    panels = figure.subplots(2, 1, sharex=True)
    cycle = dataset["bench_cycle"].to_numpy()
    for ax, name, unit, text in zip(
        panels, ("p_max", "nox_fast"), ("bar", "ppm"), ("maximum pressure [bar]", "NOx [ppm]"), strict=True
    ):
        for seeker, (dash, color) in zip(names_of(dataset, "bench_seeker"), LINE_STYLES, strict=False):
            own = dataset.sel(bench_seeker=seeker)
            low, middle, high = (own[f"applied_{name}_{end}_{unit}"].to_numpy() for end in ("low", "median", "high"))
            if color == BLACK:
                ax.fill_between(cycle, low, high, color=color, alpha=0.2, linewidth=0.0)
            ax.plot(cycle, middle, linestyle=dash, color=color, linewidth=1.2, label=seeker)
        ax.axhline(float(dataset[f"upper_{name}_{unit}"]), color=BLACK, linewidth=0.8, label="limit")
        ax.set_ylabel(text)
        ax.grid(alpha=0.3)
    panels[-1].set(xlabel="engine cycle [-]", xlim=(0, cycle[-1]))
    legend_outside(figure, panels[0], 3)
    return figure
