"""Figures of the study from design to map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREY, LINE_STYLES, ORANGE, minus, new_figure
from mgdd_studies.design_to_map_steps import PROCESS
from mgdd_studies.figures import legend_outside, names_of
from mgdd_studies.statistics import mean_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw"]

_MARKS = {"sweep in every cell": ("s", GREY), "Gaussian process": ("o", BLUE), "polynomial of degree 3": ("^", ORANGE)}


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the figures of the study by caption."""
    out = {
        "Engine cycles of a calibration, and what its map loses: mean and worst of 30 cells, 95 % intervals": _effort(
            dataset
        ),
    }
    if "part" in dataset:
        out["Where the loss of a finished map comes from, mean of the cells, 95 % intervals"] = _parts(dataset)
    out["Map of the first seed, and what the maps lose in each cell, mean over the seeds"] = _map(dataset)
    if "driven" in dataset:
        out["Loss since a new operating point, mean over drives"] = _drives(dataset)
    if "engine" in dataset:
        out["Maps on other engines, and what learning takes away, 95 % intervals"] = _other(dataset)
    return out


def _bar(values: Any) -> tuple[float, list[list[float]]]:
    """Give a mean and the two arms of its interval; without arms where there is one seed."""
    mean, low, high = mean_interval(values)
    return mean, [[max(mean - low, 0.0) if low == low else 0.0], [max(high - mean, 0.0) if high == high else 0.0]]


def _effort(dataset: xr.Dataset) -> Figure:
    figure = new_figure(9.0, 4.0)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    ways = names_of(dataset, "way")
    panels_of = zip(panels, ("lost_percent", "worst_lost_percent"), ("mean of the cells", "worst cell"), strict=True)
    for ax, name, said in panels_of:
        seen = set()
        for at, way in enumerate(ways):
            fit, _, size = way.rpartition(", ")
            mark, color = _MARKS.get(fit, ("D", BLACK))
            few = size.endswith("x 5")
            mean, arms = _bar(dataset[name][at])
            label = None if (fit, few) in seen else fit + few * ", 5 cycles a point"
            ax.errorbar(
                float(dataset["engine_cycles"][at]), mean, arms, fmt=mark, color=color, capsize=3,
                markerfacecolor="white" if few else color, label=label,
            )  # fmt: skip
            seen.add((fit, few))
        ax.set_title(said, loc="left", fontsize="medium")
        ax.set(xscale="log", yscale="log", xlabel="engine cycles with settling and check [-]")
        ax.set_xlim(3.2e3, 1.9e4)
        ax.set_xticks([4e3, 6e3, 1e4, 1.5e4], ["4000", "6000", "10 000", "15 000"])
        ax.set_yticks([0.02, 0.05, 0.1, 0.2, 0.5], ["0.02", "0.05", "0.1", "0.2", "0.5"])
        ax.minorticks_off()
        ax.grid(alpha=0.3)
    panels[0].set_ylabel("efficiency lost [points]")
    legend_outside(figure, panels[0], 3, at="lower")
    return figure


def _parts(dataset: xr.Dataset) -> Figure:
    figure = new_figure(6.6, 3.4)
    ax = figure.subplots()
    stages = names_of(dataset, "part")
    for at, way in enumerate(dataset["parted_way"].to_numpy()):
        _, color = _MARKS[str(way)]
        place = np.arange(len(stages)) + 0.16 * (2 * at - 1)
        bars = [_bar(dataset["part_percent"][at, k]) for k in range(len(stages))]
        arms = np.hstack([arm for _, arm in bars])
        ax.bar(place, [mean for mean, _ in bars], 0.3, color=color, alpha=0.75, label=str(way), yerr=arms, capsize=3)
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    ax.set_xticks(range(len(stages)), stages)
    ax.set_ylabel("efficiency lost by a step [points]")
    ax.grid(alpha=0.3, axis="y")
    ax.legend(frameon=False)
    return figure


