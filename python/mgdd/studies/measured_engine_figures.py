"""Figures of the study on the measured hydrogen-diesel engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import BLACK, GREY, LINE_STYLES, axis_label, legend, minus

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_MARKS = "osD^v"


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the figures of the study by caption; nothing is registered with pyplot."""
    return {
        "Estimates, median of the seeds; the band holds 80 % of the batch seeker's, dotted: end of the records": (
            _trajectories(dataset)
        ),
        "Where the seekers end: mean with its 95 % interval, below it each seed; dashed: optimum of the surrogate, "
        "dotted: end of the records": _ends(dataset),
    }


def _groups(dataset: xr.Dataset) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for at, name in enumerate(dataset["objective"].to_numpy()):
        groups.setdefault(str(name), []).append(at)
    return groups


def _styles(dataset: xr.Dataset) -> dict[str, int]:
    return {name: at for at, name in enumerate(dict.fromkeys(map(str, dataset["seeker"].to_numpy())))}


def _trajectories(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    groups, styles = _groups(dataset), _styles(dataset)
    figure = Figure(figsize=(8.0, 3.4 * len(groups)), layout="constrained")
    panels = figure.subplots(len(groups), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    cycle = dataset["cycle"]
    for ax, (objective, cases) in zip(panels, groups.items(), strict=True):
        lines = []
        for at in cases:
            one = dataset.isel(case=at)
            seeker = str(one["seeker"].item())
            dash, color = LINE_STYLES[styles[seeker] % len(LINE_STYLES)]
            lines += ax.plot(cycle, one["estimate_median_cad"], linestyle=dash, color=color, label=seeker)
            if at == cases[0]:
                low, high = one["estimate_low_cad"], one["estimate_high_cad"]
                ax.fill_between(cycle, low, high, color=color, alpha=0.15, linewidth=0.0)
        best = float(dataset["optimum_soi_cad"][cases[0]])
        line = ax.axhline(best, color=GREY, linewidth=1.0, label=minus(f"optimum of the surrogate: {best:.1f}"))
        for edge in ("supported_low_cad", "supported_high_cad"):
            ax.axhline(float(dataset[edge][cases[0]]), color=GREY, linewidth=0.8, linestyle=":")
        ax.annotate(minus(objective), (0.99, 0.95), xycoords="axes fraction", ha="right", va="top")
        ax.set_ylabel("start of injection [°CA aTDC]")
        legend(ax, [*lines, line], columns=6)
    panels[-1].set_xlabel(axis_label(dataset, "cycle"))
    return figure


def _ends(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    groups, styles = _groups(dataset), _styles(dataset)
    figure = Figure(figsize=(8.0, 0.42 * dataset.sizes["case"] + 1.2), layout="constrained")
    ax = figure.add_subplot()
    rows: list[str] = []
    for objective, cases in groups.items():
        best = float(dataset["optimum_soi_cad"][cases[0]])
        top = len(rows) - 0.4
        for at in cases:
            one = dataset.isel(case=at)
            seeker, place = str(one["seeker"].item()), len(rows)
            color = LINE_STYLES[styles[seeker] % len(LINE_STYLES)][1]
            each = one["final_soi_cad"].to_numpy()
            ax.plot(each, np.full(each.size, place + 0.28), ".", color=color, markersize=3)
            half = float(np.nan_to_num(one["final_soi_interval_cad"]))
            mark = _MARKS[styles[seeker] % len(_MARKS)]
            ax.errorbar(each.mean(), place, xerr=half, fmt=mark, color=color, capsize=4, markersize=6)
            rows.append(minus(f"{objective}: {seeker}"))
        ax.vlines(best, top, len(rows) - 0.6, color=BLACK, linestyle="--", linewidth=1.0)
    for edge in ("supported_low_cad", "supported_high_cad"):
        ax.axvline(float(dataset[edge][0]), color=GREY, linewidth=0.8, linestyle=":")
    ax.set_yticks(range(len(rows)), rows)
    ax.invert_yaxis()
    ax.set_xlabel("final start of injection [°CA aTDC]")
    return figure
