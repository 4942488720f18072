"""Figures of the study of the ignition delay."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import GREY, LINE_STYLES, axis_label, legend

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

__all__ = ["draw"]

_LATEST_CAD, _EARLIEST_CAD = 12.0, -40.0
_MAPPED = ("Wolfer", "Hardenberg-Hase", "polynomial of 1500 rpm", "constant of 1500 rpm")
_SHOWN = ("Watson", "Hardenberg-Hase", "polynomial of 1500 rpm", "no delay")


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the delays, the errors over the plane, and the runs, by caption."""
    out = {
        "Ignition delay over the start of injection at 1500 rpm, three correlations": _delays(dataset),
        "Error of the told injection where Watson's correlation is true; the numbers are J lost [points] with the trim "
        "of 1500 rpm and 20 mg": _plane(dataset),
    }
    if "run" in dataset:
        out["Start and step by wrong correlations: median of the estimate, and J lost per cycle"] = _runs(dataset)
    return out


def _delays(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.6, 3.9), layout="constrained")
    ax = figure.subplots()
    own = dataset.sel(soi_cad=slice(_EARLIEST_CAD, _LATEST_CAD))
    lines = []
    for at, law in enumerate(map(str, own["law"].to_numpy())):
        dash, color = LINE_STYLES[at]
        lines += ax.plot(own["soi_cad"], own["delay_cad"][at], linestyle=dash, color=color, label=law)
    ax.set(xlabel=axis_label(dataset, "soi_cad"), ylabel=axis_label(dataset, "delay_cad"), ylim=(0.0, 25.0))
    ax.grid(alpha=0.3)
    legend(ax, lines, columns=3)
    return figure


def _plane(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    pairs = [str(name) for name in dataset["pair"].to_numpy()]
    wanted = [f"Watson, told {name}" for name in _MAPPED]
    shown = [pairs.index(name) for name in wanted if name in pairs]
    figure = Figure(figsize=(12.5, 3.8), layout="constrained")
    axes = figure.subplots(1, max(len(shown), 1), sharey=True, squeeze=False)[0]
    speeds, fuels = dataset["speed_rpm"].to_numpy(), dataset["fuel_mg"].to_numpy()
    for ax, at in zip(axes, shown, strict=False):
        error = dataset["soi_error_cad"][at].to_numpy()
        mesh = ax.pcolormesh(speeds, fuels, error.T, cmap="RdBu_r", vmin=-15.0, vmax=15.0, shading="nearest")
        left = dataset["lost_trimmed"][at].to_numpy()
        for i, j in np.ndindex(*error.shape):
            color = "white" if abs(error[i, j]) > 9.0 else "black"
            ax.text(speeds[i], fuels[j], f"{left[i, j]:z.2f}", ha="center", va="center", fontsize=6.0, color=color)
        ax.set_title(pairs[at].partition("told ")[2], loc="left", fontsize="small")
        ax.set_xlabel("speed [rpm]")
    axes[0].set_ylabel("fuel [mg]")
    if shown:
        figure.colorbar(mesh, ax=list(axes), extend="both", label="told less right SOI [°CA]")
    return figure


def _runs(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    runs = [str(name) for name in dataset["run"].to_numpy()]
    cycle = dataset["cycle"].to_numpy()
    lines: list[Artist] = []
    for column, form in enumerate(("feed-forward", "curve")):
        above, below = axes[0, column], axes[1, column]
        for at, name in enumerate(_SHOWN):
            if f"{form}, {name}" not in runs:
                continue
            own = dataset.isel(run=runs.index(f"{form}, {name}"))
            dash, color = LINE_STYLES[at]
            line = above.plot(cycle, own["estimate_median_cad"], linestyle=dash, color=color, label=f"told {name}")
            lines += line if column == 0 else []
            below.plot(own["middle_cycle"], own["mean_lost"], linestyle=dash, color=color)
        best = above.plot(cycle, dataset["optimum_cad"], color=GREY, linewidth=1.0, label="right SOI")
        lines += best if column == 0 else []
        above.set_title(form, loc="left", fontsize="small")
        below.set(xlabel="engine cycle [-]", yscale="log")
    axes[0, 0].set_ylabel("estimate of the best SOI\n[°CA aTDC]")
    axes[1, 0].set_ylabel("J lost per cycle [points]")
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    figure.legend(
        lines,
        [str(line.get_label()) for line in lines],
        loc="outside upper center",
        ncols=5,
        fontsize="small",
        frameon=False,
    )
    return figure