def _map(dataset: xr.Dataset) -> Figure:
    figure = new_figure(10.0, 4.2)
    ways = names_of(dataset, "way")
    at = ways.index(PROCESS.label) if PROCESS.label in ways else 0
    left, right = figure.subplots(1, 2, sharey=True)
    shown = ((left, dataset["map_cad"][at], "start of combustion [°CA aTDC]", ".1f"),
             (right, dataset["cell_lost_percent"][at], "efficiency lost [points]", ".3f"))  # fmt: skip
    for ax, table, said, form in shown:
        values = table.transpose("fuel_mg", "speed_rpm").to_numpy()
        image = ax.imshow(values, origin="lower", aspect="auto", cmap="cividis")
        figure.colorbar(image, ax=ax).set_label(said)
        middle = 0.5 * (values.min() + values.max())
        for (row, column), value in np.ndenumerate(values):
            color = "white" if value < middle else BLACK
            ax.text(column, row, minus(format(value, form)), ha="center", va="center", fontsize="small", color=color)
        ax.set_xticks(range(values.shape[1]), [f"{speed:g}" for speed in dataset["speed_rpm"].to_numpy()])
        ax.set_yticks(range(values.shape[0]), [f"{fuel:g}" for fuel in dataset["fuel_mg"].to_numpy()])
        ax.set_xlabel("engine speed [rpm]")
    left.set_ylabel("fuel [mg]")
    fit, _, size = ways[at].rpartition(", ")
    left.set_title(f"{fit}, {size.partition(' x ')[0]} points", loc="left", fontsize="medium")
    return figure


def _drives(dataset: xr.Dataset) -> Figure:
    engines = names_of(dataset, "driven")
    figure = new_figure(3.4 * len(engines) + 0.4, 3.8)
    panels = figure.subplots(1, len(engines), sharex=True, sharey=True, squeeze=False)[0]
    cycle = dataset["cycle"].to_numpy()
    for at, (ax, engine) in enumerate(zip(panels, engines, strict=True)):
        for k, name in enumerate(dataset["guide"].to_numpy()):
            dash, color = LINE_STYLES[k]
            # A running mean over one dither period, which else hides the curves.
            lost = np.convolve(dataset["drive_lost_percent"][at, k].to_numpy(), np.full(10, 0.1), "valid")
            ax.plot(cycle[: lost.size] + 5, lost, linestyle=dash, color=color, label=str(name))
        ax.set_title(engine, loc="left", fontsize="medium")
        ax.set(yscale="log", xlabel="cycle at an operating point [-]", xlim=(0, cycle.size))
        ax.set_yticks([0.02, 0.05, 0.1, 0.2, 0.5, 1.0], ["0.02", "0.05", "0.1", "0.2", "0.5", "1"])
        ax.minorticks_off()
        ax.grid(alpha=0.3)
    panels[0].set_ylabel("efficiency lost,\nmean of ten cycles [points]")
    legend_outside(figure, panels[0], 4, at="lower")
    return figure


def _other(dataset: xr.Dataset) -> Figure:
    figure = new_figure(8.0, 3.6)
    left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
    names = names_of(dataset, "engine")
    _rows(left, names, [[dataset["other_lost_percent"][k] for k in range(len(names))]], ((BLUE, None),))
    left.set_xlabel("efficiency lost in the cells [points]")
    if "driven" in dataset:
        driven = names_of(dataset, "driven")
        both = [[dataset[f"lost_{when}_percent"][k] for k in range(len(driven))] for when in ("before", "after")]
        _rows(right, driven, both, ((GREY, "before"), (BLUE, "after learning")))
        right.set_xlabel("lost on another route,\nmap alone [points]")
        right.legend(frameon=False, fontsize="small", ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    else:
        right.remove()
    return figure


def _rows(ax: Axes, names: list[str], groups: list[list[Any]], styles: tuple[tuple[str, str | None], ...]) -> None:
    height = 0.7 / len(groups)
    for k, (values, (color, label)) in enumerate(zip(groups, styles, strict=True)):
        bars = [_bar(own) for own in values]
        place = np.arange(len(names)) + height * (k - 0.5 * (len(groups) - 1))
        arms = np.hstack([arm for _, arm in bars])
        ax.barh(
            place, [mean for mean, _ in bars], 0.9 * height, color=color, alpha=0.75, xerr=arms, capsize=2, label=label
        )
    ax.set_yticks(range(len(names)), [minus(name) for name in names], fontsize="small")
    ax.invert_yaxis()
    ax.grid(alpha=0.3, axis="x")
