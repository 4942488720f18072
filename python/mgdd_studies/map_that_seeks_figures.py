"""Figures of the study of the map that seeks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, LINE_STYLES, ORANGE, minus, new_figure
from mgdd_studies.figures import band, legend_outside, names_of
from mgdd_studies.statistics import mean_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw"]

_OWN = "as calibrated"
_PANELS = (("lost_percent", "mean of the cells"), ("worst_lost_percent", "worst cell"))
_TICKS = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0]


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the figures of the study by caption."""
    plain = dataset["search_trouble"].to_numpy() == ""
    own = dataset["search_engine"].to_numpy() == _OWN
    out = {
        "What a map loses over the visits of its search, by guide, mean and worst of 30 cells, 95 % intervals": _visits(
            dataset, np.flatnonzero(plain & own), "search_guide", others=True
        ),
    }
    changed = np.flatnonzero(plain & ~own & (dataset["search_guide"].to_numpy() == "engine as calibrated"))
    if changed.size:
        out["The same on engines that have changed since the guide was right"] = _visits(
            dataset, changed, "search_engine", others=False
        )
    out["Map of the first seed after 24 visits with the visits of each cell, and what the maps lose"] = _map(dataset)
    if "drive" in dataset:
        out["Loss since a new operating point, mean over drives; dotted the second turn"] = _drives(dataset)
    return out


def _visits(dataset: xr.Dataset, chosen: np.ndarray, named: str, *, others: bool) -> Figure:
    figure = new_figure(9.0, 4.2)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    visits = dataset["visits"].to_numpy()
    for ax, (name, said) in zip(panels, _PANELS, strict=True):
        for (dash, color), at in zip(LINE_STYLES, chosen, strict=False):
            found = np.array([mean_interval(row) for row in dataset[name][at].to_numpy()])
            known = np.isfinite(found[:, 0])
            mean, low, high = found[known].T
            low = np.maximum(np.where(np.isfinite(low), low, mean), 1e-4)  # a mean of few seeds may reach below 0
            high = np.where(np.isfinite(high), high, mean)
            label = minus(str(dataset[named].to_numpy()[at]))
            band(ax, visits[known], low, mean, high, dash=dash, color=color, label=label)
        if others and "way" in dataset:
            _conventional(ax, dataset, f"way_{name}")
        ax.set_title(said, loc="left", fontsize="medium")
        ax.set(xscale="log", yscale="log", xlabel="points visited [-]")
        ax.set_xticks([6, 8, 12, 16, 24, 32, 64, 128][: 8 if others else 6])
        ax.set_xticklabels([f"{tick:g}" for tick in ax.get_xticks()])
        ax.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
        ax.set_ylim(1e-3, 6.0)
        ax.minorticks_off()
        ax.grid(alpha=0.3)
    panels[0].set_ylabel("efficiency lost [points]")
    legend_outside(figure, panels[0], 4, at="lower")
    return figure


def _conventional(ax: Axes, dataset: xr.Dataset, name: str) -> None:
    for said, fill in (("before smoothing", "white"), ("smooth and checked", GREY)):
        ways = [(k, way) for k, way in enumerate(names_of(dataset, "way")) if way.endswith(said)]
        points = [int(way.split()[2]) for _, way in ways]
        mean = [float(dataset[name][k].mean()) for k, _ in ways]
        ax.plot(points, mean, "s", color=GREY, markerfacecolor=fill, label=f"conventional, {said}")


def _map(dataset: xr.Dataset) -> Figure:
    figure = new_figure(10.0, 4.2)
    left, right = figure.subplots(1, 2, sharey=True)
    for ax, name, said in (
        (left, "map_cad", "start of combustion [°CA aTDC]"), (right, "cell_lost_percent", "efficiency lost [points]")
    ):  # fmt: skip
        values = dataset[name].transpose("fuel_mg", "speed_rpm").to_numpy()
        image = ax.imshow(values, origin="lower", aspect="auto", cmap="cividis")
        figure.colorbar(image, ax=ax).set_label(said)
        seen = dataset["map_visits"].transpose("fuel_mg", "speed_rpm").to_numpy()
        middle = 0.5 * (values.min() + values.max())
        for (row, column), value in np.ndenumerate(values):
            color = "white" if value < middle else BLACK
            text = f"{value:.3f}"
            if ax is left:
                text = minus(f"{value:.1f}") + f"\n{'●' * int(seen[row, column])}"
            ax.text(column, row, text, ha="center", va="center", fontsize="small", color=color)
        ax.set_xticks(range(values.shape[1]), [f"{speed:g}" for speed in dataset["speed_rpm"].to_numpy()])
        ax.set_yticks(range(values.shape[0]), [f"{fuel:g}" for fuel in dataset["fuel_mg"].to_numpy()])
        ax.set_xlabel("engine speed [rpm]")
    left.set_ylabel("fuel [mg]")
    return figure


def _drives(dataset: xr.Dataset) -> Figure:
    guides, ways = dataset["drive_guide"].to_numpy(), dataset["drive_way"].to_numpy()
    names = list(dict.fromkeys(guides.tolist()))
    figure = new_figure(2.4 * len(names) + 1.0, 3.6)
    panels = figure.subplots(1, len(names), sharex=True, sharey=True, squeeze=False)[0]
    colors = dict(zip(dict.fromkeys(ways.tolist()), (BLUE, ORANGE, GREEN), strict=False))
    for ax, guide in zip(panels, names, strict=True):
        for at in np.flatnonzero(guides == guide):
            for turn, dash in enumerate(("-", ":")):
                lost = np.convolve(dataset["drive_lost_percent"][at, turn].to_numpy(), np.full(5, 0.2), "valid")
                label = ways[at] if turn == 0 else None
                ax.plot(np.arange(lost.size) + 3, lost, dash, color=colors[ways[at]], label=label)
        ax.set_title(guide, loc="left", fontsize="medium")
        ax.set(yscale="log", xlabel="cycle at a point [-]")
        ax.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
        ax.minorticks_off()
        ax.grid(alpha=0.3)
    panels[0].set_ylabel("efficiency lost,\nmean of five cycles [points]")
    legend_outside(figure, panels[0], 3, at="lower")
    return figure
