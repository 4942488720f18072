"""Figures of the study of guided transients."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_SHOWN = (
    ("unguided", "-", BLACK), ("feed-forward, wall heat +30 %", "--", BLUE), ("curve, wall heat +30 %", "-", ORANGE),
)  # fmt: skip


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the sequence (timing, loss, speed and load) and the cost over the plane, by caption."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    timing, loss, point = figure.subplots(3, 1, sharex=True, height_ratios=(2.2, 1.6, 1.0))
    cycle = dataset["cycle"].to_numpy()
    runs = [str(name) for name in dataset["run"].to_numpy()]
    for name, dash, color in _SHOWN:
        if name in runs:
            own = dataset.sel(run=name)
            timing.plot(cycle, own["estimate_cad"], dash, color=color, linewidth=1.1, label=name)
            middle = own["middle_cycle"].to_numpy()
            loss.fill_between(middle, own["lost_per_100_low"], own["lost_per_100_high"], color=color, alpha=0.2, lw=0.0)
            loss.plot(middle, own["lost_per_100"], dash, color=color, linewidth=1.1)
    timing.plot(cycle, dataset["optimum_cad"], ":", color=GREY, linewidth=1.4, label="optimum")
    timing.set(ylabel="estimate of the best\ntiming [°CA aTDC]", ylim=(-20.5, 2.0))
    timing.legend(ncols=2, fontsize="small", loc="lower right")
    loss.set(ylabel="J lost per 100 cycles\n[points × cycles]", yscale="log")
    point.plot(cycle, dataset["speed_rpm"], "-", color=BLACK)
    point.set(ylabel="speed [rpm]", xlabel="engine cycle [-]", xlim=(0, cycle.size))
    fuel = point.twinx()
    fuel.plot(cycle, dataset["fuel_mg"], "--", color=BLUE)
    fuel.set_ylabel("fuel [mg], dashed")
    for ax in (timing, loss, point):
        ax.grid(alpha=0.3)
    out = {"A sequence of twelve operating points: medians of the estimate, loss with its 95 % interval": figure}
    if "plane_run" in dataset:
        out["Loss in the 200 cycles after a step from 1500 rpm and 20 mg, over that of the unguided seeker"] = _plane(
            dataset
        )
    return out


def _plane(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    names = [str(name) for name in dataset["plane_run"].to_numpy()][1:]
    lost = dataset["plane_lost"].to_numpy()
    speeds, fuels = dataset["plane_speed_rpm"].to_numpy(), dataset["plane_fuel_mg"].to_numpy()
    rows = 2 if len(names) > 1 else 1
    columns = max(-(-len(names) // rows), 1)
    figure = Figure(figsize=(3.1 * columns, 3.4 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for ax, name, own in zip(grid.flat, names, lost[1:], strict=False):
        shares = own / lost[0]
        mesh = ax.pcolormesh(speeds, fuels, shares.T, cmap="cividis_r", vmin=0.0, vmax=1.4, shading="nearest")
        for i, j in np.ndindex(*shares.shape):
            color = "white" if shares[i, j] > 0.6 else "black"
            ax.text(speeds[i], fuels[j], f"{shares[i, j]:.2f}", ha="center", va="center", fontsize=6.0, color=color)
        ax.set_title(name, loc="left", fontsize="small")
    for ax in grid[-1]:
        ax.set_xlabel("speed [rpm]")
    for ax in grid[:, 0]:
        ax.set_ylabel("fuel [mg]")
    if names:
        figure.colorbar(mesh, ax=list(grid.flat), label="loss over unguided [-]")
    return figure
