"""Figures of the study of model validation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, axis_label
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_LOOKS = {"other loads": ("--", BLUE), "heat release": (":", GREEN), "calibrated": ("-", ORANGE)}
_MARKERS = "osD^"
_COLORS = (BLACK, BLUE, ORANGE, GREEN)
_SPAN_CAD = (-40.0, 80.0)


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw pressures by stage and the spread of the best timing, by caption."""
    law = str(dataset.attrs["shown"])
    return {
        f"Measured pressure and the model ({law}) before and after its calibration": _pressures(dataset),
        "Best CA50 of each calibrated model: 95 % of calibrations to redrawn residuals, the stated 95 % interval "
        "(short bars), and the range over a family of plausible models (grey)": _best(dataset),
    }


def _pressures(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    files = [str(name) for name in dataset["file"].to_numpy()]
    angle = dataset[ANGLE].to_numpy()
    axes = figure.subplots(4, 2, sharex=True, height_ratios=(3.0, 1.2, 3.0, 1.2))
    for at, file in enumerate(files[:4]):
        ax, below = axes[2 * (at // 2), at % 2], axes[2 * (at // 2) + 1, at % 2]
        measured = dataset["measured_bar"][at].to_numpy()
        ax.plot(angle, measured, ".", color=BLACK, markersize=2.5, label="measured")
        for stage, (dash, color) in _LOOKS.items():
            model = dataset["stage_bar"].sel(stage=stage)[at].to_numpy()
            ax.plot(angle, model, dash, color=color, linewidth=1.1, label=stage)
            below.plot(angle, model - measured, dash, color=color, linewidth=1.0)
        below.axhline(0.0, color=GREY, linewidth=0.8)
        ax.set_title(file, loc="left", fontsize="small")
        ax.set_xlim(*_SPAN_CAD)
        for panel in (ax, below):
            panel.grid(alpha=0.3)
        if at % 2 == 0:
            ax.set_ylabel("pressure [bar]")
            below.set_ylabel("model −\nmeasured\n[bar]")
    axes[0, 0].legend(fontsize="small")
    for ax in axes[-1]:
        ax.set_xlabel(axis_label(dataset, ANGLE))
    return figure


def _best(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.4, 4.2), layout="constrained")
    ax = figure.subplots()
    files, laws = ([str(name) for name in dataset[dim].to_numpy()] for dim in ("file", "law"))
    best = dataset["best_ca50_cad"].sel(stage="calibrated").to_numpy()
    redrawn, stated = dataset["redrawn_ca50_cad"].to_numpy(), dataset["stated_sd_cad"].to_numpy()
    for at in range(len(files)):
        low, high = float(dataset["family_low_cad"][at]), float(dataset["family_high_cad"][at])
        ax.fill_between([at - 0.42, at + 0.42], low, high, color=GREY, alpha=0.2, linewidth=0.0)
        for k, law in enumerate(laws):
            x = at + 0.18 * (k - 0.5 * (len(laws) - 1))
            color, marker = _COLORS[k % len(_COLORS)], _MARKERS[k % len(_MARKERS)]
            ends = np.quantile(redrawn[k, at], [0.025, 0.975])
            ax.plot([x, x], ends, color=color, linewidth=1.2)
            half = 1.96 * float(np.median(stated[k, at]))
            ax.plot([x + 0.05] * 2, [best[k, at] - half, best[k, at] + half], color=color, linewidth=3.0, alpha=0.6)
            ax.plot(x, best[k, at], marker, color=color, markersize=5, label=law if at == 0 else None)
    ax.set_xticks(range(len(files)), files, fontsize="small")
    ax.set_ylabel("best CA50 [°CA aTDC]")
    ax.grid(alpha=0.3, axis="y")
    ax.legend(fontsize="small", frameon=False, ncols=2)
    return figure
