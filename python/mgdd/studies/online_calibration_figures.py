"""Figures of the study of online calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, minus
from mgdd.studies.statistics import mean_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_LOOKS = (("-", BLACK, "o"), ("--", BLUE, "s"), ("-.", ORANGE, "^"), (":", ORANGE, "v"), ("-", GREEN, "D"))
_NEAR_PERCENT, _SURE_PERCENT, _SHOWN = 3.0, 50.0, 80


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the wall heat over cycles by noise, and what errors of the sensor do to it, by caption."""
    sensors = list(dict.fromkeys(str(name) for name in dataset["sensor"].to_numpy()))
    noises = [name for name in sensors if "noise" in name or name == "clean"]
    errors = [name for name in sensors if name not in noises]
    out = {
        "Wall heat of the guide over cycles: median of the seeds, and the band that holds 80 % of them": _approach(
            dataset, noises
        )
    }
    if errors:
        out[
            "Error of the wall heat after 150 cycles: mean, and the range that holds 95 % of the seeds; filled where "
            "the verdict is determined in most runs"
        ] = _errors(dataset, errors)
    return out


def _ways(dataset: xr.Dataset) -> list[str]:
    return list(dict.fromkeys(str(name) for name in dataset["way"].to_numpy()))


def _approach(dataset: xr.Dataset, sensors: list[str]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.0 * len(sensors), 4.4), layout="constrained")
    true = float(dataset["true_scale"])
    cycle = dataset["cycle"].to_numpy()
    axes = figure.subplots(1, len(sensors), sharey=True, squeeze=False)[0]
    for ax, sensor in zip(axes, sensors, strict=True):
        for way, (dash, color, _) in zip(_ways(dataset), _LOOKS, strict=True):
            found = np.flatnonzero((dataset["sensor"] == sensor) & (dataset["way"] == way))
            if found.size:
                own = dataset.isel(run=int(found[0]))
                ax.fill_between(cycle, own["scale_low"], own["scale_high"], color=color, alpha=0.15, linewidth=0.0)
                ax.plot(cycle, own["scale_median"], linestyle=dash, color=color, linewidth=1.3, label=way)
        near = 0.01 * _NEAR_PERCENT * true
        ax.axhspan(true - near, true + near, color=GREY, alpha=0.25, linewidth=0.0, label="truth ± 3 %")
        ax.set_title(sensor, loc="left", fontsize="small")
        ax.set(xlim=(1, _SHOWN), ylim=(0.35, 1.05))
        ax.grid(alpha=0.3)
    figure.supxlabel("cycles since the start [-]", fontsize="medium")
    axes[0].set_ylabel("wall heat over the textbook law [-]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False, fontsize="small")
    return figure


def _errors(dataset: xr.Dataset, sensors: list[str]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 4.8), layout="constrained")
    ax = figure.subplots()
    true, ways = float(dataset["true_scale"]), _ways(dataset)
    rows = np.arange(len(sensors))[::-1]
    for at, (way, (_, color, marker)) in enumerate(zip(ways, _LOOKS, strict=True)):
        for row, sensor in zip(rows, sensors, strict=True):
            found = np.flatnonzero((dataset["sensor"] == sensor) & (dataset["way"] == way))
            if not found.size:
                continue
            own = dataset.isel(run=int(found[0]))
            error = 100.0 * (own["final_scale"].to_numpy() / true - 1.0)
            sure = 100.0 * float(own["final_determined"].mean()) >= _SURE_PERCENT
            height = row + 0.3 - 0.15 * at
            ax.plot(np.quantile(error, [0.025, 0.975]), [height, height], "-", color=color, linewidth=1.2)
            ax.plot(
                mean_interval(error)[0], height, marker, color=color, markersize=5.0,
                markerfacecolor=color if sure else "white", label=way if row == rows[0] else None,
            )  # fmt: skip
    ax.axvspan(-5.0, 5.0, color=GREY, alpha=0.18, linewidth=0.0, label=minus("within 5 %"))
    ax.axvline(0.0, color=GREY, linewidth=0.8)
    ax.set_yticks(rows, [name.replace("CAD", "°CA") for name in sensors])
    ax.set_xlabel("error of the wall heat [%]")
    ax.grid(alpha=0.3, axis="x")
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, frameon=False, fontsize="small")
    return figure
